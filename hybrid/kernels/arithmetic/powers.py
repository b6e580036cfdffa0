"""Logarithms and powers to base two, to half a percent, inline: accurate enough for step lengths."""

from llvmlite import ir
from numba import njit, types

from hybrid.kernels.arithmetic.lanes import LANES
from hybrid.kernels.instructions.registers import vector_of
from hybrid.kernels.types.codes import NARROW
from hybrid.kernels.types.numba_door.building import intrinsic
from hybrid.kernels.types.options import INLINE

# A float is ``2 ** (exponent - BIAS)`` times its mantissa; the mantissa is in the lower bits.
BIAS = 1023
BITS_OF_MANTISSA = 52
MANTISSA = 2.0**BITS_OF_MANTISSA
# ``log2(1 + m) = m + BULGE m (1 - m)``, within 0.008.
BULGE = 0.346


@intrinsic
def _exponent_and_mantissa(typing_context, lanes):
    """The exponents of four positive numbers, and their mantissas minus 1."""

    def generate(context, builder, signature, arguments):
        whole = ir.VectorType(ir.IntType(64), NARROW)

        def everywhere(number):
            return whole([number] * NARROW)

        def as_numbers(bits):
            return builder.bitcast(bits, vector_of(NARROW))

        bits = builder.bitcast(arguments[0], whole)
        exponent = builder.lshr(bits, everywhere(BITS_OF_MANTISSA))
        # A small integer in the last bits of the float 2**52 adds its value to the float.
        large = int(BIAS + BITS_OF_MANTISSA) << BITS_OF_MANTISSA
        exponent = builder.fsub(
            as_numbers(builder.or_(exponent, everywhere(large))),
            vector_of(NARROW)([MANTISSA + BIAS] * NARROW),
        )
        mantissa = builder.and_(bits, everywhere((1 << BITS_OF_MANTISSA) - 1))
        mantissa = builder.or_(mantissa, everywhere(BIAS << BITS_OF_MANTISSA))
        mantissa = builder.fsub(as_numbers(mantissa), vector_of(NARROW)([1.0] * NARROW))
        return context.make_tuple(builder, signature.return_type, (exponent, mantissa))

    return types.UniTuple(LANES, 2)(LANES), generate


@intrinsic
def _from_bits(typing_context, bits):
    def generate(context, builder, signature, arguments):
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.int64), generate


@njit(**INLINE)
def binary_logarithms(lanes):
    """About ``log2`` of four numbers; -1023 for zero, 1024 or more for infinity and nan."""
    exponent, mantissa = _exponent_and_mantissa(lanes)
    return exponent + mantissa + BULGE * mantissa * (1.0 - mantissa)


@njit(**INLINE)
def power_of_two(x):
    """About ``2 ** x``; ``x`` is limited to -1000 to 1000."""
    x = min(max(x, -1000.0), 1000.0) + BIAS
    whole = int(x)
    rest = x - whole
    return _from_bits(int((whole + rest - BULGE * rest * (1.0 - rest)) * MANTISSA))
