"""One instant: which transition fires next, and whether the order of those reached together matters."""

from numba import njit

from hybrid.kernels.events.guards import (
    allowed,
    carry_rounding,
    widen_scale,
)
from hybrid.kernels.events.landing import land_beyond
from hybrid.kernels.events.moments import Place
from hybrid.kernels.events.onset import BY_SPEED, crosses_towards
from hybrid.kernels.events.resolution import stays_on_guard, underflows
from hybrid.kernels.events.sides import (
    FLOWED,
    LANDED,
    STARTED,
    Arrival,
    Before,
    Sides,
    beyond_at_start,
    end_instant,
    listed_behind,
    side_here,
    sides_of,
    take_sides,
)
from hybrid.kernels.types.codes import (
    NO_MODE,
    NO_TRANSITION,
    STALE,
)
from hybrid.kernels.types.kinds import INTEGER, REAL, TRUTH
from hybrid.kernels.types.layout import Method, Model, Run, Task, Work
from hybrid.kernels.types.options import KERNEL, exported
from hybrid.kernels.types.task import task_of

MOST_JUMPS = 50
# States with a relative difference below this are equal.
SAME = 1e-9


@exported(INTEGER, Model, Method, Run, Work)
def enter(model, method, run, work):
    """Take sides at every guard of the mode just entered; return a transition that must fire at once, if any.

    A transition is locked to this instant, not to its guard, if a reset took the state beyond its guard.
    Transitions that only fire at the start of a run come before all others.
    """
    mode, t, left = run.mode, run.phase, run.previous_mode
    if run.steps == 0:
        model.field(mode, t, run.y, model.parameters, work.field)
        widen_scale(model, run, work)
    came = STARTED if left == NO_MODE else LANDED
    fired = run.last_fired if run.jumps > 0 else NO_TRANSITION
    fires = take_sides(model, method, run, mode, t, run.y, Arrival(came, left, fired), sides_of(run), work)
    # Each of those that the start lies beyond fires, in listed order, while the run stays in the mode.
    first = model.first_at_start[mode] if came == STARTED else model.first_at_start[mode + 1]
    if left == mode:
        first = listed_behind(model, mode, run.last_fired)
    excluded = beyond_at_start(model, run, mode, t, run.y, first, work)
    if excluded != NO_TRANSITION:
        run.locked = 1
        return excluded
    run.locked = 0
    if fires >= 0:
        run.locked = 1 if run.on_guard[fires] == 0 else 0
    else:
        end_instant(model, mode, run.due)
    return fires


@exported(TRUTH, Task)
def rests_on_guard(task):
    """As :func:`hybrid.kernels.events.resolution.stays_on_guard`, for the driver."""
    return stays_on_guard(task.model, task.method, task.run, task.work)


@exported(INTEGER, Task)
def arrived(task):
    """The transition whose guard is reached or passed at the end of a run; it still belongs to this run.

    Sides and rounding are judged as by a run that starts here, which knows nothing of the step that led here,
    and takes a guard that it starts beyond as crossed: then one of the two runs fires the transition.
    """
    _, model, method, run, _, work = task_of(task)
    mode, t, found = run.mode, run.phase, NO_TRANSITION
    model.field(mode, t, run.y, model.parameters, work.field)
    for i in range(model.dimension):
        work.scale_before[i] = run.scale[i]
        run.scale[i] = abs(run.y[i])
    widen_scale(model, run, work)
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        before = run.side[transition]
        if found != NO_TRANSITION or before == 0 or run.on_guard[transition] != 0:
            continue
        if underflows(model, transition, t, run.y, t, run.y, work.scalar):
            continue
        place = Place(mode, t, run.y)
        now, _ = side_here(
            model, method, run, place, transition, STARTED, Before(before, 0, False), False, work
        )
        crossed = now == -before and crosses_towards(model.direction[transition], now)
        if crossed and allowed(model, transition, t, run.y, work.scalar):
            found = transition
    for i in range(model.dimension):
        run.scale[i] = max(run.scale[i], work.scale_before[i])
    return found


