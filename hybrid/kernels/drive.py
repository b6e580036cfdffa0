"""The driver: smooth steps, events, jumps, until a given time. All runs are calls of ``advance``."""

import math
from typing import NamedTuple

from numba import njit

from hybrid.kernels.arithmetic.clock import forward, set_clock, time_before, time_left, time_until
from hybrid.kernels.arithmetic.tables import knots_passed
from hybrid.kernels.events.clocks import (
    go_to_tick,
    next_tick,
    number_of_tick,
    pass_tick,
    show_row,
    ticking,
    turned_to,
    wind,
)
from hybrid.kernels.events.guards import (
    guard_value,
    has_program,
    rounding_band,
)
from hybrid.kernels.events.onset import BY_SPEED
from hybrid.kernels.events.renewed import is_cut_short, renew
from hybrid.kernels.limit.go import may_accumulate
from hybrid.kernels.steps.field.jumps import note_start
from hybrid.kernels.steps.field.late import is_late
from hybrid.kernels.steps.series import series_step
from hybrid.kernels.steps.step import rates_by_jacobian
from hybrid.kernels.types.codes import (
    ACCUMULATION,
    DONE,
    ENTERING,
    GO_ON,
    INCOMPLETE,
    MANY_STEPS,
    MAX_JUMPS,
    MAX_STEPS,
    NO_MODE,
    NO_TRANSITION,
    NON_FINITE,
    RECORD_FULL,
    RESTING,
    RUNGE_KUTTA,
    STALE,
    STEP_TOO_SMALL,
    STUCK,
    TERMINAL,
)
from hybrid.kernels.types.kinds import INTEGER, REAL
from hybrid.kernels.types.layout import EPSILON, Parts, Task
from hybrid.kernels.types.options import INLINE, KERNEL, exported

# More jumps than this at one instant, in total or per transition, count as endless.
MOST_JUMPS_AT_ONCE = 1000
MOST_JUMPS_EACH = 100
# By these shares time or state must have moved after many steps: of the time left, and of the size of a
# component. A run whose state is at rest, and that needs more than 10^7 such steps, does not get on.
OF_TIME = 1e-3
OF_STATE = 1e-4
# The time of a point of a table that repeats is rounded where whole periods are added.
ROUNDING_OF_KNOT = 4.0 * EPSILON
# A landing may be this many times as far from its guard as the rounding of the state.
MOST_ROUNDING = 64.0


@njit(**KERNEL)
def finite(run, length):
    """Whether the first ``length`` entries of the run's vector are finite."""
    total = 0.0
    for i in range(length):
        total += abs(run.y[i])
    return total < math.inf


@njit(**KERNEL)
def fire(parts, task, stop_cycle, stop_phase, max_jumps):
    """Make the pending jump, and follow a chatter to its limit; returns ``GO_ON``, or why the run ends."""
    model, run, record = task.model, task.run, task.record
    if run.jumps >= max_jumps:
        return MAX_JUMPS
    # Room for one jump more: this one may complete a chatter, whose limit is a jump too.
    if 0 < record.jump_phase.shape[0] <= record.jumps + 1:
        return RECORD_FULL
    if run.jumps_here > max(MOST_JUMPS_AT_ONCE, MOST_JUMPS_EACH * model.target.shape[0]):
        return STUCK
    fired = run.pending
    run.pending = NO_TRANSITION
    if model.timed_jump[fired] == 1 and run.since_entry > 0.0 and is_late(task.method, run):
        parts.late_jump(model, task.method, run, fired, task.work)
    if model.clock[fired] != 0:
        jump_at_tick(parts, task, fired)
    elif not parts.jump_plainly(task, fired):
        parts.jump(task, fired)
    begin_stretch(model, run, time_left(model, run, stop_cycle, stop_phase))
    if model.target[fired] == NO_MODE:
        return TERMINAL
    if not may_accumulate(model, run, fired):
        return GO_ON
    if parts.complete == 0:
        return INCOMPLETE
    remaining = min(time_left(model, run, stop_cycle, stop_phase), next_tick(model, run)[1])
    ended = parts.finish_chatter(task, fired, remaining)
    if ended and model.accumulates_to[run.last_fired] == NO_MODE:
        return ACCUMULATION
    return GO_ON


