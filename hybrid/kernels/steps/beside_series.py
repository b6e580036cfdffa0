"""Crossings of guards that are no series themselves, on a step along the series of the state."""

from hybrid.kernels.events.crossings import crossing_on_path
from hybrid.kernels.events.guards import guard_value
from hybrid.kernels.events.onset import LATER
from hybrid.kernels.events.path import time_at
from hybrid.kernels.types.kinds import INTEGER, REAL, Pair
from hybrid.kernels.types.layout import Method, Model, Path, Run, Work
from hybrid.kernels.types.options import exported


@exported(Pair(REAL), Model, Method, Run, INTEGER, Path, Work)
def crossing_beside_series(model, method, run, transition, path, work):
    """As ``crossings.crossing_on_path``, for a step whose end is in ``work.trial``.

    The side after the crossing goes to ``run.rehearsal[3, transition]``.
    """
    end = 0.0
    if run.on_guard[transition] >= LATER:
        end = guard_value(model, transition, time_at(path, path.length), work.trial, work.scalar)
    place, side, share = crossing_on_path(model, method, run, transition, path, end, work)
    run.rehearsal[3, transition] = side
    return place, share
