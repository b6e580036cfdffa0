"""Arithmetic on four numbers in two parts each, rounded value and rounding error: twice the digits.

The rounding error of a product or a sum is itself a floating-point number (Dekker 1971,
doi:10.1007/BF01397083; Ogita, Rump and Oishi 2005, doi:10.1137/030601818).
"""

from __future__ import annotations

from typing import Any

from hybrid.kernels.instructions.registers import built_in, everywhere, vector_of
from hybrid.kernels.types.codes import NARROW


def write_divided_dot_product(builder: Any, factors: Any, highs: Any, lows: Any, by: Any) -> Any:
    """The instructions of ``divided_dot_product``: rounded value and rounding error of a sum that is divided.

    The sum is that of ``factors[i] (highs[i] + lows[i])``, the divisor ``by``. The factors and ``by`` are
    single numbers; all else is four numbers at once.
    """
    zero = vector_of(NARROW)([0.0] * NARROW)
    add, subtract, divide = builder.fadd, builder.fsub, builder.fdiv

    def lost(factor: Any, lanes: Any, product: Any) -> Any:
        negative = subtract(vector_of(NARROW)([-0.0] * NARROW), product)
        return built_in(builder, "fma", NARROW, factor, lanes, negative)

    by = everywhere(builder, by, NARROW)
    total, rest = zero, zero
    for factor, high, low in zip(factors, highs, lows, strict=True):
        factor = everywhere(builder, factor, NARROW)
        product = builder.fmul(factor, high)
        longer = add(total, product)
        part = subtract(longer, total)
        of_sum = add(subtract(total, subtract(longer, part)), subtract(product, part))
        of_product = add(lost(factor, high, product), builder.fmul(factor, low))
        total, rest = longer, add(rest, add(of_sum, of_product))
    quotient = divide(total, by)
    low = divide(subtract(rest, lost(by, quotient, total)), by)
    whole = add(quotient, low)
    return whole, subtract(low, subtract(whole, quotient))