@njit(**KERNEL)
def jump_at_tick(parts, task, fired):
    """Make a jump at a tick, and count it if its reset gives the turn to another transition of the clock."""
    model, run = task.model, task.run
    # A new stretch begins with the jump, so the state before it may be kept here.
    for i in range(model.dimension):
        run.stretch[i] = run.y[i]
    # The tick is counted as over.
    k = number_of_tick(model, run, fired) - 1
    show_row(model, run, fired, k)
    if is_cut_short(model, run, fired, k):
        # It happens at the time of the jump that has cut it short.
        run.locked = 1
    parts.jump(task, fired)
    other = turned_to(model, run, fired, run.stretch, task.work.scalar)
    show_row(model, run, fired, k)
    if other != NO_TRANSITION:
        run.turned += 1
        run.turned_to = other


@njit(**KERNEL)
def enter_mode(parts, task):
    """Begin a stay in a mode: take the side of every guard; returns ``GO_ON``, or why the run ends."""
    model, run, mode = task.model, task.run, task.run.mode
    if not finite(run, model.dimension * (1 + task.tangents)):
        return NON_FINITE
    if model.moving.shape[0] > 0 and not renew(model, run, task.work.scalar):
        return NON_FINITE
    if model.clocks.shape[0] > 0:
        wind(model, run)
    if run.clear == 1:
        take_clear_sides(model, run)
        begin_stay(run, mode)
        return GO_ON
    fires = parts.enter(model, task.method, run, task.work)
    if fires == RESTING or (fires == NO_TRANSITION and parts.rests_on_guard(task)):
        if model.accumulates_to[run.last_fired] == NO_MODE:
            run.at_rest = 1
            return ACCUMULATION
        parts.rest(task)
        return GO_ON
    if fires != NO_TRANSITION:
        run.pending = fires
        return GO_ON
    begin_stay(run, mode)
    return GO_ON


@njit(**INLINE)
def take_clear_sides(model, run):
    """Take the sides of a mode that a plain jump has entered (``jumps.plain``)."""
    for slot in range(model.first_outgoing[run.mode], model.first_outgoing[run.mode + 1]):
        other = model.outgoing[slot]
        run.side[other], run.on_guard[other] = run.tried_side[other], run.tried_order[other]
        run.due[other] = 0
    run.clear = 0


@njit(**INLINE)
def begin_stay(run, mode):
    """Begin a stay in a mode whose sides have been taken."""
    if mode != run.previous_mode:
        run.next_step = run.first_step[mode]
        run.first_step[mode] = 0.0
    run.last_step = 0.0
    run.stage = STALE


@njit(**KERNEL)
def begin_stretch(model, run, remaining):
    """Remember where a run is: from here it has to get on."""
    run.stretch_steps, run.stretch_moved, run.stretch_left = run.steps, 0, remaining
    for i in range(model.dimension):
        run.stretch[i] = run.y[i]


@njit(**KERNEL)
def gets_on(model, method, run, remaining):
    """Whether a run gets on: many steps have moved its time or its state.

    Beside a place where the field jumps or ends, steps may be as short as the tolerances, and the state stays
    within them. Short steps that lead somewhere get on, and so does any run that makes jumps.
    """
    for i in range(model.controlled if run.stretch_moved == 0 else 0):
        y, start = run.y[i], run.stretch[i]
        if abs(y - start) > OF_STATE * max(abs(y), abs(start)) + MANY_STEPS * method.atol:
            run.stretch_moved = 1
            break
    if run.steps - run.stretch_steps < MANY_STEPS:
        return True
    ahead = not (1.0 - OF_TIME) * run.stretch_left < remaining <= run.stretch_left
    if not (ahead or run.stretch_moved == 1):
        return False
    begin_stretch(model, run, remaining)
    return True


