"""The verdicts of guards on the modes in which a run could start."""

import math

from numba import njit

from hybrid.kernels.events.guards import allowed, guard_value
from hybrid.kernels.types.codes import BEYOND, LEAVES, NO_OBJECTION, NO_TRANSITION
from hybrid.kernels.types.kinds import INDICES, INTEGER
from hybrid.kernels.types.layout import Method, Model, Parts, Run, Work
from hybrid.kernels.types.options import KERNEL, exported


@njit(**KERNEL)
def forget_scale(model, run):
    """The state alone tells how large its components are, as at the start of a run."""
    for i in range(model.dimension):
        run.scale[i] = abs(run.y[i])


@njit(**KERNEL)
def verdicts_on(parts, model, method, run, work, first, stop, verdicts):
    """Enter the modes ``first`` to ``stop - 1`` at the start of a run, one after another.

    The verdict of each of their guards goes into ``verdicts (transitions,)``, which must be zero before.
    Returns the first transition whose guard is not finite, with its value in ``work.scalar``; otherwise
    NO_TRANSITION.
    """
    t = run.phase
    for mode in range(first, stop):
        run.mode = mode
        fires = parts.enter(model, method, run, work)
        # What is large in one mode tells nothing of the others.
        forget_scale(model, run)
        for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
            transition = model.outgoing[slot]
            if not abs(guard_value(model, transition, t, run.y, work.scalar)) < math.inf:
                return transition
            beyond = model.direction[transition] == run.side[transition] and run.on_guard[transition] == 0
            beyond = beyond and model.marker[transition] == 0 and model.paired[transition] == 0
            if run.due[transition] == 0 and not beyond:
                continue
            if allowed(model, transition, t, run.y, work.scalar):
                verdicts[transition] = LEAVES if run.due[transition] == 1 else BEYOND
        if fires >= 0 and verdicts[fires] == NO_OBJECTION:
            verdicts[fires] = LEAVES
    return NO_TRANSITION


@exported(INTEGER, Parts, Model, Method, Run, Work, INTEGER, INTEGER, INDICES)
def try_modes(parts, model, method, run, work, first, stop, verdicts):
    """As :func:`verdicts_on`, for calls from Python."""
    return verdicts_on(parts, model, method, run, work, first, stop, verdicts)
