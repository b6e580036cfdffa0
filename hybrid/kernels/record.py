"""What a run is asked to remember, written down as it goes."""

from numba import njit

from hybrid.kernels.codes import CYCLE, GRAZING_GUARD, GRAZING_VALUE, GRAZINGS, JUMPS, MODE
from hybrid.kernels.guards import allowed, guard_acceleration, guard_speed
from hybrid.kernels.layout import KERNEL


@njit(**KERNEL)
def start_record(run, record, t, span):
    """Write the place of a step into the record, and return its slot: the polynomial is still missing."""
    slot = record.used[0]
    record.step_time[slot, 0], record.step_time[slot, 1] = t, span
    record.step_place[slot, 0], record.step_place[slot, 1] = run.count[CYCLE], run.count[MODE]
    record.step_place[slot, 2] = run.count[JUMPS]
    record.used[0] = slot + 1
    return slot


@njit(**KERNEL)
def raise_degree(coefficients, degree, highest, columns):
    """Write the polynomials in the first ``degree + 1`` rows as polynomials of a higher degree, in place."""
    for d in range(degree, highest):
        for i in range(columns):
            coefficients[d + 1, i] = coefficients[d, i]
            for j in range(d, 0, -1):
                share = j / (d + 1.0)
                coefficients[j, i] = share * coefficients[j - 1, i] + (1.0 - share) * coefficients[j, i]


@njit(**KERNEL)
def remember_grazing(model, run, record, time, work):
    """Count the grazing found on a step, and write it into the record if that keeps any.

    The state there is in ``work.state``, the rest in the slots of the run that ``note_grazing`` fills.
    """
    mode, transition = run.count[MODE], run.count[GRAZING_GUARD]
    if not allowed(model, transition, time, work.state, work.scalar):
        return
    run.count[GRAZINGS] += 1
    slot = record.used[2]
    if slot == record.grazing_time.shape[0]:
        return
    for i in range(model.dimension):
        record.grazing_state[slot, i] = work.state[i]
    place = record.grazing_state[slot]
    model.flow(mode, time, place, model.parameters, work.field)
    guard_speed(model, transition, time, place, work.field, work.gradient)
    record.grazing_time[slot, 0], record.grazing_time[slot, 1] = time, run.clock[GRAZING_VALUE]
    record.grazing_time[slot, 2] = guard_acceleration(model, transition, mode, time, place, work)
    record.grazing_place[slot, 0], record.grazing_place[slot, 1] = run.count[CYCLE], transition
    record.grazing_place[slot, 2] = run.count[JUMPS]
    record.used[2] = slot + 1
