"""Runs that end on a guard or beside it: no crossing is lost or doubled between two runs."""

from functools import cache

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Taylor, Transition, Tsit5, simulate


@cache
def ramp(direction):
    return HybridSystem(
        state=("q",),
        modes=[Mode("run", lambda t, x, p: (float(direction),))],
        transitions=[Transition("run", "run", Guard(lambda t, x, p: x.q, direction))],
    )


@pytest.mark.parametrize("direction", [-1, 1])
@pytest.mark.parametrize("far", [2.0**10, 2.0**20, 3.0**20])
def test_the_size_of_the_state_at_the_end_tells_whether_it_is_on_a_guard(far, direction):
    """A run that starts there does not know how far the state has come. The flight is exact."""
    for ulps in range(-20, 21):
        end = far + ulps * np.spacing(far)
        first = simulate(ramp(direction), (-direction * far,), (0.0, end), solver=Taylor())
        second = simulate(ramp(direction), first.x[-1], (end, end + 1.0), solver=Taylor())
        assert len(first.jumps) + len(second.jumps) == 1, ulps


@pytest.mark.parametrize("solver", [DOP853(), Tsit5(), RadauIIA()], ids=lambda solver: type(solver).__name__)
@pytest.mark.parametrize("direction", [-1, 1])
def test_no_crossing_is_lost_or_doubled_between_two_runs(direction, solver):
    """Rounding of the last step may take the state beyond the guard without a root on the step."""
    for far in np.linspace(1.0, 40.0, 14):
        for ulps in range(-24, 25, 2):
            end = far + ulps * np.spacing(far)
            first = simulate(ramp(direction), (-direction * far,), (0.0, end), solver=solver)
            second = simulate(ramp(direction), first.x[-1], (end, end + 1.0), solver=solver)
            assert len(first.jumps) + len(second.jumps) == 1, (far, ulps)


PARTED = {
    "time": (lambda t, x, p: (x.v, -x.q), lambda t, x, p: t - p.c, (1.0, 0.0), 0.0),
    "wave": (lambda t, x, p: (x.v, -x.q), lambda t, x, p: np.sin(2 * t) - p.c, (1.0, 0.0), -1.0),
    "ramp": (lambda t, x, p: (61.0, 1.0), lambda t, x, p: x.q - p.c, (-7.1, 0.0), 0.0),
    "fall": (lambda t, x, p: (x.v, -9.81), lambda t, x, p: x.q - p.c, (10.0, 0.0), 0.0),
    "decay": (lambda t, x, p: (-30 * x.q, -x.v + x.q), lambda t, x, p: x.q + 2 * x.v - p.c, (9.0, 2.0), 0.0),
    "moving": (lambda t, x, p: (-30 * x.q, -x.v), lambda t, x, p: x.q - p.c * t, (3.3, -0.7), 0.0),
    "pendulum": (lambda t, x, p: (x.v, -np.sin(x.q)), lambda t, x, p: x.q - p.c, (0.0, 1.5), 100.0),
    "bent": (lambda t, x, p: (x.v, -np.sin(x.q)), lambda t, x, p: x.q * x.q - p.c, (0.0, 1.5), 100.0),
}
ULPS = [*range(-24, 25), *(sign * far for far in (32, 50, 100, 300, 1000, 3000) for sign in (-1, 1))]


@pytest.mark.parametrize(
    "solver", [Taylor(), DOP853(), Tsit5(), RadauIIA()], ids=lambda solver: type(solver).__name__
)
@pytest.mark.parametrize("name", PARTED)
@pytest.mark.as_given
def test_a_run_that_is_split_beside_a_marker_marks_the_crossing_once(name, solver):
    """The first part ends, and the second begins, within some units in the last place of the crossing."""
    field, guard, start, t0 = PARTED[name]
    system = HybridSystem(
        state=("q", "v"),
        parameters={"c": 0.3},
        modes=[Mode("m", field)],
        transitions=[Transition("m", "m", Guard(guard), name="marker")],
    )
    for c in (0.176, 0.3, 0.77):
        options = {"solver": solver, "mode": "m", "parameters": {"c": c}}
        event = simulate(system, start, (t0, t0 + 6.0), **options).jumps.t[0]
        end = event + 1e-6
        for ulps in ULPS:
            cut = event + ulps * np.spacing(event)
            first = simulate(system, start, (t0, cut), **options)
            second = simulate(system, first.x[-1], (cut, end), **options)
            times = np.concatenate([first.jumps.t, second.jumps.t])
            assert len(times) == 1, (c, ulps)
            assert abs(times[0] - event) < 1e-11
