"""The Jacobian of a field, of which a large system needs few entries.

``model.field_jacobian`` writes the entries that may differ from zero, and the derivative in time. All others
are left alone: sums over a row go over the columns of those entries.
"""

from numba import njit

from hybrid.kernels.types.options import INLINE, KERNEL


@njit(**KERNEL)
def whole_jacobian(model, mode, t, x, out):
    """``(D_x f, D_t f)`` into ``out (n, n + 1)``, zeros included."""
    n = model.dimension
    for i in range(n):
        for j in range(n):
            out[i, j] = 0.0
    model.field_jacobian(mode, t, x, model.parameters, out)


@njit(**KERNEL)
def jacobian_with_opposites(model, mode, t, x, out):
    """The Jacobian into ``out (n, n + 1)``, zeros included where the entry across the diagonal is none."""
    for i in range(model.dimension):
        for place in range(model.first_slope[mode, i], model.first_slope[mode, i + 1]):
            out[model.slope_column[place], i] = 0.0
    model.field_jacobian(mode, t, x, model.parameters, out)


@njit(**INLINE)
def change_of_rate(model, mode, i, jacobian, direction):
    """Derivative of the rate of component ``i`` in a direction ``(n,)`` of the state."""
    total = 0.0
    for place in range(model.first_slope[mode, i], model.first_slope[mode, i + 1]):
        j = model.slope_column[place]
        total += jacobian[i, j] * direction[j]
    return total


@njit(**INLINE)
def spread_of_rate(model, mode, i, jacobian, sizes):
    """How far the rate of component ``i`` moves if each component of the state moves by ``sizes (n,)``."""
    total = 0.0
    for place in range(model.first_slope[mode, i], model.first_slope[mode, i + 1]):
        j = model.slope_column[place]
        total += abs(jacobian[i, j]) * sizes[j]
    return total
