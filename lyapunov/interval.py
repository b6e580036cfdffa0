"""The end of an interval of time and what has been summed up to there, as kernels and Python see them."""

from functools import cache
from typing import Any

import numpy as np

from hybrid.accuracy.averages import MAX_BATCHES
from hybrid.kernels.types.kinds import INDICES, MATRIX, REAL, VECTOR
from hybrid.kernels.types.structure import Layout, Structure


class End(Structure, counters=("cycle", "done"), numbers=("phase",)):
    """When an interval ends: after ``cycle`` whole periods and at the ``phase`` of the next.

    ``done`` is how many intervals the last call of a kernel has completed.
    """

    counters: INDICES
    numbers: VECTOR


class Sums(Structure):
    """``hits (T,)``: jumps of each transition in the interval that is under way; sums over those before.

    ``batches (B, k + 1 + T)`` and ``batch_state (3,)`` are those of ``lyapunov.batches``.
    """

    hits: INDICES
    batches: MATRIX
    batch_state: INDICES


class Growth(Structure, counters=("done", "count")):
    """The intervals of one run among others: so many are ``done`` of a ``count``.

    ``rates (M, k + 1 + T)`` are those of ``lyapunov.kernels.growth_rates``.
    """

    counters: INDICES
    end: End
    sums: Sums
    interval: REAL
    rates: MATRIX


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


def growth_of(end: Any, sums: Any, interval: float, intervals: int, columns: int) -> Any:
    """A ``Growth`` with room for so many intervals."""
    return Growth(
        counters=np.zeros(2, dtype=np.int64),
        end=end,
        sums=sums,
        interval=interval,
        rates=np.zeros((intervals, columns)),
    )


def maps_of(end: Any, interval: float, intervals: int, columns: int) -> Any:
    """The ``Maps`` of so many intervals."""
    counters = np.array([0, intervals], dtype=np.int64)
    return Maps(counters=counters, end=end, interval=interval, maps=np.full((intervals, columns), np.nan))


@cache
def sums_layout(tangents: int, transitions: int) -> Any:
    """Where the arrays of ``Sums`` lie."""
    columns = tangents + 1 + transitions
    shapes = {"hits": (transitions,), "batches": (MAX_BATCHES, columns), "batch_state": (3,)}
    return Layout(Sums, shapes)
