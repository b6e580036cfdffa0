"""Real roots of a polynomial in Bernstein form by Descartes' rule: none missed, none counted twice.

The number of sign variations of the Bernstein coefficients bounds the number of roots in the open interval
and has the same parity (Lane and Riesenfeld 1981, doi:10.1007/BF01934081). So 0 or 1 variations prove 0 or 1
roots, and an interval with more is halved. The hull of the coefficients makes "no root" cheap to prove, and
nearly every step has no root.
"""

from numba import njit

from hybrid.kernels.types.options import INLINE, KERNEL

NO_ROOT = 2.0
# Roots closer than this on the unit interval count as one root: rounding of the coefficients merges them.
CLUSTER = 1e-14
# A relative Newton step below this is in the range of quadratic convergence to a numerically simple root.
SETTLED = 1e-8
# A root closer to an end than this share of an interval may be one at the end itself, moved by rounding.
AT_END = 1e-8


@njit(**KERNEL)
def value_and_slope(coefficients, degree, theta):
    """Value and derivative at ``theta`` on [0, 1]; ``coefficients (degree + 1,)``.

    One step of de Casteljau's algorithm lowers the degree by one. The rest is summed in its Bernstein basis,
    whose members are all positive. The sum starts from the nearer end, so that each member is the previous
    member times a ratio of at most the degree.
    """
    if degree == 0:
        return coefficients[0], 0.0
    backwards = theta > 0.5
    distance = 1.0 - theta if backwards else theta
    basis, ratio = (1.0 - distance) ** (degree - 1), distance / (1.0 - distance)
    value, slope = 0.0, 0.0
    for j in range(degree):
        row = degree - 1 - j if backwards else j
        difference = coefficients[row + 1] - coefficients[row]
        value += basis * (coefficients[row] + theta * difference)
        slope += basis * difference
        step = (degree - 1 - j) / (j + 1.0)
        basis *= ratio * step
    return value, degree * slope


@njit(**KERNEL)
def simple_root(coefficients, degree, sign_left):
    """The only root in (0, 1) of a polynomial with one sign variation: Newton's method in a bracket.

    Another root may be at an end, up to rounding. There the slope has the other sign.
    """
    low, high, last = 0.0, 1.0, 1.0
    # Start at the root of the secant, unless an end is a root: that root is not in the open interval.
    theta = coefficients[0] / (coefficients[0] - coefficients[degree])
    if not (AT_END < theta < 1.0 - AT_END):
        theta = 0.5
    for _ in range(100):
        value, slope = value_and_slope(coefficients, degree, theta)
        turned = slope * sign_left > 0.0
        if turned:
            slope = 0.0
        elif value == 0.0:
            return theta
        if turned and not AT_END < theta < 1.0 - AT_END:
            # So close to the other root, rounding may have made the sign of the value.
            pass
        elif (value > 0.0) == (sign_left > 0):
            low = theta
        else:
            high = theta
        newton = theta - value / slope if slope != 0.0 else -1.0
        change = abs(newton - theta)
        # Newton steps shrink quadratically here: a step that does not comes from rounding of the value.
        if change <= 2e-16 * theta or (last < SETTLED * theta and change > 0.25 * last):
            return theta
        if not (low < newton < high):
            newton = 0.5 * (low + high)
            change = 1.0
        if high - low <= 2e-16 * high:
            return newton
        theta, last = newton, change
    return theta


@njit(**KERNEL)
def first_crossing(coefficients, degree, side, direction, stack):
    """First zero crossing in ``direction`` on [0, 1], and the side the polynomial is on after it.

    ``coefficients (degree + 1,)`` may be longer. ``side`` is the sign before the interval: if the polynomial
    starts with the other sign, it crosses at 0. ``side = 0`` stands for an unknown sign: then roots that
    rounding cannot tell from 0 are no crossings. ``stack (depth, >= degree + 3)`` is scratch. Returns
    ``(NO_ROOT, side at the end)`` if there is no crossing in that direction. A zero exactly at 1 counts as a
    crossing if the slope there leads across.
    """
    start, end, top, side = bracket_crossing(coefficients, degree, side, direction, stack)
    if start == end:
        return start, side
    return start + (end - start) * simple_root(stack[top][2:], degree, -side), side


@njit(**INLINE)
def crosses_towards(direction, side):
    """Whether a transition with this ``direction`` fires on a crossing to ``side``."""
    return direction == 0 or direction == side


