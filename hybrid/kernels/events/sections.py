"""Stroboscopic points of a run, taken without leaving the compiled code."""

from numba import float64, int64, njit, types

from hybrid.kernels.types.codes import CYCLE, DONE, JUMPS, MODE
from hybrid.kernels.types.layout import (
    ADVANCE,
    ENTRY,
    INDEX_MATRIX,
    MATRIX,
    METHOD,
    MODEL,
    PARTS,
    RECORD,
    RUN,
    WORK,
)


@njit(
    types.UniTuple(int64, 2)(
        ADVANCE, PARTS, MODEL, METHOD, RUN, RECORD, WORK, float64, int64, int64, MATRIX, INDEX_MATRIX
    ),
    **ENTRY,
)
def strobe(advance, parts, model, method, run, record, work, phase, max_steps, max_jumps, states, places):
    """State ``(N, n)``, and cycle, mode and jump count ``(N, 3)``, at ``phase`` of the next N cycles.

    Returns how many were reached, and the driver's code.
    """
    for done in range(states.shape[0]):
        cycle = run.count[CYCLE] + 1
        code = advance(parts, model, method, run, record, 0, False, cycle, phase, max_steps, max_jumps, work)
        if code != DONE:
            return done, code
        for i in range(model.dimension):
            states[done, i] = run.y[i]
        places[done, 0], places[done, 1], places[done, 2] = cycle, run.count[MODE], run.count[JUMPS]
    return states.shape[0], DONE
