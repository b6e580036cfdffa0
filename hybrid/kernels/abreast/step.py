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

from hybrid.kernels.abreast.certificate import DEGREE, certify
from hybrid.kernels.abreast.lanes import (
    AHEAD_OF_STAY,
    CYCLE,
    DIVERGENCE,
    FOLLOWS,
    LONGEST_STEP,
    LOW,
    ROOM,
    SINCE,
    STAY,
    STEPS,
    T,
    holds_roots,
    order_of,
)
from hybrid.kernels.abreast.rows import (
    binary_logarithms_of,
    bits_of,
    both,
    either,
    entry_at,
    fused,
    in_every_run,
    larger,
    magnitude,
    powers_of_two,
    put_entry,
    put_rows,
    rows_at,
    smaller,
    square_root,
    where,
    without,
)
from hybrid.kernels.events.guards import ROUNDING_OF_STATE
from hybrid.kernels.steps.series_length import (
    BEFORE_TAIL,
    EXACT_TOLERANCE,
    FALL_OF_EXACT,
    FINEST,
    LEAST_RISE,
    MOST_BITS,
    MOST_RISE,
    MOST_RISE_OF_EXACT,
    SAFETY,
    SHARE,
    TAIL,
    TAIL_OF_EXACT,
    TANGENT_SHARE,
    TINY,
)
from hybrid.kernels.types.codes import (
    ABREAST,
    DESINGULARISED,
    EXACT,
    FROM_LAST_STEP,
    FROM_STATE,
    FROM_ZERO,
    NO_TRANSITION,
    ROOTED,
)
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Rounding of a sum, as a share of the magnitudes of its terms (``certificate``).
ROUNDING_OF_SUM = 64.0 * EPSILON
# Number of terms at the end of a series by which its error is judged: some may be zero.
LAST_TERMS = 5
# A crossing is slow if the guard would change by no more than this share of its terms, over the whole step;
# or by no more than so many bands: then an error of their size could turn it back.
SLOW_SHARE = 1e-6
SLOW_BANDS = 64.0
# Two crossings closer than this share of the step are taken for one.
APART = 1e-9
# Steps of Newton's method, and the change, as a share of the place, below which it is rounding.
MOST_CORRECTIONS = 16
AT_ROOT = 4.0 * EPSILON
LONGEST = 1e100
# A guard is far from zero if it is so many bands away.
DISTANT = 1e3
# Shortest step, in units of the rounding of time.
FINEST_STEP = 4.0 * EPSILON


@njit(**INLINE)
def weigh(method, sea, n, controlled, tangents, start, stride, exact):
    """One over the tolerance of each component into ``sea.weights``, as ``series_length.weigh_state``."""
    powers, biggest = sea.powers, in_every_run(0.0)
    rtol, atol = (EXACT_TOLERANCE, 0.0) if exact else (method.rtol, method.atol)
    floor = in_every_run(atol + TINY)
    if exact:
        for i in range(controlled):
            biggest = larger(magnitude(entry_at(powers, 0, i)), biggest)
        floor = SHARE * rtol * biggest + TINY
    for i in range(n):
        put_rows(sea.weights, i, 1.0 / (floor + rtol * magnitude(entry_at(powers, 0, i))))
    if not exact:
        rtol = min(rtol, max(TANGENT_SHARE * rtol, FINEST))
    for k in range(tangents):
        square, first = in_every_run(0.0), start + k * stride
        for i in range(controlled):
            component = entry_at(powers, 0, first + i)
            square = fused(component, component, square)
        floor = ((SHARE * rtol if exact else rtol) / math.sqrt(controlled)) * square_root(square) + TINY
        for i in range(n):
            component = magnitude(entry_at(powers, 0, first + i))
            put_rows(sea.weights, n * (1 + k) + i, 1.0 / (floor + rtol * component))


@njit(**INLINE)
def largest_of_state(sea, n, order):
    """The largest term of the state of an order, in tolerances."""
    powers, worst = sea.powers, in_every_run(0.0)
    for i in range(n):
        worst = larger(rows_at(sea.weights, i) * magnitude(entry_at(powers, order, i)), worst)
    return worst


@njit(**INLINE)
def largest_of_tangents(sea, n, tangents, start, stride, order, worst):
    """The largest term of an order of the tangent vectors, or ``worst`` if that is larger."""
    for k in range(tangents):
        for i in range(n):
            component = entry_at(sea.powers, order, start + k * stride + i)
            worst = larger(rows_at(sea.weights, n * (1 + k) + i) * magnitude(component), worst)
    return worst


