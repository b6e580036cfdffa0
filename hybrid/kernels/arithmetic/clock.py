"""The clock of a run: the number of whole periods, and the phase in the current period.

The phase has two parts: the rounded number and its rounding error. So the time between two events keeps as
many digits after a million units of time as at the start. A system without forcing depends on time only
through the time between events.
"""

import math

from numba import njit

from hybrid.kernels.types.layout import EPSILON, UPPER_HALF
from hybrid.kernels.types.options import INLINE, KERNEL

# The rounding error of a sum is found only if the compiler keeps the order of the operations.
IN_ORDER = KERNEL | {"fastmath": False}


@njit(**IN_ORDER)
def sum_in_two_parts(a, b):
    """``a + b``, rounded, and its rounding error (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@njit(**IN_ORDER)
def product_in_two_parts(a, b):
    """``a * b``, rounded, and its rounding error (Dekker)."""
    product = a * b
    part = UPPER_HALF * a
    high = part - (part - a)
    part = UPPER_HALF * b
    other = part - (part - b)
    low, other_low = a - high, b - other
    return product, ((high * other - product) + high * other_low + low * other) + low * other_low


@njit(**IN_ORDER)
def time_left(model, run, stop_cycle, stop_phase):
    """Time until the stop; whole periods are counted, so that they lose no digits."""
    if not stop_phase < math.inf:
        return stop_phase
    left, lost = sum_in_two_parts(stop_phase, -run.phase)
    return (stop_cycle - run.cycle) * model.period + (left + (lost - run.phase_low))


@njit(**IN_ORDER)
def time_until(run, phase, low):
    """Time until a phase of the current period, in two parts."""
    return (phase - run.phase) + (low - run.phase_low)


@njit(**IN_ORDER)
def time_before(t, last):
    """The longest time from ``t`` on that does not lead beyond ``last``, rounding included."""
    h = last - t
    while t + h > last:
        h *= 1.0 - EPSILON
    return h


@njit(**IN_ORDER)
def forward(run, period, span):
    """Advance the clock of a run by ``span``; the phase stays below the period."""
    phase, lost = sum_in_two_parts(run.phase, span)
    phase, low = sum_in_two_parts(phase, lost + run.phase_low)
    while period > 0.0 and phase >= period:
        # A step may be longer than a period: the difference is then rounded, too.
        phase, lost = sum_in_two_parts(phase, -period)
        phase, low = sum_in_two_parts(phase, lost + low)
        run.cycle += 1
    run.phase, run.phase_low = phase, low


@njit(**KERNEL)
def set_clock(run, cycle, phase):
    """Set the clock of a run to a number of whole periods and a phase."""
    run.cycle = cycle
    run.phase, run.phase_low = phase, 0.0


@njit(**INLINE)
def measured_time(model, run, mode):
    """The time whose rounding limits the steps of a mode.

    It is the phase if the vector field of the mode or one of its guards depends on time. Otherwise it is the
    time since the last jump.
    """
    return abs(run.phase) if model.timed[mode] == 1 else run.since_entry
