"""Whether an expression has a pulse on a step that samples of the step do not show.

The expression is bounded over the step by interval arithmetic. The step is *explained* if between two samples
the expression stays in the range of these two, give or take a share of what the samples differ by. All
subexpressions that could hide a pulse are held to this: two switches may each be explained, and their
difference be a pulse.

Where the expression is monotone, its ends explain it: one evaluation on intervals is all a step costs.
"""

import math
from typing import NamedTuple

from numba import njit

from hybrid.kernels.types.codes import (
    HIGH,
    HIGH_MIDDLE,
    LEAST_SLOPE,
    LOW,
    LOW_MIDDLE,
    MOST_SLOPE,
)
from hybrid.kernels.types.kinds import REAL, TRUTH, VECTOR
from hybrid.kernels.types.options import INLINE, KERNEL

# Verdicts on a piece of a step.
EXPLAINED, UNDECIDED, HIDDEN = range(3)
# The expression may leave the range of two samples by this share of what all samples differ by: a maximum
# that error control sees lies a little above them.
BETWEEN = 0.25
# The roundings of an expression at two places of a step differ by no more than this factor.
ROUNDINGS = 4.0
# Share of the tolerance that may remain unseen on a piece: a few pieces of a step hold a jump.
SHARE_OF_TOLERANCE = 0.01
# Most pieces between two samples: a place is found to rounding in some 50, one pulse among others in more.
MOST_PIECES_OF_FORCING = 80


class Asked(NamedTuple):
    """What is asked of an expression on a step, and where a method looks at it.

    ``nodes`` are shares of the step. ``tolerance`` is that of the expression's integral, zero if unknown.
    Pieces are no shorter than ``finest``. The bounds of an expression ``of_state`` may be wide: it is
    unexplained only where the middle of a piece is certain to be.
    """

    nodes: VECTOR
    tolerance: REAL
    finest: REAL
    of_state: TRUTH


@njit(**INLINE)
def _is_monotone(row):
    """Whether a row that has bounds is monotone on its piece."""
    return (row[LEAST_SLOPE] >= 0.0 or row[MOST_SLOPE] <= 0.0) and row[HIGH] - row[LOW] < math.inf


@njit(**KERNEL)
def _is_steady(model, program, path, tolerance, work):
    """Whether all rows that are checked are monotone on a path, or the expression is negligible there."""
    programs, half = model.programs, 0.5 * path.length
    first, last = programs.first[program], model.bound(programs, program, path, half, half, work.registers)
    row = work.registers[last]
    if (row[HIGH] - row[LOW]) * path.length <= SHARE_OF_TOLERANCE * tolerance:
        return True
    for place in range(last + 1):
        if programs.checked[first + place] == 1 and not _is_monotone(work.registers[place]):
            return False
    return True


@njit(**KERNEL)
def _take_samples(model, program, path, asked, work):
    """Ranges of all rows at the nodes into ``work.samples``, low and high in turn.

    The last row takes the largest low end and the smallest high end of each.
    """
    samples, nodes = work.samples, asked.nodes
    common = samples[samples.shape[0] - 1]
    for j in range(len(nodes)):
        last = model.bound(model.programs, program, path, nodes[j] * path.length, 0.0, work.registers)
        for row in range(last + 1):
            low, high = work.registers[row, LOW_MIDDLE], work.registers[row, HIGH_MIDDLE]
            samples[j, 2 * row], samples[j, 2 * row + 1] = low, high
            common[2 * row] = low if j == 0 else max(common[2 * row], low)
            common[2 * row + 1] = high if j == 0 else min(common[2 * row + 1], high)


@njit(**INLINE)
def _explained_range(row, place, j, work):
    """What the samples ``j`` and ``j + 1`` explain of a row: a range, and by what rounding may leave it.

    For a sample within rounding of a jump, it is unknown which side the method has seen: the range is that
    surely between both.
    """
    i, common = 2 * place, work.samples[work.samples.shape[0] - 1]
    a, b = work.samples[j, i], work.samples[j, i + 1]
    c, d = work.samples[j + 1, i], work.samples[j + 1, i + 1]
    one, other = min(b, d), max(a, c)
    slack = BETWEEN * max(common[i] - common[i + 1], 0.0)
    rounding = min(row[HIGH_MIDDLE] - row[LOW_MIDDLE], max(b - a, d - c))
    noise = ROUNDINGS * rounding if rounding < math.inf else 0.0
    return min(one, other) - slack, max(one, other) + slack, noise


