"""Whether the impacts that a limit of chatter skips are like the last one that was made.

A reset or a condition may know a threshold: a ball that sticks once it is slow, a catch that lets slow balls
pass. Impacts slower than the last one are therefore tried before their limit is taken.
"""

from numba import njit

from hybrid.kernels.arithmetic.clock import measured_time
from hybrid.kernels.events.derivatives import speed_rounding
from hybrid.kernels.events.guards import ROUNDING_OF_STATE, allowed, guard_speed
from hybrid.kernels.types.codes import ENDLESS
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import KERNEL

# Each impact that is tried is slower by this factor, down to this share of the last speed.
SLOWER = 0.1
SLOWEST = 1e-12
# What skipped impacts may change, in units of the tolerances.
ALIKE = 10.0
# The restitution is judged at speeds this many times that of rounding.
CLEAR = 1e3


@njit(**KERNEL)
def impact(model, run, transition, t, x, after, work):
    """Restitution of an impact from ``x (n,)`` to ``after (n,)``, and the change of the guard's speed."""
    model.field(run.mode, t, x, model.parameters, work.field)
    before = guard_speed(model, transition, t, x, work.field, work.gradient)
    model.reset(transition, t, x, model.parameters, after)
    model.field(run.mode, t, after, model.parameters, work.field)
    later = guard_speed(model, transition, t, after, work.field, work.gradient)
    return -later / before, later - before


@njit(**KERNEL)
def slower_are_alike(model, method, run, transition, speed, span, impulse, misfit, work):
    """Whether impacts slower than ``speed``, which has its sign, lead to the limit in ``work.settled``.

    Their condition must hold. Their restitution and their ``impulse (n,)`` may differ from those of the last
    impact by no more than changes the limit, ``span`` later, by a few tolerances, or by ``misfit`` of them.
    What counters do is none of this.
    """
    n, t = model.dimension, run.phase + span
    place, after, kind = work.new, work.second_error, run.restitution
    units = ALIKE * max(misfit, 1.0)
    clock = 8.0 * EPSILON * measured_time(model, run, run.mode)
    share = SLOWER
    while share >= SLOWEST:
        for i in range(n):
            place[i] = work.settled[i] - share * speed * impulse[i]
        model.field(run.mode, t, place, model.parameters, work.field)
        guard_speed(model, transition, t, place, work.field, work.gradient)
        if abs(share * speed) <= CLEAR * speed_rounding(model, run, transition, run.mode, t, place, work):
            return True
        if not allowed(model, transition, t, place, work.scalar):
            return False
        ratio, change = impact(model, run, transition, t, place, after, work)
        # All impacts below the last speed that was tried may be like this one.
        slow = share / SLOWER
        if not slow * span * abs(ratio - kind) <= units * (method.rtol * span + clock) * (1.0 - ratio):
            return False
        total = slow * abs(speed) * (1.0 + kind) / (1.0 - kind)
        for i in range(n):
            if run.trail[ENDLESS, i] != 0.0:
                continue
            rounding = ROUNDING_OF_STATE * EPSILON * run.scale[i] / abs(change)
            excess = abs((after[i] - place[i]) / change - impulse[i]) - rounding
            scale = method.atol + method.rtol * max(abs(work.settled[i]), run.scale[i])
            if not total * excess <= units * scale:
                return False
        share *= SLOWER
    return True
