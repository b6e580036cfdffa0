"""Rounds: transitions that fire in turn, each round shorter than the last by a steady ratio.

Time and state right after the jumps of one transition then approach their limits as geometric series do, so
that three of them tell the limit (Aitken). A ``Series`` is what an extrapolation knows, by rounds or by the
closed form that impacts on one guard have (``impacts``).
"""

from typing import Any, NamedTuple

from numba import njit

from hybrid.kernels.events.guards import rounding_band
from hybrid.kernels.jumps.past import fired_before, time_before, visit_before
from hybrid.kernels.types.codes import ENDLESS, LIMIT
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import KERNEL

# Rounds that must have occurred: two estimates of a limit and of a steady ratio need four durations.
FEWEST_ROUNDS = 5
# Jumps that must have occurred while they can be seen and resolved, so that an arc holds the visible ones.
FEWEST_JUMPS = 16
# The ratio of the rounds may change from one to the next by this share of its distance from 1. The series is
# then summed up to about this share, and the agreement of two sums is left to judge.
STEADY = 0.1
# The share of a quantity that counts as nothing at a limit: what is left of the time, and how far the state
# may be from the guards and from where the resets lead. Linear extrapolation and a landing's rounding reach it.
RESOLVED = 1e-6


class Series(NamedTuple):
    """Jumps that accumulate.

    The number of jumps in a round; the ``ratio`` by which each round is shorter than the last; how long the
    ``latest`` took, and all rounds so far; the time ``left`` for those to come, and its ``shift`` since the
    estimate one round before.
    """

    turn: Any
    ratio: Any
    latest: Any
    lasted: Any
    left: Any
    shift: Any


@njit(**KERNEL)
def no_series():
    """What stands for jumps that do not accumulate."""
    return Series(0, 0.0, 0.0, 0.0, 0.0, 0.0)


@njit(**KERNEL)
def shortens(model, run):
    """Whether the last two jumps took less time than the two before them."""
    if run.jumps <= FEWEST_ROUNDS:
        return False
    return time_before(model, run, 0, 2) < (1.0 - RESOLVED) * time_before(model, run, 2, 4)


@njit(**KERNEL)
def time_left_of_rounds(model, run, turn, back):
    """Time that infinitely many more rounds take after the jump ``back`` before the last one, and the ratio.

    Zero if the rounds do not shorten by a steady ratio.
    """
    d0 = time_before(model, run, back, back + turn)
    d1 = time_before(model, run, back + turn, back + 2 * turn)
    d2 = time_before(model, run, back + 2 * turn, back + 3 * turn)
    if not 0.0 < d0 < d1 < d2:
        return 0.0, 1.0
    ratio = d0 / d1
    if abs(ratio - d1 / d2) > STEADY * (1.0 - ratio):
        return 0.0, 1.0
    return d0 * ratio / (1.0 - ratio), ratio


@njit(**KERNEL)
def repeats(run, turn):
    """Whether the last rounds of ``turn`` jumps have been of the same transitions in the same order."""
    for back in range((FEWEST_ROUNDS - 1) * turn):  # noqa: SIM110 (no generators in kernels)
        if fired_before(run, back) != fired_before(run, back + turn):
            return False
    return True


@njit(**KERNEL)
def series_of_rounds(model, run):
    """The series of transitions that fire in turn; impacts on one guard have a better one of their own."""
    if not shortens(model, run):
        return no_series()
    known = min(run.jumps, run.visits.shape[0]) - 1
    for turn in range(1, known // FEWEST_ROUNDS + 1):
        left, ratio = time_left_of_rounds(model, run, turn, 0)
        earlier, _ = time_left_of_rounds(model, run, turn, turn)
        if left > 0.0 and earlier > 0.0 and repeats(run, turn):
            if turn == 1 and run.chattering > 0:
                return no_series()
            latest = time_before(model, run, 0, turn)
            lasted = time_before(model, run, 0, min(known, max(FEWEST_JUMPS, FEWEST_ROUNDS * turn)))
            return Series(turn, ratio, latest, lasted, left, left + latest - earlier)
    return no_series()


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
def rounding_of_landing(model, run, work):
    """How far rounding may move the time of the last jump: that of the time, and that of its guard."""
    fired = run.last_fired
    model.guard_gradient(fired, run.phase, run.y, model.parameters, work.gradient)
    band = rounding_band(model, run, fired, run.phase, run.y, work)
    return EPSILON * abs(run.phase) + band / abs(run.last_transversality)


@njit(**KERNEL)
def still_changes(series):
    """So many times the difference of the last two estimates may later rounds change the limit, at least once.

    Errors go with the square of the time left, so that the changes to come sum up to ``r^2 + r^4 + ...``.
    """
    square = series.ratio**2
    return max(1.0, square / (1.0 - square))


@njit(**KERNEL)
def time_is_known(method, series, landing):
    """Whether two estimates of the time of a limit agree, up to the tolerances and to what rounding hides."""
    unknown = still_changes(series) * abs(series.shift)
    return unknown <= method.rtol * series.left + hidden_time(series, landing)


@njit(**KERNEL)
def hidden_time(series, landing):
    """The time of a limit that the rounding of a landing hides, no longer than the last round.

    It is magnified by the sum of the series and by the rounding of its ratio.
    """
    return min(landing / (1.0 - series.ratio) ** 2, series.latest)


@njit(**KERNEL)
def state_is_known(model, method, run, series, landing, work):
    """Whether ``work.settled (n,)`` and the estimate in ``run.trail`` agree, up to the same, but for counters.

    The sizes of the components go to ``work.trial``, with what rounding hides of them.
    """
    n, sizes, times, hidden = model.dimension, work.trial, still_changes(series), hidden_time(series, landing)
    sizes_of_visits(model, run, max(FEWEST_JUMPS, FEWEST_ROUNDS * series.turn), sizes)
    model.field(run.mode, run.phase, run.y, model.parameters, work.field)
    last, before = run.visits[visit_before(run, 0)], run.visits[visit_before(run, series.turn)]
    known = True
    for i in range(n):
        slack = hidden * (abs(work.field[i]) + abs(last[i] - before[i]) / series.latest)
        allowed = method.atol + method.rtol * sizes[i] + slack
        apart = not times * abs(work.settled[i] - run.trail[LIMIT, i]) <= allowed
        known = known and not (apart and run.trail[ENDLESS, i] == 0.0)
        sizes[i] = max(sizes[i], (method.atol + slack) / RESOLVED)
    return known


@njit(**KERNEL)
def is_hidden(series, landing, share):
    """Whether the rounding of landings will be more than a ``share`` of the next round.

    That round is shorter by the ratio, and the rounding of its slower landings is larger by the ratio.
    """
    return landing >= share * series.ratio**2 * series.latest


@njit(**KERNEL)
def has_begun(series, jumps, landing):
    """Whether enough jumps have been made, or those to come would be too brief to be seen or resolved."""
    if jumps > max(FEWEST_JUMPS, FEWEST_ROUNDS * series.turn):
        return True
    return series.left <= RESOLVED * series.lasted or is_hidden(series, landing, RESOLVED)
