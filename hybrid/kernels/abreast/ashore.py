"""Where a run is that stops within a step, or has reached a guard at its end.

A run is asked for at times that have nothing to do with its steps, such as the ends of the intervals in which
the growth of tangent vectors is measured. A step leads beyond them: the series tell the state there, and the
run goes on along the same step.
"""

from numba import njit

from hybrid.kernels.abreast.crossing import DISTANT, is_twin
from hybrid.kernels.abreast.lanes import clear_guards
from hybrid.kernels.abreast.rows import bits_of, both, entry_at, rows_at
from hybrid.kernels.abreast.step import evaluate_four
from hybrid.kernels.drive import keep_scale
from hybrid.kernels.steps.series import holds_roots, land_series, number_of_guards, order_of
from hybrid.kernels.types.abreast import CYCLE, DIVERGENCE, LONGEST_STEP, PER_GUARD, ROOM, SINCE, STEPS
from hybrid.kernels.types.codes import ABREAST
from hybrid.kernels.types.options import INLINE, KERNEL


@njit(**INLINE)
def row_of_stop(model, method, mode):
    """The row of the series that has the values at a stop."""
    return order_of(model, method, mode) + 3 + number_of_guards(model, mode)


@njit(**KERNEL)
def evaluate_stops(model, method, sea, lane, places, mode, tangents):
    """Evaluate the series at the stop of each run, and see whether it is far from all guards there."""
    powers, order, end = sea.powers, order_of(model, method, mode), row_of_stop(model, method, mode)
    n, slot, place = model.dimension, model.first_outgoing[mode], rows_at(sea.stops, 0)
    for column in range(0, n + places.count + (2 if tangents > 0 else 0), 4):
        evaluate_four(powers, column, order, place, column < n, end)
    for column in range(sea.tangent_start, sea.tangent_start + (n if tangents > 0 else 0), 4):
        evaluate_four(powers, column, order, place, False, end)
    distant = place >= 0.0
    for g in range(places.count):
        if not is_twin(model, mode, slot + g):
            value = entry_at(powers, end, n + g) * rows_at(lane, places.guards + PER_GUARD * g)
            distant = both(distant, value > DISTANT * rows_at(lane, places.guards + PER_GUARD * g + 3))
    sea.distant_at_stop = bits_of(distant)


@njit(**KERNEL)
def look_out(sea, lane, places, task, factor, row):
    """Move a run to its stop; its lane has it at the end of the step already.

    Its tangent vector has been multiplied by ``factor`` since the start of the step.
    """
    model, run, powers, first = task.model, task.run, sea.powers, places.numbers * ABREAST + row
    n, mode, end = model.dimension, run.mode, row_of_stop(model, task.method, run.mode)
    order, steps = order_of(model, task.method, mode), int(lane[first + STEPS * ABREAST])
    for i in range(n):
        run.scale[i] = powers[end + 1, i * ABREAST + row]
        run.y[i] = powers[end, i * ABREAST + row]
    # What the lane has from here on is counted from the stop.
    if task.tangents > 0:
        for i in range(n):
            run.y[n + i] = factor * powers[end, (sea.tangent_start + i) * ABREAST + row]
        column = (n + places.count + 1) * ABREAST + row
        change = powers[order + 1, column] - powers[end, column]
        run.divergence += lane[first + DIVERGENCE * ABREAST] - change
        lane[first + DIVERGENCE * ABREAST] = change
    for g in range(places.count if holds_roots(model, mode) else 0):
        task.work.series[order + 1, n + g] = powers[end, (n + g) * ABREAST + row]
    run.steps += steps
    run.unchecked += steps
    run.since_entry = lane[first + SINCE * ABREAST] - (sea.ends[row] - sea.stops[row])
    run.longest_step = lane[first + LONGEST_STEP * ABREAST]
    lane[first + CYCLE * ABREAST] += run.cycle
    clear_guards(model, run, steps)
    run.distant = (sea.distant_at_stop >> row) & 1


@njit(**INLINE)
def look_ahead(sea, lane, places, task, room, factor, row):
    """Let a run that stopped go on to the end of its step; the rest of its ``room`` is left there."""
    first, n = places.numbers * ABREAST + row, task.model.dimension
    # The rest of the step counts as a step.
    lane[first + STEPS * ABREAST] = 1.0
    lane[first + CYCLE * ABREAST] -= task.run.cycle
    lane[first + ROOM * ABREAST] = room - (sea.ends[row] - sea.stops[row])
    for i in range(n, n * (1 + task.tangents)):
        lane[i * ABREAST + row] *= factor


@njit(**KERNEL)
def reach_end(sea, task, on_guard, row):
    """Bring a run onto the guard that its step ends at; returns the time that this takes.

    The event is left pending. The step may have begun ``on_guard``.
    """
    run, fired = task.run, sea.fired[row]
    stay, span = run.since_entry, sea.ends[row]
    gap = land_series(task.model, run, task.tangents, fired, run.phase, stay, span, task.work)
    run.pending = fired
    keep_scale(task.model, run, on_guard, run.phase + gap, task.work)
    return gap


@njit(**INLINE)
def largest_of_tangent(run, n):
    """Where the largest component of the tangent vector stands in the run's vector."""
    largest = n
    for i in range(n + 1, 2 * n):
        if abs(run.y[i]) > abs(run.y[largest]):
            largest = i
    return largest
