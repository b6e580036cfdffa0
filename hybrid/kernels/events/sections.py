"""Stroboscopic points of a run, computed without leaving the compiled code."""

from numba import float64, int64, njit, types

from hybrid.kernels.types.codes import DONE
from hybrid.kernels.types.layout import (
    ADVANCE,
    ENTRY,
    INDEX_MATRIX,
    MATRIX,
    PARTS,
    TASK,
)


@njit(
    types.UniTuple(int64, 2)(ADVANCE, PARTS, TASK, float64, int64, int64, MATRIX, INDEX_MATRIX),
    **ENTRY,
)
def strobe(advance, parts, task, phase, max_steps, max_jumps, states, places):
    """State ``(N, n)``, and cycle, mode and jump count ``(N, 3)``, at ``phase`` of the next N cycles.

    Returns the number of points reached, and the driver's code.
    """
    model, run = task.model, task.run
    for done in range(states.shape[0]):
        cycle = run.cycle + 1
        code = advance(parts, task, cycle, phase, max_steps, max_jumps)
        if code != DONE:
            return done, code
        for i in range(model.dimension):
            states[done, i] = run.y[i]
        places[done, 0], places[done, 1], places[done, 2] = cycle, run.mode, run.jumps
    return states.shape[0], DONE
