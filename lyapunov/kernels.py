"""Long runs in bounded memory: growth of tangent vectors, and distances of neighbouring orbits."""

import math

from numba import boolean, float64, int64, njit, types

from hybrid.kernels.arithmetic.tangent import orthonormalise
from hybrid.kernels.types.codes import (
    DIVERGENCE,
    DONE,
    ENTERING,
    INDISTINCT,
    LAST_FIRED,
    LOG_DETERMINANT,
    MODE,
    NO_TRANSITION,
    PENDING,
    PHASE_OF_RUN,
    PREVIOUS_MODE,
    READY,
    STALE,
    STEPS,
    STRAIN,
)
from hybrid.kernels.types.layout import (
    ADVANCE,
    ENTRY,
    INDICES,
    KERNEL,
    MATRIX,
    METHOD,
    MODEL,
    PARTS,
    RECORD,
    RUN,
    VECTOR,
    WORK,
)
from lyapunov import statistics

UNLIMITED = 9223372036854775807

push = njit(**KERNEL)(statistics.push)


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


@njit(
    types.UniTuple(int64, 2)(
        ADVANCE,
        PARTS,
        MODEL,
        METHOD,
        RUN,
        RECORD,
        WORK,
        int64,
        INDICES,
        VECTOR,
        float64,
        int64,
        boolean,
        MATRIX,
        MATRIX,
        INDICES,
    ),
    **ENTRY,
)
def growth_rates(
    advance,
    parts,
    model,
    method,
    run,
    record,
    work,
    tangents,
    cycle,
    phase,
    interval,
    max_steps,
    resumed,
    rates,
    batches,
    batch_state,
):
    """Growth rates ``(M, k + 1)`` of ``k`` tangent vectors over ``M`` intervals (Benettin et al. 1980).

    The last column is the other side of the sum rule: the integral of div f plus the log-determinants of the
    saltation matrices, per unit time. ``cycle (1,)`` and ``phase (1,)`` hold the end of the last interval.
    Each row also goes to ``batches``. Returns how many intervals were completed, and the driver's code. After
    ``MAX_STEPS`` the interval that was not completed is ``resumed`` by the next call.
    """
    n = model.dimension
    for done in range(rates.shape[0]):
        if done > 0 or not resumed:
            for c in range(tangents):
                run.growth[c] = 0.0
            run.clock[DIVERGENCE], run.clock[LOG_DETERMINANT] = 0.0, 0.0
            cycle[0], phase[0] = later(model.period, cycle[0], phase[0], interval)
        code = advance(
            parts, model, method, run, record, tangents, True, cycle[0], phase[0], max_steps, UNLIMITED, work
        )
        if code != DONE:
            return done, code
        run.count[INDISTINCT] += orthonormalise(run.y, n, tangents, run.growth, 0.0)
        run.clock[STRAIN] = 0.0
        if run.count[PHASE_OF_RUN] == READY:
            run.count[PHASE_OF_RUN] = STALE
        for c in range(tangents):
            rates[done, c] = run.growth[c] / interval
        rates[done, tangents] = (run.clock[DIVERGENCE] + run.clock[LOG_DETERMINANT]) / interval
        push(batches, batch_state, rates[done])
    return rates.shape[0], DONE


@njit(**KERNEL)
def distance(run, other, n):
    """Euclidean distance of the states of two runs; the phase of the forcing is the same in both."""
    total = 0.0
    for i in range(n):
        total += (run.y[i] - other.y[i]) ** 2
    return math.sqrt(total)


@njit(**KERNEL)
def rescale(run, other, n, factor):
    """Multiply the distance of ``other`` from ``run`` by ``factor``, and put it in the mode of ``run``."""
    for i in range(n):
        other.y[i] = run.y[i] + factor * (other.y[i] - run.y[i])
    # It has been taken from the point of ``run`` to its own: what lies in between it has crossed.
    for i in range(other.side.shape[0]):
        other.side[i], other.on_guard[i], other.due[i] = run.side[i], run.on_guard[i], 0
    other.count[PREVIOUS_MODE] = run.count[MODE]
    other.count[MODE] = run.count[MODE]
    other.count[PHASE_OF_RUN] = ENTERING
    other.count[LAST_FIRED] = NO_TRANSITION
    other.count[PENDING] = NO_TRANSITION


@njit(
    types.UniTuple(int64, 2)(
        ADVANCE,
        PARTS,
        MODEL,
        METHOD,
        RUN,
        RUN,
        RUN,
        RECORD,
        WORK,
        WORK,
        WORK,
        INDICES,
        VECTOR,
        float64,
        float64,
        int64,
        int64,
        boolean,
        MATRIX,
    ),
    **ENTRY,
)
def distances(
    advance,
    parts,
    model,
    method,
    run,
    free,
    renormalised,
    record,
    work,
    free_work,
    renormalised_work,
    cycle,
    phase,
    interval,
    separation,
    max_steps,
    burst,
    resumed,
    out,
):
    """Distances ``(M, 2)`` of two companions from an orbit at the ends of ``M`` intervals.

    The first companion runs freely; the second is brought back to ``separation`` after each interval
    (Benettin, Galgani, Strelcyn 1976). Returns how many intervals were completed, and the driver's code. Each
    run takes ``burst`` steps at most; after ``MAX_STEPS`` the interval that was not completed is ``resumed``
    by the next call.
    """
    n = model.dimension
    most = min(max_steps, run.count[STEPS] + burst)
    free_most = min(max_steps, free.count[STEPS] + burst)
    renormalised_most = min(max_steps, renormalised.count[STEPS] + burst)
    for done in range(out.shape[0]):
        if done > 0 or not resumed:
            cycle[0], phase[0] = later(model.period, cycle[0], phase[0], interval)
        code = advance(parts, model, method, run, record, 0, False, cycle[0], phase[0], most, UNLIMITED, work)
        if code == DONE:
            code = advance(
                parts,
                model,
                method,
                free,
                record,
                0,
                False,
                cycle[0],
                phase[0],
                free_most,
                UNLIMITED,
                free_work,
            )
        if code == DONE:
            code = advance(
                parts,
                model,
                method,
                renormalised,
                record,
                0,
                False,
                cycle[0],
                phase[0],
                renormalised_most,
                UNLIMITED,
                renormalised_work,
            )
        if code != DONE:
            return done, code
        out[done, 0] = distance(run, free, n)
        out[done, 1] = distance(run, renormalised, n)
        if out[done, 1] > 0.0:
            rescale(run, renormalised, n, separation / out[done, 1])
    return out.shape[0], DONE
