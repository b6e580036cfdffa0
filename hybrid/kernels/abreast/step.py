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
    DESINGULARISED,
    EXACT,
    HIGHEST_ORDER,
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
def end_of_column(powers, column, order, h):
    """Value of a column at ``h``."""
    total = entry_at(powers, order, column)
    for o in range(order - 1, -1, -1):
        total = fused(total, h, entry_at(powers, o, column))
    return total


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
def band_of(model, method, sea, mode, slot, order, size, h, exact):
    """How far errors may move a guard: rounding of state, time and terms, tolerances, terms left out."""
    n, powers, row = model.dimension, sea.powers, order + 3 + slot
    share = ROUNDING_OF_STATE * EPSILON
    clock = larger(magnitude(rows_at(sea.t, 0)), model.period)
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
def first_crossing(model, method, sea, mode, order, h, exact, able):
    """The place of the first crossing, beyond the step if there is none, and the runs for which that is proved.

    ``sea.fired`` gets the transitions.
    """
    n, powers, first = model.dimension, sea.powers, model.first_outgoing[mode]
    earliest = in_every_run(2.0)
    for slot in range(first, model.first_outgoing[mode + 1]):
        if is_twin(model, mode, slot):
            continue
        column = n + slot - first
        value, size = end_with_size(powers, column, order, h)
        start, side = entry_at(powers, 0, column), entry_at(sea.sides, 0, slot - first)
        known = entry_at(sea.sides, 1, slot - first) > 0.5
        band = band_of(model, method, sea, mode, slot - first, order, size, h, exact)
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
    return earliest, able


@njit(**KERNEL)
def step_abreast(model, method, sea, mode, tangents, asked):
    """One step of the runs of the mask ``asked`` in a mode; returns the mask of those that have taken it.

    Values at the end, and what the state is a sum of, are left in the rows behind the series.
    """
    n, powers, kind = model.dimension, sea.powers, model.propagator[mode]
    exact, on_clock = kind == EXACT, kind == DESINGULARISED
    order, degree = HIGHEST_ORDER if exact else method.order, model.degree[mode]
    if degree > 0:
        order = degree
    guards = model.first_outgoing[mode + 1] - model.first_outgoing[mode]
    start, stride = sea.tangent_start, sea.tangent_columns[mode]
    sea.series(mode, sea.t, sea.x, sea.p, order, powers)
    able, h = asked, in_every_run(LONGEST)
    if degree == 0:
        weigh(method, sea, n, model.controlled, tangents, start, stride, exact)
        h, regular = trusted_length(method, sea, n, tangents, start, stride, order, exact)
        able = both(able, regular)
    remaining, rounding = rows_at(sea.limits, 0), rows_at(sea.limits, 2)
    if not on_clock:
        h = smaller(h, smaller(remaining, rows_at(sea.limits, 1)))
        able = both(able, h < LONGEST)
    else:
        h = smaller(h, LONGEST)
    for row in range(sea.fired.shape[0]):
        sea.fired[row] = NO_TRANSITION
    if guards > 0:
        earliest, able = first_crossing(model, method, sea, mode, order, h, exact, able)
        h = where(earliest <= 1.0, earliest * h, h)
    time = h
    if on_clock:
        time, size = end_with_size(powers, n + guards, order, h)
        # Beyond the end of the run, or so close to it that no step leads through what would be left.
        able = both(able, time + fused(size, 4.0 * EPSILON, rounding) < remaining)
    able = both(able, time > rounding)
    total = in_every_run(0.0)
    for i in range(n):
        value, size = end_with_size(powers, i, order, h)
        put_entry(powers, order + 1, i, value)
        put_entry(powers, order + 2, i, size)
        total = total + size
    able = both(able, total < math.inf)
    for g in range(guards if on_clock or kind == ROOTED else 0):
        put_entry(powers, order + 1, n + g, end_of_column(powers, n + g, order, h))
    if tangents > 0:
        put_entry(powers, order + 1, n + guards + 1, end_of_column(powers, n + guards + 1, order, h))
        for k in range(tangents):
            for i in range(n):
                column = start + k * stride + i
                put_entry(powers, order + 1, column, end_of_column(powers, column, order, h))
    put_rows(sea.ends, 0, time)
    put_rows(sea.ends, 1, h)
    return able
