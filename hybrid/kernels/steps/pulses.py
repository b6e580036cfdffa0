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
from hybrid.kernels.types.kinds import INTEGER, REAL, TRUTH, VECTOR
from hybrid.kernels.types.layout import Path
from hybrid.kernels.types.options import INLINE, KERNEL

# Verdicts on a piece of a step.
EXPLAINED, NOISY, UNKNOWN, HIDDEN = range(4)
# A range is rounding if it is at most this many times as wide as the range at one point.
FLAT = 4.0
# An arbitrary place of the step.
ELSEWHERE = 0.3819
# The expression may leave the range of neighbouring samples by this share of the largest difference of
# samples: a resolved maximum lies a little above them, and error control sees the differences of the samples.
BETWEEN = 0.25
# The same for an expression in the state, whose bounds are wider.
BETWEEN_IN_STATE = 1.0
# Shares of the tolerance that may remain unseen, on the whole step and on one piece.
SHARE = 0.1
SHARE_OF_PIECE = 0.01
# Largest number of pieces of a step, and of the part between two samples for an expression in the state.
MOST_PIECES = 400
MOST_PIECES_IN_STATE = 64


class Samples(NamedTuple):
    """The places of a step, as shares of it, at which a method looks at a function.

    The method may have ``seen`` other states there than those of the path: these are ``work.places``.
    """

    nodes: VECTOR
    seen: TRUTH


class Demand(NamedTuple):
    """What may remain unseen of an expression on a step.

    ``tolerance`` is that of its integral, values up to ``negligible`` do not matter. It may leave the range
    of two samples by the share ``between``. Pieces are no shorter than ``finest``, and no more than ``most``.
    An expression ``of_state`` has as many between any two samples.
    """

    tolerance: REAL
    negligible: REAL
    between: REAL
    finest: REAL
    most: INTEGER
    of_state: TRUTH


@njit(**INLINE)
def demand_on(length, tolerance, finest, of_state):
    """What is asked of an expression on a step.

    An expression ``of_state`` varies with every step, and its bounds may be wide.
    """
    between = BETWEEN_IN_STATE if of_state else BETWEEN
    most = MOST_PIECES_IN_STATE if of_state else MOST_PIECES
    return Demand(tolerance, SHARE * tolerance / length, between, finest, most, of_state)


@njit(**INLINE)
def _last_row(programs, program):
    """The row of the expression itself, behind those of its parts."""
    return programs.first[program + 1] - 1 - programs.first[program]


@njit(**INLINE)
def _is_monotone(row):
    return row[LEAST_SLOPE] >= 0.0 or row[MOST_SLOPE] <= 0.0


@njit(**KERNEL)
def is_steady(model, program, path, negligible, work):
    """Whether no row that is checked turns round on a path, or the forcing is negligible.

    Rounding does not count as a turn. Returned second is the range of the forcing if it turns by rounding.
    """
    programs, registers = model.programs, work.registers
    first, half = programs.first[program], 0.5 * path.length
    last = model.bound(programs, program, path, half, half, registers)
    row = registers[last]
    if row[HIGH] - row[LOW] <= negligible:
        return True, 0.0
    if not row[HIGH] - row[LOW] < math.inf:
        return False, 0.0
    doubtful, widths = False, work.samples[0]
    for place in range(last + 1):
        row, widths[place] = registers[place], 0.0
        if programs.checked[first + place] == 1 and not _is_monotone(row):
            doubtful, widths[place] = True, row[HIGH] - row[LOW]
            if not widths[place] <= FLAT * (row[HIGH_MIDDLE] - row[LOW_MIDDLE]):
                return False, 0.0
    if doubtful:
        # The middle may lie within rounding of a jump, another place will not.
        model.bound(programs, program, path, ELSEWHERE * path.length, 0.0, registers)
        for place in range(last + 1):
            row = registers[place]
            if not widths[place] <= FLAT * (row[HIGH_MIDDLE] - row[LOW_MIDDLE]):
                return False, 0.0
    return True, widths[last]


