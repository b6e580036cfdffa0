"""What a run is asked to remember, written down as it goes."""

from numba import njit

from hybrid.kernels.events.guards import allowed, keep_grazing
from hybrid.kernels.types.codes import CYCLE, GRAZING_GUARD, GRAZING_VALUE, JUMPS, MODE, PHASE_LOW
from hybrid.kernels.types.layout import KERNEL


@njit(**KERNEL)
def start_record(run, record, t, span):
    """Write the place of a step into the record, and return its slot: the polynomial is still missing."""
    slot = record.used[0]
    record.step_time[slot, 0], record.step_time[slot, 1] = t, span
    record.step_time[slot, 2] = run.clock[PHASE_LOW]
    record.step_place[slot, 0], record.step_place[slot, 1] = run.count[CYCLE], run.count[MODE]
    record.step_place[slot, 2] = run.count[JUMPS]
    record.used[0] = slot + 1
    return slot


@njit(**KERNEL)
def remember_grazing(model, run, record, time, work):
    """Keep the grazing found on a step, at ``work.state``, if its transition might have fired there."""
    transition = run.count[GRAZING_GUARD]
    if allowed(model, transition, time, work.state, work.scalar):
        keep_grazing(model, run, record, transition, time, work.state, run.clock[GRAZING_VALUE], work)
