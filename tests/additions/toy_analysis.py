"""An analysis in one file: the share of time that an orbit spends in each mode, without storing the orbit."""

from hybrid.kernels.types.codes import DONE, MAX_STEPS
from hybrid.simulation.periods import split_time
from hybrid.simulation.trajectory import start


def residence(system, x0, t1):
    """Share of the time up to ``t1`` by the name of the mode."""
    trajectory = start(system, x0, 0.0)
    end = split_time(t1, trajectory.model.period)
    spent, code = dict.fromkeys(system.mode_names, 0.0), MAX_STEPS
    while code == MAX_STEPS:
        mode, before = trajectory.mode, trajectory.t
        code = trajectory.advance_to(*end, trajectory.no_record(), max_steps=trajectory.steps + 1)
        spent[mode] += trajectory.t - before
    assert code == DONE
    return {mode: time / t1 for mode, time in spent.items()}
