"""The clock of a run: whole periods counted, and the phase in the present one.

The phase has two parts, the number itself and what its rounding lost. The time between two events, which is
all that a system without forcing knows of time, then has as many digits after a million units of time as at
the start.
"""

import math

from numba import njit

from hybrid.kernels.types.layout import INLINE, KERNEL

# What a sum loses is found by sums in the order in which they are written.
IN_ORDER = KERNEL | {"fastmath": False}


@njit(**IN_ORDER)
def sum_in_two_parts(a, b):
    """``a + b``, rounded, and what the rounding lost (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@njit(**IN_ORDER)
def time_left(model, run, stop_cycle, stop_phase):
    """Time until the stop; periods are counted, not measured, so that none of their digits is lost."""
    if not stop_phase < math.inf:
        return stop_phase
    left, lost = sum_in_two_parts(stop_phase, -run.phase)
    return (stop_cycle - run.cycle) * model.period + (left + (lost - run.phase_low))


@njit(**IN_ORDER)
def forward(run, period, span):
    """Move the clock of a run on, keeping the phase below the period."""
    phase, lost = sum_in_two_parts(run.phase, span)
    phase, low = sum_in_two_parts(phase, lost + run.phase_low)
    while period > 0.0 and phase >= period:
        phase, low = sum_in_two_parts(phase - period, low)
        run.cycle += 1
    run.phase, run.phase_low = phase, low


@njit(**KERNEL)
def set_clock(run, cycle, phase):
    """Put the clock of a run to a number of whole periods and a phase."""
    run.cycle = cycle
    run.phase, run.phase_low = phase, 0.0


@njit(**INLINE)
def measured_time(model, run, mode):
    """The time whose rounding limits the steps of a mode.

    It is the phase where the field of the mode or one of its guards depends on time. Where they do not, it is
    the time since the last jump.
    """
    return abs(run.phase) if model.timed[mode] == 1 else run.since_entry
