"""The longest step on which no pulse of the field is hidden from the method.

A method knows a step by samples: the field at its stages, or the series at its start. Error control cannot
see a pulse between them. So each part of the field that depends on time alone is bounded over the step. A
component of the state that grows at a constant rate tells the time as well. Where the forcing is monotone
over many steps to come, it costs nothing.

Parts that may be flat and have a pulse in the state, such as a narrow bump of a potential or a contact that
the orbit meets for a moment, are bounded over the series, or over the interpolant of an attempted step.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.clock import measured_time
from hybrid.kernels.events.guards import has_program, has_terms_in_state
from hybrid.kernels.events.path import up_to
from hybrid.kernels.steps.pulses import SHARE, Samples, demand_on, first_hidden, is_steady
from hybrid.kernels.steps.step import combine, interpolant_path, rates_by_jacobian
from hybrid.kernels.types.codes import ARGUMENTS, HIGH, IN_TIME, LOW, NARROW, TERMS
from hybrid.kernels.types.kinds import INTEGER, REAL
from hybrid.kernels.types.layout import EPSILON, Method, Model, Path, Run, Work
from hybrid.kernels.types.options import INLINE, KERNEL, exported

# A piece that rounding explains, or that is as short as the rounding of time, is taken as it is: what it may
# hide is as large as what this rounding does to a jump. More than so many tolerances of it are reported.
COARSE_PIECE = 10.0
# Number of steps ahead for which monotone forcing is tested, and number of steps until the next test.
AHEAD = 16.0
WAIT = 8
# Most attempts to shorten a step.
MOST_CUTS = 200
# Shortest step, in units of the rounding of time.
FINEST = 64.0 * EPSILON
# After this many such steps the forcing is no longer tested.
MOST_UNRESOLVED = 100
# Tolerances by which a series may differ from its field over a step.
MARGIN = 2.0
# Rounding of a state, in units in its last place, by which the noise of its field is measured.
ROUNDING = 8.0 * EPSILON
# An exponential whose argument changes by no more than this is not small to all digits where it matters.
MOST_CHANGE = 8.0
# An attempted step is cut to this share of what is explained: the next attempt has another interpolant.
SAFELY = 0.9


@njit(**INLINE)
def _tolerance(model, method, run, forcing):
    """Tolerance for the integral of a forcing; zero if its contribution to the state is unknown."""
    component = model.forcing_component[forcing]
    return method.atol + method.rtol * abs(run.y[component]) if component >= 0 else 0.0


@njit(**KERNEL)
def _is_calm(model, method, run, path, work):
    """Whether all forcing is monotone on the step and known to be so for longer."""
    mode, start, h = run.mode, path.start, path.length
    known = run.calm_mode == mode + 1 and run.calm_cycle == run.cycle
    if known and start + h <= run.calm_until:
        return True
    run.calm_wait -= 1
    if run.calm_wait > 0:
        return False
    for forcing in range(model.first_forcing[mode], model.first_forcing[mode + 1]):
        program = model.target.shape[0] + forcing
        if model.forcing_kind[forcing] != IN_TIME or not has_program(model, program):
            continue
        steady, noise = is_steady(model, program, up_to(path, AHEAD * h), 0.0, work)
        if not steady or AHEAD * h * noise > SHARE * _tolerance(model, method, run, forcing):
            run.calm_wait = WAIT
            return False
    run.calm_mode, run.calm_cycle = mode + 1, run.cycle
    run.calm_until = start + AHEAD * h
    return True


@njit(**KERNEL)
def _arguments_change(model, mode, path, work):
    """Whether an argument of the exponentials in the state changes so much that a step may hide a pulse.

    If not, the exponential is not so small anywhere on the step that its series does not show it.
    """
    if not has_terms_in_state(model, mode):
        return False
    forcing = model.first_forcing[mode]
    while model.forcing_kind[forcing] != ARGUMENTS:
        forcing += 1
    program = model.target.shape[0] + forcing
    if not has_program(model, program):
        return True
    first, half = model.programs.first[program], 0.5 * path.length
    last = model.bound(model.programs, program, path, half, half, work.registers)
    for row in range(last + 1):
        change = work.registers[row, HIGH] - work.registers[row, LOW]
        if model.programs.checked[first + row] == 1 and not change <= MOST_CHANGE:
            return True
    return False


@njit(**KERNEL)
def _longest_explained(model, method, run, path, at, timed, swings, work):
    """The longest part of a path that is explained; one as short as rounding allows is taken as it is.

    Asked of the parts of the field in time if ``timed``, and of those in the state if it ``swings``.

    A step is cut to where it is explained. If that is hardly anything, the pulse has begun, and a step as far
    as its first place that is not explained has the length of the pulse.
    """
    mode, h, clock = run.mode, path.length, path.clock
    if timed and clock < 0 and _is_calm(model, method, run, path, work):
        timed = False
    if not (timed or swings):
        return h
    rounding = 0.0 if clock >= 0 else measured_time(model, run, mode)
    longest, shortest = h, FINEST * rounding + EPSILON * h
    for _ in range(MOST_CUTS):
        finest = 2.0 * EPSILON * (rounding + h)
        explained, beyond, coarse = h, h, False
        for forcing in range(model.first_forcing[mode], model.first_forcing[mode + 1]):
            program, kind = model.target.shape[0] + forcing, model.forcing_kind[forcing]
            asked = timed if kind == IN_TIME else swings and kind == TERMS
            if not asked or not has_program(model, program):
                continue
            tolerance = _tolerance(model, method, run, forcing)
            demand = demand_on(explained, tolerance, finest, kind == TERMS)
            part = Samples(at.nodes, at.seen and explained == longest)
            place, other, rest = first_hidden(model, program, up_to(path, explained), part, demand, work)
            coarse = coarse or (rest > COARSE_PIECE * tolerance and kind == IN_TIME)
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
    path = Path(work.path, 1, -1, run.phase, 1.0, h, False)
    return _longest_explained(model, method, run, path, Samples(method.nodes, False), True, False, work)


@njit(**KERNEL)
def _keep_places(model, method, run, h, work):
    """The states at which an explicit method has evaluated the field of the attempted step, by its nodes.

    They are farther from the solution than the interpolant: what lies there may be hidden from the method.
    The stages of the interpolant alone come last.
    """
    n, s, places, count = model.dimension, method.b.shape[0], work.places, len(method.nodes)
    for j in range(count - 1):
        for i in range(s):
            if method.c[i] == method.nodes[j]:
                combine(run.y, h, method.a[i], work.stages, i, n, places[j])
    for i in range(n):
        places[count - 1, i] = work.new[i]
    for i in range(s + 1, method.a.shape[0]):
        place = places[count + i - s - 1]
        combine(run.y, h, method.a[i], work.stages, i, n, place)
        place[n] = method.c[i]


@exported(REAL, Model, Method, Run, REAL, Work)
def explained_attempt(model, method, run, h, work):
    """The length up to ``h`` of a step on which no pulse in the state is hidden from the attempted one.

    The interpolant of the attempted step, whose stages are those of ``work``, is the way between its ends.
    """
    interpolant_path(method, h, run.y, model.dimension, work)
    degree, powers, unit = method.powers.shape[0] - 1, work.path, 1.0
    for k in range(1, degree + 1):
        unit /= h
        for i in range(model.dimension):
            powers[k, i] *= unit
            if not abs(powers[k, i]) < math.inf:
                return h
    path = Path(powers, degree, -1, run.phase, 1.0, h, False)
    if not _arguments_change(model, run.mode, path, work):
        return h
    explicit = method.implicit == 0
    if explicit:
        _keep_places(model, method, run, h, work)
    at = Samples(method.nodes, explicit)
    explained = _longest_explained(model, method, run, path, at, False, True, work)
    return h if explained == h else SAFELY * explained


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
def _follows_field(model, method, run, tangents, path, noisy, work):
    """Whether the series has the field as its derivative at the nodes: its order may not know a pulse yet.

    Over the step both may differ by some tolerances, and with ``noisy`` by what rounding of the state makes
    of the field besides.
    """
    n, mode, start = model.dimension, run.mode, path.start
    length, series, order, clock, h = n * (1 + tangents), path.powers, path.degree, path.clock, path.length
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


@exported(REAL, Model, Method, Run, INTEGER, Path, Work)
def explained_series(model, method, run, tangents, path, work):
    """The length of the step on which a path of series follows the forcing; nan if it is not finite."""
    if not _is_finite(model, run.mode, tangents, path.degree, work):
        return math.nan
    h = path.length
    rounding = 0.0 if path.clock >= 0 else measured_time(model, run, run.mode)
    for _ in range(MOST_CUTS):
        part = up_to(path, h)
        swings = _arguments_change(model, run.mode, part, work)
        at = Samples(method.series_nodes, False)
        h = _longest_explained(model, method, run, part, at, True, swings, work)
        for noisy in (False, True):
            if _follows_field(model, method, run, tangents, up_to(path, h), noisy, work):
                return h
        h *= 0.5
        if not h > FINEST * rounding + EPSILON * path.length:
            break
    return _unresolved(run, path.length, h)
