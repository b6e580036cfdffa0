"""One step of the Taylor series of several runs in one mode: it is taken by the runs that can prove it.

What is not plain is refused, and left to the step of a single run (``steps.series``), which asks more. Here
is all that is refused:

- a guard whose side at the start is not clear, which rests on zero, or has left it by more than its speed;
- a guard that is neither proved to keep its side nor to cross it once;
- a crossing that is slow, or in the direction in which the transition does not fire;
- two guards that are crossed at about the same place, and a crossing under a condition;
- a series with gaps, one whose terms are no normal floats, and a value that is not finite;
- a step that on its own clock leads beyond the end of the run, and one that is rounding.
"""

import math

from numba import njit

from hybrid.kernels.abreast.crossing import first_crossing
from hybrid.kernels.abreast.length import trusted_length, weigh
from hybrid.kernels.abreast.rows import (
    bits_of,
    both,
    either,
    entry_at,
    in_every_run,
    put_entry,
    put_rows,
    rows_at,
    where,
    without,
)
from hybrid.kernels.arithmetic.clock import sum_in_two_parts
from hybrid.kernels.arithmetic.wide import fused, larger, magnitude, smaller
from hybrid.kernels.steps.series import holds_roots, order_of
from hybrid.kernels.steps.step import FINEST
from hybrid.kernels.types.abreast import (
    AHEAD_OF_STAY,
    CYCLE,
    DIVERGENCE,
    FOLLOWS,
    LONGEST_STEP,
    PER_GUARD,
    PERIOD,
    PHASE_LOW,
    ROOM,
    SINCE,
    STAY,
    STEPS,
    T,
)
from hybrid.kernels.types.codes import (
    ABREAST,
    DESINGULARISED,
    EXACT,
    FROM_LAST_STEP,
    FROM_STATE,
    FROM_ZERO,
    NO_TRANSITION,
)
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

ANY_LENGTH = 1e100


@njit(**INLINE)
def evaluate_four(powers, column, order, h, with_sizes, end):
    """Values at ``h`` of four columns into the row ``end``, and what they are sums of into the next.

    Each sum waits for itself: four run at once.
    """
    a, b = entry_at(powers, order, column), entry_at(powers, order, column + 1)
    c, d = entry_at(powers, order, column + 2), entry_at(powers, order, column + 3)
    if with_sizes:
        size_a, size_b, size_c, size_d = magnitude(a), magnitude(b), magnitude(c), magnitude(d)
        for o in range(order - 1, -1, -1):
            term = entry_at(powers, o, column)
            a, size_a = fused(a, h, term), fused(size_a, h, magnitude(term))
            term = entry_at(powers, o, column + 1)
            b, size_b = fused(b, h, term), fused(size_b, h, magnitude(term))
            term = entry_at(powers, o, column + 2)
            c, size_c = fused(c, h, term), fused(size_c, h, magnitude(term))
            term = entry_at(powers, o, column + 3)
            d, size_d = fused(d, h, term), fused(size_d, h, magnitude(term))
        put_entry(powers, end + 1, column, size_a)
        put_entry(powers, end + 1, column + 1, size_b)
        put_entry(powers, end + 1, column + 2, size_c)
        put_entry(powers, end + 1, column + 3, size_d)
    else:
        for o in range(order - 1, -1, -1):
            a = fused(a, h, entry_at(powers, o, column))
            b = fused(b, h, entry_at(powers, o, column + 1))
            c = fused(c, h, entry_at(powers, o, column + 2))
            d = fused(d, h, entry_at(powers, o, column + 3))
    put_entry(powers, end, column, a)
    put_entry(powers, end, column + 1, b)
    put_entry(powers, end, column + 2, c)
    put_entry(powers, end, column + 3, d)


