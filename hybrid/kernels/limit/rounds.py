"""Rounds: transitions that fire in turn, each round shorter than the last by a steady ratio.

Time and state right after the jumps of one transition then approach their limits as geometric series do, so
that three of them tell the limit (Aitken). A ``Series`` is what an extrapolation knows, by rounds or by the
closed form that impacts on one guard have (``impacts``).
"""

from typing import Any, NamedTuple

from numba import njit

from hybrid.kernels.events.guards import rounding_band, size_of_time
from hybrid.kernels.jumps.past import fired_before, time_between, visit_before
from hybrid.kernels.jumps.rest import RESOLVED
from hybrid.kernels.types.codes import ENDLESS, LIMIT
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Rounds that must have occurred: two estimates of a limit and of a steady ratio need four durations.
FEWEST_ROUNDS = 5
# Jumps that must have occurred while they can be seen and resolved, so that an arc holds the visible ones.
FEWEST_JUMPS = 16
# The ratio of the rounds may change from one to the next by this share of its distance from 1. The series is
# then summed up to about this share, and the agreement of two sums is left to judge.
STEADY = 0.1
# The share of a time by which rounding moves the time between two jumps.
HIDDEN_IN_TIME = 4.0 * EPSILON


class Series(NamedTuple):
    """Jumps that accumulate.

    The number of jumps in a round, and of all that were made; the ``ratio`` by which each round is shorter
    than the last; how long the ``latest`` took; the time ``left`` for those to come, and its ``shift`` since
    the estimate one round before.
    """

    turn: Any
    jumps: Any
    ratio: Any
    latest: Any
    left: Any
    shift: Any


# What stands for jumps that do not accumulate.
NO_SERIES = Series(0, 0, 0.0, 0.0, 0.0, 0.0)


@njit(**INLINE)
def shortens(model, run, turn):
    """Whether the last ``turn`` jumps took less time than those before them, or rounding may hide it."""
    before, hidden = time_between(model, run, turn, 2 * turn), HIDDEN_IN_TIME * size_of_time(model, run.phase)
    return time_between(model, run, 0, turn) - hidden < (1.0 - RESOLVED) * before


@njit(**KERNEL)
def time_left_of_rounds(model, run, turn, back):
    """Time that infinitely many more rounds take after the jump ``back`` before the last one, and the ratio.

    Zero if the rounds do not shorten by a steady ratio.
    """
    d0 = time_between(model, run, back, back + turn)
    d1 = time_between(model, run, back + turn, back + 2 * turn)
    if not 0.0 < d0 < d1:
        return 0.0, 1.0
    d2 = time_between(model, run, back + 2 * turn, back + 3 * turn)
    if not d1 < d2:
        return 0.0, 1.0
    ratio = d0 / d1
    if abs(ratio - d1 / d2) > STEADY * (1.0 - ratio):
        return 0.0, 1.0
    return d0 * ratio / (1.0 - ratio), ratio


@njit(**KERNEL)
def jumps_in_turn(run, turn, most):
    """Of how many last jumps, at ``most``, every one was of the same transition as that ``turn`` later."""
    back = 0
    while back + turn < most and fired_before(run, back) == fired_before(run, back + turn):
        back += 1
    return back + turn


@njit(**INLINE)
def fewest_jumps(turn):
    """How many jumps in rounds of ``turn`` are made before their limit is taken."""
    return max(FEWEST_JUMPS, FEWEST_ROUNDS * turn) + 1


@njit(**KERNEL)
def series_of_rounds(model, run):
    """The series of transitions that fire in turn; impacts on one guard have a better one of their own."""
    if run.jumps <= FEWEST_ROUNDS or not shortens(model, run, 2):
        return NO_SERIES
    known = min(run.jumps, run.visits.shape[0])
    for turn in range(2 if run.chattering > 0 else 1, (known - 1) // FEWEST_ROUNDS + 1):
        if fired_before(run, 0) != fired_before(run, turn):
            continue
        left, ratio = time_left_of_rounds(model, run, turn, 0)
        if not left > 0.0:
            continue
        jumps = jumps_in_turn(run, turn, min(known, fewest_jumps(turn)))
        if jumps <= FEWEST_ROUNDS * turn:
            continue
        earlier, _ = time_left_of_rounds(model, run, turn, turn)
        if earlier > 0.0:
            latest = time_between(model, run, 0, turn)
            return Series(turn, jumps, ratio, latest, left, left + latest - earlier)
    return NO_SERIES


@njit(**KERNEL)
def extrapolate_rounds(model, run, turn, back, out):
    """Limit of the state from three jumps of one transition, ``back`` the last of them, into ``out (n,)``."""
    visits = run.visits
    last, before = visits[visit_before(run, back)], visits[visit_before(run, back + turn)]
    earlier = visits[visit_before(run, back + 2 * turn)]
    for i in range(model.dimension):
        change, former = last[i] - before[i], before[i] - earlier[i]
        out[i] = last[i]
        if abs(change) < abs(former):
            out[i] += change * change / (former - change)


@njit(**KERNEL)
def sizes_of_visits(model, run, seen, out):
    """Largest size of each component over the last step and right after the last jumps, into ``out (n,)``."""
    for i in range(model.dimension):
        out[i] = run.scale[i]
        for back in range(min(seen, run.jumps)):
            out[i] = max(out[i], abs(run.visits[visit_before(run, back), i]))


@njit(**KERNEL)
def rounding_of_landing(model, run, time, work):
    """How far rounding may move the time of the last jump: that of this ``time``, and that of its guard."""
    fired = run.last_fired
    model.guard_gradient(fired, run.phase, run.y, model.parameters, work.gradient)
    band = rounding_band(model, run, fired, run.phase, run.y, work)
    return EPSILON * time + band / abs(run.last_transversality)


@njit(**KERNEL)
def still_changes(series):
    """How many times the difference of the last two estimates later rounds may still change the limit by.

    Errors go with the square of the time left: the changes to come are ``r^2 + r^4 + ...``, and taken for 1
    if they are less.
    """
    square = series.ratio**2
    return max(1.0, square / (1.0 - square))


@njit(**KERNEL)
def state_is_known(model, method, run, series, hidden, work):
    """Whether the estimates of the state in ``work.settled`` and ``run.trail`` agree, but for counters.

    They may differ by the tolerances, and by what the state moves in the ``hidden`` time. The sizes of the
    components go to ``work.trial``, with what may be unknown of them.
    """
    n, sizes, times = model.dimension, work.trial, still_changes(series)
    sizes_of_visits(model, run, fewest_jumps(series.turn), sizes)
    model.field(run.mode, run.phase, run.y, model.parameters, work.field)
    last, before = run.visits[visit_before(run, 0)], run.visits[visit_before(run, series.turn)]
    known = True
    for i in range(n):
        slack = hidden * (abs(work.field[i]) + abs(last[i] - before[i]) / series.latest)
        apart = times * abs(work.settled[i] - run.trail[LIMIT, i])
        agree = apart <= method.atol + method.rtol * sizes[i] + slack
        known = known and (agree or run.trail[ENDLESS, i] != 0.0)
        sizes[i] = max(sizes[i], (method.atol + slack) / RESOLVED)
    return known
