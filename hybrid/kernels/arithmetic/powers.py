"""Logarithms and powers to base two, inline: accurate enough for step lengths."""

from llvmlite import ir
from numba import njit, types

from hybrid.kernels.arithmetic.wide import (
    BIAS,
    BITS_OF_MANTISSA,
    bits_of_floats,
    from_bits,
    larger,
    smaller,
    whole_part,
)
from hybrid.kernels.types.numba_door.building import intrinsic
from hybrid.kernels.types.options import INLINE

MANTISSA = 2.0**BITS_OF_MANTISSA
# ``log2(1 + m) = m + BULGE m (1 - m)``, within 0.008; or ``m + HALF_BULGE``, within 0.044.
BULGE, HALF_BULGE = 0.346, 0.043


@intrinsic
def _from_bits(typing_context, bits):
    def generate(context, builder, signature, arguments):
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.int64), generate


@njit(**INLINE)
def binary_logarithms(numbers):
    """``log2`` of each number within 0.044; about -1023 for zero, 1024 or more for infinity and nan.

    The exponent of a float and its mantissa, read as one number, are the logarithm but for its bulge.
    """
    return bits_of_floats(numbers) * (1.0 / MANTISSA) - (BIAS - HALF_BULGE)


@njit(**INLINE)
def powers_of_two(x):
    """About ``2 ** x`` of each number; ``x`` is limited to -1000 to 1000."""
    x = smaller(larger(x, -1000.0), 1000.0) + float(BIAS)
    whole = whole_part(x)
    rest = x - whole
    return from_bits((whole + rest - BULGE * (rest * (1.0 - rest))) * MANTISSA)


@njit(**INLINE)
def power_of_two(x):
    """About ``2 ** x`` of one number; ``x`` is limited to -1000 to 1000."""
    x = min(max(x, -1000.0), 1000.0) + BIAS
    whole = int(x)
    rest = x - whole
    return _from_bits(int((whole + rest - BULGE * rest * (1.0 - rest)) * MANTISSA))
