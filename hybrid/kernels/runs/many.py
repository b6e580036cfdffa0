"""Runs from many starts, without leaving the compiled code."""

from numba import njit

from hybrid.kernels.runs.initial_mode import verdicts_on
from hybrid.kernels.types import notes
from hybrid.kernels.types.abreast import Crew
from hybrid.kernels.types.codes import (
    BEYOND,
    DESINGULARISED,
    DONE,
    GO_ON,
    NO_MODE,
    NO_OBJECTION,
    NO_TRANSITION,
    REFUSED,
    ROOTED,
)
from hybrid.kernels.types.kinds import INTEGER
from hybrid.kernels.types.layout import Parts, Task
from hybrid.kernels.types.numba_door.addressed import structure_at
from hybrid.kernels.types.options import KERNEL, exported
from hybrid.kernels.types.starts import Sampled

sampled_at = structure_at(Sampled)


@njit(**KERNEL)
def guards_beyond(named, verdicts):
    """Number of guards that a start in the mode ``named`` lies beyond: none where the mode was found."""
    count = 0
    for i in range(verdicts.shape[0] if named != NO_MODE else 0):
        if verdicts[i] == BEYOND:
            count += 1
    return count


@njit(**KERNEL)
def mode_of_start(parts, task, named, verdicts):
    """The mode in which a run starts: the one named, or the only one that allows the state; else NO_MODE.

    Nor does a run start in a mode whose series hold the root of a guard if it starts beyond a guard.
    """
    model = task.model
    modes = model.first_outgoing.shape[0] - 1
    for i in range(verdicts.shape[0]):
        verdicts[i] = NO_OBJECTION
    first, stop = (0, modes) if named == NO_MODE else (named, named + 1)
    if verdicts_on(parts, model, task.method, task.run, task.work, first, stop, verdicts) != NO_TRANSITION:
        return NO_MODE
    if named != NO_MODE:
        rooted = model.propagator[named] == DESINGULARISED or model.propagator[named] == ROOTED
        return NO_MODE if rooted and guards_beyond(named, verdicts) > 0 else named
    chosen = NO_MODE
    for mode in range(modes):
        allowed = True
        for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
            allowed = allowed and verdicts[model.outgoing[slot]] == NO_OBJECTION
        if allowed:
            if chosen != NO_MODE:
                return NO_MODE
            chosen = mode
    return chosen


@njit(**KERNEL)
def begin_next(parts, task, starts):
    """Begin the run of the next start in fresh memory; the mode that it starts in, as ``mode_of_start``.

    Without a next start, ``starts.now`` is -1.
    """
    run, i = task.run, starts.queue[0]
    if i >= starts.origins.shape[0]:
        starts.now = -1
        return NO_MODE
    starts.now = i
    starts.queue[0] = i + 1
    for word in range(starts.run_words.shape[0]):
        starts.run_words[word] = starts.fresh_run[word]
    for word in range(starts.work_words.shape[0]):
        starts.work_words[word] = 0
    for c in range(task.model.dimension):
        run.y[c] = starts.origins[i, c]
        run.scale[c] = abs(starts.origins[i, c])
    run.mode = mode_of_start(parts, task, starts.named, starts.verdicts)
    return run.mode


ends_plainly = njit(**KERNEL)(notes.is_plain)


@exported(INTEGER, Parts, Task, Crew, INTEGER, INTEGER)
def sampled(parts, task, crew, r, code):
    """What a run does next whose states are kept at given times (``ONWARD``).

    Of a run that is not complete, or of which there is something to tell, the code is returned; REFUSED if
    it cannot start here. At the next call its memory takes the next start.
    """
    job, run = sampled_at(crew.jobs[r]), task.run
    starts, last = job.starts, job.cycles.shape[0] - 1
    i, s = starts.now, job.sample
    if code not in (DONE, GO_ON):
        return code
    if code == DONE:
        for c in range(task.model.dimension):
            job.states[i, s, c] = run.y[c]
        job.modes[i, s] = run.mode
        s += 1
        if s > last:
            starts.found[i, 0] = run.jumps
            if not ends_plainly(task.model, run, guards_beyond(starts.named, starts.verdicts)):
                return DONE
    if code == GO_ON or s > last:
        s = 0
        mode = begin_next(parts, task, starts)
        if starts.now < 0:
            return DONE
        if mode == NO_MODE:
            return REFUSED
    job.sample = s
    crew.cycles[r], crew.phases[r] = job.cycles[s], job.phases[s]
    return GO_ON
