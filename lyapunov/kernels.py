"""Long runs in bounded memory: growth of tangent vectors, and distances of neighbouring orbits."""

import math

from numba import njit

from hybrid.kernels.arithmetic.tangent import orthonormalise
from hybrid.kernels.types import notes
from hybrid.kernels.types.abreast import Crew
from hybrid.kernels.types.codes import (
    DONE,
    ENTERING,
    GO_ON,
    MAX_JUMPS,
    NO_TRANSITION,
    READY,
    STALE,
)
from hybrid.kernels.types.kinds import INTEGER, MATRIX, REAL, TRUTH
from hybrid.kernels.types.layout import ADVANCE, Parts, Task
from hybrid.kernels.types.numba_door.addressed import structure_at
from hybrid.kernels.types.options import KERNEL, exported
from lyapunov import batches
from lyapunov.interval import End, Growths, Maps

UNLIMITED = 9223372036854775807

push = njit(**KERNEL)(batches.push)
is_plain, carries_plainly = njit(**KERNEL)(notes.is_plain), njit(**KERNEL)(notes.carries_plainly)
growths_at, maps_at = structure_at(Growths), structure_at(Maps)


@njit(**KERNEL)
def later(period, cycle, phase, interval):
    """Time an interval later, in periods and a phase; a forcing period later is exactly the next cycle."""
    if interval == period:
        return cycle + 1, phase
    phase += interval
    while period > 0.0 and phase >= period:
        phase -= period
        cycle += 1
    return cycle, phase


@njit(**KERNEL)
def advance_and_count(advance, parts, task, growths, max_steps):
    """Advance the only run to the end of its interval and count its jumps, if they are. Returns its code."""
    run, cycle, phase = task.run, growths.cycles[0], growths.phases[0]
    counted = growths.hits.shape[0] > 0
    code = advance(parts, task, cycle, phase, max_steps, run.jumps if counted else UNLIMITED)
    while code == MAX_JUMPS:
        growths.hits[run.pending] += 1
        code = advance(parts, task, cycle, phase, max_steps, run.jumps + 1)
    return code


@exported(INTEGER, ADVANCE, Parts, Task, Growths, INTEGER, TRUTH)
def growth_rates(advance, parts, task, growths, max_steps, resumed):
    """Growth rates of the tangent vectors of one run (Benettin et al. 1980). Returns the driver's code.

    After ``MAX_STEPS`` the next call resumes the interval that was not completed: ``resumed``.
    """
    while growths.done[0] < growths.count:
        if not resumed:
            begin_interval(task, growths, 0)
        resumed = False
        code = advance_and_count(advance, parts, task, growths, max_steps)
        if code != DONE:
            return code
        end_interval(task, growths, 0)
    return DONE


@njit(**KERNEL)
def begin_interval(task, growths, r):
    """Begin an interval of run ``r``."""
    run = task.run
    for c in range(task.tangents):
        run.growth[c] = 0.0
    run.divergence, run.log_determinant = 0.0, 0.0
    for i in range(growths.hits.shape[0]):
        growths.hits[i] = 0
    growths.cycles[r], growths.phases[r] = later(
        task.model.period, growths.cycles[r], growths.phases[r], growths.lengths[r]
    )


@njit(**KERNEL)
def end_interval(task, growths, r):
    """End an interval of run ``r``: its growth rates are the next row, and go into the batches."""
    run, n, tangents = task.run, task.model.dimension, task.tangents
    run.indistinct += orthonormalise(run.y, n, tangents, run.growth, task.work.jacobian, False, 0)
    run.strain = 0.0
    if run.stage == READY:
        run.stage = STALE
    rates, interval = growths.rates[r, growths.done[r]], growths.lengths[r]
    for c in range(tangents):
        rates[c] = run.growth[c] / interval
    rates[tangents] = (run.divergence + run.log_determinant) / interval
    for i in range(growths.hits.shape[0]):
        rates[tangents + 1 + i] = growths.hits[i] / interval
    push(growths.batches[r], growths.batch_states[r], rates)
    growths.done[r] += 1