@njit(**INLINE)
def longest_room(model, lane, places, mode):
    """The time until the next step must end, and that until it should: a little after the last stay ended."""
    left = rows_at(lane, places.numbers + STAY) - rows_at(lane, places.numbers + SINCE)
    beyond = rows_at(lane, places.numbers + AHEAD_OF_STAY)
    return where(both(left > 0.0, beyond > 0.0), left + beyond, math.inf)


@njit(**INLINE)
def leads_on(model, mode, tangents):
    """Whether a step may lead beyond the time at which a run is asked for: nothing else ends its room.

    Tangent vectors may be exchanged there for others; one is at most scaled.
    """
    timeless = model.clocks.shape[0] == 0 and model.knots.shape[0] == 0
    return timeless and tangents <= 1 and model.degree[mode] == 0 and model.propagator[mode] != DESINGULARISED


@njit(**INLINE)
def set_origins_abreast(sea, lane, places, n, order):
    """Tell the series what they may take the roots of guards from (``steps.series.set_origins``)."""
    follows = rows_at(lane, places.numbers + FOLLOWS) > 0.5
    for g in range(places.count):
        known = rows_at(lane, places.guards + PER_GUARD * g + 1) > 0.5
        origin = where(follows, float(FROM_LAST_STEP), float(FROM_STATE))
        put_entry(sea.powers, order + 1, n + g, rows_at(lane, places.guards + PER_GUARD * g + 2))
        put_entry(sea.powers, order + 2, n + g, where(known, float(FROM_ZERO), origin))


@njit(**INLINE)
def take_step(model, sea, lane, places, mode, tangents, order, able):
    """Move the runs of a mask to the end of the step."""
    n, powers, rooted = model.dimension, sea.powers, holds_roots(model, mode)
    for i in range(n):
        put_rows(lane, i, where(able, entry_at(powers, order + 1, i), rows_at(lane, i)))
        size = rows_at(lane, places.sizes + i)
        # On a guard, rounding is that of the landing.
        put_rows(lane, places.sizes + i, where(able, entry_at(powers, order + 2, i), size))
    for k in range(tangents):
        begin = sea.tangent_start + k * sea.tangent_columns[mode]
        for i in range(n):
            place = n * (1 + k) + i
            put_rows(lane, place, where(able, entry_at(powers, order + 1, begin + i), rows_at(lane, place)))
    for g in range(places.count):
        place = places.guards + PER_GUARD * g
        put_rows(lane, place + 1, where(able, 0.0, rows_at(lane, place + 1)))
        if rooted:
            root = entry_at(powers, order + 1, n + g)
            put_rows(lane, place + 2, where(able, root, rows_at(lane, place + 2)))
    first, span = places.numbers, where(able, rows_at(sea.ends, 0), 0.0)
    move_clock(lane, first, span)
    put_rows(lane, first + SINCE, rows_at(lane, first + SINCE) + span)
    put_rows(lane, first + LONGEST_STEP, larger(rows_at(lane, first + LONGEST_STEP), span))
    put_rows(lane, first + ROOM, rows_at(lane, first + ROOM) - span)
    put_rows(lane, first + STEPS, rows_at(lane, first + STEPS) + where(able, 1.0, 0.0))
    put_rows(lane, first + FOLLOWS, where(able, 1.0, rows_at(lane, first + FOLLOWS)))
    if tangents > 0:
        change = where(able, entry_at(powers, order + 1, n + places.count + 1), 0.0)
        put_rows(lane, first + DIVERGENCE, rows_at(lane, first + DIVERGENCE) + change)


@njit(**INLINE)
def move_clock(lane, first, span):
    """``arithmetic.clock.forward`` of all runs."""
    phase, lost = sum_in_two_parts(rows_at(lane, first + T), span)
    phase, low = sum_in_two_parts(phase, lost + rows_at(lane, first + PHASE_LOW))
    cycle, period = rows_at(lane, first + CYCLE), rows_at(lane, first + PERIOD)
    over = both(phase >= period, period > 0.0)
    while bits_of(over) != 0:
        earlier, lost = sum_in_two_parts(phase, where(over, -period, 0.0))
        earlier, lost = sum_in_two_parts(earlier, lost + low)
        phase, low = where(over, earlier, phase), where(over, lost, low)
        cycle = cycle + where(over, 1.0, 0.0)
        over = both(phase >= period, period > 0.0)
    put_rows(lane, first + T, phase)
    put_rows(lane, first + PHASE_LOW, low)
    put_rows(lane, first + CYCLE, cycle)


