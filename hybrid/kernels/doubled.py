"""Four numbers in two parts each, what is rounded and what it lacks: twice the digits of one number.

What a product and a sum lose in rounding are numbers again (Dekker 1971, doi:10.1007/BF01397083; Ogita, Rump
and Oishi 2005, doi:10.1137/030601818).
"""

from numba import types
from numba.extending import intrinsic, overload, register_jitable

from hybrid.kernels.codes import NARROW
from hybrid.kernels.lanes import HERE, LANES, built_in, everywhere, four_times, vector_of

# Times this, less the number itself, is a number with the upper half of its digits.
UPPER_HALF = 2.0**27 + 1.0


def lost(factor, lanes, product):
    """What ``factor * lanes`` is beyond ``product``, to which it was rounded."""
    (a, b), (c, d) = _halves(factor), _halves(lanes)
    return (a * c - product) + a * d + b * c + b * d


def _halves(number):
    upper = UPPER_HALF * number - (UPPER_HALF * number - number)
    return upper, number - upper


@overload(lost, jit_options=HERE)
def _overload_lost(factor, lanes, product):
    return lambda factor, lanes, product: _multiply_and_subtract(factor, lanes, product)


@intrinsic
def _multiply_and_subtract(typing_context, factor, lanes, product):
    def generate(context, builder, signature, arguments):
        factor, lanes, product = arguments
        negative = builder.fsub(vector_of(NARROW)([-0.0] * NARROW), product)
        return built_in(builder, "fma", NARROW, everywhere(builder, factor, NARROW), lanes, negative)

    return LANES(types.float64, LANES, LANES), generate


@register_jitable(**HERE)
def nothing():
    """Zero in two parts."""
    return four_times(0.0), four_times(0.0)


@register_jitable(**HERE)
def times(factor, high, low):
    """``factor (high + low)`` in two parts."""
    product = factor * high
    return product, lost(factor, high, product) + factor * low


@register_jitable(**HERE)
def plus(total, rest, high, low):
    """``(total + rest) + (high + low)`` in two parts."""
    longer = total + high
    part = longer - total
    return longer, rest + ((total - (longer - part)) + (high - part)) + low


@register_jitable(**HERE)
def divided(total, rest, by):
    """``(total + rest) / by`` in two parts, the first of them the whole, rounded."""
    quotient = total / by
    low = (rest - lost(by, quotient, total)) / by
    high = quotient + low
    return high, low - (high - quotient)