@njit(**KERNEL)
def settle_corner(model, method, run, first, out, work):
    """State ``(n,)`` after ``first`` and all jumps that it triggers at the same instant; returns the mode."""
    n, t = model.dimension, run.phase
    mode, fired = run.mode, first
    tried = Sides(run.tried_side, run.tried_due, run.tried_order)
    for i in range(run.side.shape[0]):
        tried.side[i], tried.due[i], tried.zero[i] = run.side[i], run.due[i], run.on_guard[i]
    for i in range(n):
        out[i], work.trial[i] = run.y[i], run.scale[i]
    for _ in range(MOST_JUMPS):
        tried.due[fired] = 0
        model.reset(fired, t, out, model.parameters, work.state)
        if model.target[fired] not in (NO_MODE, mode):
            carry_rounding(model, run, fired, t, out, work.state, work.reset_jacobian, work.settled)
        for i in range(n):
            out[i] = work.state[i]
            run.scale[i] = max(run.scale[i], abs(out[i]))
        left, mode = mode, model.target[fired]
        if mode == NO_MODE:
            break
        fired = take_sides(model, method, run, mode, t, out, Arrival(LANDED, left, fired), tried, work)
        if fired < 0:
            break
    for i in range(n):
        run.scale[i] = work.trial[i]
    return mode


@njit(**KERNEL)
def order_matters(model, method, run, one, other, work):
    """Whether firing ``one`` or ``other`` first leads to different states or modes."""
    mode_one = settle_corner(model, method, run, one, work.error, work)
    mode_other = settle_corner(model, method, run, other, work.second_error, work)
    if mode_one != mode_other:
        return True
    for i in range(model.dimension):
        scale = max(run.scale[i], abs(work.error[i]))
        if abs(work.error[i] - work.second_error[i]) > SAME * scale:
            return True
    return False


@njit(**KERNEL)
def first_due(model, method, run, work):
    """The first transition that is due and allowed; whether it matters which one fires first is counted."""
    t, chosen, first, together, matters = run.phase, NO_TRANSITION, NO_TRANSITION, 0, False
    for slot in range(model.first_outgoing[run.mode], model.first_outgoing[run.mode + 1]):
        other = model.outgoing[slot]
        if run.due[other] == 0 or not allowed(model, other, t, run.y, work.scalar):
            continue
        if chosen == NO_TRANSITION:
            chosen = other
        if model.marker[other] == 1:
            continue
        together += 1
        if together == 1:
            first = other
        elif not matters:
            matters = order_matters(model, method, run, first, other, work)
    run.order_mattered += 1 if matters else 0
    return chosen


@exported(INTEGER, Task, INTEGER, INTEGER, REAL)
def first_in_order(task, fired, stop_cycle, stop_phase):
    """Of the transitions due where the flow has reached the guard of ``fired``, the one listed first.

    The run lands beyond the guards of all that are due. Notes whether order matters. None if ``fired`` may
    not fire, and no other is due: the run then goes on from this point. What comes before
    the guard there, and what comes after it, may differ by rounding alone, so its side is left to the next
    step: the crossing is behind, and cannot be found where it was refused.
    """
    _, model, method, run, _, work = task_of(task)
    mode = run.mode
    direction = model.direction[fired]
    beyond = direction if direction != 0 else -run.side[fired]
    land_beyond(model, run, fired, beyond, stop_cycle, stop_phase, work)
    flowed = Arrival(FLOWED, mode, NO_TRANSITION)
    take_sides(model, method, run, mode, run.phase, run.y, flowed, sides_of(run), work)
    run.side[fired] = beyond
    if run.on_guard[fired] == 0:
        run.on_guard[fired] = BY_SPEED
    run.due[fired] = 1
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        other = model.outgoing[slot]
        if run.due[other] == 1 and other != fired:
            land_beyond(model, run, other, run.side[other], stop_cycle, stop_phase, work)
    chosen = first_due(model, method, run, work)
    if chosen == NO_TRANSITION:
        run.side[fired] = 0
        for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
            other = model.outgoing[slot]
            if run.due[other] == 1:
                run.side[other], run.due[other] = 0, 0
        run.stage, run.last_step = STALE, 0.0
    return chosen
