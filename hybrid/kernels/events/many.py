"""Runs from many starts, one after another, without leaving the compiled code."""

from numba import njit

from hybrid.kernels.events.initial_mode import verdicts_on
from hybrid.kernels.types import notes
from hybrid.kernels.types.codes import (
    BEYOND,
    DESINGULARISED,
    DONE,
    GO_ON,
    MAX_STEPS,
    NO_MODE,
    NO_OBJECTION,
    NO_TRANSITION,
    REFUSED,
    ROOTED,
)
from hybrid.kernels.types.kinds import CUBE, INDICES, INTEGER, VECTOR
from hybrid.kernels.types.layout import ADVANCE, Parts, Task
from hybrid.kernels.types.options import KERNEL, exported
from hybrid.kernels.types.starts import Starts


@njit(**KERNEL)
def set_words(words, fresh):
    """Make a structure's memory what it was when the structure was new."""
    for i in range(words.shape[0]):
        words[i] = fresh[i]


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
    if verdicts_on(parts, model, task.run, task.work, first, stop, verdicts) != NO_TRANSITION:
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
def mode_of_fresh_run(parts, task, starts, i):
    """``mode_of_start`` of the run from start ``i``, whose memory is made fresh."""
    run = task.run
    set_words(starts.run_words, starts.fresh_run)
    set_words(starts.work_words, starts.fresh_work)
    for c in range(task.model.dimension):
        run.y[c] = starts.origins[i, c]
        run.scale[c] = abs(starts.origins[i, c])
    return mode_of_start(parts, task, starts.named, starts.verdicts)


is_plain = njit(**KERNEL)(notes.is_plain)


@exported(INTEGER, ADVANCE, Parts, Task, Starts, INDICES, VECTOR, INTEGER, CUBE)
def many_runs(advance, parts, task, starts, cycles, phases, budget, states):
    """The states ``(N, S, n)`` of runs from many starts at ``S`` times, the last one their end.

    ``starts.found (N, 3)`` gets the mode, the number of jumps and the number of states reached. Stops at the
    first run that is not complete, or of which there is something to tell. Returns the code of that run;
    REFUSED if it cannot start here, GO_ON if the ``budget`` of steps was used up, after which the next call
    resumes the run.
    """
    run, found = task.run, starts.found
    for i in range(starts.reached, states.shape[0]):
        starts.reached = i
        if starts.resumed == 0:
            found[i, 2] = 0
            mode = mode_of_fresh_run(parts, task, starts, i)
            if mode == NO_MODE:
                return REFUSED
            run.mode = mode
        starts.resumed = 0
        for s in range(found[i, 2], cycles.shape[0]):
            before = run.steps
            most = min(starts.max_steps, before + budget)
            code = advance(parts, task, cycles[s], phases[s], most, starts.max_jumps)
            budget -= run.steps - before
            if code == MAX_STEPS and most < starts.max_steps:
                starts.resumed = 1
                return GO_ON
            if code != DONE:
                return code
            for c in range(task.model.dimension):
                states[i, s, c] = run.y[c]
            found[i, 2] = s + 1
        found[i, 0], found[i, 1] = run.mode, run.jumps
        if not is_plain(task.model, run, guards_beyond(starts.named, starts.verdicts)):
            return DONE
    starts.reached = states.shape[0]
    return DONE
