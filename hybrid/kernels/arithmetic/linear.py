"""Small dense linear systems, solved in place: LU factors with row exchanges."""

from numba import njit

from hybrid.kernels.types.options import KERNEL


@njit(**KERNEL)
def factorise(matrix, pivots, n):
    """Replace the leading ``(n, n)`` of ``matrix`` by its LU factors; false if it is singular or not finite.

    ``pivots (n,)`` receives the row from which the pivot of each column came.
    """
    for column in range(n):
        pivot = column
        for i in range(column + 1, n):
            if abs(matrix[i, column]) > abs(matrix[pivot, column]):
                pivot = i
        pivots[column] = pivot
        if not abs(matrix[pivot, column]) > 0.0:
            return False
        if pivot != column:
            for j in range(n):
                matrix[column, j], matrix[pivot, j] = matrix[pivot, j], matrix[column, j]
        inverse = 1.0 / matrix[column, column]
        for i in range(column + 1, n):
            factor = matrix[i, column] * inverse
            matrix[i, column] = factor
            if factor != 0.0:
                for j in range(column + 1, n):
                    matrix[i, j] -= factor * matrix[column, j]
    return True


@njit(**KERNEL)
def substitute(matrix, pivots, n, vector):
    """Replace ``vector (n,)`` by the solution of the system that ``factorise`` has factored."""
    for i in range(n):
        vector[i], vector[pivots[i]] = vector[pivots[i]], vector[i]
    for i in range(n):
        total = vector[i]
        for j in range(i):
            total -= matrix[i, j] * vector[j]
        vector[i] = total
    for i in range(n - 1, -1, -1):
        total = vector[i]
        for j in range(i + 1, n):
            total -= matrix[i, j] * vector[j]
        vector[i] = total / matrix[i, i]