@njit(**INLINE)
def halve(stack, top, degree):
    """Halve the interval in row ``top`` of the stack; the left half, searched first, goes on top."""
    row, left = stack[top], stack[top + 1]
    middle = 0.5 * (row[0] + row[1])
    left[0], left[1] = row[0], middle
    row[0] = middle
    for level in range(degree, -1, -1):
        left[2 + degree - level] = row[2]
        for i in range(2, level + 2):
            row[i] = 0.5 * (row[i] + row[i + 1])


@njit(**KERNEL)
def bracket_crossing(coefficients, degree, side, direction, stack):
    """Bracket of ``first_crossing``: ``(start, end, row, side after it)``.

    If ``start == end``, the crossing is there. Otherwise it is the only root in between, and
    ``stack[row, 2:]`` holds the polynomial on the bracket.
    """
    top, unknown = 0, side == 0
    stack[0, 0] = 0.0
    stack[0, 1] = 1.0
    for i in range(degree + 1):
        stack[0, 2 + i] = coefficients[i]
    while top >= 0:
        row = stack[top]
        start, end = row[0], row[1]
        first, last, variations = 0, 0, 0
        for i in range(2, degree + 3):
            if row[i] != 0.0:
                sign = 1 if row[i] > 0.0 else -1
                if last != 0 and sign != last:
                    variations += 1
                if first == 0:
                    first = sign
                last = sign
        if first == 0:
            top -= 1
            continue
        if side == 0:
            side = first
        if first != side:
            side = first
            if crosses_towards(direction, first):
                return start, start, top, side
        if variations > 1 and end - start > CLUSTER:
            halve(stack, top, degree)
            top += 1
            continue
        if last != side:
            side = last
            at_start = unknown and start == 0.0 and variations > 1
            if not at_start and crosses_towards(direction, last):
                return start, start if variations > 1 else end, top, side
        top -= 1
    if coefficients[degree] == 0.0:
        # The sign before 1 alone does not show whether the root at 1 is odd or even: use the slope.
        slope = -coefficients[max(degree - 1, 0)]
        after = 1 if slope > 0.0 else (-1 if slope < 0.0 else side)
        if after != side:
            side = after
            if crosses_towards(direction, after):
                return 1.0, 1.0, 0, side
    return NO_ROOT, NO_ROOT, 0, side


@njit(**INLINE)
def stays(coefficients, degree, side, band):
    """Whether all coefficients lie beyond ``band`` on ``side``: enough to prove nearly every step."""
    for i in range(degree + 1):  # noqa: SIM110 (no generators in kernels)
        if not coefficients[i] * side > band:
            return False
    return True


@njit(**KERNEL)
def restrict(coefficients, degree, start):
    """Replace a polynomial, in place, by its restriction to ``[start, 1]`` as a polynomial on ``[0, 1]``."""
    for level in range(degree, 0, -1):
        for i in range(level):
            coefficients[i] += start * (coefficients[i + 1] - coefficients[i])


@njit(**KERNEL)
def next_turn(coefficients, degree, start, stack):
    """Place, value and kind of the first turn beyond ``start``; ``NO_ROOT`` if there is none before 1.

    The kind is +1 for a minimum and -1 for a maximum. ``stack (depth, >= degree + 3)`` is scratch.
    """
    slope = stack[stack.shape[0] - 2]
    if start >= 1.0:
        return NO_ROOT, 0.0, 0
    for i in range(degree):
        slope[i] = coefficients[i + 1] - coefficients[i]
    restrict(slope, degree - 1, start)
    kind = -1 if slope[0] > 0.0 else 1
    theta, _ = first_crossing(slope, degree - 1, -kind, kind, stack)
    if theta > 1.0:
        return NO_ROOT, 0.0, kind
    place = start + theta * (1.0 - start)
    value, _ = value_and_slope(coefficients, degree, place)
    return place, value, kind


@njit(**KERNEL)
def divide_by_theta(coefficients, degree):
    """Divide, in place, a polynomial that vanishes at 0 by its variable; returns the new degree.

    This removes a known root at the start of a step exactly: the root cannot be found again, nor hide a
    second root near it.
    """
    for i in range(degree):
        coefficients[i] = coefficients[i + 1] * degree / (i + 1)
    return degree - 1


@njit(**KERNEL)
def multiply_by_theta(coefficients, degree):
    """Undo ``divide_by_theta``; returns the new degree."""
    for i in range(degree, -1, -1):
        coefficients[i + 1] = coefficients[i] * (i + 1) / (degree + 1)
    coefficients[0] = 0.0
    return degree + 1
