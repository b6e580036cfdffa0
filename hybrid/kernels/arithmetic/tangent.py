"""Orthonormalisation of tangent vectors, and determinants: the linear algebra of jumps and exponents."""

import math

from numba import njit

from hybrid.kernels.types.codes import (
    DESINGULARISED,
    EXACT,
    READY,
    RUNGE_KUTTA,
    STALE,
    STEPS_ALONE,
    STEPS_IN_CONTACT,
    STEPS_IN_EXACT,
)
from hybrid.kernels.types.kinds import INTEGER, MATRIX
from hybrid.kernels.types.layout import Model, Run
from hybrid.kernels.types.options import INLINE, KERNEL, exported

# A vector that is shorter than this share of the terms that make it up along itself is only rounding.
COLLAPSED = 1e-13
# A pivot is zero if it is smaller than this share of the terms that make it up, and may be below the second.
SINGULAR, NEARLY_SINGULAR = 1e-14, 1e-12
# Tangent vectors are orthonormalised once the strain of all jumps since the last orthonormalisation reaches
# this limit. A condition number of a thousand costs three digits of the vectors that grow less.
STRAINED = math.log(1e3)
# Tangent vectors are orthonormalised between steps as soon as the product of their sines (see
# ``independence``) is below the limit of the propagator. These limits are squared. The solver's error is
# relative to a whole vector, but only the part orthogonal to the previous vectors counts: a product of
# ``10**-d`` costs ``d`` digits of that part. An exact step has rounding errors only. A Runge-Kutta method has
# to evaluate the rates once more after orthonormalisation.
CLOSE_IN_EXACT, CLOSE_IN_TAYLOR, CLOSE_IN_RUNGE_KUTTA = 1e-3**2, 1e-1**2, 1e-2**2
# Tangent vectors are also orthonormalised when the square of a length leaves this range.
SHORTEST_SQUARE, LONGEST_SQUARE = 1e-200, 1e200


@njit(**KERNEL)
def orthonormalise(y, n, k, growth, sizes, images, annihilated):
    """Orthonormalise the ``k`` tangent vectors in ``y (n (1 + k),)``.

    The logarithms of the lengths taken out are added to ``growth (k,)``. Modified Gram-Schmidt runs twice,
    which is enough (Giraud, Langou, Rozloznik 2005).

    Whether what is left of a vector is more than rounding is judged along its own direction, by the sizes of
    the terms that were added to make it up: so the units of the states do not matter. With ``images`` the
    vectors are images by a matrix, and ``sizes (k, n)`` has those of the terms of each component; without,
    it is scratch. Images that are only rounding have collapsed if the matrix is singular, and as many of them
    as directions that it has ``annihilated``: their growth is minus infinity and they stay zero vectors.
    Returns the number of other vectors of which only rounding is left, or nothing.
    """
    indistinct, collapsed = 0, 0
    for c in range(k):
        start, size = n * (1 + c), sizes[c]
        for i in range(n):
            size[i] = (size[i] if images else 0.0) + abs(y[start + i])
        for _ in range(2):
            for other in range(n, start, n):
                dot = 0.0
                for i in range(n):
                    dot += y[other + i] * y[start + i]
                for i in range(n):
                    term = dot * y[other + i]
                    y[start + i] -= term
                    size[i] += abs(term)
        largest, square, made_of = 0.0, 0.0, 0.0
        for i in range(n):
            largest = max(largest, abs(y[start + i]))
        for i in range(n if largest > 0.0 else 0):
            # Squares of the components themselves may leave the range of floats.
            share = y[start + i] / largest
            square += share * share
            made_of += abs(share) * (size[i] / largest)
        length = largest * math.sqrt(square)
        distinct = square > COLLAPSED * made_of
        if length > 0.0 and (distinct or not images or collapsed == annihilated):
            growth[c] += math.log(length)
            indistinct += 0 if distinct else 1
            for i in range(start, start + n):
                y[i] /= length
        else:
            was_zero = True
            for i in range(n):
                was_zero = was_zero and size[i] == 0.0
            if images and not was_zero and collapsed < annihilated:
                collapsed += 1
            elif not was_zero:
                indistinct += 1
            growth[c] = -math.inf
            for i in range(start, start + n):
                y[i] = 0.0
    return indistinct


@njit(**KERNEL)
def independence(y, n, k, gram):
    """Squared product of the sines between each of ``k`` tangent vectors and the span of the previous ones.

    The result is 1 if the vectors are orthogonal, 0 if they are linearly dependent, and -1 if the length of
    one of them is near the limits of floating-point numbers. Zero vectors are skipped. ``gram``, at least
    ``(k, k)``, is scratch for the Cholesky factorisation of the Gram matrix without square roots: the
    quotients are below the diagonal, the numerators above.
    """
    product = 1.0
    for c in range(k):
        start = n * (1 + c)
        square = 0.0
        for i in range(start, start + n):
            square += y[i] * y[i]
        if square != 0.0 and not SHORTEST_SQUARE < square < LONGEST_SQUARE:
            return -1.0
        rest = square
        for d in range(c):
            other = n * (1 + d) - start
            numerator = 0.0
            for i in range(start, start + n):
                numerator += y[i] * y[other + i]
            for e in range(d):
                numerator -= gram[c, e] * gram[e, d]
            quotient = numerator / gram[d, d] if gram[d, d] > 0.0 else 0.0
            gram[c, d], gram[d, c] = quotient, numerator
            rest -= quotient * numerator
        gram[c, c] = rest
        if square > 0.0:
            product *= max(rest, 0.0) / square
    return product