@njit(**KERNEL)
def _judged(programs, program, j, whole, length, tolerance, work):
    """Whether a piece between the samples ``j`` and ``j + 1``, which has just been bounded, is explained.

    HIDDEN if its middle is certain to lie beyond what they explain. Returned second is by how much the
    expression may leave what they explain, rounding aside.
    """
    first, last = programs.first[program], programs.first[program + 1] - 1 - programs.first[program]
    verdict, unseen = EXPLAINED, 0.0
    # The last row is the expression itself: if that is explained, or negligible, so are its parts.
    for place in range(last, -1, -1):
        if programs.checked[first + place] == 0:
            continue
        row = work.registers[place]
        low, high, noise = _explained_range(row, place, j, work)
        if place == last:
            unseen = max(low - row[LOW], row[HIGH] - high, 0.0)
            if unseen * length <= SHARE_OF_TOLERANCE * tolerance:
                return EXPLAINED, 0.0
        elif not row[HIGH] - row[LOW] < math.inf:
            # This part may be unused, such as the other branch of a choice.
            continue
        if whole and _is_monotone(row):
            continue
        if row[LOW] < low - noise or row[HIGH] > high + noise:
            if row[HIGH_MIDDLE] < low - noise or row[LOW_MIDDLE] > high + noise:
                return HIDDEN, unseen
            verdict = UNDECIDED
    return verdict, unseen


@njit(**KERNEL)
def _hidden_between(model, program, path, j, asked, work):
    """``first_hidden`` between the samples ``j`` and ``j + 1``."""
    stack, top, pieces, coarse, tolerance = work.intervals, 0, 0, 0.0, asked.tolerance
    stack[0, 0], stack[0, 1] = asked.nodes[j] * path.length, asked.nodes[j + 1] * path.length
    while top >= 0:
        low, high = stack[top, 0], stack[top, 1]
        middle = 0.5 * (low + high)
        radius = max(high - middle, middle - low)
        last = model.bound(model.programs, program, path, middle, radius, work.registers)
        verdict, unseen = _judged(model.programs, program, j, pieces == 0, high - low, tolerance, work)
        pieces += 1
        if verdict == UNDECIDED and high - low > asked.finest:
            if pieces < MOST_PIECES_OF_FORCING and top < stack.shape[0] - 1:
                stack[top, 0], stack[top + 1, 0], stack[top + 1, 1] = middle, low, middle
                top += 1
                continue
            verdict = EXPLAINED if asked.of_state else HIDDEN
        if verdict == HIDDEN:
            return low, middle, coarse
        if tolerance > 0.0:
            coarse = max(coarse, unseen * (high - low))
        elif verdict == EXPLAINED:
            row = work.registers[last]
            if unseen > BETWEEN * max(abs(row[LOW]), abs(row[HIGH])):
                coarse = math.inf
        top -= 1
    return path.length, path.length, coarse


@njit(**KERNEL)
def first_hidden(model, program, path, asked, work):
    """The length on which an expression is explained, of a path, and the first unexplained place after it.

    Both are the path's length if all of it is explained. Returned third is the most that a piece adds to the
    expression's integral, as far as bounds can tell, which rounding explains or which is as short as the
    rounding of time. It is infinite if the integral has no tolerance and much of the expression is rounding.
    """
    h, coarse = path.length, 0.0
    if _is_steady(model, program, path, asked.tolerance, work):
        return h, h, 0.0
    _take_samples(model, program, path, asked, work)
    for j in range(len(asked.nodes) - 1):
        before, place, rest = _hidden_between(model, program, path, j, asked, work)
        coarse = max(coarse, rest)
        if place < h:
            return before, place, coarse
    return h, h, coarse
