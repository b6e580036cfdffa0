"""Runs from many starts, each until it is known which attractor it leads to."""

from numba import njit

from hybrid.kernels.events.many import guards_beyond, mode_of_fresh_run
from hybrid.kernels.types.attractors import Known, Progress, Section
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
from hybrid.kernels.types.options import KERNEL, exported
from hybrid.kernels.types.starts import Starts

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
def next_point(advance, parts, task, section, progress, max_steps):
    """Advance to the next point of the section; DONE there, or the code of the run if it ends before."""
    run, period = task.run, task.model.period
    if section.markers == 0:
        if progress.under_way == 0:
            if section.interval > 0.0:
                progress.phase += section.interval
                while period > 0.0 and progress.phase >= period:
                    progress.phase -= period
                    progress.cycle += 1
            else:
                progress.cycle += 1
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
def begin(parts, task, starts, section, progress, i):
    """Begin the run from start ``i``; DONE, or REFUSED if it has no mode, or GO_ON if it has several."""
    run, found, named = task.run, starts.found, starts.named
    mode = mode_of_fresh_run(parts, task, starts, i)
    progress.cycle, progress.phase = run.cycle, section.phase
    progress.under_way, progress.points, progress.near, progress.streak = 0, 0, NONE, 0
    if guards_beyond(named, starts.verdicts) > 0:
        mode = NO_MODE
    found[i, MODE] = mode
    if mode != NO_MODE:
        run.mode = mode
        return DONE
    found[i, OWNER], found[i, POINTS], found[i, CODE] = NONE, 0, REFUSED
    return REFUSED if named != NO_MODE or violates_all(task.model, starts.verdicts) else GO_ON


@njit(**KERNEL)
def advance_until_decided(advance, parts, task, starts, known, section, progress, budget):
    """Go on from point to point until the start of a run is decided; the code and the rest of the budget.

    The code is GO_ON if the budget is used up.
    """
    run, code = task.run, DONE
    while code == DONE and progress.streak < section.wanted and progress.points < section.most:
        before = run.steps
        most = min(starts.max_steps, before + budget)
        code = next_point(advance, parts, task, section, progress, most)
        budget -= run.steps - before
        if code == MAX_STEPS and most < starts.max_steps:
            return GO_ON, budget
        if code == DONE:
            progress.points += 1
            owner = near(known, run.y, run.mode)
            progress.streak = progress.streak + 1 if owner == progress.near and owner != NONE else 1
            progress.near = owner
            if owner == NONE:
                progress.streak = 0
    return code, budget


@exported(INTEGER, ADVANCE, Parts, Task, Starts, Known, Section, Progress, INTEGER)
def settle(advance, parts, task, starts, known, section, progress, budget):
    """Run until each start is decided; the rows of ``starts.found (N, 4)`` are described above.

    A run stops at the point that decides its start. Its code is DONE then, and MAX_STEPS where ``most``
    points decide nothing; other codes are those of runs that end. REFUSED, with no mode at the start: it
    violates the mode that is named, or every mode if none is. Returns DONE after the last start, GO_ON if
    the ``budget`` of steps was used up, after which the next call resumes the run; REFUSED if more than one
    mode allows the start that was reached.
    """
    found = starts.found
    for i in range(starts.reached, found.shape[0]):
        starts.reached = i
        if starts.resumed == 0:
            code = begin(parts, task, starts, section, progress, i)
            if code == GO_ON:
                return REFUSED
            if code == REFUSED:
                continue
        code, budget = advance_until_decided(advance, parts, task, starts, known, section, progress, budget)
        starts.resumed = 1 if code == GO_ON else 0
        if code == GO_ON:
            return GO_ON
        decided = code == DONE and progress.streak >= section.wanted
        found[i, OWNER] = progress.near if decided else NONE
        found[i, POINTS] = progress.points
        found[i, CODE] = MAX_STEPS if code == DONE and not decided else code
    starts.reached = found.shape[0]
    return DONE


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
