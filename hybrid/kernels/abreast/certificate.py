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

import numpy as np
from numba import njit

from hybrid.kernels.abreast.rows import (
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
from hybrid.kernels.types.abreast import DEGREE
from hybrid.kernels.types.options import INLINE, KERNEL

# Pieces that are looked at, and the shortest one, as a share of the step.
MOST_PIECES = 16
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


@njit(**INLINE)
def signs(powers, side, band, open_):
    """The runs whose Bernstein coefficients all lie beyond a band, and those where they change sign once."""
    nobody = without(open_, open_)
    clear, changes, wrong, unclear, beyond = open_, open_, nobody, nobody, nobody
    for i in range(DEGREE + 1):
        total = rows_at(powers, 0)
        for k in range(1, i + 1):
            total = fused(rows_at(powers, k), WEIGHTS[i, k], total)
        value = total * side
        is_clear, is_beyond = value > band, value < -band
        between = without(without(open_, is_clear), is_beyond)
        # After the first that is not clear, all others are beyond; one alone may be in between.
        left = either(unclear, beyond)
        wrong = either(wrong, both(left, without(open_, is_beyond)))
        unclear = either(unclear, between)
        beyond = either(beyond, is_beyond)
        clear = both(clear, is_clear)
        if i == 0:
            changes = is_clear
    return clear, without(both(changes, beyond), wrong)


@njit(**KERNEL)
def certify(powers, side, band, asked, moved):
    """The runs of the mask ``asked`` with no root, those with one, and the piece that has it.

    ``powers (DEGREE + 1,)`` are those of the polynomial on ``[0, 1]``, with the sign ``side`` at 0; ``moved
    (DEGREE + 1,)`` is scratch.
    """
    begin, length = in_every_run(0.0), in_every_run(1.0)
    nobody = without(asked, asked)
    none, one = nobody, nobody
    for piece in range(MOST_PIECES):
        if piece == 0:
            clear, changes = signs(powers, side, band, asked)
        else:
            put_on_piece(powers, begin, length, moved)
            clear, changes = signs(moved, side, band, asked)
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
