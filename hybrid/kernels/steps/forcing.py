"""The longest step on which no pulse of the forcing is hidden from the method.

A method knows a step by samples: the field at its stages, or the series at its start. Error control cannot
see a pulse between them. So each part of the field that depends on time alone is bounded over the step by
interval arithmetic. A component of the state that grows at a constant rate tells the time as well. A step is
*explained* if between two samples the forcing stays in the range of these two, give or take a share of what
the samples differ by. All subexpressions that could hide a pulse are held to this: two switches may each be
explained, and their difference be a pulse.

Where the forcing is monotone, its ends explain it: one evaluation on intervals is all a step costs. Where
it is so over many steps to come, they cost nothing.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.clock import measured_time
from hybrid.kernels.events.guards import has_program
from hybrid.kernels.steps.step import rates_by_jacobian
from hybrid.kernels.types.codes import (
    HIGH,
    HIGH_MIDDLE,
    LEAST_SLOPE,
    LOW,
    LOW_MIDDLE,
    MOST_SLOPE,
    NARROW,
)
from hybrid.kernels.types.kinds import INTEGER, REAL
from hybrid.kernels.types.layout import EPSILON, Method, Model, Run, Work
from hybrid.kernels.types.options import INLINE, KERNEL, exported

# Verdicts on a piece of a step.
EXPLAINED, NOISY, UNKNOWN, HIDDEN = range(4)
# A range is rounding if it is at most this many times as wide as the range at one point.
FLAT = 4.0
# An arbitrary place of the step.
ELSEWHERE = 0.3819
# The forcing may leave the range of neighbouring samples by this share of the largest difference of samples:
# a resolved maximum lies a little above them, and error control sees the differences of the samples.
BETWEEN = 0.25
# Shares of the tolerance that may remain unseen, on the whole step and on one piece.
SHARE = 0.1
SHARE_OF_PIECE = 0.01
# A piece that rounding explains, or that is as short as the rounding of time, is taken as it is: what it may
# hide is as large as what this rounding does to a jump. More than so many tolerances of it are reported.
COARSE_PIECE = 10.0
# Number of steps ahead for which monotone forcing is tested, and number of steps until the next test.
AHEAD = 16.0
WAIT = 8
# Largest number of pieces of a step, and of attempts to shorten it.
MOST_PIECES = 400
MOST_CUTS = 200
# Shortest step, in units of the rounding of time.
FINEST = 64.0 * EPSILON
# After this many such steps the forcing is no longer tested.
MOST_UNRESOLVED = 100
# Tolerances by which a series may differ from its field over a step.
MARGIN = 2.0
# Rounding of a state, in units in its last place, by which the noise of its field is measured.
ROUNDING = 8.0 * EPSILON


@njit(**INLINE)
def _is_monotone(row):
    return row[LEAST_SLOPE] >= 0.0 or row[MOST_SLOPE] <= 0.0


@njit(**KERNEL)
def _is_steady(model, program, path, order, clock, start, h, negligible, work):
    """Whether no row that is checked turns round on a step of length ``h``, or the forcing is negligible.

    Rounding does not count as a turn. Returned second is the range of the forcing if it turns by rounding.
    """
    programs, registers = model.programs, work.registers
    first = programs.first[program]
    last = model.bound(programs, program, path, order, clock, start, 1.0, 0.5 * h, 0.5 * h, registers)
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
        model.bound(programs, program, path, order, clock, start, 1.0, ELSEWHERE * h, 0.0, registers)
        for place in range(last + 1):
            row = registers[place]
            if not widths[place] <= FLAT * (row[HIGH_MIDDLE] - row[LOW_MIDDLE]):
                return False, 0.0
    return True, widths[last]


@njit(**KERNEL)
def _take_samples(model, program, path, order, clock, start, nodes, h, work):
    """Ranges of all rows at the nodes into ``work.samples``, low and high in turn.

    The last row takes the largest low end and the smallest high end of each.
    """
    samples = work.samples
    common = samples[samples.shape[0] - 1]
    for j in range(len(nodes)):
        last = model.bound(
            model.programs, program, path, order, clock, start, 1.0, nodes[j] * h, 0.0, work.registers
        )
        for place in range(last + 1):
            low, high = work.registers[place, LOW_MIDDLE], work.registers[place, HIGH_MIDDLE]
            samples[j, 2 * place], samples[j, 2 * place + 1] = low, high
            common[2 * place] = low if j == 0 else max(common[2 * place], low)
            common[2 * place + 1] = high if j == 0 else min(common[2 * place + 1], high)


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
def _judged(programs, first, last, j, whole, length, negligible, tolerance, work):
    """Whether a piece between the samples ``j`` and ``j + 1``, which has just been bounded, is explained.

    HIDDEN if its middle is certain to lie beyond what they explain, NOISY if rounding alone explains it.
    """
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
            if beyond <= negligible or beyond * length <= tolerance:
                return EXPLAINED
        elif not row[HIGH] - row[LOW] < math.inf:
            # This part may be unused, such as the other branch of a choice.
            continue
        if whole and _is_monotone(row) and row[HIGH] - row[LOW] < math.inf:
            continue
        slack = BETWEEN * max(common[i] - common[i + 1], 0.0)
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
def _first_hidden(model, program, path, order, clock, start, nodes, h, tolerance, finest, work):
    """The length on which a forcing is explained, of a step ``h``, and the first unexplained place after it.

    Both are ``h`` if all of it is explained. ``tolerance`` is that of the forcing's integral. Returned third
    is the most that a piece adds to that, as far as bounds can tell, which rounding explains or which is as
    short as the rounding of time.
    """
    programs = model.programs
    first, negligible = programs.first[program], SHARE * tolerance / h
    steady, noise = _is_steady(model, program, path, order, clock, start, h, negligible, work)
    if steady:
        return h, h, _unseen(work.registers[programs.first[program + 1] - 1 - first], noise, h, tolerance)
    last = programs.first[program + 1] - 1 - first
    _take_samples(model, program, path, order, clock, start, nodes, h, work)
    stack, pieces, coarse = work.intervals, 0, 0.0
    for j in range(len(nodes) - 1):
        top, whole = 0, True
        stack[0, 0], stack[0, 1] = nodes[j] * h, nodes[j + 1] * h
        while top >= 0:
            low, high = stack[top, 0], stack[top, 1]
            middle = 0.5 * (low + high)
            radius = max(high - middle, middle - low)
            last = model.bound(
                programs, program, path, order, clock, start, 1.0, middle, radius, work.registers
            )
            pieces += 1
            verdict = _judged(
                programs,
                first,
                last,
                j,
                whole,
                high - low,
                negligible,
                SHARE_OF_PIECE * tolerance,
                work,
            )
            whole = False
            if verdict == UNKNOWN and pieces < MOST_PIECES:
                if not (low < middle < high and high - low > finest and top < stack.shape[0] - 1):
                    if tolerance > 0.0:
                        beyond = _beyond(work.registers[last], j, last, work)
                        coarse = max(coarse, beyond * (high - low))
                    top -= 1
                    continue
                stack[top, 0], stack[top + 1, 0], stack[top + 1, 1] = middle, low, middle
                top += 1
            elif verdict > NOISY:
                return low, middle, coarse
            else:
                if verdict == NOISY:
                    row = work.registers[last]
                    coarse = max(coarse, _unseen(row, _beyond(row, j, last, work), high - low, tolerance))
                top -= 1
    return h, h, coarse


@njit(**INLINE)
def _tolerance(model, method, run, forcing):
    """Tolerance for the integral of a forcing; zero if its contribution to the state is unknown."""
    component = model.forcing_component[forcing]
    return method.atol + method.rtol * abs(run.y[component]) if component >= 0 else 0.0


@njit(**KERNEL)
def _is_calm(model, method, run, mode, path, order, h, work):
    """Whether all forcing is monotone on the step and known to be so for longer."""
    start = run.phase
    known = run.calm_mode == mode + 1 and run.calm_cycle == run.cycle
    if known and start + h <= run.calm_until:
        return True
    run.calm_wait -= 1
    if run.calm_wait > 0:
        return False
    for forcing in range(model.first_forcing[mode], model.first_forcing[mode + 1]):
        program = model.target.shape[0] + forcing
        if not has_program(model, program):
            continue
        steady, noise = _is_steady(model, program, path, order, -1, start, AHEAD * h, 0.0, work)
        if not steady or AHEAD * h * noise > SHARE * _tolerance(model, method, run, forcing):
            run.calm_wait = WAIT
            return False
    run.calm_mode, run.calm_cycle = mode + 1, run.cycle
    run.calm_until = start + AHEAD * h
    return True


@njit(**KERNEL)
def _longest_explained(model, method, run, path, order, clock, nodes, h, work):
    """The longest step up to ``h`` that is explained; one as short as rounding allows is taken as it is.

    A step is cut to where it is explained. If that is hardly anything, the pulse has begun, and a step as far
    as its first place that is not explained has the length of the pulse.
    """
    mode, start = run.mode, run.phase
    if clock < 0 and _is_calm(model, method, run, mode, path, order, h, work):
        return h
    rounding = 0.0 if clock >= 0 else measured_time(model, run, mode)
    longest, shortest = h, FINEST * rounding + EPSILON * h
    for _ in range(MOST_CUTS):
        finest = 2.0 * EPSILON * (rounding + h)
        explained, beyond, coarse = h, h, False
        for forcing in range(model.first_forcing[mode], model.first_forcing[mode + 1]):
            program = model.target.shape[0] + forcing
            if not has_program(model, program):
                continue
            tolerance = _tolerance(model, method, run, forcing)
            place, other, rest = _first_hidden(
                model, program, path, order, clock, start, nodes, explained, tolerance, finest, work
            )
            coarse = coarse or rest > COARSE_PIECE * tolerance
            if place < explained:
                explained, beyond = place, other
        if explained >= h:
            run.coarse += 1 if coarse else 0
            return h
        h = explained if 2.0 * explained >= beyond else beyond
        if not h > shortest:
            break
    return _unresolved(run, longest, max(h, shortest))


@njit(**KERNEL)
def _unresolved(run, longest, shortest):
    """The step if no step is explained: the shortest one; after many such steps, the proposed one."""
    run.unresolved += 1
    return min(longest, shortest) if run.unresolved <= MOST_UNRESOLVED else longest


@exported(REAL, Model, Method, Run, REAL, Work)
def explained_step(model, method, run, h, work):
    """The length up to ``h`` of a step whose stages explain the forcing.

    The components that tell the time grow at a constant rate. ``work.stages[0]`` holds the rates.
    """
    for i in range(model.dimension):
        work.path[0, i], work.path[1, i] = run.y[i], work.stages[0, i]
    return _longest_explained(model, method, run, work.path, 1, -1, method.nodes, h, work)


@njit(**INLINE)
def _value_and_slope(series, column, order, s):
    """One column and its derivative."""
    value, slope = series[order, column], 0.0
    for o in range(order - 1, -1, -1):
        slope = slope * s + value
        value = value * s + series[o, column]
    return value, slope


@njit(**KERNEL)
def _along_series(model, mode, tangents, order, s, work):
    """State and tangent vectors of a series into ``work.trial``, their derivatives into ``work.new``."""
    n, series = model.dimension, work.series
    for i in range(n):
        work.trial[i], work.new[i] = _value_and_slope(series, i, order, s)
    for vector in range(tangents):
        column = model.tangent_start + vector // NARROW * model.tangent_columns[mode] + vector % NARROW
        for i in range(n):
            place = n * (1 + vector) + i
            work.trial[place], work.new[place] = _value_and_slope(series, column + NARROW * i, order, s)


@njit(**KERNEL)
def _is_finite(model, mode, tangents, order, work):
    """Whether all terms of the series are finite, of the state and of the tangent vectors."""
    n, total = model.dimension, 0.0
    for o in range(order + 1):
        for i in range(n):
            total += abs(work.series[o, i])
        for vector in range(tangents):
            column = model.tangent_start + vector // NARROW * model.tangent_columns[mode] + vector % NARROW
            for i in range(n):
                total += abs(work.series[o, column + NARROW * i])
    return total < math.inf


@njit(**KERNEL)
def _is_beyond_guard(model, run, order, s, work):
    """Whether a place on the clock of a mode lies beyond a guard in the series: the mode ends before."""
    first = model.first_outgoing[run.mode]
    for slot in range(first, model.first_outgoing[run.mode + 1]):
        transition = model.outgoing[slot]
        if model.guard_in_series[transition] == 1:
            value, _ = _value_and_slope(work.series, model.dimension + slot - first, order, s)
            if value * run.side[transition] < 0.0:
                return True
    return False


@njit(**KERNEL)
def _follows_field(model, method, run, tangents, order, clock, h, noisy, work):
    """Whether the series has the field as its derivative at the nodes: its order may not know a pulse yet.

    Over the step both may differ by some tolerances, and with ``noisy`` by what rounding of the state makes
    of the field besides.
    """
    n, mode, start = model.dimension, run.mode, run.phase
    length, series = n * (1 + tangents), work.series
    field, other, missing = work.stages[0], work.stages[1], work.error
    for i in range(length):
        missing[i] = 0.0
    for j in range(1, len(method.series_nodes)):
        s, weight = method.series_nodes[j] * h, method.series_weights[j] * h
        _along_series(model, mode, tangents, order, s, work)
        t, pace = start + s, 1.0
        if clock >= 0:
            t, pace = _value_and_slope(series, clock, order, s)
            t += start
            if _is_beyond_guard(model, run, order, s, work):
                break
        rates_by_jacobian(model, mode, t, work.trial, tangents, work.jacobian, field)
        for i in range(length):
            other[i] = field[i]
        if noisy:
            for i in range(length):
                work.trial[i] *= 1.0 + (ROUNDING if (i + 1) // 2 % 2 == 0 else -ROUNDING)
            rates_by_jacobian(model, mode, t, work.trial, tangents, work.jacobian, other)
        for i in range(length):
            gap, noise = abs(pace * field[i] - work.new[i]), abs(pace * (other[i] - field[i]))
            if not gap <= noise:
                missing[i] += weight * (gap - noise)
    for first in range(0, length, n):
        floor = method.atol
        if first > 0:
            square = 0.0
            for i in range(first, first + n):
                square += run.y[i] * run.y[i]
            floor = method.rtol * math.sqrt(square / n) + 1e-300
        for i in range(first, first + n):
            size = max(abs(run.y[i]), abs(work.trial[i]))
            if not missing[i] <= MARGIN * (floor + (method.rtol + ROUNDING) * size):
                return False
    return True


@exported(REAL, Model, Method, Run, INTEGER, INTEGER, INTEGER, REAL, Work)
def explained_series(model, method, run, tangents, order, clock, h, work):
    """The length up to ``h`` of a step on which the series follows the forcing; nan if it is not finite."""
    if not _is_finite(model, run.mode, tangents, order, work):
        return math.nan
    nodes, longest = method.series_nodes, h
    rounding = 0.0 if clock >= 0 else measured_time(model, run, run.mode)
    for _ in range(MOST_CUTS):
        h = _longest_explained(model, method, run, work.series, order, clock, nodes, h, work)
        for noisy in (False, True):
            if _follows_field(model, method, run, tangents, order, clock, h, noisy, work):
                return h
        h *= 0.5
        if not h > FINEST * rounding + EPSILON * longest:
            break
    return _unresolved(run, longest, h)