@njit(**INLINE)
def trusted_length(method, sea, n, tangents, start, stride, order, exact):
    """The longest step at which the last terms are below the tolerances, and the runs whose series are regular.

    As ``series_length.longest_step`` and ``is_regular``.
    """
    fall = FALL_OF_EXACT if exact else -math.log2(method.rtol) / order
    tail = order - (TAIL_OF_EXACT if exact else TAIL)
    last, own, before = in_every_run(-1e300), in_every_run(-1e300), in_every_run(-1e300)
    newer, older = last, last
    for o in range(order, tail, -1):
        worst, lower, share = largest_of_state(sea, n, o), fall * (order - o), 1.0 / max(o, 1)
        logarithm = binary_logarithms_of(worst)
        own = larger((logarithm - lower) * share, own)
        if o > order - 4:
            newer = larger(logarithm, newer)
        else:
            older = larger(logarithm, older)
        if tangents > 0:
            worst = largest_of_tangents(sea, n, tangents, start, stride, o, worst)
            last = larger((binary_logarithms_of(worst) - lower) * share, last)
    last = larger(own, last)
    for o in range(tail, max(tail - BEFORE_TAIL, 0), -1):
        logarithm = binary_logarithms_of(largest_of_state(sea, n, o))
        before = larger((logarithm - fall * (order - o)) * (1.0 / max(o, 1)), before)
    # Tangent vectors may shorten the step: that makes the series of the state no less regular.
    rise = before - own
    regular = both(rise >= LEAST_RISE, rise <= (MOST_RISE_OF_EXACT if exact else MOST_RISE))
    if not exact:
        regular = both(regular, newer - older <= 0.5 * TAIL * last)
    length = (1.0 if exact else SAFETY) * powers_of_two(-1.0 * last)
    reach = 2.0 ** (MOST_BITS / order)
    return length, both(regular, both(length * reach > 1.0, length < reach))