@njit(**KERNEL)
def is_full(record):
    """Whether the next step might not fit into the record."""
    if 0 < record.step_phase.shape[0] <= record.steps + 1:
        return True
    return 0 < record.grazing_phase.shape[0] == record.grazings


@njit(**KERNEL)
def remember_scale(model, run, work):
    """Keep the sizes of the state's components in ``work.scale_before`` if the state is on a guard."""
    for slot in range(model.first_outgoing[run.mode], model.first_outgoing[run.mode + 1]):
        if run.on_guard[model.outgoing[slot]] > 0:
            for i in range(model.dimension):
                work.scale_before[i] = run.scale[i]
            return True
    return False


@njit(**KERNEL)
def keep_scale(model, run, on_guard, t, work):
    """Make the sizes at a landing such that the guard counts as zero there.

    A flight from a guard back to it, no higher than the rounding of the landing before it, ends as far from
    the guard as it has begun: the sizes at its start tell. And where a Runge-Kutta step has landed on a bent
    guard, the rounding of the step may be a few times that of the state.
    """
    fired = run.pending
    bent = model.propagator[run.mode] == RUNGE_KUTTA and model.affine_guard[fired] == 0
    if not (on_guard or bent):
        return
    value = abs(guard_value(model, fired, t, run.y, work.scalar))
    model.guard_gradient(fired, t, run.y, model.parameters, work.gradient)
    band = rounding_band(model, run, fired, t, run.y, work)
    if on_guard and value > band:
        for i in range(model.dimension):
            run.scale[i] = max(run.scale[i], work.scale_before[i])
        band = rounding_band(model, run, fired, t, run.y, work)
    if bent and band < value <= MOST_ROUNDING * band:
        for i in range(model.dimension):
            run.scale[i] *= 2.0 * value / band


@njit(**KERNEL)
def step(parts, task, remaining):
    """One step by the propagator of the mode; returns a code and the time that the step took."""
    model, run, work = task.model, task.run, task.work
    on_guard = remember_scale(model, run, work)
    watched = task.tangents > 0 and model.abrupt[run.mode] == 1
    if watched:
        note_start(model, run, work)
    code, span = step_by_propagator(parts, task, remaining)
    if code == GO_ON and watched:
        parts.look_back(model, task.method, run, span, work)
    if code == GO_ON and run.pending != NO_TRANSITION:
        keep_scale(model, run, on_guard, run.phase + span, work)
    return code, span


@njit(**KERNEL)
def step_by_propagator(parts, task, remaining):
    """``step``, without regard to the rounding of the state."""
    model, run = task.model, task.run
    if model.propagator[run.mode] == RUNGE_KUTTA:
        return parts.runge_kutta_step(task, remaining)
    code, span = series_step(task, remaining)
    if code == NON_FINITE and model.fragile[run.mode] == 1:
        run.stage = STALE
        code, span = parts.runge_kutta_step(task, remaining)
        run.stage = STALE
    return code, span


@njit(**KERNEL)
def fires_at_tick(parts, task, stop_cycle, stop_phase):
    """The transition that fires first where a clock ticks: a clock, or one whose guard is reached as well."""
    model, run = task.model, task.run
    clock = ticking(model, run, task.work)
    if clock == NO_TRANSITION:
        return clock
    fired = parts.arrived(task) if run.since_entry > 0.0 else NO_TRANSITION
    if fired != NO_TRANSITION:
        fired = parts.first_in_order(task, fired, stop_cycle, stop_phase)
    if fired != NO_TRANSITION and fired < clock:
        return fired
    pass_tick(model, run, clock, True)
    return clock


