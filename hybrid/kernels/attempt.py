"""Trying a step, by whichever kind of method it is."""

from numba import float64, int64, njit

from hybrid.kernels.layout import INLINE, METHOD, MODEL, PARTS, VECTOR, WORK
from hybrid.kernels.step import attempt_explicit


@njit(float64(PARTS, MODEL, METHOD, int64, float64, float64, VECTOR, int64, WORK), **INLINE)
def attempt(parts, model, method, mode, t, h, y, tangents, work):
    """Try a step of length ``h`` from ``y``; its result is ``work.new``. Returns the error ratio.

    ``work.stages[0]`` holds the rates at ``(t, y)``; the rates at the new point are left in
    ``work.stages[s]``. A ratio above 1, or nan, rejects the step.
    """
    if method.implicit != 0:
        return parts.attempt_implicit(model, method, mode, t, h, y, tangents, work)
    return attempt_explicit(model, method, mode, t, h, y, tangents, work)
