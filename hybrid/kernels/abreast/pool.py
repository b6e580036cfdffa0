"""Runs that wait in a pool until others are in the same mode, and then take a step together."""

from numba import njit

from hybrid.kernels.abreast.ashore import evaluate_stops, largest_of_tangent, look_ahead, look_out, reach_end
from hybrid.kernels.abreast.lanes import come_aboard, leave_lane, places_in
from hybrid.kernels.abreast.rows import bits_of, mask_of
from hybrid.kernels.abreast.step import step_abreast
from hybrid.kernels.arithmetic.clock import set_clock
from hybrid.kernels.drive import (
    NO_ROOM,
    Room,
    conclude,
    go_forward,
    prepare,
    reaches_one_guard,
    remember_scale,
)
from hybrid.kernels.events.onset import BY_SPEED
from hybrid.kernels.steps.field.late import is_late
from hybrid.kernels.types.abreast import ONWARD, ROOM, STEPS, Abreast, Crew
from hybrid.kernels.types.codes import (
    ABREAST,
    DONE,
    GO_ON,
    MAX_STEPS,
    NO_MODE,
    NO_TRANSITION,
    RUNGE_KUTTA,
)
from hybrid.kernels.types.kinds import INTEGER
from hybrid.kernels.types.layout import ADVANCE, Parts, Task
from hybrid.kernels.types.numba_door.addressed import structure_at
from hybrid.kernels.types.options import INLINE, KERNEL, exported

task_at = structure_at(Task)
# Steps that a run takes at once in a mode in which none are taken abreast.
ALONE = 16
NOBODY = -1


@njit(**KERNEL)
def begins_plainly(model, method, run, sea):
    """Whether the next step of a run may be taken abreast, as far as its start tells."""
    mode = run.mode
    if sea.able[mode] == 0 or model.propagator[mode] == RUNGE_KUTTA:
        return False
    if model.timed[mode] == 1 and is_late(method, run):
        return False
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        if run.side[transition] == 0 or run.on_guard[transition] > BY_SPEED:
            return False
    return True


@njit(**INLINE)
def next_waiting(crew, queue):
    """The run that has waited longest, which waits no more: so all get on alike, and lanes stay full."""
    r = crew.waiting[queue, crew.heads[queue]]
    crew.heads[queue] = (crew.heads[queue] + 1) % crew.waiting.shape[1]
    crew.counts[queue] -= 1
    return r


@njit(**INLINE)
def board(sea, crew, mode, row, r):
    """Let a run into an empty lane of its mode."""
    crew.aboard[mode, row] = r
    task = task_at(crew.tasks[r])
    places = places_in(task.model, task.tangents, crew.parameters, mode)
    come_aboard(sea.lanes[mode], places, task, crew.rooms[r, 2], row)


@njit(**KERNEL)
def go_to_next_step(parts, task, crew, onward, r, code):
    """Bring a run to where it takes its next step: GO_ON and its room there; or to its end, and its code.

    The ``code`` is that with which it has come to its time, or ended; GO_ON where that is to be seen.
    """
    room = NO_ROOM
    while True:
        if code == GO_ON:
            code, room = prepare(
                parts, task, crew.cycles[r], crew.phases[r], crew.max_steps[r], crew.max_jumps[r]
            )
            if code == GO_ON:
                return code, room
        code = onward(parts, task, crew, r, code)
        if code != GO_ON:
            return code, room


@njit(**KERNEL)
def queue_up(sea, crew, r, room, left, row):
    """Let a run wait for its next step, which has this ``room``.

    A run that goes on in the mode that it has ``left`` goes back into its lane, in that ``row``.
    """
    task, queue = task_at(crew.tasks[r]), crew.aboard.shape[0]
    if crew.refused[r] == 0 and begins_plainly(task.model, task.method, task.run, sea):
        queue = task.run.mode
        crew.rooms[r, 0], crew.rooms[r, 1] = room.remains, room.until
        crew.rooms[r, 2], crew.rooms[r, 3] = room.all, room.knot
        crew.clocks[r] = room.clock
        if queue == left:
            board(sea, crew, left, row, r)
            return
    crew.waiting[queue, (crew.heads[queue] + crew.counts[queue]) % crew.waiting.shape[1]] = r
    crew.counts[queue] += 1


