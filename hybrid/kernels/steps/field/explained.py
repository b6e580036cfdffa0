"""The longest step on which no pulse of the field is hidden from the method.

Error control cannot see a pulse between the places at which a method looks. So each part of the field that
depends on time alone is bounded over the step before it is taken. A component of the state that grows at a
constant rate tells the time as well.

Parts that may be flat and have a pulse in the state, such as a narrow bump of a potential or a contact that
the orbit meets for a moment, are bounded over the series, or over the interpolant of an attempted step.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.clock import measured_time
from hybrid.kernels.events.guards import has_program, has_terms_in_state
from hybrid.kernels.events.path import up_to
from hybrid.kernels.steps.field.pulses import Asked, first_hidden
from hybrid.kernels.steps.field.residual import (
    MARGIN_OF_FIELD,
    MARGIN_OF_INTERPOLANT,
    follows_field,
    has_finite_terms,
)
from hybrid.kernels.steps.step import interpolant_path, path_of_step
from hybrid.kernels.types.codes import ARGUMENTS, HIGH, IN_TIME, LOW, TERMS
from hybrid.kernels.types.kinds import INTEGER, REAL, TRUTH
from hybrid.kernels.types.layout import EPSILON, Method, Model, Path, Run, Work
from hybrid.kernels.types.options import KERNEL, exported

# More than so many tolerances of a forcing that are as short as the rounding of time, or that are rounding,
# are reported.
COARSE = 10.0
# Shortest step, in units of the rounding of time: the places at which a method looks are apart.
FINEST_PIECE = 64.0 * EPSILON
# After this many such steps the forcing is no longer tested: a run does not crawl where bounds say nothing.
MOST_UNRESOLVED = 100
# Most attempts to shorten a step; one that halves the step reaches its rounding sooner.
MOST_CUTS = 200
# An exponential whose argument changes by no more than this is not small to all digits where it matters.
MOST_CHANGE = 8.0


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
def _longest_explained(model, method, run, path, nodes, kind, work):
    """The longest part of a path on which the forcings of a kind are explained, down to rounding.

    A step is cut to where it is explained. If that is hardly anything, the pulse has begun, and a step as far
    as its first place that is not explained has the length of the pulse.
    """
    h, mode = path.length, run.mode
    rounding = 0.0 if path.clock >= 0 else measured_time(model, run, mode) / path.pace
    shortest = FINEST_PIECE * rounding + EPSILON * h
    for _ in range(MOST_CUTS):
        finest = 2.0 * EPSILON * (rounding + h)
        explained, beyond, coarse = h, h, False
        for forcing in range(model.first_forcing[mode], model.first_forcing[mode + 1]):
            program, component = model.target.shape[0] + forcing, model.forcing_component[forcing]
            if model.forcing_kind[forcing] != kind or not has_program(model, program):
                continue
            tolerance = 0.0
            if component >= 0:
                tolerance = (method.atol + method.rtol * abs(run.y[component])) / path.pace
            asked = Asked(nodes, tolerance, finest, kind == TERMS)
            place, other, rest = first_hidden(model, program, up_to(path, explained), asked, work)
            coarse = coarse or (kind == IN_TIME and rest > COARSE * tolerance)
            if place < explained:
                explained, beyond = place, other
        if explained >= h:
            run.coarse += 1 if coarse else 0
            return h
        h = explained if 2.0 * explained >= beyond else beyond
        if not h > shortest:
            break
    return _unresolved(run, path.length, max(h, shortest))


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
    path = Path(work.path, 1, -1, run.phase, 1.0, h, False, 1)
    return _longest_explained(model, method, run, path, method.nodes, IN_TIME, work)


@exported(REAL, Model, Method, Run, REAL, Work)
def explained_attempt(model, method, run, h, work):
    """The length up to ``h`` of a step on which no pulse in the state is hidden from the attempted one.

    The interpolant of the attempted step, whose stages are those of ``work``, is the way between its ends.
    Samples are taken where it has the field as its derivative: at the nodes of an implicit method, and where
    ``follows_attempt`` compares both for an explicit one.
    """
    interpolant_path(method, h, run.y, model.dimension, work)
    path = path_of_step(method, run.phase, h, work)
    if not _arguments_change(model, run.mode, path, work):
        return h
    nodes = method.nodes if method.implicit != 0 else method.series_nodes
    return h * _longest_explained(model, method, run, path, nodes, TERMS, work)


@exported(TRUTH, Model, Method, Run, REAL, Work)
def follows_attempt(model, method, run, h, work):
    """Whether the interpolant of the attempted step has the field as its derivative at a few places.

    That of an implicit method has, at its nodes. Elsewhere a stiff field magnifies what it leaves out.
    """
    if method.implicit != 0:
        return True
    interpolant_path(method, h, run.y, model.dimension, work)
    path = path_of_step(method, run.phase, h, work)
    return follows_field(model, method, run, 0, path, MARGIN_OF_INTERPOLANT, work)


@exported(REAL, Model, Method, Run, INTEGER, Path, Work)
def explained_series(model, method, run, tangents, path, work):
    """The length of the step on which a path of series follows the forcing; nan if it is not finite."""
    h, nodes = path.length, method.series_nodes
    if not has_finite_terms(model, run.mode, tangents, path, work):
        return math.nan
    shortest = EPSILON * h + (0.0 if path.clock >= 0 else FINEST_PIECE * measured_time(model, run, run.mode))
    for _ in range(MOST_CUTS):
        h = timed = _longest_explained(model, method, run, up_to(path, h), nodes, IN_TIME, work)
        if _arguments_change(model, run.mode, up_to(path, h), work):
            h = _longest_explained(model, method, run, up_to(path, h), nodes, TERMS, work)
        if shortest < h < timed:
            # On a shorter step, the forcing in time has other places to be explained by.
            continue
        if follows_field(model, method, run, tangents, up_to(path, h), MARGIN_OF_FIELD, work):
            return h
        h *= 0.5
        if not h > shortest:
            break
    return _unresolved(run, path.length, h)
