"""The tangent map of rounds whose jumps keep the state, such as the swings of a block in a groove.

The limit lies where two guards meet. On its way there the state moves along the fields ``f_k`` of the modes
of the round, and after the limit along ``f``, which keeps it on both. So a displacement is taken out along
the differences ``f_k - f``: ``Xi = I - V (G V)^-1 G``, with the gradients ``G`` of the guards and two such
differences in ``V``. If all differences have one direction ``d``, as forces that change a velocity have, the
other one is that of the motion that it brings, ``D_x f d``.
"""

import math

from numba import njit

from hybrid.kernels.events.guards import error_band, guard_acceleration
from hybrid.kernels.jumps.past import fired_before
from hybrid.kernels.jumps.rest import RESOLVED, ROUNDED, motion, project
from hybrid.kernels.limit.rounds import rounding_of_landing
from hybrid.kernels.types.codes import NO_TRANSITION
from hybrid.kernels.types.options import KERNEL


@njit(**KERNEL)
def meets_another(model, run, turn):
    """A transition of the last ``turn`` jumps with another guard than the last.

    There is none if there are three guards, or if a jump changes the state.
    """
    first, other = fired_before(run, 0), NO_TRANSITION
    for back in range(turn):
        fired = fired_before(run, back)
        if model.keeps_state[fired] == 0:
            return NO_TRANSITION
        if model.surface[fired] == model.surface[first]:
            continue
        if other != NO_TRANSITION and model.surface[fired] != model.surface[other]:
            return NO_TRANSITION
        other = fired
    return other


@njit(**KERNEL)
def difference(model, mode, target, t, x, out, work):
    """Field of a mode less that of the mode after the limit, at ``x (n,)``, into ``out (n,)``."""
    model.field(mode, t, x, model.parameters, work.field)
    model.field(target, t, x, model.parameters, work.field_after)
    for i in range(model.dimension):
        out[i] = work.field[i] - work.field_after[i]
        if abs(out[i]) <= ROUNDED * (abs(work.field[i]) + abs(work.field_after[i])):
            out[i] = 0.0


@njit(**KERNEL)
def leaves(n, matrix, x):
    """Whether a projection leaves a part of ``x (n,)``."""
    for i in range(n):
        total, terms = 0.0, 0.0
        for j in range(n):
            total += matrix[i, j] * x[j]
            terms += abs(matrix[i, j] * x[j])
        if abs(total) > RESOLVED * terms:
            return True
    return False


@njit(**KERNEL)
def find_ways(model, run, turn, target, t, x, work):
    """Project along the ways of a round that comes to the meeting ``x (n,)``, into ``work.saltation``.

    Returns whether all modes of the round lead along two ways.
    """
    n, rows, change, found = model.dimension, work.rounding, work.new, False
    for i in range(n):
        rows[2, i] = 0.0
    for back in range(turn):
        if not found:
            difference(model, model.target[fired_before(run, back)], target, t, x, rows[3], work)
            found = project(n, rows, work.saltation)
        for i in range(n if not found else 0):
            rows[2, i] = rows[3, i]
    tied = not found
    if tied:
        motion(model, target, t, x, rows[2], rows[3], work)
        found = project(n, rows, work.saltation)
    for back in range(turn if found else 0):
        mode = model.target[fired_before(run, back)]
        difference(model, mode, target, t, x, change, work)
        found = found and not leaves(n, work.saltation, change)
        if tied:
            motion(model, mode, t, x, rows[2], change, work)
            found = found and not leaves(n, work.saltation, change)
    return found


@njit(**KERNEL)
def may_be_mapped(model, run, turn):
    """Whether the tangent map of a round of ``turn`` jumps may be that of a meeting of two guards."""
    return model.dimension > 1 and meets_another(model, run, turn) != NO_TRANSITION


@njit(**KERNEL)
def hides_next_round(model, method, run, series, work):
    """Whether the tolerances hide how far the next round leads beyond the last guard, or rounding its time.

    What the jumps to come do to tangent vectors besides the map of the meeting fades with the time left.
    """
    if rounding_of_landing(model, run, abs(run.phase), work) >= RESOLVED * series.ratio**2 * series.latest:
        return True
    model.field(run.mode, run.phase, run.y, model.parameters, work.field)
    acceleration = guard_acceleration(model, run, run.last_fired, run.mode, run.phase, run.y, work)
    band = error_band(method, run, work.gradient, model.controlled)
    return (series.ratio * run.last_transversality) ** 2 <= 2.0 * abs(acceleration) * band


@njit(**KERNEL)
def meeting_matrix(model, run, turn, target, left, work):
    """Tangent map of the jumps to come and of the limit, into ``work.saltation (n, n)``; whether it is known.

    The derivative of the instant of the limit is not: ``run.instant`` becomes nan.
    """
    n, t, x, way, onward = model.dimension, run.phase + left, work.settled, work.new, work.error
    pair = fired_before(run, 0), meets_another(model, run, turn)
    for k in range(2):
        model.guard_gradient(pair[k], t, x, model.parameters, work.gradient)
        for i in range(n):
            work.rounding[k, i] = work.gradient[i]
    if not find_ways(model, run, turn, target, t, x, work):
        return False
    for j in range(n):
        for i in range(n):
            way[i] = work.saltation[i, j]
        motion(model, target, t, x, way, onward, work)
        for i in range(n):
            work.saltation[i, j] += left * onward[i]
        run.instant[j] = math.nan
    return True
