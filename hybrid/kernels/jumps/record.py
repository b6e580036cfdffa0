"""What a run records of its jumps, and of flights that it skips."""

from numba import njit

from hybrid.kernels.events.record import start_record
from hybrid.kernels.types.options import KERNEL


@njit(**KERNEL)
def remember_jump(run, record, transition, transversality, kind, known, x_plus, work):
    """Write a jump from the run's state to ``x_plus`` into the record, if it keeps any.

    Its matrix is ``work.saltation`` if that is ``known``; else the matrix follows from the other entries.
    """
    n, slot = record.jump_states.shape[2], record.jumps
    if slot == record.jump_phase.shape[0]:
        return
    record.jump_phase[slot], record.jump_low[slot] = run.phase, run.phase_low
    record.jump_cycle[slot] = run.cycle
    record.jump_transition[slot] = transition
    record.jump_transversality[slot] = transversality
    record.jump_kind[slot] = kind
    record.jump_has_matrix[slot] = 1 if known else 0
    record.jump_row[slot] = run.row
    for i in range(n):
        record.jump_states[slot, 0, i] = run.y[i]
        record.jump_states[slot, 1, i] = x_plus[i]
    record.jumps = slot + 1
    if known:
        matrix = record.jump_saltation[record.matrices]
        for i in range(n):
            for j in range(n):
                matrix[i, j] = work.saltation[i, j]
        record.matrices += 1


@njit(**KERNEL)
def remember_flight(run, record, n, span, x_limit):
    """Write the skipped jumps into the record of steps, as one straight line to their limit."""
    if record.steps == record.step_phase.shape[0]:
        return
    rows = record.step_coefficients[start_record(run, record, run.phase, span)]
    for k in range(rows.shape[0]):
        for i in range(n):
            rows[k, i] = run.y[i] if k == 0 else (x_limit[i] - run.y[i] if k == 1 else 0.0)
        rows[k, n] = span if k == 1 else 0.0