@njit(**KERNEL)
def muster(parts, sea, crew, onward, r, code, left, row):
    """Bring a run to where it takes its next step, and let it wait there; or to its end (``queue_up``)."""
    code, room = go_to_next_step(parts, task_at(crew.tasks[r]), crew, onward, r, code)
    if code == GO_ON:
        queue_up(sea, crew, r, room, left, row)
    else:
        crew.codes[r] = code


@njit(**KERNEL)
def step_alone(advance, parts, sea, crew, onward, r):
    """One step of a run that is not taken abreast, with what follows at its end."""
    task = task_at(crew.tasks[r])
    more = 1 if sea.able[task.run.mode] == 1 else ALONE
    most = min(crew.max_steps[r], task.run.steps + more)
    crew.alone += 1
    crew.refused[r] = 0
    code = advance(parts, task, crew.cycles[r], crew.phases[r], most, crew.max_jumps[r])
    if code == MAX_STEPS and task.run.steps < crew.max_steps[r]:
        code = GO_ON
    muster(parts, sea, crew, onward, r, code, NO_MODE, 0)


@njit(**KERNEL)
def fill(sea, crew, mode):
    """Let runs that wait for a mode into its empty lanes; returns the bits of the lanes that are taken."""
    bits = 0
    for row in range(ABREAST):
        if crew.aboard[mode, row] < 0 and crew.counts[mode] > 0:
            board(sea, crew, mode, row, next_waiting(crew, mode))
        if crew.aboard[mode, row] >= 0:
            bits |= 1 << row
    return bits


@njit(**KERNEL)
def fullest(crew):
    """The mode that has most runs, aboard or waiting; -1 if there are none."""
    found, most = -1, 0
    for mode in range(crew.aboard.shape[0]):
        count = crew.counts[mode]
        for row in range(ABREAST):
            count += 1 if crew.aboard[mode, row] >= 0 else 0
        if count > most:
            found, most = mode, count
    return found


@njit(**INLINE)
def beyond(time, room):
    """How much longer a time is than a room; both may be infinite."""
    return 0.0 if time == room else time - room


@njit(**INLINE)
def room_left(sea, crew, places, mode, row):
    """The room of a run in a lane. What is left of a time that ends with it ends with it to the last bit."""
    r, left = crew.aboard[mode, row], sea.lanes[mode][(places.numbers + ROOM) * ABREAST + row]
    remains = left + beyond(crew.rooms[r, 0], crew.rooms[r, 2])
    until = left + beyond(crew.rooms[r, 1], crew.rooms[r, 2])
    return Room(remains, until, left, crew.rooms[r, 3], crew.clocks[r])


@njit(**KERNEL)
def arrive(parts, sea, crew, onward, places, mode, row):
    """Let a run leave its lane at the end of its step, and bring it to its next one."""
    r, room = crew.aboard[mode, row], room_left(sea, crew, places, mode, row)
    task, lane, fired, gap = task_at(crew.tasks[r]), sea.lanes[mode], sea.fired[row], 0.0
    model, run = task.model, task.run
    crew.aboard[mode, row] = NOBODY
    on_guard = lane[(places.numbers + STEPS) * ABREAST + row] == 1.0 and remember_scale(model, run, task.work)
    leave_lane(lane, places, task, row)
    # The last step is counted where vectors are looked at.
    run.unchecked -= 1
    run.distant = 1 if fired == NO_TRANSITION and (sea.distant >> row) & 1 else 0
    if fired != NO_TRANSITION:
        gap = reach_end(sea, task, on_guard, row)
        go_forward(model, run, gap)
    alone, length = reaches_one_guard(model, run), sea.ends[row] + gap
    code = conclude(parts, task, room, gap, length, crew.cycles[r], crew.phases[r], alone)
    muster(parts, sea, crew, onward, r, code, mode, row)


