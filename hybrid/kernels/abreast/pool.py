"""Runs that wait in a pool until others are in the same mode, and then take a step together."""

from numba import njit

from hybrid.kernels.abreast.lanes import come_aboard, leave, places_in
from hybrid.kernels.abreast.rows import bits_of, mask_of
from hybrid.kernels.abreast.step import step_abreast
from hybrid.kernels.arithmetic.bernstein import NO_ROOT
from hybrid.kernels.drive import Room, complete, keep_scale, prepare, reaches_one_guard, remember_scale
from hybrid.kernels.events.onset import BY_SPEED
from hybrid.kernels.guards.touch import forget_touches
from hybrid.kernels.steps.field.late import is_late
from hybrid.kernels.steps.series import holds_roots, land, order_of
from hybrid.kernels.types.abreast import ONWARD, ROOM, STEPS, Abreast, Crew
from hybrid.kernels.types.codes import (
    ABREAST,
    DESINGULARISED,
    DONE,
    GO_ON,
    MAX_STEPS,
    NO_MODE,
    NO_TRANSITION,
    READY,
    RUNGE_KUTTA,
)
from hybrid.kernels.types.kinds import INTEGER
from hybrid.kernels.types.layout import ADVANCE, Parts, Path, Task
from hybrid.kernels.types.numba_door.addressed import structure_at
from hybrid.kernels.types.options import INLINE, KERNEL, exported

task_at = structure_at(Task)
# Steps that a run takes at once in a mode in which none are taken abreast.
ALONE = 16


@njit(**KERNEL)
def is_plain(model, method, run, sea):
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


@njit(**KERNEL)
def take_ashore(sea, task, row):
    """Move a run to the end of its step; returns the time that it took. An event is left pending."""
    model, run, work, method = task.model, task.run, task.work, task.method
    n, mode, tangents = model.dimension, run.mode, task.tangents
    order, powers, fired = order_of(model, method, mode), sea.powers, sea.fired[row]
    first, last = model.first_outgoing[mode], model.first_outgoing[mode + 1]
    on_guard = remember_scale(model, run, work)
    span, t = sea.ends[row], run.phase
    run.steps += 1
    for i in range(n):
        run.scale[i] = powers[order + 2, i * ABREAST + row]
        run.y[i] = powers[order + 1, i * ABREAST + row]
    if tangents > 0:
        run.divergence += powers[order + 1, (n + last - first + 1) * ABREAST + row]
        for k in range(tangents):
            begin = sea.tangent_start + k * sea.tangent_columns[mode]
            for i in range(n):
                run.y[n * (1 + k) + i] = powers[order + 1, (begin + i) * ABREAST + row]
    forget_touches(run)
    for slot in range(first, last):
        transition, column = model.outgoing[slot], n + slot - first
        run.rehearsal[1, transition], run.on_guard[transition] = run.on_guard[transition], 0
        run.rehearsal[3, transition] = run.side[transition] if transition == fired else 0
        run.passed[transition] = NO_ROOT
        if holds_roots(model, mode):
            work.series[order + 1, column] = powers[order + 1, column * ABREAST + row]
    run.stage = READY
    run.distant = 1 if fired == NO_TRANSITION and (sea.distant >> row) & 1 else 0
    if fired != NO_TRANSITION:
        clock = 0 if model.propagator[mode] == DESINGULARISED else -1
        path = Path(work.series, order, clock, t, 1.0, sea.ends[ABREAST + row], False, 1)
        span += land(model, run, tangents, fired, path, span, work)
        run.pending = fired
        keep_scale(model, run, on_guard, t + span, work)
    return span


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
def muster(parts, sea, crew, onward, r, left, row):
    """Bring a run to where it takes its next step, and let it wait there; or to its end.

    A run that goes on in the mode that it has ``left`` goes back into its lane, in that ``row``.
    """
    task = task_at(crew.tasks[r])
    while True:
        code, room = prepare(
            parts, task, crew.cycles[r], crew.phases[r], crew.max_steps[r], crew.max_jumps[r]
        )
        if code == GO_ON:
            break
        code = onward(parts, task, crew, r, code)
        if code != GO_ON:
            crew.codes[r] = code
            return
    queue = crew.aboard.shape[0]
    if crew.refused[r] == 0 and is_plain(task.model, task.method, task.run, sea):
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
def step_alone(advance, parts, sea, crew, onward, r):
    """One step of a run that is not taken abreast, with what follows at its end."""
    task = task_at(crew.tasks[r])
    more = 1 if sea.able[task.run.mode] == 1 else ALONE
    most = min(crew.max_steps[r], task.run.steps + more)
    crew.alone += 1
    crew.refused[r] = 0
    code = advance(parts, task, crew.cycles[r], crew.phases[r], most, crew.max_jumps[r])
    if code != MAX_STEPS or task.run.steps >= crew.max_steps[r]:
        code = onward(parts, task, crew, r, code)
        if code != GO_ON:
            crew.codes[r] = code
            return
    muster(parts, sea, crew, onward, r, NO_MODE, 0)


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


