"""Runs that wait in a pool until others are in the same mode, and then take a step together."""

import math

from numba import njit

from hybrid.kernels.abreast.rows import bits_of, mask_of
from hybrid.kernels.abreast.step import step_abreast
from hybrid.kernels.arithmetic.clock import measured_time
from hybrid.kernels.drive import Room, complete, keep_scale, prepare, remember_scale
from hybrid.kernels.events.guards import has_program
from hybrid.kernels.events.onset import BY_SPEED
from hybrid.kernels.guards.touch import forget_touches
from hybrid.kernels.arithmetic.bernstein import NO_ROOT
from hybrid.kernels.steps.field.late import is_late
from hybrid.kernels.steps.series import FINEST, as_far_as_last_time, land
from hybrid.kernels.types.abreast import Abreast, Crew
from hybrid.kernels.types.codes import (
    ABREAST,
    DESINGULARISED,
    EXACT,
    FROM_LAST_STEP,
    FROM_STATE,
    FROM_ZERO,
    GO_ON,
    HIGHEST_ORDER,
    MAX_STEPS,
    NO_TRANSITION,
    READY,
    ROOTED,
    RUNGE_KUTTA,
)
from hybrid.kernels.types.kinds import INTEGER
from hybrid.kernels.types.layout import ADVANCE, Parts, Path, Task
from hybrid.kernels.types.numba_door.addressed import task_at
from hybrid.kernels.types.options import INLINE, KERNEL, exported