@njit(**INLINE)
def evaluate_four(powers, column, order, h, with_sizes):
    """Values at ``h`` of four columns into row ``order + 1``, and what they are sums of into the next.

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
        put_entry(powers, order + 2, column, size_a)
        put_entry(powers, order + 2, column + 1, size_b)
        put_entry(powers, order + 2, column + 2, size_c)
        put_entry(powers, order + 2, column + 3, size_d)
    else:
        for o in range(order - 1, -1, -1):
            a = fused(a, h, entry_at(powers, o, column))
            b = fused(b, h, entry_at(powers, o, column + 1))
            c = fused(c, h, entry_at(powers, o, column + 2))
            d = fused(d, h, entry_at(powers, o, column + 3))
    put_entry(powers, order + 1, column, a)
    put_entry(powers, order + 1, column + 1, b)
    put_entry(powers, order + 1, column + 2, c)
    put_entry(powers, order + 1, column + 3, d)


@njit(**INLINE)
def end_with_size(powers, column, order, h):
    """Value of a column at ``h``, and the sum of the magnitudes of its terms."""
    total = entry_at(powers, order, column)
    size = magnitude(total)
    for o in range(order - 1, -1, -1):
        term = entry_at(powers, o, column)
        total, size = fused(total, h, term), fused(size, h, magnitude(term))
    return total, size


@njit(**INLINE)
def band_of(model, method, sea, time, mode, slot, order, size, h, exact):
    """How far errors may move a guard: rounding of state, time and terms, tolerances, terms left out."""
    n, powers, row = model.dimension, sea.powers, order + 3 + slot
    share = ROUNDING_OF_STATE * EPSILON
    clock = larger(magnitude(time), model.period)
    band = share * (entry_at(powers, row, n) * clock) + ROUNDING_OF_SUM * entry_at(powers, row, n + 1)
    for i in range(n):
        scale = fused(magnitude(entry_at(powers, 1, i)), h, magnitude(entry_at(powers, 0, i)))
        error = share * scale
        if not exact and i < model.controlled:
            error = fused(scale, method.rtol, error + method.atol)
        band = fused(entry_at(powers, row, i), error, band)
    if model.propagator[mode] == DESINGULARISED or model.propagator[mode] == ROOTED:
        # The column may hold the root of the guard.
        band = square_root(band) if model.root[mode] == 2 else powers_of_two(
            (binary_logarithms_of(band) + 0.1) / model.root[mode]
        )
    band = fused(size, ROUNDING_OF_SUM, band)
    if model.degree[mode] == 0:
        column, left_out = n + slot, magnitude(entry_at(powers, order, n + slot))
        for o in range(order - 1, order - LAST_TERMS, -1):
            left_out = larger(left_out * h, magnitude(entry_at(powers, o, column)))
        for _ in range(order - LAST_TERMS + 1):
            left_out = left_out * h
        band = band + left_out
    return band


@njit(**INLINE)
def leading_powers(sea, column, order, size, known, h):
    """The first powers of a guard on ``[0, 1]`` into ``sea.polynomial``; a bound for the others.

    A guard that is zero at the start is divided by its variable.
    """
    powers, target = sea.powers, sea.polynomial
    rest, power = size, in_every_run(1.0)
    for i in range(DEGREE + 2):
        term = in_every_run(0.0)
        if i <= order:
            term = entry_at(powers, i, column) * power
        if i > 0:
            put_rows(target, i - 1, where(known, term, rows_at(target, i - 1)))
        if i <= DEGREE:
            put_rows(target, i, term)
            rest = rest - magnitude(term)
        else:
            rest = rest - where(known, magnitude(term), 0.0)
        power = power * h
    return larger(rest, 0.0)


@njit(**INLINE)
def root_in(sea, column, order, known, side, begin, length, h, found):
    """The root of a guard on a piece, as a share of the step, its slope there, and the runs that have it."""
    powers, low, high = sea.powers, begin, begin + length
    x, start = fused(length, 0.5, begin), entry_at(powers, 0, column)
    settled, slope = without(found, found), in_every_run(1.0)
    for _ in range(MOST_CORRECTIONS):
        place = x * h
        value, rate = entry_at(powers, order, column), in_every_run(0.0)
        for o in range(order - 1, -1, -1):
            rate = fused(rate, place, value)
            value = fused(value, place, entry_at(powers, o, column))
        rate = rate * h
        # A guard that is zero at the start is divided by its variable, until the end.
        divided = (value - start) / x
        value = where(known, divided, value)
        rate = where(known, (rate - divided) / x, rate)
        slope = where(settled, slope, rate)
        before = value * side > 0.0
        low, high = where(before, x, low), where(before, high, x)
        nearer = x - value / rate
        inside = both(nearer >= low, nearer <= high)
        nearer = where(inside, nearer, 0.5 * (low + high))
        shift = magnitude(nearer - x)
        x = where(settled, x, nearer)
        settled = either(settled, both(inside, shift <= AT_ROOT * x))
        if bits_of(without(found, settled)) == 0:
            break
    return x, slope, both(found, settled)


@njit(**INLINE)
def fires(model, mode, slot, towards):
    """The transition that fires if the guard of a slot is crossed towards a side; none if that is not plain.

    Transitions on one surface share its crossings: the first that is allowed fires.
    """
    first = model.first_outgoing[mode]
    guard = model.outgoing[slot]
    for place in range(first, model.first_outgoing[mode + 1]):
        other = model.outgoing[place]
        if model.surface[other] != model.surface[guard]:
            continue
        way = towards * model.orientation[other] * model.orientation[guard]
        if model.direction[other] == 0 or model.direction[other] == way:
            return NO_TRANSITION if model.conditional[mode] == 1 else other
    return NO_TRANSITION


@njit(**INLINE)
def is_twin(model, mode, slot):
    """Whether a transition listed before has the same surface."""
    guard = model.outgoing[slot]
    for place in range(model.first_outgoing[mode], slot):
        if model.surface[model.outgoing[place]] == model.surface[guard]:
            return True
    return False


@njit(**KERNEL)
def first_crossing(model, method, sea, lane, places, mode, order, h, exact, able):
    """The place of the first crossing, beyond the step if there is none, and the runs for which that is proved.

    ``sea.fired`` gets the transitions.
    """
    n, powers, first = model.dimension, sea.powers, model.first_outgoing[mode]
    earliest, time, distant = in_every_run(2.0), rows_at(lane, places.numbers + T), able
    for slot in range(first, model.first_outgoing[mode + 1]):
        if is_twin(model, mode, slot):
            continue
        column = n + slot - first
        value, size = end_with_size(powers, column, order, h)
        start, side = entry_at(powers, 0, column), rows_at(lane, places.guards + 3 * (slot - first))
        known = rows_at(lane, places.guards + 3 * (slot - first) + 1) > 0.5
        band = band_of(model, method, sea, time, mode, slot - first, order, size, h, exact)
        distant = both(distant, value * side > DISTANT * band)
        keeps = without(start * side > size - value * side + 2.0 * band, known)
        asked = without(able, keeps)
        if bits_of(asked) == 0:
            continue
        rest = leading_powers(sea, column, order, size, known, h)
        band = band + rest
        clear = rows_at(sea.polynomial, 0) * side > band
        none, one, begin, length = certify(sea.polynomial, side, band, both(asked, clear), sea.moved)
        if bits_of(one) != 0:
            place, slope, one = root_in(sea, column, order, known, side, begin, length, h, one)
            steep = slope * side < -1.0 * larger(SLOW_SHARE * size, SLOW_BANDS * band)
            # The slope is that of the guard divided by its variable.
            one = both(one, both(steep, magnitude(place - earliest) > APART))
            upwards, downwards = fires(model, mode, slot, 1), fires(model, mode, slot, -1)
            if upwards == NO_TRANSITION:
                one = both(one, side > 0.0)
            if downwards == NO_TRANSITION:
                one = both(one, side < 0.0)
            sooner = both(one, place < earliest)
            earliest = where(sooner, place, earliest)
            bits, falling = bits_of(sooner), bits_of(side > 0.0)
            for row in range(sea.fired.shape[0]):
                if (bits >> row) & 1:
                    sea.fired[row] = downwards if (falling >> row) & 1 else upwards
        able = both(able, either(keeps, either(none, one)))
    sea.distant = bits_of(distant)
    return earliest, able


@njit(**INLINE)
def longest_room(model, lane, places, mode):
    """The time until the next step must end, and that until it should: a little after the last stay ended."""
    left = rows_at(lane, places.numbers + STAY) - rows_at(lane, places.numbers + SINCE)
    beyond = rows_at(lane, places.numbers + AHEAD_OF_STAY)
    return where(both(left > 0.0, beyond > 0.0), left + beyond, math.inf)


@njit(**INLINE)
def set_origins(sea, lane, places, n, order):
    """Tell the series what they may take the roots of guards from (``steps.series.set_origins``)."""
    follows = rows_at(lane, places.numbers + FOLLOWS) > 0.5
    for g in range(places.count):
        known = rows_at(lane, places.guards + 3 * g + 1) > 0.5
        origin = where(follows, float(FROM_LAST_STEP), float(FROM_STATE))
        put_entry(sea.powers, order + 1, n + g, rows_at(lane, places.guards + 3 * g + 2))
        put_entry(sea.powers, order + 2, n + g, where(known, float(FROM_ZERO), origin))


@njit(**INLINE)
def take_step(model, sea, lane, places, mode, tangents, order, going):
    """Move the runs of a mask to the end of the step, where they go on."""
    n, powers, rooted = model.dimension, sea.powers, holds_roots(model, mode)
    for i in range(n):
        put_rows(lane, i, where(going, entry_at(powers, order + 1, i), rows_at(lane, i)))
        size = rows_at(lane, places.sizes + i)
        # On a guard, rounding is that of the landing.
        put_rows(lane, places.sizes + i, where(going, entry_at(powers, order + 2, i), size))
    for k in range(tangents):
        begin = sea.tangent_start + k * sea.tangent_columns[mode]
        for i in range(n):
            place = n * (1 + k) + i
            put_rows(lane, place, where(going, entry_at(powers, order + 1, begin + i), rows_at(lane, place)))
    for g in range(places.count):
        place = places.guards + 3 * g
        put_rows(lane, place + 1, where(going, 0.0, rows_at(lane, place + 1)))
        if rooted:
            root = entry_at(powers, order + 1, n + g)
            put_rows(lane, place + 2, where(going, root, rows_at(lane, place + 2)))
    first, span = places.numbers, where(going, rows_at(sea.ends, 0), 0.0)
    move_clock(model, lane, first, span)
    put_rows(lane, first + SINCE, rows_at(lane, first + SINCE) + span)
    put_rows(lane, first + LONGEST_STEP, larger(rows_at(lane, first + LONGEST_STEP), span))
    put_rows(lane, first + ROOM, rows_at(lane, first + ROOM) - span)
    put_rows(lane, first + STEPS, rows_at(lane, first + STEPS) + where(going, 1.0, 0.0))
    put_rows(lane, first + FOLLOWS, where(going, 1.0, rows_at(lane, first + FOLLOWS)))
    if tangents > 0:
        change = where(going, entry_at(powers, order + 1, n + places.count + 1), 0.0)
        put_rows(lane, first + DIVERGENCE, rows_at(lane, first + DIVERGENCE) + change)


@njit(**INLINE)
def sum_of(a, b):
    """``a + b``, rounded, and its rounding error (``arithmetic.clock``)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@njit(**INLINE)