@njit(**INLINE)
def _bound_at_stage(model, program, t, row, work):
    """Bounds of all rows at the time and the state of one stage, a row of ``work.places``; the last row."""
    place = Path(work.places[row : row + 1], 0, -1, t, 1.0, 0.0, False)
    return model.bound(model.programs, program, place, 0.0, 0.0, work.registers)


@njit(**KERNEL)
def _take_samples(model, program, path, at, work):
    """Ranges of all rows at the nodes into ``work.samples``, low and high in turn.

    The last row takes the largest low end and the smallest high end of each.
    """
    samples, nodes = work.samples, at.nodes
    common = samples[samples.shape[0] - 1]
    for j in range(len(nodes)):
        place = nodes[j] * path.length
        if at.seen:
            last = _bound_at_stage(model, program, path.start + place, j, work)
        else:
            last = model.bound(model.programs, program, path, place, 0.0, work.registers)
        for row in range(last + 1):
            low, high = work.registers[row, LOW_MIDDLE], work.registers[row, HIGH_MIDDLE]
            samples[j, 2 * row], samples[j, 2 * row + 1] = low, high
            common[2 * row] = low if j == 0 else max(common[2 * row], low)
            common[2 * row + 1] = high if j == 0 else min(common[2 * row + 1], high)


@njit(**INLINE)
def _sampled_range(a, b, c, d):
    """The range surely between the samples ``[a, b]`` and ``[c, d]``; all between if both are uncertain."""
    one, other = min(b, d), max(a, c)
    return min(one, other), max(one, other)


@njit(**INLINE)
def _beyond(row, j, place, work):
    """How far a row may leave the range of the samples ``j`` and ``j + 1``."""
    one, other = work.samples[j], work.samples[j + 1]
    i = 2 * place
    low, high = _sampled_range(one[i], one[i + 1], other[i], other[i + 1])
    return max(low - row[LOW], row[HIGH] - high)


@njit(**KERNEL)
def _judged(programs, program, j, whole, length, demand, work):
    """Whether a piece between the samples ``j`` and ``j + 1``, which has just been bounded, is explained.

    HIDDEN if its middle is certain to lie beyond what they explain, NOISY if rounding alone explains it.
    """
    first, last = programs.first[program], _last_row(programs, program)
    samples, common = work.samples, work.samples[work.samples.shape[0] - 1]
    verdict = EXPLAINED
    # The last row is the forcing itself: if that is negligible, so are its parts.
    for place in range(last, -1, -1):
        if programs.checked[first + place] == 0:
            continue
        row, i = work.registers[place], 2 * place
        # For a sample within rounding of a jump, it is unknown which side the method has seen.
        low, high = _sampled_range(samples[j, i], samples[j, i + 1], samples[j + 1, i], samples[j + 1, i + 1])
        if place == last:
            beyond = _beyond(row, j, last, work)
            if beyond <= demand.negligible or beyond * length <= SHARE_OF_PIECE * demand.tolerance:
                return EXPLAINED
        elif not row[HIGH] - row[LOW] < math.inf:
            # This part may be unused, such as the other branch of a choice.
            continue
        if whole and _is_monotone(row) and row[HIGH] - row[LOW] < math.inf:
            continue
        slack = demand.between * max(common[i] - common[i + 1], 0.0)
        one, other = samples[j, i + 1] - samples[j, i], samples[j + 1, i + 1] - samples[j + 1, i]
        rounding = min(row[HIGH_MIDDLE] - row[LOW_MIDDLE], max(one, other))
        noise = FLAT * rounding if rounding < math.inf else 0.0
        if row[LOW] < low - slack - noise or row[HIGH] > high + slack + noise:
            if row[HIGH_MIDDLE] < low - slack - noise or row[LOW_MIDDLE] > high + slack + noise:
                return HIDDEN
            verdict = UNKNOWN
        elif row[LOW] < low - slack or row[HIGH] > high + slack:
            verdict = max(verdict, NOISY)
    return verdict