@njit(**KERNEL)
def next_knot(model, run):
    """The next time at which a table of the mode has a point, and the last moment before it.

    Both are infinite if no point is left. The times of tables that repeat are known up to rounding.
    """
    last, knot = math.inf, math.inf
    for group in range(model.first_group[run.mode], model.first_group[run.mode + 1]):
        repeat, first, stop = model.repeat[group], model.first_knot[group], model.first_knot[group + 1]
        within = run.phase % repeat if repeat > 0.0 else run.phase
        place = first + knots_passed(model.knots, first, stop, within)
        if place == stop:
            continue
        at, before = model.knots[place], model.before_knots[place]
        if repeat > 0.0:
            middle = run.phase - within + at
            apart = ROUNDING_OF_KNOT * abs(middle) + (at - before)
            at, before = middle + apart, middle - apart
        last, knot = min(last, before), min(knot, at)
    return last, knot


@njit(**KERNEL)
def room_before_knot(model, run, remaining):
    """How long the next step may be, which ends at the last moment before the next knot; and that knot."""
    last, knot = next_knot(model, run)
    return (min(time_before(run.phase, last), remaining) if last < math.inf else remaining), knot


@njit(**KERNEL)
def pass_knot(task, knot):
    """Move a run from the last moment before a knot to the knot, from which the piece behind it holds.

    No step looks at the knot itself, so the moment before belongs to the piece that ends there.
    """
    model, run, out = task.model, task.run, task.work.error
    gap = time_until(run, knot, 0.0)
    rates_by_jacobian(model, run.mode, run.phase, run.y, task.tangents, task.work.jacobian, out)
    for i in range(model.dimension * (1 + task.tangents)):
        run.y[i] += gap * out[i]
    run.since_entry += gap
    set_clock(run, run.cycle, knot)
    forward(run, model.period, 0.0)
    run.last_step = 0.0
    run.stage = STALE


@njit(**KERNEL)
def go_forward(model, run, span):
    """Count the time of a step."""
    forward(run, model.period, span)
    run.since_entry += span
    run.longest_step = max(run.longest_step, span)


@njit(**KERNEL)
def meet(task, clock, knot, at_knot):
    """Set the clock of a run whose step has ended at the tick of a clock, or before a knot."""
    if at_knot:
        pass_knot(task, knot)
    else:
        go_to_tick(task.model, task.run, clock)


class Room(NamedTuple):
    """How long the next step may be.

    So much time ``remains`` until the stop, ``until`` the tick of a ``clock`` if that is before, and so much
    in ``all`` until the last moment before a ``knot``.
    """

    remains: REAL
    until: REAL
    all: REAL
    knot: REAL
    clock: INTEGER


NO_ROOM = Room(0.0, 0.0, 0.0, 0.0, NO_TRANSITION)


@njit(**KERNEL)
def prepare(parts, task, stop_cycle, stop_phase, max_steps, max_jumps):
    """Bring a run to where it can take its next step: GO_ON and its room there, or why the run ends."""
    model, run = task.model, task.run
    if run.horizon == 0.0 and run.steps == 0:
        run.horizon = max(time_left(model, run, stop_cycle, stop_phase), 0.0)
    while True:
        if run.pending != NO_TRANSITION:
            code = fire(parts, task, stop_cycle, stop_phase, max_jumps)
            if code != GO_ON:
                return code, NO_ROOM
            continue
        if run.stage == ENTERING:
            code = enter_mode(parts, task)
            if code != GO_ON:
                return code, NO_ROOM
            continue
        remaining = time_left(model, run, stop_cycle, stop_phase)
        clock, tick, band = NO_TRANSITION, math.inf, 0.0
        if model.clocks.shape[0] > 0:
            clock, tick, band = next_tick(model, run)
        if tick <= band:
            run.pending = fires_at_tick(parts, task, stop_cycle, stop_phase)
            continue
        if remaining <= 0.0 and run.distant == 1:
            return DONE, NO_ROOM
        if remaining <= 0.0:
            fired = parts.arrived(task)
            if fired == NO_TRANSITION:
                return DONE, NO_ROOM
            run.pending = parts.first_in_order(task, fired, stop_cycle, stop_phase)
            continue
        if is_full(task.record):
            return RECORD_FULL, NO_ROOM
        if run.steps >= max_steps:
            return MAX_STEPS, NO_ROOM
        # A tick that is as good as at the end is there.
        until = remaining if tick + band >= remaining else tick
        room, knot = until, math.inf
        if model.knots.shape[0] > 0:
            room, knot = room_before_knot(model, run, until)
        if not room > 0.0:
            pass_knot(task, knot)
            continue
        return GO_ON, Room(remaining, until, room, knot, clock)


