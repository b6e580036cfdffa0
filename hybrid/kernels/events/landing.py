"""An event lands on the far side: beyond its guard, by more than the rounding of the guard there.

The root of a guard on a step is known up to rounding, on this side of zero or on that. A reset, a condition
or another guard may ask for the same quantity: ``mod``, ``floor``, ``sign``, a comparison. Each of them must
find the crossing made. So the state of an event is the first on the flow at which the guard has the far sign
by more than its rounding, or, where the guard or a force jumps, at which it has jumped.

The flow needs time for that, and a slow crossing would be late. So an event stays at its root if neither its
guard nor its reset may jump there, and no condition in its mode changes on that way.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.clock import forward, set_clock, time_left
from hybrid.kernels.events.guards import (
    ROUNDING_OF_STATE,
    allowed,
    guard_speed,
    guard_value,
    may_jump,
    rounding_band,
    size_of_time,
)
from hybrid.kernels.events.moments import moment_of_rounding
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import KERNEL

# The guard of an event is beyond zero by this share of its band, one and a half units in the last place.
MOST_BEYOND = 1.5 / ROUNDING_OF_STATE
# A landing is no farther from its guard, or from its jump, than so many times the rounding of the state.
MOST_BANDS = 64.0
# The flow goes on through the guard if its speed keeps this share on the way.
SPEED_KEPT = 0.5


@njit(**KERNEL)
def _is_beyond(model, run, transition, side, t, x, work):
    """Whether a guard at ``x`` has the sign ``side`` by more than its rounding, or after its jump."""
    value = guard_value(model, transition, t, x, work.scalar) * side
    if not value > 0.0:
        return False
    if may_jump(model, run, transition, t, x, work):
        return True
    model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    return value >= MOST_BEYOND * rounding_band(model, run, transition, t, x, work)


@njit(**KERNEL)
def _goes_on(model, transition, mode, t, x, side, speed, work):
    """Whether a guard keeps its ``speed`` up to ``x``, as at a crossing deeper than its rounding."""
    model.field(mode, t, x, model.parameters, work.field_after)
    return guard_speed(model, transition, t, x, work.field_after, work.gradient) * side >= SPEED_KEPT * speed


@njit(**KERNEL)
def _decides(model, run, transition, t, later, x, work):
    """Whether a condition in the mode changes from the state at ``t`` to ``x`` at the time ``later``."""
    for slot in range(model.first_outgoing[run.mode], model.first_outgoing[run.mode + 1]):
        other = model.outgoing[slot]
        before = allowed(model, other, t, run.y, work.scalar)
        if before != allowed(model, other, later, x, work.scalar):
            return True
    return False


@njit(**KERNEL)
def _shortest_span(model, run, t, work):
    """A time in which the first component, or the clock, moves by half of its rounding."""
    span = size_of_time(model, t)
    for i in range(model.dimension):
        size, pace = run.scale[i], abs(work.field[i])
        if size > 0.0 and pace > 0.0:
            span = min(span, size / pace)
    return 0.5 * EPSILON * span


@njit(**KERNEL)
def _advance(model, run, transition, side, jumps, stop_cycle, stop_phase, work):
    """``land_beyond`` with the sizes of the state in ``run.scale``; ``jumps`` says that the guard may."""
    n, mode, t = model.dimension, run.mode, run.phase
    if _is_beyond(model, run, transition, side, t, run.y, work):
        return
    model.field(mode, t, run.y, model.parameters, work.field)
    speed = guard_speed(model, transition, t, run.y, work.field, work.gradient) * side
    moment = moment_of_rounding(model, run, t, work)
    if 0.0 < speed < math.inf:
        moment = max(moment, rounding_band(model, run, transition, t, run.y, work) / speed)
    # A landing takes no longer than the stay that it ends. Each try is twice as long as the last.
    longest = max(run.since_entry, MOST_BANDS * EPSILON * size_of_time(model, t))
    span = min(_shortest_span(model, run, t, work), longest)
    longest = min(MOST_BANDS * moment, longest)
    cycle, low = run.cycle, run.phase_low
    while 0.0 < span <= longest:
        for i in range(n):
            work.state[i] = run.y[i] + span * work.field[i]
        forward(run, model.period, span)
        if time_left(model, run, stop_cycle, stop_phase) < 0.0:
            set_clock(run, stop_cycle, stop_phase)
        if _is_beyond(model, run, transition, side, run.phase, work.state, work):
            if speed > 0.0 and not _goes_on(
                model, transition, mode, run.phase, work.state, side, speed, work
            ):
                break
            if not (
                jumps
                or model.jumping_reset[transition] == 1
                or _decides(model, run, transition, t, run.phase, work.state, work)
            ):
                break
            for i in range(n):
                run.y[i] = work.state[i]
            run.since_entry += span
            return
        run.cycle, run.phase, run.phase_low = cycle, t, low
        span *= 2.0
    run.cycle, run.phase, run.phase_low = cycle, t, low


@njit(**KERNEL)
def land_beyond(model, run, transition, side, stop_cycle, stop_phase, work):
    """Move a run along the flow until the guard that it has reached has the sign ``side``.

    The rounding that counts is that of the guard at this state, not that of the way there. Nothing is moved
    where nothing jumps, nor where the guard dips to that side by less than its rounding. Markers change
    nothing. The clock does not pass the stop of the run. Tangent vectors stay: they change by rounding.
    """
    if side == 0 or model.marker[transition] == 1:
        return
    t = run.phase
    jumps = may_jump(model, run, transition, t, run.y, work)
    if not jumps and model.jumping_reset[transition] == 0 and model.conditional[run.mode] == 0:
        return
    if not jumps:
        value = guard_value(model, transition, t, run.y, work.scalar)
        model.guard_gradient(transition, t, run.y, model.parameters, work.gradient)
        if not abs(value) <= MOST_BANDS * rounding_band(model, run, transition, t, run.y, work):
            return
    for i in range(model.dimension):
        work.error[i], run.scale[i] = run.scale[i], abs(run.y[i])
    _advance(model, run, transition, side, jumps, stop_cycle, stop_phase, work)
    for i in range(model.dimension):
        run.scale[i] = work.error[i]
