"""Where a guard changes its side or turns, and where a clock shows a time: Newton's method in a bracket."""

import math

from numba import njit

from hybrid.kernels.events.onset import AT_REST, BY_SPEED
from hybrid.kernels.events.path import value_at
from hybrid.kernels.guards.form import form_at, is_smooth, middle_slope, sample
from hybrid.kernels.guards.touch import TOUCHES_APART
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Returned instead of a place on the path if there is none.
NOWHERE = -1.0
# More than any bracket in floating-point numbers can be halved, with as many steps of Newton's method.
MOST_ROOT_STEPS = 200

# Safety factor for the estimated error of the last step towards a root, which leaves out higher derivatives.
UNSEEN = 64.0


@njit(**INLINE)
def expanded_at(series, column, first, order, s):
    """Value, derivative and half the second one of a series divided by its variable to the power ``first``.

    Horner's scheme in ``s**2`` for even and for odd terms, which do not wait for each other.
    """
    square = s * s
    even, even_slope, even_bend = 0.0, 0.0, 0.0
    odd, odd_slope, odd_bend = 0.0, 0.0, 0.0
    top = order
    if (order - first) % 2 == 0:
        even = series[order, column]
        top = order - 1
    for o in range(top, first, -2):
        odd_bend = odd_bend * square + odd_slope
        odd_slope = odd_slope * square + odd
        odd = odd * square + series[o, column]
        even_bend = even_bend * square + even_slope
        even_slope = even_slope * square + even
        even = even * square + series[o - 1, column]
    value = even + s * odd
    slope = odd + 2.0 * (s * even_slope + square * odd_slope)
    bend = even_slope + s * (3.0 * odd_slope + 4.0 * (s * even_bend + square * odd_bend))
    return value, slope, bend


@njit(**KERNEL)
def time_of(series, clock, order, h, span):
    """Place on ``[0, h]`` where the clock shows ``span``: Newton's method in a bracket; time only grows."""
    low, high = 0.0, h
    # The clock may start at speed zero; the place then grows like the root of the time.
    s = h * math.sqrt(min(max(span / value_at(series, clock, order, h), 0.0), 1.0))
    if s == 0.0:
        return s
    for _ in range(MOST_ROOT_STEPS):
        value, slope, _ = expanded_at(series, clock, 0, order, s)
        misfit = value - span
        if misfit > 0.0:
            high = s
        else:
            low = s
        newton = s - misfit / slope
        # Where the step is rounding, the place itself is an end of the bracket.
        if abs(newton - s) <= 2.0 * EPSILON * s:
            return min(newton, h)
        if not low < newton < high:
            newton = 0.5 * (low + high)
        if high - low <= 2.0 * EPSILON * high:
            return newton
        s = newton
    return s


@njit(**KERNEL)
def _value_in(model, path, guard, form, work):
    """Value of a guard at the place of a form.

    Within rounding of a jump or of a vertical tangent bounds are useless: the compiled function is evaluated.
    """
    if form.low_middle <= 0.0 <= form.high_middle and not is_smooth(form):
        return sample(model, guard.transition, path, form.start, work) - guard.base
    return 0.5 * (form.low_middle + form.high_middle)


@njit(**KERNEL)
def _towards_root(value, form):
    """The step to a root by Halley's method, by Newton's without a bend; nan if the slope is not known.

    Near a vertical tangent the bounds are wide: a steeper slope than the flattest that they allow would end
    the method before the root.
    """
    slope = form.least_slope if form.least_slope > 0.0 else form.most_slope
    if not (form.least_slope > 0.0 or form.most_slope < 0.0) or not abs(slope) < math.inf:
        return math.nan
    shift = -value / slope
    turned = shift * 0.5 * (form.least_bend + form.most_bend) / slope
    # Far from the root, next to a turning point, Halley's steps would be as short as the slope is small.
    return shift / (1.0 + turned) if abs(turned) < 0.5 else shift


@njit(**INLINE)
def is_next_rounding(form, change, length, place):
    """Whether the error after a step of Halley's method is rounding: about the cube of the step.

    It comes over the square of the length on which the guard bends; higher derivatives are left out.
    """
    curve = 0.5 * abs((form.least_bend + form.most_bend) / middle_slope(form)) + 1.0 / length
    return UNSEEN * (curve * change) ** 2 * change <= EPSILON * place


@njit(**KERNEL)
def place_of_change(model, path, guard, form, end, work):
    """Where a guard leaves its side between the last place where that was sure and ``end``, where it has.

    Before its first certain sign a guard leaves its side where it is beyond the noise; one that is at rest
    does at the start. One that stays zero for a while, or has no value, has not crossed yet. The place is the
    root, or the end of its bracket beyond it. The search begins where the ``form`` of the piece tells.
    """
    low, high, side, last = guard.sure, end, guard.side, end - guard.sure
    noise = -side * guard.radius if guard.on_guard == AT_REST else side * guard.radius
    place = 0.5 * (form.start + form.end)
    place += _towards_root(0.5 * (form.low_middle + form.high_middle), form)
    if low == 0.0 and guard.on_guard != BY_SPEED:
        # The start comes first.
        place = low
    elif not low < place < high:
        place = 0.5 * (low + high)
    for trial in range(MOST_ROOT_STEPS):
        at = form_at(model, path, guard, place, work)
        value = _value_in(model, path, guard, at, work)
        # Beside a jump bounds tell no slope, and zero is as far as the guard has come.
        flat = not is_smooth(at) or (at.least_slope == 0.0 and at.most_slope == 0.0)
        at_rest = value == 0.0 and flat
        value += noise
        # A guard without a value has not crossed yet: it crosses after that.
        if value * side > 0.0 or at_rest or math.isnan(value):
            low = place
        elif place == 0.0:
            return 0.0
        else:
            high = place
        if (value == 0.0 and not at_rest) or high - low <= 2.0 * EPSILON * high:
            break
        closer = place + _towards_root(value, at)
        change = abs(closer - place)
        if change <= EPSILON * place:
            return place
        # If Newton's method does not halve its steps, the bracket is halved instead.
        if not low < closer < high or (trial > 2 and change > 0.5 * last):
            closer, change = 0.5 * (low + high), high - low
        elif is_next_rounding(at, change, path.length, place):
            return closer
        if closer == place:
            break
        place, last = closer, change
    return high


@njit(**KERNEL)
def place_of_turn(model, path, guard, form, work):
    """Where a guard comes closest to zero on a piece; ``NOWHERE`` if it does not turn there.

    A turn next to the end of the path counts as on it: the next path may begin beyond the turn, by rounding.
    """
    side, low, high = guard.side, form.start, form.end
    if high == path.length:
        high *= 1.0 + TOUCHES_APART
    at = form_at(model, path, guard, high, work)
    if not (at.most_slope if side > 0 else -at.least_slope) >= 0.0:
        return NOWHERE
    place = low
    for _ in range(MOST_ROOT_STEPS):
        at = form_at(model, path, guard, place, work)
        slope = middle_slope(at)
        if slope * side < 0.0:
            low = place
        elif place == low:
            return NOWHERE
        else:
            high = place
        closer = place - 0.5 * slope / at.least_bend if abs(at.least_bend) < math.inf else math.nan
        if abs(closer - place) <= EPSILON * high or high - low <= 2.0 * EPSILON * high:
            break
        place = closer if low < closer < high else 0.5 * (low + high)
        if not low < place < high:
            break
    return min(place, form.end)
