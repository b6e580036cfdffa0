"""The end of an interval of time and what has been summed up to there, as kernels and Python see them."""

from functools import lru_cache
from typing import Any

import numpy as np

from hybrid.kernels.types.kinds import CUBE, INDEX_MATRIX, INDICES, MATRIX, REAL, VECTOR
from hybrid.kernels.types.structure import Layout, Structure
from hybrid.measures.averages import MAX_BATCHES
from hybrid.simulation.memory import MOST_LAYOUTS

# Intervals in a round. Means are summed by rounds, so that their rounding does not depend on where a burst of
# a kernel ends.
INTERVALS_AT_ONCE = 1000


class End(Structure, counters=("cycle", "done"), numbers=("phase",)):
    """When an interval ends: after ``cycle`` whole periods and at the ``phase`` of the next.

    ``done`` is how many intervals the last call of a kernel has completed.
    """

    counters: INDICES
    numbers: VECTOR


class Growths(Structure, counters=("count",)):
    """Growth rates of ``R`` runs over a ``count`` of intervals; ``done (R,)`` of them are complete.

    The interval of a run that is under way ends after ``cycles (R,)`` whole periods and at ``phases (R,)`` of
    the next; its length is in ``lengths (R,)``. ``rates (R, M, k + 1 + T)`` has a row for each interval: the
    rates of ``k`` tangent vectors, and the other side of the sum rule, which is the integral of div f plus
    the log-determinants of the saltation matrices, all per unit time. ``batches (R, B, k + 1 + T)`` and
    ``batch_states (R, 3)`` are those of ``lyapunov.batches``, over all intervals so far.

    The jumps of each transition are counted for a run alone: so far they are ``hits (T,)`` in the interval
    that is under way, and the last columns are their numbers per unit time. For runs together ``T`` is zero;
    ``plain (R,)`` is 1 for those that have reached their end with nothing to tell.
    """

    counters: INDICES
    done: INDICES
    cycles: INDICES
    phases: VECTOR
    lengths: VECTOR
    hits: INDICES
    rates: CUBE
    batches: CUBE
    batch_states: INDEX_MATRIX
    plain: INDICES


class Maps(Structure, counters=("done", "count")):
    """The intervals of a run among others whose tangent maps are wanted: so many are ``done`` of a ``count``.

    A row of ``maps (M, k n + 1)`` has the images of ``k`` unit vectors, and the other side of the sum rule:
    the integral of div f plus the log-determinants of the saltation matrices.
    """

    counters: INDICES
    end: End
    interval: REAL
    maps: MATRIX


END = Layout(End, {"counters": (2,), "numbers": (1,)})


def end_at(run: Any) -> Any:
    """The current time of a run as the end of an interval."""
    end = END.zeros()
    end.cycle, end.phase = run.cycle, run.phase
    return end


def maps_of(end: Any, interval: float, intervals: int, columns: int) -> Any:
    """The ``Maps`` of so many intervals."""
    counters = np.array([0, intervals], dtype=np.int64)
    return Maps(counters=counters, end=end, interval=interval, maps=np.full((intervals, columns), np.nan))


@lru_cache(MOST_LAYOUTS)
def growths_layout(runs: int, tangents: int, counted: int) -> Layout:
    """Where the arrays of ``Growths`` lie; jumps of so many transitions are ``counted``."""
    columns = tangents + 1 + counted
    shapes = {
        "counters": (1,),
        **dict.fromkeys(("done", "cycles", "phases", "lengths", "plain"), (runs,)),
        "hits": (counted,),
        "rates": (runs, INTERVALS_AT_ONCE, columns),
        "batches": (runs, MAX_BATCHES, columns),
        "batch_states": (runs, 3),
    }
    return Layout(Growths, shapes)