@njit(**KERNEL)
def go_ashore(parts, sea, crew, mode, row, took, went):
    """Let a run leave its lane: at the end of a step that it took, or where it was at the start.

    Returns its number, and GO_ON or why it ends.
    """
    r, lane = crew.aboard[mode, row], sea.lanes[mode]
    crew.aboard[mode, row] = -1
    task = task_at(crew.tasks[r])
    places = places_in(task.model, task.tangents, crew.parameters, mode)
    left = lane[(places.numbers + ROOM) * ABREAST + row]
    leave(lane, places, task, took, row)
    if not took:
        if (went >> row) & 1 and task.tangents > 0 and task.orthonormal != 0:
            task.run.unchecked -= 1
            parts.keep_apart(task.model, task.run, mode, task.tangents, task.work.jacobian)
        return r, GO_ON
    span = take_ashore(sea, task, row)
    alone = reaches_one_guard(task.model, task.run)
    # What is left of a time that ends with the room ends with it to the last bit.
    remains = left + beyond(crew.rooms[r, 0], crew.rooms[r, 2])
    until = left + beyond(crew.rooms[r, 1], crew.rooms[r, 2])
    room = Room(remains, until, left, crew.rooms[r, 3], crew.clocks[r])
    return r, complete(parts, task, room, span, crew.cycles[r], crew.phases[r], alone)


@njit(**KERNEL)
def step_together(parts, sea, crew, onward, mode):
    """One step of the runs in the lanes of a mode; those to whom something happens leave."""
    bits = fill(sea, crew, mode)
    first = crew.aboard[mode, 0]
    for row in range(ABREAST):
        first = max(first, crew.aboard[mode, row])
    task, lane = task_at(crew.tasks[first]), sea.lanes[mode]
    places = places_in(task.model, task.tangents, crew.parameters, mode)
    able, going, staying = step_abreast(
        task.model, task.method, sea, lane, places, mode, task.tangents, mask_of(bits)
    )
    took, went, stays = bits_of(able), bits_of(going), bits_of(staying)
    for row in range(ABREAST):
        if not (bits >> row) & 1:
            continue
        crew.steps += 1
        if (stays >> row) & 1 and lane[(places.numbers + STEPS) * ABREAST + row] < crew.longest[mode]:
            continue
        arrives = (took >> row) & 1 and not (went >> row) & 1
        r, code = go_ashore(parts, sea, crew, mode, row, arrives, went)
        if not (took >> row) & 1:
            crew.refused[r] = 1
        if code != GO_ON:
            code = onward(parts, task_at(crew.tasks[r]), crew, r, code)
        if code != GO_ON:
            crew.codes[r] = code
            continue
        muster(parts, sea, crew, onward, r, mode, row)


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
            muster(parts, sea, crew, onward, r, NO_MODE, 0)
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
