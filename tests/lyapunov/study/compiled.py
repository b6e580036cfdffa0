"""Functions that numba compiles, as kernels call them: an array comes as its address and its length."""

from numba import carray, cfunc, njit, types

VECTOR = (types.CPointer(types.float64), types.int64)


def compiled(function):
    """A field ``f(t, y, p, out)`` for the kernels of the study."""
    inner = njit(function)

    @cfunc(types.void(types.float64, *VECTOR, *VECTOR, *VECTOR))
    def field(t, y, n, p, m, out, k):
        inner(t, carray(y, n), carray(p, m), carray(out, k))

    return field
