"""A proof that a polynomial keeps its sign on a step, or changes it exactly once.

On a piece ``[A, A + B]`` of the step a polynomial in Bernstein form lies between its least and its largest
coefficient. It has no root there if all coefficients are beyond a band on one side. If they begin beyond the
band on one side, end beyond it on the other, and at most one of them between is within the band, then they
change sign once, and so does the polynomial (Descartes), whatever an error of the size of the band makes of
it. A piece that says neither is halved; nothing is said of what is left after a few pieces.

Rounding is covered by a band of 64 roundings of the sum of all terms: each Bernstein coefficient of a piece
is a sum of the terms with weights that are positive and together no more than one, and of fewer than 50
operations.
"""

import math
from functools import reduce

import numpy as np
from llvmlite import ir
from numba import njit, types

from hybrid.kernels.abreast.rows import (
    MASK,
    ROWS,
    address_in,
    bits_of,
    both,
    either,
    in_every_run,
    put_rows,
    rows_at,
    where,
    without,
)
from hybrid.kernels.arithmetic.wide import fused, smaller
from hybrid.kernels.instructions.registers import DOUBLE, everywhere, multiply_add, read
from hybrid.kernels.types.abreast import DEGREE
from hybrid.kernels.types.codes import ABREAST
from hybrid.kernels.types.numba_door.building import intrinsic
from hybrid.kernels.types.options import INLINE, KERNEL

# Pieces that are looked at, and the shortest one, as a share of the step.
MOST_PARTS = 16
SHORTEST_PIECE = 0.01
# What a power adds to each Bernstein coefficient: ``C(i, k) / C(DEGREE, k)`` in row ``i``.
WEIGHTS = np.array(
    [[math.comb(i, k) / math.comb(DEGREE, k) for k in range(DEGREE + 1)] for i in range(DEGREE + 1)]
)


@njit(**INLINE)
def put_on_piece(powers, begin, length, moved):
    """The powers of a polynomial on ``[0, 1]`` as those of its part on ``[begin, begin + length]``."""
    for i in range(DEGREE + 1):
        put_rows(moved, i, rows_at(powers, i))
    for i in range(DEGREE):
        held = rows_at(moved, DEGREE)
        for j in range(DEGREE - 1, i - 1, -1):
            held = fused(begin, held, rows_at(moved, j))
            put_rows(moved, j, held)
    power = length
    for i in range(1, DEGREE + 1):
        put_rows(moved, i, rows_at(moved, i) * power)
        power = power * length


@intrinsic
def signs(typing_context, powers, side, band):
    """The runs whose Bernstein coefficients all lie beyond a band, and those where they change sign once.

    They do if the first is beyond the band on the ``side``, the last on the other, and each of them on the
    other side, or behind one that is still on the first.
    """

    def generate(context, builder, signature, arguments):
        array, side, band = arguments
        # All coefficients grow at the same time: a sum alone would wait for itself.
        totals = [_power(context, builder, signature.args[0], array, 0)] * (DEGREE + 1)
        for k in range(1, DEGREE + 1):
            power = _power(context, builder, signature.args[0], array, k)
            for i in range(k, DEGREE + 1):
                weight = everywhere(builder, DOUBLE(WEIGHTS[i, k]), ABREAST)
                totals[i] = multiply_add(builder, power, weight, totals[i])
        values = [builder.fmul(total, side) for total in totals]
        before = [builder.fcmp_ordered(">", value, band) for value in values]
        behind = [builder.fcmp_ordered("<", value, builder.fneg(band)) for value in values]
        changes = builder.and_(before[0], behind[-1])
        for i in range(1, DEGREE + 1):
            changes = builder.and_(changes, builder.or_(behind[i], before[i - 1]))
        return context.make_tuple(builder, signature.return_type, [reduce(builder.and_, before), changes])

    return types.UniTuple(MASK, 2)(powers, ROWS, ROWS), generate


def _power(context, builder, kind, array, k):
    place = address_in(context, builder, kind, array, [ir.IntType(64)(k)])
    return read(builder, place, ABREAST)


@njit(**KERNEL)
def certify(powers, side, band, asked, moved):
    """The runs of the mask ``asked`` with no root, those with one, and the piece that has it.

    ``powers (DEGREE + 1,)`` are those of the polynomial on ``[0, 1]``, with the sign ``side`` at 0; ``moved
    (DEGREE + 1,)`` is scratch.
    """
    begin, length = in_every_run(0.0), in_every_run(1.0)
    nobody = without(asked, asked)
    none, one = nobody, nobody
    for piece in range(MOST_PARTS):
        if piece == 0:
            clear, changes = signs(powers, side, band)
        else:
            put_on_piece(powers, begin, length, moved)
            clear, changes = signs(moved, side, band)
        clear, changes = both(clear, asked), both(changes, asked)
        end = begin + length
        through = both(clear, end >= 1.0)
        none, one = either(none, through), either(one, changes)
        asked = without(without(asked, through), changes)
        if bits_of(asked) == 0:
            break
        onward = both(asked, clear)
        halved = without(asked, clear)
        begin = where(onward, end, begin)
        length = where(onward, smaller(2.0 * length, 1.0 - end), where(halved, 0.5 * length, length))
        asked = without(asked, both(halved, length < SHORTEST_PIECE))
    return none, one, begin, length
