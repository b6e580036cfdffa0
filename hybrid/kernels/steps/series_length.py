"""How long the step of a series may be: its last terms are to be below the tolerances."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hybrid.kernels.arithmetic.lanes import (
    four_times,
    largest,
    largest_of_each,
    load,
    places,
    store,
)
from hybrid.kernels.arithmetic.powers import binary_logarithms, power_of_two
from hybrid.kernels.arithmetic.wide import larger, magnitude, square_root
from hybrid.kernels.instructions.registers import whole_registers
from hybrid.kernels.types.codes import HIGHEST_ORDER, NARROW
from hybrid.kernels.types.kinds import INTEGER, REAL, TRUTH
from hybrid.kernels.types.options import INLINE, KERNEL

# Series that can be trusted to the last digit are cut off below rounding.
EXACT_TOLERANCE = 1e-17
# Share of the largest component that serves as absolute tolerance for the others.
SHARE_OF_LARGEST = 1e-3
# A step is shorter by so many bits, shared by its orders: the safety factor of Jorba and Zou.
SAFETY_BITS = 0.7 / math.log(2.0)
# Share of the tolerance for tangent vectors: a stiff contact stretches a vector a thousandfold and shrinks it
# again, and the error made while the vector is long remains when it is short.
TANGENT_SHARE = 0.1
# Below this tolerance the error of tangent vectors is rounding.
FINEST_OF_TANGENTS = 1e-14
# Absolute tolerance of exact series, which need none.
TINY = 1e-300
# Number of terms at the end of a series that must be small.
TAIL = 8
TAIL_OF_EXACT = 3
# Number of terms before these that must suggest about the same step. The logarithm of the quotient of both
# steps: more if the terms before suggest a shorter one, as in a gap, or a longer one, as at the end of a gap.
BEFORE_TAIL = 5
LEAST_RISE = -0.5
MOST_RISE = 0.2
# The same for exact modes, whose terms fall ever faster.
MOST_RISE_OF_EXACT = 1.0
# The terms of a series must be normal floats, from 2**-1022 to 2**1024. In units of time far from its pace
# they grow or fall by as many bits per order as the step has. All orders together may take this many.
MOST_BITS = 900.0
# How many bits a term of an exact series may be larger than the next, about as many as there where it ends.
FALL_OF_EXACT = 4.0


# One over each of four orders, from the one in the row down.
SHARES = np.array(
    [[1.0 / max(order - place, 1) for place in range(NARROW)] for order in range(HIGHEST_ORDER + 1)]
)


class Columns(NamedTuple):
    """The columns of a series by which its step is controlled.

    The first ``n`` are the state, of which ``controlled`` have tolerances. The tangent vectors, four in a
    group, begin at ``first``, and their ``groups`` are ``stride`` columns apart.
    """

    n: INTEGER
    controlled: INTEGER
    first: INTEGER
    stride: INTEGER
    groups: INTEGER


class Tolerance(NamedTuple):
    """The tolerances of a series; one that is ``exact`` can be trusted to the last digit."""

    rtol: REAL
    atol: REAL
    exact: TRUTH


@njit(**INLINE)
def size_from_origin(series, controlled):
    """How far a state at the origin gets while what moves it changes by its own size, in any unit of time."""
    first, second, third = 0.0, 0.0, 0.0
    for i in range(controlled):
        first, second = max(first, abs(series[1, i])), max(second, abs(series[2, i]))
        third = max(third, abs(series[3, i]))
    if first > 0.0:
        pace = max(second / first, math.sqrt(third / first))
        return first / pace if pace > 0.0 else first
    pace = third / second if second > 0.0 else 0.0
    return second / pace**2 if pace > 0.0 else max(second, third)


@njit(**INLINE)
def weigh_state(series, n, controlled, tolerance, weights):
    """One over the tolerance of each component of the state into ``weights``; all other weights are zero."""
    largest, (rtol, atol, exact) = 0.0, tolerance
    for i in range(controlled if exact else 0):
        largest = max(largest, abs(series[0, i]))
    if exact and largest == 0.0:
        largest = size_from_origin(series, controlled)
    floor = SHARE_OF_LARGEST * rtol * largest + TINY if exact else atol + TINY
    for i in range(0, n, NARROW):
        store(weights, 0, i, 1.0 / (floor + rtol * magnitude(load(series, 0, i))))
    for i in range(n, whole_registers(n, NARROW)):
        weights[0, i] = 0.0


@njit(**INLINE)
def weigh_tangents(series, n, controlled, first, tolerance, weights):
    """One over the tolerance of every component of four tangent vectors, each measured against itself."""
    square, (rtol, _, exact) = four_times(0.0), tolerance
    for i in range(controlled):
        component = load(series, 0, first + NARROW * i)
        square = component * component + square
    if not exact:
        rtol = min(rtol, max(TANGENT_SHARE * rtol, FINEST_OF_TANGENTS))
    floor = (SHARE_OF_LARGEST * rtol if exact else rtol) * square_root(square / controlled) + TINY
    for i in range(n):
        component = load(series, 0, first + NARROW * i)
        store(weights, 0, first + NARROW * i, 1.0 / (floor + rtol * magnitude(component)))


@njit(**INLINE)
def largest_term(series, columns, order, weights):
    """The largest terms of an order in tolerances, four at a time."""
    # A nan is skipped here; it shows when the series is summed.
    worst, (n, _, first, stride, groups) = four_times(0.0), columns
    for i in range(0, n, NARROW):
        worst = larger(load(weights, 0, i) * magnitude(load(series, order, i)), worst)
    for g in range(groups):
        for i in range(first + g * stride, first + g * stride + NARROW * n, NARROW):
            worst = larger(load(weights, 0, i) * magnitude(load(series, order, i)), worst)
    return worst


@njit(**INLINE)
def logarithms_of_terms(series, columns, order, least, weights):
    """Logarithms of the largest terms of ``order`` and the three orders before, of those above ``least``."""
    a = largest_term(series, columns, order, weights)
    b, c, d = four_times(0.0), four_times(0.0), four_times(0.0)
    if order - 1 > least:
        b = largest_term(series, columns, order - 1, weights)
    if order - 2 > least:
        c = largest_term(series, columns, order - 2, weights)
    if order - 3 > least:
        d = largest_term(series, columns, order - 3, weights)
    return binary_logarithms(largest_of_each(a, b, c, d))


@njit(**INLINE)
def shares_of_orders(logarithms, first, order, fall):
    """What each of four terms, from order ``first`` down, says of the logarithm of one over the step."""
    return (logarithms - fall * (order - first + places())) * load(SHARES, first, 0)


@njit(**INLINE)
def fall_per_order(tolerance, order):
    """How many bits a term of a series is to be larger than the next."""
    return FALL_OF_EXACT if tolerance.exact else -math.log2(tolerance.rtol) / order


@njit(**KERNEL)
def longest_step(series, columns, order, tolerance, weights):
    """Longest step at which the last terms are below tolerance, as after Jorba and Zou 2005.

    The tolerances are those of the Runge-Kutta methods, each tangent vector a block by itself. The last
    term is to be the tolerance. One term is not enough, on the clock of a contact only every fifth may be
    there: the ones before must be on their way, below the powers of ``rtol`` that lead to it. The series of
    exact modes fall faster than any power, what is behind their last term is next to nothing, and three of
    their terms are enough. ``weights (1, columns)`` is scratch.

    Returned with it are the logarithm of one over the step that the terms suggest, and by how much the newer
    of them are larger than the older ones, for ``is_regular``.
    """
    n, controlled, first, stride, groups = columns
    weigh_state(series, n, controlled, tolerance, weights)
    for g in range(groups):
        weigh_tangents(series, n, controlled, first + g * stride, tolerance, weights)
    exact, fall = tolerance.exact, fall_per_order(tolerance, order)
    tail = order - (TAIL_OF_EXACT if exact else TAIL)
    newer = logarithms_of_terms(series, columns, order, tail, weights)
    older = newer
    last = largest(shares_of_orders(newer, order, order, fall))
    for o in range(order - NARROW, tail, -NARROW):
        older = logarithms_of_terms(series, columns, o, tail, weights)
        last = max(last, largest(shares_of_orders(older, o, order, fall)))
    growth = largest(newer) - largest(older)
    return power_of_two(-last - (0.0 if exact else SAFETY_BITS / (order - 1))), last, growth


@njit(**KERNEL)
def is_regular(series, n, order, tolerance, last, growth, weights):
    """Whether the terms of the state before the last ones suggest about the same step.

    ``last`` and ``growth`` are results of ``longest_step``, which has left the weights. A series may have
    gaps, as that of ``t - x**9`` near zero: then small terms say nothing of those that follow. Nor do terms
    that grow over the step.
    """
    exact = tolerance.exact
    tail = order - (TAIL_OF_EXACT if exact else TAIL)
    if tail <= 0:
        return last > -1000.0
    fall, state = fall_per_order(tolerance, order), Columns(n, n, 0, 0, 0)
    before, least = -math.inf, max(tail - BEFORE_TAIL, 0)
    for o in range(tail, least, -NARROW):
        earlier = logarithms_of_terms(series, state, o, least, weights)
        before = max(before, largest(shares_of_orders(earlier, o, order, fall)))
    if not LEAST_RISE <= before - last <= (MOST_RISE_OF_EXACT if exact else MOST_RISE):
        return False
    # If the newer terms are larger on the step than the older ones, those to come are larger yet.
    return exact or growth <= 0.5 * TAIL * last


@njit(**KERNEL)
def within_floats(series, columns, order, tolerance, weights):
    """The order up to which the terms of a series are normal floats, with what ``longest_step`` says of it.

    Units of time far from the pace of the solution make the later terms overflow or vanish. The first terms
    tell the pace. Later terms that vanish though their pace keeps them normal are those of a polynomial, and
    so are first terms that vanish: the order stays as it is.
    """
    least = (TAIL_OF_EXACT if tolerance.exact else TAIL) + 1
    by_size = Tolerance(1.0, tolerance.atol, tolerance.exact)
    pace, _, _ = longest_step(series, columns, least, by_size, weights)
    bits = abs(math.log2(pace))
    if least * bits <= MOST_BITS < order * bits:
        order = int(MOST_BITS / bits)
    h, last, growth = longest_step(series, columns, order, tolerance, weights)
    return order, h, last, growth
