"""Long runs in bounded memory: growth of tangent vectors, and distances of neighbouring orbits."""

import math

from numba import njit

from hybrid.kernels.arithmetic.tangent import orthonormalise
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
from lyapunov.interval import End, Growth, Maps, Sums

UNLIMITED = 9223372036854775807

push = njit(**KERNEL)(batches.push)
growth_at, maps_at = structure_at(Growth), structure_at(Maps)


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
def advance_and_count(advance, parts, task, cycle, phase, max_steps, hits):
    """Advance a run; the jumps that it makes are counted in ``hits (transitions,)``. Returns its code."""
    run = task.run
    code = advance(parts, task, cycle, phase, max_steps, run.jumps)
    while code == MAX_JUMPS:
        hits[run.pending] += 1
        code = advance(parts, task, cycle, phase, max_steps, run.jumps + 1)
    return code


@exported(INTEGER, ADVANCE, Parts, Task, End, Sums, REAL, INTEGER, TRUTH, MATRIX)
def growth_rates(advance, parts, task, end, sums, interval, max_steps, resumed, rates):
    """Growth rates ``(M, k + 1 + T)`` of ``k`` tangent vectors over ``M`` intervals (Benettin et al. 1980).

    The column after them is the other side of the sum rule: the integral of div f plus the log-determinants
    of the saltation matrices, per unit time. The last columns are the jumps of each transition per unit time.
    ``end`` is the end of the last interval. Each row is also added to the batches of ``sums``. Returns the
    driver's code; ``end.done`` is how many intervals were completed. After ``MAX_STEPS`` the next call
    resumes the interval that was not completed: ``resumed``.
    """
    for done in range(rates.shape[0]):
        end.done = done
        if done > 0 or not resumed:
            begin_interval(task, end, sums, interval)
        code = advance_and_count(advance, parts, task, end.cycle, end.phase, max_steps, sums.hits)
        if code != DONE:
            return code
        end_interval(task, sums, interval, rates[done])
    end.done = rates.shape[0]
    return DONE


@njit(**KERNEL)
def begin_interval(task, end, sums, interval):
    """Begin an interval: ``end`` becomes its end."""
    run = task.run
    for c in range(task.tangents):
        run.growth[c] = 0.0
    run.divergence, run.log_determinant = 0.0, 0.0
    for i in range(sums.hits.shape[0]):
        sums.hits[i] = 0
    end.cycle, end.phase = later(task.model.period, end.cycle, end.phase, interval)


@njit(**KERNEL)
def end_interval(task, sums, interval, rates):
    """End an interval: its growth rates into ``rates (k + 1 + T,)``, and into the batches."""
    run, n, tangents, hits = task.run, task.model.dimension, task.tangents, sums.hits
    run.indistinct += orthonormalise(run.y, n, tangents, run.growth, task.work.jacobian, False, 0)
    run.strain = 0.0
    if run.stage == READY:
        run.stage = STALE
    for c in range(tangents):
        rates[c] = run.growth[c] / interval
    rates[tangents] = (run.divergence + run.log_determinant) / interval
    for i in range(hits.shape[0]):
        rates[tangents + 1 + i] = hits[i] / interval
    push(sums.batches, sums.batch_state, rates)


@exported(INTEGER, Parts, Task, Crew, INTEGER, INTEGER)
def growth_of_run(parts, task, crew, r, code):
    """What a run does next whose growth rates are those of ``growth_rates`` (``ONWARD``)."""
    growth, run = growth_at(crew.jobs[r]), task.run
    if code == MAX_JUMPS:
        growth.sums.hits[run.pending] += 1
        crew.max_jumps[r] = run.jumps + 1
        return GO_ON
    if code == DONE:
        end_interval(task, growth.sums, growth.interval, growth.rates[growth.done])
        growth.done += 1
        if growth.done == growth.count:
            return DONE
    elif code != GO_ON:
        return code
    begin_interval(task, growth.end, growth.sums, growth.interval)
    crew.cycles[r], crew.phases[r] = growth.end.cycle, growth.end.phase
    crew.max_jumps[r] = run.jumps
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
