"""Stroboscopic points of a run, computed without leaving the compiled code."""

from hybrid.kernels.types.codes import DONE, UNLIMITED
from hybrid.kernels.types.kinds import INDEX_MATRIX, INDICES, INTEGER, MATRIX, REAL
from hybrid.kernels.types.layout import ADVANCE, Parts, Task
from hybrid.kernels.types.options import exported


@exported(INTEGER, ADVANCE, Parts, Task, REAL, INTEGER, MATRIX, INDEX_MATRIX, INDICES)
def strobe(advance, parts, task, phase, max_steps, states, places, reached):
    """State ``(N, n)``, and cycle, mode and jump count ``(N, 3)``, at ``phase`` of the next N cycles.

    Returns the driver's code; the number of points reached goes into ``reached (1,)``.
    """
    model, run = task.model, task.run
    for done in range(states.shape[0]):
        reached[0] = done
        cycle = run.cycle + 1
        code = advance(parts, task, cycle, phase, max_steps, UNLIMITED)
        if code != DONE:
            return code
        for i in range(model.dimension):
            states[done, i] = run.y[i]
        places[done, 0], places[done, 1], places[done, 2] = cycle, run.mode, run.jumps
    reached[0] = states.shape[0]
    return DONE
