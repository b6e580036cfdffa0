"""Logarithms and powers to base two, to half a percent: enough for the length of a step, and no function call."""

from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from hybrid.kernels.layout import INLINE

# A float is ``2 ** (exponent - BIAS)`` times its mantissa, whose bits are the lower ones.
BIAS = 1023
MANTISSA = 2.0**52
# ``log2(1 + m) = m + BULGE m (1 - m)``, within 0.008.
BULGE = 0.346


@intrinsic
def _bits(typing_context, number):
    def generate(context, builder, signature, arguments):
        return builder.bitcast(arguments[0], ir.IntType(64))

    return types.int64(types.float64), generate


@intrinsic
def _from_bits(typing_context, bits):
    def generate(context, builder, signature, arguments):
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.int64), generate


@njit(**INLINE)
def binary_logarithm(x):
    """About ``log2(x)`` for ``x >= 0``; -1023 for zero, more than 1023 for what is not finite."""
    bits = _bits(x)
    exponent = bits >> 52
    mantissa = (bits - (exponent << 52)) / MANTISSA
    return exponent - BIAS + mantissa + BULGE * mantissa * (1.0 - mantissa)


@njit(**INLINE)
def power_of_two(x):
    """About ``2 ** x``; what would not fit is cut off."""
    x = min(max(x, -1000.0), 1000.0) + BIAS
    whole = int(x)
    rest = x - whole
    return _from_bits(int((whole + rest - BULGE * rest * (1.0 - rest)) * MANTISSA))
