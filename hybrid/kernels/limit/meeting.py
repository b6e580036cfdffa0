"""The tangent map of rounds whose jumps keep the state, such as the swings of a block in a groove.

The limit lies where two guards meet. On its way there the state moves along the fields ``f_k`` of the modes
of the round, and after the limit along ``f``, which keeps it on both. So a displacement is taken out along
the differences ``f_k - f``: ``Xi = I - V (G V)^-1 G``, with the gradients ``G`` of the guards and two such
differences in ``V``. If all differences have one direction ``d``, as forces that change a velocity have, the
other one is that of the motion that it brings, ``D_x f d``.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.slopes import whole_jacobian
from hybrid.kernels.events.guards import error_band, guard_acceleration, guard_speed, guard_value
from hybrid.kernels.jumps.past import fired_before
from hybrid.kernels.jumps.rest import ROUNDED
from hybrid.kernels.limit.rounds import RESOLVED, rounding_of_landing
from hybrid.kernels.types.codes import NO_TRANSITION
from hybrid.kernels.types.options import KERNEL


@njit(**KERNEL)
def meets_another(model, run, turn):
    """A transition of the last ``turn`` jumps with another guard than the last; none for a third guard."""
    first, other = fired_before(run, 0), NO_TRANSITION
    for back in range(1, turn):
        fired = fired_before(run, back)
        if model.surface[fired] == model.surface[first]:
            continue
        if other != NO_TRANSITION and model.surface[fired] != model.surface[other]:
            return NO_TRANSITION
        other = fired
    return other


@njit(**KERNEL)
def keeps_state(model, transition, t, x, work):
    """Whether a transition has no reset, to first order at ``x (n,)``."""
    model.reset_jacobian(transition, t, x, model.parameters, work.reset_jacobian)
    for i in range(model.dimension):
        for j in range(model.dimension):
            if work.reset_jacobian[i, j] != (1.0 if i == j else 0.0):
                return False
    return True


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
def dot(n, a, b):
    """The product of two vectors ``(n,)``; zero if it may be rounding."""
    total, terms = 0.0, 0.0
    for i in range(n):
        total += a[i] * b[i]
        terms += abs(a[i] * b[i])
    return total if abs(total) > ROUNDED * terms else 0.0


@njit(**KERNEL)
def determinant(n, normals, ways):
    """Determinant of the rates of two guards along two ways; zero if it may be rounding."""
    one = dot(n, normals[0], ways[0]) * dot(n, normals[1], ways[1])
    other = dot(n, normals[0], ways[1]) * dot(n, normals[1], ways[0])
    return one - other if abs(one - other) > RESOLVED * (abs(one) + abs(other)) else 0.0


@njit(**KERNEL)
def take_out(n, normals, ways, det, x):
    """Move ``x (n,)`` along two ways to where two guards vanish."""
    a, b = dot(n, normals[0], x), dot(n, normals[1], x)
    along = (a * dot(n, normals[1], ways[1]) - b * dot(n, normals[0], ways[1])) / det
    across = (b * dot(n, normals[0], ways[0]) - a * dot(n, normals[1], ways[0])) / det
    for i in range(n):
        left = x[i] - along * ways[0, i] - across * ways[1, i]
        terms = abs(x[i]) + abs(along * ways[0, i]) + abs(across * ways[1, i])
        # What is rounding of the terms would look like a direction.
        x[i] = left if abs(left) > ROUNDED * terms else 0.0


@njit(**KERNEL)
def is_within(n, normals, ways, det, x, out):
    """Whether ``x (n,)`` is a combination of two ways."""
    for i in range(n):
        out[i] = x[i]
    take_out(n, normals, ways, det, out)
    within = True
    for i in range(n):
        within = within and abs(out[i]) <= RESOLVED * (abs(x[i]) + abs(ways[0, i]) + abs(ways[1, i]))
    return within


@njit(**KERNEL)
def motion(model, mode, t, x, way, out, work):
    """The motion ``D_x f d`` that a change ``d`` of the state brings in a mode, into ``out (n,)``."""
    whole_jacobian(model, mode, t, x, work.jacobian)
    for i in range(model.dimension):
        out[i] = dot(model.dimension, work.jacobian[i], way)


@njit(**KERNEL)
def find_ways(model, run, turn, target, t, x, normals, ways, work):
    """The two ways along which a round comes to the meeting ``x (n,)``; their determinant, zero for none."""
    n, change, rest, det = model.dimension, work.new, work.error, 0.0
    found = 0
    for back in range(turn):
        mode = model.target[fired_before(run, back)]
        difference(model, mode, target, t, x, change, work)
        moves = dot(n, normals[0], change) != 0.0 or dot(n, normals[1], change) != 0.0
        if det == 0.0 and moves:
            for i in range(n):
                ways[found, i] = change[i]
            det = determinant(n, normals, ways) if found == 1 else 0.0
            found = 1
    tied = found == 1 and det == 0.0
    if tied:
        motion(model, target, t, x, ways[0], ways[1], work)
        det = determinant(n, normals, ways)
    if det == 0.0:
        return 0.0
    for back in range(turn):
        mode = model.target[fired_before(run, back)]
        difference(model, mode, target, t, x, change, work)
        if not is_within(n, normals, ways, det, change, rest):
            return 0.0
        if tied:
            motion(model, mode, t, x, ways[0], change, work)
            if not is_within(n, normals, ways, det, change, rest):
                return 0.0
    return det


@njit(**KERNEL)
def may_be_mapped(model, run, turn):
    """Whether the tangent map of a round of ``turn`` jumps may be that of a meeting of two guards."""
    return model.dimension > 1 and meets_another(model, run, turn) != NO_TRANSITION


@njit(**KERNEL)
def is_close_to_limit(model, method, run, series, work):
    """Whether the tolerances hide how far the next round moves a guard, or rounding begins to hide it.

    What the jumps to come do to tangent vectors besides the map of the meeting fades with the time left.
    """
    landing = rounding_of_landing(model, run, abs(run.phase), work)
    if landing >= RESOLVED * series.ratio**2 * series.latest:
        return True
    t, x = run.phase, run.y
    for transition in (fired_before(run, 0), meets_another(model, run, series.turn)):
        height = abs(guard_value(model, transition, t, x, work.scalar))
        model.field(run.mode, t, x, model.parameters, work.field)
        speed = guard_speed(model, transition, t, x, work.field, work.gradient)
        acceleration = abs(guard_acceleration(model, run, transition, run.mode, t, x, work))
        if acceleration > 0.0:
            height += speed**2 / (2.0 * acceleration)
            model.guard_gradient(transition, t, x, model.parameters, work.gradient)
            if height * series.ratio**2 <= error_band(method, run, work.gradient, model.controlled):
                return True
    return False


@njit(**KERNEL)
def meeting_matrix(model, run, turn, target, left, work):
    """Tangent map of the jumps to come and of the limit, into ``work.saltation (n, n)``; whether it is known.

    The derivative of the instant of the limit is not: ``run.instant`` becomes nan.
    """
    n, t, x, normals, ways = model.dimension, run.phase + left, work.settled, work.rounding, work.sizes
    pair = fired_before(run, 0), meets_another(model, run, turn)
    for back in range(turn):
        if not keeps_state(model, fired_before(run, back), t, x, work):
            return False
    for k in range(2):
        model.guard_gradient(pair[k], t, x, model.parameters, work.gradient)
        for i in range(n):
            normals[k, i] = work.gradient[i]
    det = find_ways(model, run, turn, target, t, x, normals, ways, work)
    if det == 0.0:
        return False
    column, onward = work.new, work.error
    for j in range(n):
        for i in range(n):
            column[i] = 1.0 if i == j else 0.0
        take_out(n, normals, ways, det, column)
        motion(model, target, t, x, column, onward, work)
        for i in range(n):
            work.saltation[i, j] = column[i] + left * onward[i]
        run.instant[j] = math.nan
    return True