@exported(INTEGER, Parts, Task, Crew, INTEGER, INTEGER)
def growth_of_run(parts, task, crew, r, code):
    """What a run does next whose growth rates are wanted (``ONWARD``), as in ``growth_rates``."""
    growths = growths_at(crew.jobs[r])
    if code == DONE:
        end_interval(task, growths, r)
        if growths.done[r] == growths.count:
            plain = carries_plainly(task.run) and is_plain(task.model, task.run, 0)
            growths.plain[r] = 1 if plain else 0
            return DONE
    elif code != GO_ON:
        return code
    begin_interval(task, growths, r)
    crew.cycles[r], crew.phases[r] = growths.cycles[r], growths.phases[r]
    return GO_ON


@exported(INTEGER, Parts, Task, Crew, INTEGER, INTEGER)
def maps_of_run(parts, task, crew, r, code):
    """What a run does next whose tangent maps are wanted, each over an interval (``ONWARD``)."""
    job, run, n = maps_at(crew.jobs[r]), task.run, task.model.dimension
    entries = n * task.tangents
    if code == DONE:
        for i in range(entries):
            job.maps[job.done, i] = run.y[n + i]
        job.maps[job.done, entries] = run.divergence + run.log_determinant
        job.done += 1
        if job.done == job.count:
            return DONE
    elif code != GO_ON:
        return code
    for i in range(entries):
        run.y[n + i] = 1.0 if i // n == i % n else 0.0
    run.divergence, run.log_determinant, run.strain = 0.0, 0.0, 0.0
    if run.stage == READY:
        run.stage = STALE
    job.end.cycle, job.end.phase = later(task.model.period, job.end.cycle, job.end.phase, job.interval)
    crew.cycles[r], crew.phases[r] = job.end.cycle, job.end.phase
    return GO_ON


@njit(**KERNEL)
def distance(run, other, n):
    """Euclidean distance of the states of two runs; the phase of the forcing is the same in both."""
    largest, total = 0.0, 0.0
    for i in range(n):
        largest = max(largest, abs(run.y[i] - other.y[i]))
    for i in range(n if largest > 0.0 else 0):
        # Squares of the differences themselves may leave the range of floats.
        share = (run.y[i] - other.y[i]) / largest
        total += share * share
    return largest * math.sqrt(total)


@njit(**KERNEL)
def rescale(run, other, n, factor):
    """Multiply the distance of ``other`` from ``run`` by ``factor``, and put it in the mode of ``run``."""
    for i in range(n):
        other.y[i] = run.y[i] + factor * (other.y[i] - run.y[i])
    # It has been taken from the point of ``run`` to its own: what lies in between it has crossed.
    for i in range(other.side.shape[0]):
        other.side[i], other.on_guard[i], other.due[i] = run.side[i], run.on_guard[i], 0
    other.previous_mode = run.mode
    other.mode = run.mode
    other.stage = ENTERING
    other.last_fired = NO_TRANSITION
    other.pending = NO_TRANSITION


@exported(INTEGER, ADVANCE, Parts, Task, Task, Task, End, REAL, REAL, INTEGER, INTEGER, TRUTH, MATRIX)
def distances(
    advance, parts, task, free, renormalised, end, interval, separation, max_steps, burst, resumed, out
):
    """Distances ``(M, 2)`` of two companions from an orbit at the ends of ``M`` intervals.

    The first companion runs freely; the second is brought back to ``separation`` after each interval
    (Benettin, Galgani, Strelcyn 1976). Returns the driver's code; ``end.done`` is how many intervals were
    completed. Each run takes ``burst`` steps at most; after ``MAX_STEPS`` the interval that was not completed
    is ``resumed`` by the next call.
    """
    run, period, n = task.run, task.model.period, task.model.controlled
    most = min(max_steps, run.steps + burst)
    free_most = min(max_steps, free.run.steps + burst)
    renormalised_most = min(max_steps, renormalised.run.steps + burst)
    for done in range(out.shape[0]):
        end.done = done
        if done > 0 or not resumed:
            end.cycle, end.phase = later(period, end.cycle, end.phase, interval)
        code = advance(parts, task, end.cycle, end.phase, most, UNLIMITED)
        if code == DONE:
            code = advance(parts, free, end.cycle, end.phase, free_most, UNLIMITED)
        if code == DONE:
            code = advance(parts, renormalised, end.cycle, end.phase, renormalised_most, UNLIMITED)
        if code != DONE:
            return code
        out[done, 0] = distance(run, free.run, n)
        out[done, 1] = distance(run, renormalised.run, n)
        if out[done, 1] > 0.0:
            rescale(run, renormalised.run, n, separation / out[done, 1])
    end.done = out.shape[0]
    return DONE
