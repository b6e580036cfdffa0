"""Writes the steps of a run into its record."""

from numba import njit

from hybrid.kernels.types.options import KERNEL


@njit(**KERNEL)
def start_record(run, record, t, span):
    """Write time and mode of a step into the record; returns its slot, which still lacks the polynomial."""
    slot = record.steps
    record.step_phase[slot] = t
    record.step_low[slot] = run.phase_low
    record.step_length[slot] = span
    record.step_cycle[slot] = run.cycle
    record.step_mode[slot] = run.mode
    record.step_jumps[slot] = run.jumps
    record.steps = slot + 1
    return slot