@njit(**INLINE)
def reaches_one_guard(model, run):
    """Whether a step with one crossing, which is certain, ends at it and may fire no other transition.

    Then its guard is crossed, and nothing else has to be asked.
    """
    fired, mode = run.pending, run.mode
    if fired == NO_TRANSITION or model.conditional[mode] == 1 or model.jumping_reset[fired] == 1:
        return False
    if has_program(model, fired):
        return False
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        other = model.outgoing[slot]
        # A guard that was zero at the start of the step may not have left zero by more than rounding.
        if other != fired and (model.surface[other] == model.surface[fired] or run.order_before[other] > 0):
            return False
    run.side[fired] = -run.side[fired]
    run.on_guard[fired], run.due[fired] = BY_SPEED, 1
    return True


@njit(**KERNEL)
def complete(parts, task, room, span, stop_cycle, stop_phase, alone):
    """Count the time of a step, which has moved the state; returns GO_ON, or why the run ends.

    An event may be known to be ``alone``: then it is the one that fires.
    """
    go_forward(task.model, task.run, span)
    return conclude(parts, task, room, span, span, stop_cycle, stop_phase, alone)


@njit(**KERNEL)
def conclude(parts, task, room, span, length, stop_cycle, stop_phase, alone):
    """``complete`` for a step of this ``length`` whose time is counted; its ``room`` is ``span`` before."""
    model, run = task.model, task.run
    if not gets_on(model, task.method, run, room.remains):
        return STEP_TOO_SMALL
    if model.timed[run.mode] == 1 and is_late(task.method, run):
        parts.late_step(model, task.method, run, length, task.work)
    if task.tangents > 0 and task.orthonormal != 0 and length > 0.0 and span < room.remains:
        parts.keep_apart(model, run, run.mode, task.tangents, task.work.jacobian)
    fired = run.pending
    if span > room.remains or (span >= room.remains and fired == NO_TRANSITION):
        set_clock(run, stop_cycle, stop_phase)
    elif span >= room.all and (fired == NO_TRANSITION or room.all == room.until < room.remains):
        # A crossing that rounding puts at the tick or behind it does not pass the tick.
        meet(task, room.clock, room.knot, room.all < room.until)
    if fired != NO_TRANSITION and not alone:
        run.pending = parts.first_in_order(task, fired, stop_cycle, stop_phase)
    return GO_ON


@exported(INTEGER, Parts, Task, INTEGER, REAL, INTEGER, INTEGER)
def advance(parts, task, stop_cycle, stop_phase, max_steps, max_jumps):
    """Advance a run to the time ``stop_cycle`` periods and ``stop_phase``; returns a code.

    The run can be taken up again after ``RECORD_FULL`` once the record has been emptied, after ``MAX_STEPS``
    and ``MAX_JUMPS`` with larger limits; after ``INCOMPLETE`` where this call began, with all parts.
    """
    while True:
        code, room = prepare(parts, task, stop_cycle, stop_phase, max_steps, max_jumps)
        if code != GO_ON:
            return code
        task.run.distant = task.run.crossings = 0
        code, span = step(parts, task, room.all)
        if code != GO_ON:
            return int(code)
        alone = task.run.crossings == 1 and reaches_one_guard(task.model, task.run)
        code = complete(parts, task, room, span, stop_cycle, stop_phase, alone)
        if code != GO_ON:
            return code
