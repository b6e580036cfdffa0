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
def keep_largest(method, run, i, change, other):
    """Keep a change of component ``i``, whose size is that over the last step or the ``other`` number."""
    tolerance = method.atol + method.rtol * max(run.scale[i], abs(other))
    if abs(change) > run.lateness * tolerance:
        run.lateness = abs(change) / tolerance


@exported(None, Model, Method, Run, REAL, Work)
def late_step(model, method, run, span, work):
    """Keep in ``run.lateness`` what the rounding of the time makes of the field over a step."""
    t, later = run.phase, run.phase + EPSILON * abs(run.phase)
    model.field(run.mode, t, run.y, model.parameters, work.field)
    model.field(run.mode, later, run.y, model.parameters, work.field_after)
    for i in range(model.dimension):
        change = span * (work.field_after[i] - work.field[i])
        keep_largest(method, run, i, change, span * work.field[i])


@exported(None, Model, Method, Run, INTEGER, Work)
def late_jump(model, method, run, transition, work):
    """Keep in ``run.lateness`` what the rounding of the time makes of the state after the pending jump.

    A guard is crossed at another time, and the reset is another one. The time alone is no error of the state:
    a marker changes nothing.
    """
    target = model.target[transition]
    if target == NO_MODE or model.marker[transition] == 1:
        return
    t, rounding = run.phase, EPSILON * abs(run.phase)
    before, after, image = work.field, work.field_after, work.new
    model.field(run.mode, t, run.y, model.parameters, before)
    speed = guard_speed(model, transition, t, run.y, before, work.gradient)
    value = guard_value(model, transition, t, run.y, work.scalar)
    change = guard_value(model, transition, t + rounding, run.y, work.scalar) - value
    delay = change / speed if abs(change) < abs(speed) * run.since_entry else run.since_entry
    model.reset(transition, t, run.y, model.parameters, image)
    model.field(target, t, image, model.parameters, after)
    for i in range(model.dimension):
        work.state[i] = run.y[i] + delay * before[i]
    model.reset(transition, t + rounding, work.state, model.parameters, work.trial)
    for i in range(model.dimension):
        keep_largest(method, run, i, work.trial[i] - image[i] - delay * after[i], image[i])
