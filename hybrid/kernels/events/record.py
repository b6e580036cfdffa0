"""Writes the record of a run: its steps and grazings."""

from numba import njit

from hybrid.kernels.events.guards import allowed, keep_grazing
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


@njit(**KERNEL)
def remember_grazing(model, run, record, time, work):
    """Record the grazing found on a step, at ``work.state``, if its transition is allowed there."""
    transition = run.grazing_guard
    if allowed(model, transition, time, work.state, work.scalar):
        keep_grazing(model, run, record, transition, time, work.state, run.grazing_value, work)