@njit(**INLINE)
def _unseen(row, noise, length, tolerance):
    """What the rounding of a forcing, whose bounds are ``row``, may add to its integral over a piece.

    If the forcing has no tolerance, its factor in the field is unknown. Then the result is infinite if much
    of the forcing is rounding, and otherwise zero.
    """
    if tolerance > 0.0:
        return noise * length
    return math.inf if noise > BETWEEN * max(abs(row[LOW]), abs(row[HIGH])) else 0.0


@njit(**KERNEL)
def _hidden_from_stages(model, program, path, nodes, demand, work):
    """A pulse at a stage that only the interpolant has: the node before it and its place, or the step twice.

    Such a pulse bends the interpolant, which then does not show it.
    """
    h = path.length
    for k in range(len(nodes), work.places.shape[0]):
        place = work.places[k, model.dimension] * h
        _bound_at_stage(model, program, path.start + place, k, work)
        j = 0
        while nodes[j + 1] * h < place:
            j += 1
        if _judged(model.programs, program, j, False, h, demand, work) == HIDDEN:
            return nodes[j] * h, place
    return h, h


@njit(**KERNEL)
def _hidden_between(model, program, path, j, pieces, demand, work):
    """``first_hidden`` between the samples ``j`` and ``j + 1``, the ends of the interval in ``work``.

    Returned last is the number of pieces so far, which was ``pieces`` before.
    """
    stack, top, whole, coarse = work.intervals, 0, True, 0.0
    last, tolerance = _last_row(model.programs, program), demand.tolerance
    while top >= 0:
        low, high = stack[top, 0], stack[top, 1]
        middle = 0.5 * (low + high)
        model.bound(model.programs, program, path, middle, max(high - middle, middle - low), work.registers)
        pieces += 1
        verdict = _judged(model.programs, program, j, whole, high - low, demand, work)
        row, whole = work.registers[last], False
        if verdict == UNKNOWN and pieces < demand.most:
            if low < middle < high and high - low > demand.finest and top < stack.shape[0] - 1:
                stack[top, 0], stack[top + 1, 0], stack[top + 1, 1] = middle, low, middle
                top += 1
                continue
            if tolerance > 0.0:
                coarse = max(coarse, _beyond(row, j, last, work) * (high - low))
        elif verdict == HIDDEN or (verdict == UNKNOWN and not demand.of_state):
            return low, middle, coarse, pieces
        elif verdict == NOISY:
            coarse = max(coarse, _unseen(row, _beyond(row, j, last, work), high - low, tolerance))
        top -= 1
    return path.length, path.length, coarse, pieces


@njit(**KERNEL)
def first_hidden(model, program, path, at, demand, work):
    """The length on which a forcing is explained, of a path, and the first unexplained place after it.

    Both are the path's length if all of it is explained. Returned third is the most that a piece adds to the
    forcing's integral, as far as bounds can tell, which rounding explains or which is as short as the
    rounding of time.

    An expression of the state is unexplained only where the middle of a piece is certain to be.
    """
    h, nodes, pieces, coarse = path.length, at.nodes, 0, 0.0
    steady, noise = is_steady(model, program, path, demand.negligible, work)
    if steady:
        row = work.registers[_last_row(model.programs, program)]
        return h, h, _unseen(row, noise, h, demand.tolerance)
    _take_samples(model, program, path, at, work)
    if at.seen:
        before, place = _hidden_from_stages(model, program, path, nodes, demand, work)
        if place < h:
            return before, place, 0.0
    for j in range(len(nodes) - 1):
        work.intervals[0, 0], work.intervals[0, 1] = nodes[j] * h, nodes[j + 1] * h
        before, place, rest, pieces = _hidden_between(
            model, program, path, j, 0 if demand.of_state else pieces, demand, work
        )
        coarse = max(coarse, rest)
        if before < h:
            return before, place, coarse
    return h, h, coarse
