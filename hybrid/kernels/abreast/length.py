"""The length of a step that the series of several runs in one mode allow, and whether these are regular.

All as for a single run (``steps.series_length``).
"""

import math

from numba import njit

from hybrid.kernels.abreast.rows import (
    both,
    entry_at,
    in_every_run,
    put_rows,
    rows_at,
)
from hybrid.kernels.arithmetic.powers import binary_logarithms, powers_of_two
from hybrid.kernels.arithmetic.wide import fused, larger, magnitude, square_root
from hybrid.kernels.steps.series_length import (
    BEFORE_TAIL,
    EXACT_TOLERANCE,
    FALL_OF_EXACT,
    FINEST_OF_TANGENTS,
    LEAST_RISE,
    MOST_BITS,
    MOST_RISE,
    MOST_RISE_OF_EXACT,
    SAFETY_BITS,
    SHARE_OF_LARGEST,
    TAIL,
    TAIL_OF_EXACT,
    TANGENT_SHARE,
    TINY,
)
from hybrid.kernels.types.options import INLINE


@njit(**INLINE)
def weigh(method, sea, n, controlled, tangents, start, stride, exact):
    """One over the tolerance of each component into ``sea.weights``, as ``series_length.weigh_state``."""
    powers, biggest = sea.powers, in_every_run(0.0)
    rtol, atol = (EXACT_TOLERANCE, 0.0) if exact else (method.rtol, method.atol)
    floor = in_every_run(atol + TINY)
    if exact:
        for i in range(controlled):
            biggest = larger(magnitude(entry_at(powers, 0, i)), biggest)
        floor = SHARE_OF_LARGEST * rtol * biggest + TINY
    for i in range(n):
        put_rows(sea.weights, i, 1.0 / (floor + rtol * magnitude(entry_at(powers, 0, i))))
    if not exact:
        rtol = min(rtol, max(TANGENT_SHARE * rtol, FINEST_OF_TANGENTS))
    for k in range(tangents):
        square, first = in_every_run(0.0), start + k * stride
        for i in range(controlled):
            component = entry_at(powers, 0, first + i)
            square = fused(component, component, square)
        share = (SHARE_OF_LARGEST * rtol if exact else rtol) / math.sqrt(controlled)
        floor = share * square_root(square) + TINY
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
    """The longest step at which the last terms are below the tolerances, and where the series are regular.

    As ``series_length.longest_step`` and ``is_regular``.
    """
    fall = FALL_OF_EXACT if exact else -math.log2(method.rtol) / order
    tail = order - (TAIL_OF_EXACT if exact else TAIL)
    last, own, before = in_every_run(-1e300), in_every_run(-1e300), in_every_run(-1e300)
    newer, older = last, last
    for o in range(order, tail, -1):
        worst, lower, share = largest_of_state(sea, n, o), fall * (order - o), 1.0 / max(o, 1)
        logarithm = binary_logarithms(worst)
        own = larger((logarithm - lower) * share, own)
        if o > order - 4:
            newer = larger(logarithm, newer)
        else:
            older = larger(logarithm, older)
        if tangents > 0:
            worst = largest_of_tangents(sea, n, tangents, start, stride, o, worst)
            last = larger((binary_logarithms(worst) - lower) * share, last)
    last = larger(own, last)
    for o in range(tail, max(tail - BEFORE_TAIL, 0), -1):
        logarithm = binary_logarithms(largest_of_state(sea, n, o))
        before = larger((logarithm - fall * (order - o)) * (1.0 / max(o, 1)), before)
    # Tangent vectors may shorten the step: that makes the series of the state no less regular.
    rise = before - own
    regular = both(rise >= LEAST_RISE, rise <= (MOST_RISE_OF_EXACT if exact else MOST_RISE))
    if not exact:
        regular = both(regular, newer - older <= 0.5 * TAIL * last)
    length = powers_of_two(-1.0 * last - (0.0 if exact else SAFETY_BITS / (order - 1)))
    reach = 2.0 ** (MOST_BITS / order)
    return length, both(regular, both(length * reach > 1.0, length < reach))
