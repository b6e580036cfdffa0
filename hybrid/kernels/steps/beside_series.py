"""Crossings of guards that are no series themselves, on a step along the series of the state."""

from hybrid.kernels.events.crossings import crossing_on_path
from hybrid.kernels.events.guards import guard_value
from hybrid.kernels.events.onset import BY_STEP
from hybrid.kernels.events.path import time_at
from hybrid.kernels.types.codes import EXACT
from hybrid.kernels.types.kinds import INTEGER, REAL, Pair
from hybrid.kernels.types.layout import Method, Model, Run, Work
from hybrid.kernels.types.options import exported


@exported(Pair(REAL), Model, Method, Run, INTEGER, INTEGER, REAL, REAL, INTEGER, Work)
def crossing_beside_series(model, method, run, transition, order, t, h, clock, work):
    """As ``crossings.crossing_on_path``, for a step whose end is in ``work.trial``.

    The side after the crossing goes to ``run.rehearsal[3, transition]``.
    """
    series, end = work.series, 0.0
    if run.on_guard[transition] == BY_STEP:
        later = time_at(series, order, clock, t, 1.0, h)
        end = guard_value(model, transition, later, work.trial, work.scalar)
    exact = model.propagator[run.mode] == EXACT
    place, side, share = crossing_on_path(
        model, method, run, transition, series, order, clock, t, 1.0, h, end, exact, work
    )
    run.rehearsal[3, transition] = side
    return place, share