@njit(**INLINE)
def order_of(model, method, mode):
    """The order of the series of a mode."""
    if model.degree[mode] > 0:
        return model.degree[mode]
    return HIGHEST_ORDER if model.propagator[mode] == EXACT else method.order


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
def take_aboard(sea, task, room, row):
    """Write where a run is into its lane of the step."""
    model, run, method, series = task.model, task.run, task.method, task.work.series
    n, mode, order = model.dimension, run.mode, order_of(model, method, run.mode)
    sea.t[row] = run.phase
    for i in range(n * (1 + task.tangents)):
        sea.x[i * ABREAST + row] = run.y[i]
    for i in range(sea.p.shape[0] // ABREAST):
        sea.p[i * ABREAST + row] = model.parameters[i]
    sea.limits[row] = room
    sea.limits[ABREAST + row] = min(method.max_step, as_far_as_last_time(model, run, mode))
    sea.limits[2 * ABREAST + row] = FINEST * measured_time(model, run, mode)
    first = model.first_outgoing[mode]
    rooted = model.propagator[mode] == DESINGULARISED or model.propagator[mode] == ROOTED
    for slot in range(first, model.first_outgoing[mode + 1]):
        transition, g = model.outgoing[slot], slot - first
        known = run.on_guard[transition] == BY_SPEED
        sea.sides[0, g * ABREAST + row] = run.side[transition]
        sea.sides[1, g * ABREAST + row] = 1.0 if known else 0.0
        if rooted:
            origin = FROM_LAST_STEP if run.stage == READY else FROM_STATE
            sea.powers[order + 1, (n + g) * ABREAST + row] = series[order + 1, n + g]
            sea.powers[order + 2, (n + g) * ABREAST + row] = FROM_ZERO if known else origin


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
        run.scale[i] = max(run.scale[i] if on_guard else 0.0, powers[order + 2, i * ABREAST + row])
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
        run.on_guard[transition] = 0
        run.rehearsal[3, transition] = run.side[transition] if transition == fired else 0
        run.passed[transition] = NO_ROOT
        if model.propagator[mode] == DESINGULARISED or model.propagator[mode] == ROOTED:
            work.series[order + 1, column] = powers[order + 1, column * ABREAST + row]
    run.stage = READY
    if fired != NO_TRANSITION:
        clock = 0 if model.propagator[mode] == DESINGULARISED else -1
        path = Path(work.series, order, clock, t, 1.0, sea.ends[ABREAST + row], False)
        span += land(model, run, tangents, fired, path, span, work)
        run.pending = fired
        keep_scale(model, run, on_guard, t + span, work)
        if is_alone(model, mode, fired):
            run.side[fired] = -run.side[fired]
            run.on_guard[fired], run.due[fired], run.rehearsal[3, fired] = BY_SPEED, 1, 0
    return span


@njit(**INLINE)
def is_alone(model, mode, fired):
    """Whether a crossing that the step has proved fires its transition, and no other comes into question."""
    certain = model.conditional[mode] == 0 and model.jumping_reset[fired] == 0
    return certain and not has_program(model, fired)


# Columns of ``Crew.state``: the code of a run, whether it has its room for a step, and the clock that ends it.
CODE, READY_TO_STEP, CLOCK = range(3)


@njit(**KERNEL)
def muster(advance, parts, sea, crew, r, max_steps, max_jumps):
    """Bring a run to where it can take its next step abreast, or to its end; steps that are not plain it takes."""
    task, state = task_at(crew.tasks[r]), crew.state[r]
    while True:
        code, room = prepare(parts, task, crew.cycles[r], crew.phases[r], max_steps, max_jumps)
        state[CODE] = code
        if code != GO_ON:
            return
        if state[CLOCK] >= 0 and is_plain(task.model, task.method, task.run, sea):
            crew.rooms[r, 0], crew.rooms[r, 1] = room.remains, room.until
            crew.rooms[r, 2], crew.rooms[r, 3] = room.all, room.knot
            crew.clocks[r] = room.clock
            mode = task.run.mode
            crew.waiting[mode, crew.counts[mode]] = r
            crew.counts[mode] += 1
            return
        state[CLOCK] = 0
        crew.refused += 1
        most = min(max_steps, task.run.steps + 1)
        code = advance(parts, task, crew.cycles[r], crew.phases[r], most, max_jumps)
        if code != MAX_STEPS or most == max_steps:
            state[CODE] = code
            return


@exported(None, ADVANCE, Parts, Abreast, Crew, INTEGER, INTEGER)
def advance_abreast(advance, parts, sea, crew, max_steps, max_jumps):
    """Advance the runs of a crew, each to its own time; ``crew.state`` gets their codes."""
    for r in range(crew.tasks.shape[0]):
        muster(advance, parts, sea, crew, r, max_steps, max_jumps)
    modes = crew.counts.shape[0]
    while True:
        mode = 0
        for m in range(1, modes):
            if crew.counts[m] > crew.counts[mode]:
                mode = m
        count = min(crew.counts[mode], ABREAST)
        if count == 0:
            return
        crew.counts[mode] -= count
        aboard = crew.waiting[mode, crew.counts[mode] : crew.counts[mode] + count]
        for lane in range(count):
            r = aboard[lane]
            take_aboard(sea, task_at(crew.tasks[r]), crew.rooms[r, 2], lane)
            crew.lanes[lane] = r
        first = task_at(crew.tasks[crew.lanes[0]])
        for lane in range(count, ABREAST):
            take_aboard(sea, first, crew.rooms[crew.lanes[0], 2], lane)
        asked = mask_of((1 << count) - 1)
        done = bits_of(step_abreast(first.model, first.method, sea, mode, first.tangents, asked))
        crew.steps += count
        for lane in range(count):
            r = crew.lanes[lane]
            task, state = task_at(crew.tasks[r]), crew.state[r]
            if (done >> lane) & 1:
                fired = sea.fired[lane]
                alone = fired != NO_TRANSITION and is_alone(task.model, mode, fired)
                span = take_ashore(sea, task, lane)
                room = Room(crew.rooms[r, 0], crew.rooms[r, 1], crew.rooms[r, 2], crew.rooms[r, 3], crew.clocks[r])
                code = complete(parts, task, room, span, crew.cycles[r], crew.phases[r], alone)
                state[CODE] = code
                if code != GO_ON:
                    continue
            else:
                state[CLOCK] = -1
            muster(advance, parts, sea, crew, r, max_steps, max_jumps)