@njit(**KERNEL)
def stop_on_the_way(parts, sea, crew, onward, places, mode, row):
    """Let a run stop within its step; from there it goes on, to its next stop or to the end, or elsewhere."""
    r, lane = crew.aboard[mode, row], sea.lanes[mode]
    task = task_at(crew.tasks[r])
    run, n, tangents = task.run, task.model.dimension, task.tangents
    sea.stopping ^= 1 << row
    look_out(sea, lane, places, task, sea.stops[ABREAST + row], row)
    set_clock(run, crew.cycles[r], crew.phases[r])
    entry, jumps = largest_of_tangent(run, n) if tangents > 0 else 0, run.jumps
    before = run.y[entry]
    code, room = go_to_next_step(parts, task, crew, onward, r, DONE if run.distant == 1 else GO_ON)
    if code != GO_ON:
        crew.codes[r], crew.aboard[mode, row] = code, NOBODY
        return
    # Another run has begun, a guard was reached, or the tangent vector is another one.
    if run.steps == 0 or run.jumps > jumps or (tangents > 0 and before == 0.0):
        crew.aboard[mode, row] = NOBODY
        queue_up(sea, crew, r, room, mode, row)
        return
    factor = run.y[entry] / before if tangents > 0 else 1.0
    look_ahead(sea, lane, places, task, room.all, factor, row)
    sea.stops[ABREAST + row] *= factor
    rest, reaches = sea.ends[row] - sea.stops[row], sea.fired[row] != NO_TRANSITION
    if room.all < rest or (room.all == rest and not reaches):
        sea.stops[row] += room.all
        sea.stopping |= 1 << row
    elif reaches:
        arrive(parts, sea, crew, onward, places, mode, row)


@njit(**KERNEL)
def stay_behind(parts, sea, crew, onward, places, mode, row):
    """Let a run that does not take the step leave its lane, and step alone."""
    r = crew.aboard[mode, row]
    crew.aboard[mode, row], crew.refused[r] = NOBODY, 1
    leave_lane(sea.lanes[mode], places, task_at(crew.tasks[r]), row)
    muster(parts, sea, crew, onward, r, GO_ON, mode, row)


@njit(**KERNEL)
def step_together(parts, sea, crew, onward, mode):
    """One step of the runs in the lanes of a mode; those to whom something happens leave."""
    bits = fill(sea, crew, mode)
    first = crew.aboard[mode, 0]
    for row in range(ABREAST):
        first = max(first, crew.aboard[mode, row])
    task, lane = task_at(crew.tasks[first]), sea.lanes[mode]
    model, method, tangents = task.model, task.method, task.tangents
    places = places_in(model, tangents, crew.parameters, mode)
    able, staying = step_abreast(model, method, sea, lane, places, mode, tangents, mask_of(bits))
    took, stays, stopping = bits_of(able), bits_of(staying), sea.stopping
    for row in range(ABREAST):
        if not (bits >> row) & 1:
            continue
        crew.steps += 1
        steps = lane[(places.numbers + STEPS) * ABREAST + row]
        if not (took >> row) & 1:
            stay_behind(parts, sea, crew, onward, places, mode, row)
        elif (stopping >> row) & 1:
            # What was left at the start of the step.
            sea.stops[row] = lane[(places.numbers + ROOM) * ABREAST + row] + sea.ends[row]
            sea.stops[ABREAST + row] = 1.0
        elif not ((stays >> row) & 1 and steps < crew.longest[mode]):
            arrive(parts, sea, crew, onward, places, mode, row)
    while sea.stopping != 0:
        evaluate_stops(model, method, sea, lane, places, mode, tangents)
        for row in range(ABREAST):
            if (sea.stopping >> row) & 1:
                stop_on_the_way(parts, sea, crew, onward, places, mode, row)


@exported(INTEGER, ADVANCE, Parts, Abreast, Crew, ONWARD)
def advance_abreast(advance, parts, sea, crew, onward):
    """Advance the runs of a crew until they are over; their codes are in ``crew.codes``.

    Returns DONE, or GO_ON if the budget of steps was used up, after which the next call goes on.
    """
    if crew.begun == 0:
        crew.begun = 1
        for r in range(crew.tasks.shape[0]):
            if crew.codes[r] != GO_ON:
                continue
            crew.codes[r] = onward(parts, task_at(crew.tasks[r]), crew, r, GO_ON)
            if crew.codes[r] != GO_ON:
                continue
            muster(parts, sea, crew, onward, r, GO_ON, NO_MODE, 0)
    alone = crew.aboard.shape[0]
    while crew.steps + crew.alone < crew.budget:
        # One at a time, and all those that are alone before the others, who wait for them.
        if crew.counts[alone] > 0:
            step_alone(advance, parts, sea, crew, onward, next_waiting(crew, alone))
            continue
        mode = fullest(crew)
        if mode < 0:
            return DONE
        step_together(parts, sea, crew, onward, mode)
    return GO_ON