def move_clock(model, lane, first, span):
    """``arithmetic.clock.forward`` of all runs."""
    phase, lost = sum_of(rows_at(lane, first + T), span)
    phase, low = sum_of(phase, lost + rows_at(lane, first + LOW))
    cycle, period = rows_at(lane, first + CYCLE), model.period
    if period > 0.0:
        over = phase >= period
        while bits_of(over) != 0:
            earlier, lost = sum_of(phase, where(over, -period, 0.0))
            phase, low = sum_of(earlier, lost + low)
            cycle = cycle + where(over, 1.0, 0.0)
            over = phase >= period
    put_rows(lane, first + T, phase)
    put_rows(lane, first + LOW, low)
    put_rows(lane, first + CYCLE, cycle)


@njit(**KERNEL)
def step_abreast(model, method, sea, lane, places, mode, tangents, asked):
    """One step of the runs of the mask ``asked`` in a mode; the masks of those that took it, and that go on.

    Those that do not go on have reached an event or the end of their room: the values at the end, and what
    the state is a sum of, are left in the rows behind the series.
    """
    n, powers, kind = model.dimension, sea.powers, model.propagator[mode]
    exact, on_clock, first = kind == EXACT, kind == DESINGULARISED, places.numbers
    order, degree, guards = order_of(model, method, mode), model.degree[mode], places.count
    start, stride = sea.tangent_start, sea.tangent_columns[mode]
    if on_clock or kind == ROOTED:
        set_origins(sea, lane, places, n, order)
    x = lane[: places.parameters * ABREAST]
    p = lane[places.parameters * ABREAST : first * ABREAST]
    sea.series(mode, lane[first * ABREAST :], x, p, order, powers)
    able, h = asked, in_every_run(LONGEST)
    if degree == 0:
        weigh(method, sea, n, model.controlled, tangents, start, stride, exact)
        h, regular = trusted_length(method, sea, n, tangents, start, stride, order, exact)
        able = both(able, regular)
    remaining, t = rows_at(lane, first + ROOM), magnitude(rows_at(lane, first + T))
    rounding = FINEST_STEP * (t if model.timed[mode] == 1 else rows_at(lane, first + SINCE))
    if not on_clock:
        room = smaller(remaining, longest_room(model, lane, places, mode))
        h = smaller(h, smaller(room, method.max_step))
        able = both(able, h < LONGEST)
    else:
        h = smaller(h, LONGEST)
    for row in range(sea.fired.shape[0]):
        sea.fired[row] = NO_TRANSITION
    event, sea.distant = without(asked, asked), bits_of(asked)
    if guards > 0:
        earliest, able = first_crossing(model, method, sea, lane, places, mode, order, h, exact, able)
        event = earliest <= 1.0
        h = where(event, earliest * h, h)
    # The state; guards and the clock if there is one; the divergence with tangent vectors.
    width = n
    if on_clock or kind == ROOTED:
        width = n + guards + 1
    if tangents > 0:
        width = n + guards + 2
    for column in range(0, width, 4):
        evaluate_four(powers, column, order, h, True)
    time = h
    if on_clock:
        time, size = entry_at(powers, order + 1, n + guards), entry_at(powers, order + 2, n + guards)
        # Beyond the end of the run, or so close to it that no step leads through what would be left.
        able = both(able, time + fused(size, 4.0 * EPSILON, rounding) < remaining)
    able = both(able, time > rounding)
    total = in_every_run(0.0)
    for i in range(n):
        total = total + entry_at(powers, order + 2, i)
    able = both(able, total < math.inf)
    for k in range(tangents):
        for column in range(start + k * stride, start + k * stride + n, 4):
            evaluate_four(powers, column, order, h, False)
    put_rows(sea.ends, 0, time)
    put_rows(sea.ends, 1, h)
    going = both(without(able, event), time < remaining)
    take_step(model, sea, lane, places, mode, tangents, order, going)
    if model.timed[mode] == 1:
        late = method.rtol * rows_at(lane, first + LONGEST_STEP) < EPSILON * magnitude(rows_at(lane, first + T))
        return able, going, without(going, late)
    return able, going, going
