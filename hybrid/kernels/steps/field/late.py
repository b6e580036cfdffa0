"""What the rounding of a late time does to a run, in tolerances.

Far from zero, neighbouring floating-point numbers are far apart. A field, guard or reset that depends on time
is then evaluated at another time than the state has, and no error estimate sees it. The change to the next
number shows how much this matters.
"""

from numba import njit

from hybrid.kernels.events.guards import guard_speed, guard_value
from hybrid.kernels.types.codes import NO_MODE
from hybrid.kernels.types.kinds import INTEGER, REAL
from hybrid.kernels.types.layout import EPSILON, Method, Model, Run, Work
from hybrid.kernels.types.options import INLINE, exported


@njit(**INLINE)
def is_late(method, run):
    """Whether the rounding of the time may matter to what changes by its own size over a step.

    Short steps, and flights that chatter, are no measure: there the state is as hard to know at any time.
    """
    return method.rtol * run.longest_step < EPSILON * abs(run.phase)


@njit(**INLINE)
def _keep_largest(method, run, i, change, size):
    """Keep a change of component ``i``, whose size is that over the last step or the ``size`` given."""
    tolerance = method.atol + method.rtol * max(run.scale[i], abs(size))
    run.lateness = max(run.lateness, abs(change) / tolerance)


@exported(None, Model, Method, Run, REAL, Work)
def late_step(model, method, run, span, work):
    """Keep in ``run.lateness`` what the rounding of the time makes of the field over a step."""
    t, before, after = run.phase, work.field, work.field_after
    model.field(run.mode, t, run.y, model.parameters, before)
    model.field(run.mode, t + EPSILON * abs(t), run.y, model.parameters, after)
    for i in range(model.dimension):
        _keep_largest(method, run, i, span * (after[i] - before[i]), span * before[i])


@exported(None, Model, Method, Run, INTEGER, Work)
def late_jump(model, method, run, transition, work):
    """Keep in ``run.lateness`` what the rounding of the time makes of the state after the pending jump.

    A guard is crossed at another time, and the reset is another one. The time alone is no error of the state:
    a marker changes nothing.
    """
    target, t = model.target[transition], run.phase
    if target == NO_MODE or model.marker[transition] == 1:
        return
    before, after, image, later = work.field, work.field_after, work.new, t + EPSILON * abs(t)
    model.field(run.mode, t, run.y, model.parameters, before)
    speed = guard_speed(model, transition, t, run.y, before, work.gradient)
    change = guard_value(model, transition, later, run.y, work.scalar)
    change -= guard_value(model, transition, t, run.y, work.scalar)
    delay = change / speed if abs(change) < abs(speed) * run.since_entry else run.since_entry
    model.reset(transition, t, run.y, model.parameters, image)
    model.field(target, t, image, model.parameters, after)
    for i in range(model.dimension):
        work.state[i] = run.y[i] + delay * before[i]
    model.reset(transition, later, work.state, model.parameters, work.trial)
    for i in range(model.dimension):
        _keep_largest(method, run, i, work.trial[i] - image[i] - delay * after[i], image[i])
