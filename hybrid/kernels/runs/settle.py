"""Runs from many starts, each until it is known which attractor it leads to."""

from numba import njit

from hybrid.kernels.runs.many import begin_next, guards_beyond
from hybrid.kernels.types.abreast import Crew
from hybrid.kernels.types.attractors import Progress, Section
from hybrid.kernels.types.codes import (
    DONE,
    GO_ON,
    MAX_JUMPS,
    MAX_STEPS,
    NO_MODE,
    NO_OBJECTION,
    REFUSED,
    UNLIMITED,
)
from hybrid.kernels.types.kinds import INDEX_MATRIX, INTEGER, MATRIX
from hybrid.kernels.types.layout import ADVANCE, Parts, Task
from hybrid.kernels.types.numba_door.addressed import structure_at
from hybrid.kernels.types.options import KERNEL, exported
from hybrid.kernels.types.starts import Settling

settling_at = structure_at(Settling)
INFINITE = float("inf")
# Columns of what is found: the attractor, the number of points, the code of the run, the mode at the start.
OWNER, POINTS, CODE, MODE = range(4)
NONE = -1


@njit(**KERNEL)
def near(known, y, mode):
    """The attractor that has a point near a state, the nearest in units of its radius; or NONE."""
    points, axis, n = known.points, known.axis, known.points.shape[1]
    low, high = 0, points.shape[0]
    least = y[axis] - known.widest
    while low < high:
        middle = (low + high) // 2
        if points[middle, axis] < least:
            low = middle + 1
        else:
            high = middle
    found, closest = NONE, 1.0
    for i in range(low, points.shape[0]):
        if points[i, axis] > y[axis] + known.widest:
            break
        if known.mode[i] != mode:
            continue
        owner, far = known.owner[i], 0.0
        for c in range(n):
            apart = abs(y[c] - points[i, c])
            if known.turns[c] > 0.0:
                apart = abs(apart - known.turns[c] * round(apart / known.turns[c]))
            far = max(far, apart / known.radius[owner, c])
        if far <= closest:
            found, closest = owner, far
    return found


@njit(**KERNEL)
def go_to_next(section, progress, period):
    """Let the time of the next point be that of ``progress``."""
    if section.interval == 0.0:
        progress.cycle += 1
        return
    progress.phase += section.interval
    while period > 0.0 and progress.phase >= period:
        progress.phase -= period
        progress.cycle += 1


@njit(**KERNEL)
def next_point(advance, parts, task, section, progress, max_steps):
    """Advance to the next point of the section; DONE there, or the code of the run if it ends before."""
    run, period = task.run, task.model.period
    if section.markers == 0:
        if progress.under_way == 0:
            go_to_next(section, progress, period)
            progress.under_way = 1
        code = advance(parts, task, progress.cycle, progress.phase, max_steps, UNLIMITED)
        if code == DONE:
            progress.under_way = 0
        return code
    far_cycle = UNLIMITED if period > 0.0 else 0
    while True:
        before = run.jumps
        code = advance(parts, task, far_cycle, INFINITE, max_steps, before + progress.under_way)
        if code != MAX_JUMPS:
            if run.jumps > before:
                progress.under_way = 0
            return code
        progress.under_way = 1
        if run.pending < section.markers:
            return DONE


@njit(**KERNEL)
def violates_all(model, verdicts):
    """Whether a guard of every mode speaks against a start."""
    for mode in range(model.first_outgoing.shape[0] - 1):
        against = False
        for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
            against = against or verdicts[model.outgoing[slot]] != NO_OBJECTION
        if not against:
            return False
    return True


@njit(**KERNEL)
def begin(parts, task, job):
    """Begin the next run that has a mode; DONE without one, REFUSED if more than one mode allows a start."""
    run, starts, progress = task.run, job.starts, job.progress
    found, named = starts.found, starts.named
    while True:
        mode = begin_next(parts, task, starts)
        if starts.now < 0:
            return DONE
        progress.cycle, progress.phase = run.cycle, job.section.phase
        progress.under_way, progress.points, progress.near, progress.streak = 0, 0, NONE, 0
        if guards_beyond(named, starts.verdicts) > 0:
            mode = NO_MODE
        i = starts.now
        found[i, MODE] = mode
        if mode != NO_MODE:
            return GO_ON
        found[i, OWNER], found[i, POINTS], found[i, CODE] = NONE, 0, REFUSED
        if not (named != NO_MODE or violates_all(task.model, starts.verdicts)):
            return REFUSED


@njit(**KERNEL)
def is_decided(known, section, progress, run):
    """Take a point of the section; whether no more are wanted."""
    progress.points += 1
    owner = near(known, run.y, run.mode)
    progress.streak = progress.streak + 1 if owner == progress.near and owner != NONE else 1
    progress.near = owner
    if owner == NONE:
        progress.streak = 0
    return progress.streak >= section.wanted or progress.points >= section.most


@exported(INTEGER, Parts, Task, Crew, INTEGER, INTEGER)
def settle(parts, task, crew, r, code):
    """What a run does next that settles on an attractor (``ONWARD``); ``starts.found`` is described above.

    A run stops at the point that decides its start. Its code is DONE then, and MAX_STEPS where ``most``
    points decide nothing; other codes are those of runs that end. REFUSED, with no mode at the start: it
    violates the mode that is named, or every mode if none is. The result is REFUSED if more than one mode
    allows the start that was reached.
    """
    job, run = settling_at(crew.jobs[r]), task.run
    section, progress, starts = job.section, job.progress, job.starts
    if section.markers > 0 and code == MAX_JUMPS and run.pending >= section.markers:
        crew.max_jumps[r] = run.jumps + 1
        return GO_ON
    if code != GO_ON:
        arrives = code == DONE or (section.markers > 0 and code == MAX_JUMPS)
        if not arrives or is_decided(job.known, section, progress, run):
            found, decided = starts.found[starts.now], arrives and progress.streak >= section.wanted
            found[OWNER], found[POINTS] = progress.near if decided else NONE, progress.points
            found[CODE] = code
            if arrives:
                found[CODE] = DONE if decided else MAX_STEPS
            code = GO_ON
        elif section.markers > 0:
            crew.max_jumps[r] = run.jumps + 1
            return GO_ON
    if code == GO_ON:
        code = begin(parts, task, job)
        if code != GO_ON:
            return code
    if section.markers == 0:
        go_to_next(section, progress, task.model.period)
        crew.cycles[r], crew.phases[r] = progress.cycle, progress.phase
    else:
        crew.cycles[r], crew.phases[r] = UNLIMITED if task.model.period > 0.0 else 0, INFINITE
        crew.max_jumps[r] = run.jumps
    return GO_ON


@exported(INTEGER, ADVANCE, Parts, Task, Section, Progress, INTEGER, MATRIX, INDEX_MATRIX)
def collect(advance, parts, task, section, progress, max_steps, states, places):
    """The next points ``(N, n)`` of a section; rows of ``places (N, 2)`` are modes and jumps so far.

    Returns DONE, or the code of the run if it ends before, or GO_ON at the limit of steps, after which the
    next call goes on behind ``progress.points``.
    """
    run = task.run
    while progress.points < states.shape[0]:
        code = next_point(advance, parts, task, section, progress, max_steps)
        if code == MAX_STEPS:
            return GO_ON
        if code != DONE:
            return code
        for c in range(task.model.dimension):
            states[progress.points, c] = run.y[c]
        places[progress.points, 0], places[progress.points, 1] = run.mode, run.jumps
        progress.points += 1
    return DONE