@exported(None, Model, Run, INTEGER, INTEGER, MATRIX)
def keep_apart(model, run, mode, tangents, gram):
    """After a step, orthonormalise the tangent vectors if they are too close for the mode's propagator."""
    kind, closest, steps = model.propagator[mode], CLOSE_IN_TAYLOR, 1
    if kind == EXACT:
        closest, steps = CLOSE_IN_EXACT, STEPS_IN_EXACT
    elif kind == RUNGE_KUTTA:
        closest = CLOSE_IN_RUNGE_KUTTA
    elif kind == DESINGULARISED:
        steps = STEPS_IN_CONTACT
    if tangents == 1:
        steps = STEPS_ALONE
    run.unchecked += 1
    if run.unchecked < steps:
        return
    run.unchecked = 0
    n = model.dimension
    if independence(run.y, n, tangents, gram) > closest:
        return
    run.indistinct += orthonormalise(run.y, n, tangents, run.growth, gram, False, 0)
    run.strain = 0.0
    if kind == RUNGE_KUTTA and run.stage == READY:
        run.stage = STALE


@njit(**KERNEL)
def multiply(matrix, y, n, tangents, image, ends):
    """Multiply the tangent vectors in ``y (n (1 + k),)`` by a matrix.

    ``image (n,)`` is scratch, and so is ``ends (2, n)``: each row has entries between two columns only, since
    a jump changes a few components of a large system.
    """
    for i in range(n):
        first, last = 0, n
        while first < n and matrix[i, first] == 0.0:
            first += 1
        while last > first and matrix[i, last - 1] == 0.0:
            last -= 1
        ends[0, i], ends[1, i] = first, last
    for start in range(n, n * (1 + tangents), n):
        for i in range(n):
            total = 0.0
            for j in range(int(ends[0, i]), int(ends[1, i])):
                total += matrix[i, j] * y[start + j]
            image[i] = total
        for i in range(n):
            y[start + i] = image[i]


@njit(**KERNEL)
def strain(matrix, n, log_determinant):
    """How much a matrix distorts angles: 0 if it keeps all angles, infinite if it is singular.

    The strain is ``n log(|Xi|_F / sqrt(n)) - log|det Xi|``. The condition number is at most 2 times its
    exponential (Guggenheimer, Edelman and Johnson 1995, College Mathematics Journal 26, 2-5).
    """
    square = 0.0
    for i in range(n):
        for j in range(n):
            square += matrix[i, j] * matrix[i, j]
    return strain_of_square(square, n, log_determinant)


@njit(**INLINE)
def strain_of_square(square, n, log_determinant):
    """``strain`` of a matrix whose entries have this sum of squares."""
    return 0.5 * n * math.log(square / n) - log_determinant if square > 0.0 else math.inf


@njit(**KERNEL)
def solve(system, n, out):
    """Solve the linear equations in the rows of ``system (n, n + 1)``.

    The last column is the right-hand side. ``system`` is overwritten. If it is singular to rounding, some
    unknowns are set to zero and contradictory equations are ignored.
    """
    for column in range(n):
        out[column] = 0.0
        for i in range(n):
            out[column] = max(out[column], abs(system[i, column]))
    rank = 0
    for column in range(n):
        pivot = rank
        for i in range(rank + 1, n):
            if abs(system[i, column]) > abs(system[pivot, column]):
                pivot = i
        if rank == n or not abs(system[pivot, column]) > COLLAPSED * out[column]:
            out[column] = -1.0
            continue
        for j in range(n + 1):
            system[rank, j], system[pivot, j] = system[pivot, j], system[rank, j]
        for i in range(n):
            factor = system[i, column] / system[rank, column]
            for j in range(column, n + 1 if i != rank and factor != 0.0 else 0):
                system[i, j] -= factor * system[rank, j]
        rank += 1
    rank = 0
    for column in range(n):
        if out[column] < 0.0:
            out[column] = 0.0
        else:
            out[column] = system[rank, n] / system[rank, column]
            rank += 1


@njit(**KERNEL)
def log_abs_determinant(matrix, magnitude, n):
    """``log |det|`` of a matrix ``(n, n)``, and how many directions it annihilates, as far as can be told.

    The logarithm is minus infinity if the matrix is singular to rounding. ``magnitude``, of at least that
    shape, holds the size of the terms that made up each entry. A pivot within the rounding of these terms
    counts as zero; a pivot that is merely small, as near a grazing, does not. Both are overwritten.
    """
    total, row, annihilated = 0.0, 0, 0
    for column in range(n):
        pivot = row
        for i in range(row + 1, n):
            if abs(matrix[i, column]) > abs(matrix[pivot, column]):
                pivot = i
        size = abs(matrix[pivot, column])
        if not size > NEARLY_SINGULAR * magnitude[pivot, column]:
            annihilated += 1
        if not size > SINGULAR * magnitude[pivot, column]:
            total = -math.inf
            continue
        for j in range(n):
            matrix[row, j], matrix[pivot, j] = matrix[pivot, j], matrix[row, j]
            magnitude[row, j], magnitude[pivot, j] = magnitude[pivot, j], magnitude[row, j]
        total += math.log(size)
        for i in range(row + 1, n):
            factor = matrix[i, column] / matrix[row, column]
            # The matrix of a jump that changes a few components of a large system is nearly the identity.
            for j in range(column, n if factor != 0.0 else 0):
                term = factor * matrix[row, j]
                matrix[i, j] -= term
                magnitude[i, j] = max(magnitude[i, j], abs(factor) * magnitude[row, j])
        row += 1
    return total, annihilated
