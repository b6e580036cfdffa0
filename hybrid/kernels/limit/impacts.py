"""Impacts of one transition on its guard: the series that its speed, pull and restitution tell at once.

The flights after a jump with the guard's speed ``v`` take the time ``2 v / (a (1 - r))``, where ``a`` is the
acceleration towards the guard and ``r`` the restitution of the jump just made. Until then the state follows
the field averaged over the flights. Both are better than what past rounds tell: their errors are those of a
changing pull and restitution alone.
"""

import math

from numba import njit

from hybrid.kernels.events.guards import guard_acceleration, guard_speed, guard_value, rounding_band
from hybrid.kernels.jumps.past import fired_before, follows_impact
from hybrid.kernels.limit.rounds import NO_SERIES, Series, shortens
from hybrid.kernels.types.codes import IMPULSE, LIMIT
from hybrid.kernels.types.options import KERNEL


@njit(**KERNEL)
def far_side(model, run, transition):
    """The side of the guard on which the state was before the transition that has just fired."""
    if model.direction[transition] != 0:
        return model.direction[transition]
    return 1 if run.last_transversality > 0.0 else -1


@njit(**KERNEL)
def series_of_impacts(model, run, transition, work):
    """The series of impacts on one guard, known once two have followed each other.

    The last columns of ``run.trail`` hold what the next impact compares with: the guard's speed and the time
    left.
    """
    n, ratio, t, x = model.dimension, run.restitution, run.phase, run.y
    side = -far_side(model, run, transition)
    follows = run.chatter_jumps + 1 == run.jumps and fired_before(run, 1) == transition
    earlier, run.chattering = run.chattering if follows else 0, 0
    if not follows_impact(model, run) or (run.jumps > 2 and not shortens(model, run, 1)):
        return NO_SERIES
    # No chatter begins with a reset that leaves the guard.
    value = guard_value(model, transition, t, x, work.scalar)
    model.field(run.mode, t, x, model.parameters, work.field)
    speed = side * guard_speed(model, transition, t, x, work.field, work.gradient)
    pull = -side * guard_acceleration(model, run, transition, run.mode, t, x, work)
    if not (pull > 0.0 and speed > 0.0 and abs(value) <= rounding_band(model, run, transition, t, x, work)):
        return NO_SERIES
    span, before, flight = 2.0 * speed / (pull * (1.0 - ratio)), run.trail[LIMIT, n], run.stay[run.mode]
    run.trail[IMPULSE, n], run.trail[LIMIT, n], run.chatter_jumps = speed, span, run.jumps
    run.chattering = earlier + 1
    if earlier == 0:
        run.trail[LIMIT, 0] = math.inf
        return NO_SERIES
    return Series(1, run.chattering, ratio, flight, span, span + flight - before)


@njit(**KERNEL)
def mean_field(model, run, transition, t, x, out, work):
    """Field of a chatter averaged over its flights, ``f - a p`` into ``out (n,)``; returns ``a``.

    ``a`` is the guard's acceleration and ``p`` the impulse per unit of the guard's speed: the impulses give
    back the speed that the pull takes.
    """
    mode = run.mode
    model.field(mode, t, x, model.parameters, work.field)
    guard_speed(model, transition, t, x, work.field, work.gradient)
    acceleration = guard_acceleration(model, run, transition, mode, t, x, work)
    for i in range(model.dimension):
        out[i] = work.field[i] - acceleration * run.trail[IMPULSE, i]
    return acceleration


@njit(**KERNEL)
def follow_mean(model, run, transition, start, span, moved, work):
    """How far the state ``start (n,)`` moves along the mean field in the time ``span``, into ``moved (n,)``.

    One step of the classical Runge-Kutta method; returns the guard's acceleration at the start. Scratch is
    ``work.error`` and ``work.new``.
    """
    n, t, at_start = model.dimension, run.phase, 0.0
    place, slope = work.error, work.new
    for i in range(n):
        moved[i], slope[i] = 0.0, 0.0
    for stage in range(4):
        part = 0.5 * span * ((stage + 1) // 2)
        weight = span / (6.0 if stage in (0, 3) else 3.0)
        for i in range(n):
            place[i] = start[i] + part * slope[i]
        acceleration = mean_field(model, run, transition, t + part, place, slope, work)
        at_start = acceleration if stage == 0 else at_start
        for i in range(n):
            moved[i] += weight * slope[i]
    return at_start


@njit(**KERNEL)
def extrapolate_impacts(model, run, transition, span, work):
    """Limit of the state into ``work.settled (n,)``: its speed taken out, then along the mean field until it.

    The error is of third order in the speed where pull and impulse are constant.
    """
    n, start = model.dimension, work.trial
    speed = -far_side(model, run, transition) * run.trail[IMPULSE, n]
    for i in range(n):
        start[i] = run.y[i] - speed * run.trail[IMPULSE, i]
    follow_mean(model, run, transition, start, span, work.settled, work)
    for i in range(n):
        work.settled[i] += start[i]


@njit(**KERNEL)
def impact(model, run, transition, t, x, after, work):
    """Restitution of an impact from ``x (n,)`` to ``after (n,)``, and the change of the guard's speed."""
    model.field(run.mode, t, x, model.parameters, work.field)
    before = guard_speed(model, transition, t, x, work.field, work.gradient)
    model.reset(transition, t, x, model.parameters, after)
    model.field(run.mode, t, after, model.parameters, work.field)
    later = guard_speed(model, transition, t, after, work.field, work.gradient)
    return -later / before, later - before
