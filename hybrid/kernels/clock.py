"""The clock of a run: whole periods counted, and the phase in the present one."""

from numba import njit

from hybrid.kernels.codes import CYCLE, PHASE
from hybrid.kernels.layout import INLINE, KERNEL


@njit(**INLINE)
def time_left(model, run, stop_cycle, stop_phase):
    """Time until the stop; periods are counted, not measured, so that none of their digits is lost."""
    return (stop_cycle - run.count[CYCLE]) * model.period + (stop_phase - run.clock[PHASE])


@njit(**KERNEL)
def forward(run, period, span):
    """Move the clock of a run on, keeping the phase below the period."""
    phase = run.clock[PHASE] + span
    while period > 0.0 and phase >= period:
        phase -= period
        run.count[CYCLE] += 1
    run.clock[PHASE] = phase