@njit(**KERNEL)
def step_abreast(model, method, sea, lane, places, mode, tangents, asked):
    """One step of the runs of the mask ``asked`` in a mode; the masks of those that took it, and may go on.

    Those that may not go on have reached an event or the end of their room, or are late.
    """
    n, powers, kind = model.dimension, sea.powers, model.propagator[mode]
    exact, on_clock, rooted = kind == EXACT, kind == DESINGULARISED, holds_roots(model, mode)
    order, degree = order_of(model, method, mode), model.degree[mode]
    first, guards = places.numbers, places.count
    start, stride = sea.tangent_start, sea.tangent_columns[mode]
    if rooted:
        set_origins_abreast(sea, lane, places, n, order)
    x = lane[: places.parameters * ABREAST]
    p = lane[places.parameters * ABREAST : first * ABREAST]
    sea.series(mode, lane[first * ABREAST :], x, p, order, powers)
    able, h = asked, in_every_run(ANY_LENGTH)
    if degree == 0:
        weigh(method, sea, n, model.controlled, tangents, start, stride, exact)
        h, regular = trusted_length(method, sea, n, tangents, start, stride, order, exact)
        able = both(able, regular)
    remaining, t = rows_at(lane, first + ROOM), magnitude(rows_at(lane, first + T))
    rounding = FINEST * (t if model.timed[mode] == 1 else rows_at(lane, first + SINCE))
    late = without(asked, asked)
    if model.timed[mode] == 1:
        late = method.rtol * rows_at(lane, first + LONGEST_STEP) < EPSILON * t
    onward = without(asked, late) if leads_on(model, mode, tangents) else without(asked, asked)
    if not on_clock:
        room = smaller(where(onward, math.inf, remaining), longest_room(model, lane, places, mode))
        h = smaller(h, smaller(room, method.max_step))
        able = both(able, h < ANY_LENGTH)
    else:
        h = smaller(h, ANY_LENGTH)
    for row in range(sea.fired.shape[0]):
        sea.fired[row] = NO_TRANSITION
    event, sea.distant = without(asked, asked), bits_of(asked)
    if guards > 0:
        earliest, able = first_crossing(model, method, sea, lane, places, mode, order, h, exact, able)
        event = earliest <= 1.0
        h = where(event, earliest * h, h)
    # The state; guards and the clock if there is one; the divergence with tangent vectors.
    width = n + guards + 1 if rooted else n
    if tangents > 0:
        width = n + guards + 2
    for column in range(0, width, 4):
        evaluate_four(powers, column, order, h, column < n, order + 1)
    time = h
    if on_clock:
        time = entry_at(powers, order + 1, n + guards)
        # Beyond the end of the run, or so close to it that no step leads through what would be left.
        able = both(able, time + rounding < (1.0 - 64.0 * EPSILON) * remaining)
    able = both(able, time > rounding)
    total = in_every_run(0.0)
    for i in range(n):
        total = total + entry_at(powers, order + 2, i)
    able = both(able, total < math.inf)
    for k in range(tangents):
        for column in range(start + k * stride, start + k * stride + n, 4):
            evaluate_four(powers, column, order, h, False, order + 1)
    put_rows(sea.ends, 0, time)
    going, before = without(able, event), time < remaining
    sea.stopping = bits_of(without(both(both(able, onward), either(going, time > remaining)), before))
    take_step(model, sea, lane, places, mode, tangents, order, able)
    return able, without(both(going, either(before, onward)), late)
