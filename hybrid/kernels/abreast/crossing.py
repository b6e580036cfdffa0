"""The first crossing of a guard on a step of several runs in one mode, where that can be proved."""

from numba import njit

from hybrid.kernels.abreast.certificate import certify
from hybrid.kernels.abreast.rows import (
    bits_of,
    both,
    either,
    entry_at,
    in_every_run,
    put_rows,
    rows_at,
    where,
    without,
)
from hybrid.kernels.arithmetic.powers import binary_logarithms, powers_of_two
from hybrid.kernels.arithmetic.wide import fused, larger, magnitude, square_root
from hybrid.kernels.events.guards import ROUNDING_OF_STATE
from hybrid.kernels.steps.series import holds_roots
from hybrid.kernels.types.abreast import DEGREE, PER_GUARD, PERIOD, T
from hybrid.kernels.types.codes import NO_TRANSITION
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
# Two crossings closer than this share of the step, or than what so many bands hide, are taken for one.
CROSSINGS_APART = 1e-9
ZERO_BANDS = 4.0
# Steps of Newton's method, with the first powers and with all; and the change, as a share of the place, below
# which it is rounding.
APPROACHES = 3
MOST_NEWTON_STEPS = 16
ROUNDING_OF_ROOT = 4.0 * EPSILON
# What a landing has left of a guard may move the next one by this share of the time between them.
MOST_LEFT = 0.1
# A guard is far from zero if it is so many bands away.
DISTANT = 1e3


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
def band_of(model, method, sea, clock, mode, slot, order, size, h, exact):
    """How far errors may move a guard: rounding of state, time and terms, tolerances, terms left out."""
    n, powers, row = model.dimension, sea.powers, order + 3 + slot
    share = ROUNDING_OF_STATE * EPSILON
    band = share * (entry_at(powers, row, n) * clock) + ROUNDING_OF_SUM * entry_at(powers, row, n + 1)
    for i in range(n):
        scale = fused(magnitude(entry_at(powers, 1, i)), h, magnitude(entry_at(powers, 0, i)))
        error = share * scale
        if not exact and i < model.controlled:
            error = fused(scale, method.rtol, error + method.atol)
        band = fused(entry_at(powers, row, i), error, band)
    if holds_roots(model, mode):
        # The column may hold the root of the guard.
        band = (
            square_root(band)
            if model.root[mode] == 2
            else powers_of_two((binary_logarithms(band) + 0.1) / model.root[mode])
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
def first_powers(sea, column, order, size, known, h):
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
def corrected(over, under, side, x, low, high):
    """A place by Newton's method, halfway if that is not in the bracket; whether it is, and the bracket."""
    before = over * side > 0.0
    low, high = where(before, x, low), where(before, high, x)
    nearer = x - over / under
    inside = both(nearer >= low, nearer <= high)
    return where(inside, nearer, 0.5 * (low + high)), inside, low, high


@njit(**INLINE)
def root_in(sea, column, order, known, side, begin, length, h, found):
    """The root of a guard on a piece, as a share of the step, its slope there, and the runs that have it.

    The powers in ``sea.polynomial`` tell where to begin.
    """
    powers, low, high = sea.powers, begin, begin + length
    x, start = fused(length, 0.5, begin), where(known, entry_at(powers, 0, column), 0.0)
    for _ in range(APPROACHES):
        value, rate = rows_at(sea.polynomial, DEGREE), in_every_run(0.0)
        for i in range(DEGREE - 1, -1, -1):
            rate = fused(rate, x, value)
            value = fused(value, x, rows_at(sea.polynomial, i))
        x, _, low, high = corrected(value, rate, side, x, low, high)
    low, high = begin, begin + length
    settled, slope = without(found, found), in_every_run(1.0)
    for _ in range(MOST_NEWTON_STEPS):
        place = x * h
        value, rate, bend = entry_at(powers, order, column), in_every_run(0.0), in_every_run(0.0)
        for o in range(order - 1, -1, -1):
            bend = fused(bend, place, rate)
            rate = fused(rate, place, value)
            value = fused(value, place, entry_at(powers, o, column))
        value, rate, bend = value - start, rate * h, bend * h * h
        # A guard that is zero at the start is divided by its variable.
        over, under = where(known, value * x, value), where(known, fused(rate, x, -value), rate)
        bent = where(known, bend * x / under - 1.0 / x, bend / under)
        slope = where(settled, slope, under)
        nearer, inside, low, high = corrected(over, under, side, x, low, high)
        shift = nearer - x
        x = where(settled, x, nearer)
        # So much the next correction would be.
        close = magnitude(bent) * shift * shift <= ROUNDING_OF_ROOT * x
        settled = either(settled, both(inside, close))
        if bits_of(without(found, settled)) == 0:
            break
    # What has been left of a guard that counts as zero is made up for.
    left = start / slope
    x = where(magnitude(left) < MOST_LEFT, x - left * x, x)
    return x, where(known, slope / (x * x), slope), both(found, settled)


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
    """The place of the first crossing, beyond the step if there is none, and the runs that prove it.

    ``sea.fired`` gets the transitions.
    """
    n, powers, first = model.dimension, sea.powers, model.first_outgoing[mode]
    earliest, widest, distant = in_every_run(2.0), in_every_run(0.0), able
    clock = larger(magnitude(rows_at(lane, places.numbers + T)), rows_at(lane, places.numbers + PERIOD))
    for slot in range(first, model.first_outgoing[mode + 1]):
        if is_twin(model, mode, slot):
            continue
        column = n + slot - first
        value, size = end_with_size(powers, column, order, h)
        start, side = entry_at(powers, 0, column), rows_at(lane, places.guards + PER_GUARD * (slot - first))
        known = rows_at(lane, places.guards + PER_GUARD * (slot - first) + 1) > 0.5
        band = band_of(model, method, sea, clock, mode, slot - first, order, size, h, exact)
        put_rows(lane, places.guards + PER_GUARD * (slot - first) + 3, band)
        distant = both(distant, value * side > DISTANT * band)
        keeps = without(start * side > size - value * side + 2.0 * band, known)
        asked = without(able, keeps)
        if bits_of(asked) == 0:
            continue
        rest = first_powers(sea, column, order, size, known, h)
        band = band + rest
        clear = rows_at(sea.polynomial, 0) * side > band
        none, one, begin, length = certify(sea.polynomial, side, band, both(asked, clear), sea.moved)
        if bits_of(one) != 0:
            place, slope, one = root_in(sea, column, order, known, side, begin, length, h, one)
            steep = slope * side < -1.0 * larger(SLOW_SHARE * size, SLOW_BANDS * band)
            # Where one guard is zero, the other one is clear of zero.
            width = larger(ZERO_BANDS * band / magnitude(slope), CROSSINGS_APART)
            one = both(one, both(steep, magnitude(place - earliest) > larger(width, widest)))
            upwards, downwards = fires(model, mode, slot, 1), fires(model, mode, slot, -1)
            if upwards == NO_TRANSITION:
                one = both(one, side > 0.0)
            if downwards == NO_TRANSITION:
                one = both(one, side < 0.0)
            sooner = both(one, place < earliest)
            earliest, widest = where(sooner, place, earliest), where(sooner, width, widest)
            bits, falling = bits_of(sooner), bits_of(side > 0.0)
            for row in range(sea.fired.shape[0]):
                if (bits >> row) & 1:
                    sea.fired[row] = downwards if (falling >> row) & 1 else upwards
        able = both(able, either(keeps, either(none, one)))
    sea.distant = bits_of(distant)
    return earliest, able
