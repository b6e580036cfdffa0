"""The driver: smooth steps, events, jumps, until a given time. All runs are calls of ``advance``."""

import math

from numba import boolean, float64, int64, njit

from hybrid.kernels.arithmetic.bernstein import crosses_towards
from hybrid.kernels.arithmetic.clock import forward, set_clock, time_left
from hybrid.kernels.arithmetic.tangent import keep_apart
from hybrid.kernels.events.guards import (
    allowed,
    guard_speed,
    is_forced,
    may_jump,
    was_left_behind,
    widen_scale,
)
from hybrid.kernels.events.onset import BY_STEP
from hybrid.kernels.events.sides import side_of
from hybrid.kernels.steps.series import series_step
from hybrid.kernels.types.codes import (
    ACCUMULATION,
    AT_REST,
    DONE,
    ENTERING,
    GO_ON,
    JUMPS,
    JUMPS_HERE,
    LAST_FIRED,
    LAST_STEP,
    MAX_JUMPS,
    MAX_STEPS,
    MODE,
    NEXT_STEP,
    NO_MODE,
    NO_TRANSITION,
    NON_FINITE,
    PENDING,
    PHASE,
    PHASE_OF_RUN,
    PREVIOUS_MODE,
    RECORD_FULL,
    RESTING,
    RUNGE_KUTTA,
    SINCE_ENTRY,
    STALE,
    STEPS,
    STUCK,
    TERMINAL,
)
from hybrid.kernels.types.layout import ENTRY, KERNEL, METHOD, MODEL, PARTS, RECORD, RUN, WORK

# More jumps than this at one instant, in all or per transition, are not going to end.
MOST_JUMPS_AT_ONCE = 1000
MOST_JUMPS_EACH = 100


@njit(**KERNEL)
def arrived(model, run, work):
    """Transition whose guard is reached or passed at the end of a run: it belongs to this run.

    Sides and rounding are judged as by a run that starts here, which knows nothing of the step that led here,
    and takes a guard that it starts beyond as crossed; but the steps of Runge-Kutta methods can pass a guard
    by their own rounding without having found it.
    """
    mode, t, found = run.count[MODE], run.clock[PHASE], NO_TRANSITION
    model.flow(mode, t, run.y, model.parameters, work.field)
    for i in range(model.dimension):
        work.settled[i] = run.scale[i]
        if model.propagator[mode] != RUNGE_KUTTA:
            run.scale[i] = abs(run.y[i])
    widen_scale(model, run, work)
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        before = run.side[transition]
        if found != NO_TRANSITION or before == 0 or run.on_guard[transition] != 0:
            continue
        now, order = side_of(model, run, mode, transition, t, run.y, before, False, work)
        if order == BY_STEP and may_jump(model, run, transition, t, run.y, work):
            # An event at a jump lies beyond its near side.
            now = -before
        elif now == -before and order == 0:
            speed = guard_speed(model, transition, t, run.y, work.field, work.gradient)
            if was_left_behind(model, run, transition, t, run.y, speed, before, work):
                now = before
        crossed = now == -before and crosses_towards(model.direction[transition], now)
        if crossed and allowed(model, transition, t, run.y, work.scalar):
            found = transition
    for i in range(model.dimension):
        run.scale[i] = max(run.scale[i], work.settled[i])
    return found


@njit(**KERNEL)
def finite(run, length):
    """Whether the first ``length`` entries of the run's vector are finite."""
    total = 0.0
    for i in range(length):
        total += abs(run.y[i])
    return total < math.inf


@njit(
    int64(PARTS, MODEL, METHOD, RUN, RECORD, int64, boolean, int64, float64, int64, int64, WORK),
    **ENTRY,
)
def advance(
    parts,
    model,
    method,
    run,
    record,
    tangents,
    orthonormal,
    stop_cycle,
    stop_phase,
    max_steps,
    max_jumps,
    work,
):
    """Advance a run to the time ``stop_cycle`` periods and ``stop_phase``; returns a code.

    The run can be taken up again from any code that is not an error: after ``RECORD_FULL`` once the record
    has been emptied, after ``MAX_STEPS`` and ``MAX_JUMPS`` with larger limits. Nothing is allocated.
    """
    length = model.dimension * (1 + tangents)
    recording = record.step_time.shape[0] > 0
    while True:
        if run.count[PENDING] != NO_TRANSITION:
            if run.count[JUMPS] >= max_jumps:
                return MAX_JUMPS
            # One more than this jump: it may turn out to be the last of a chatter, whose limit follows at
            # once.
            if 0 < record.jump_time.shape[0] <= record.used[1] + 1:
                return RECORD_FULL
            if run.count[JUMPS_HERE] > max(MOST_JUMPS_AT_ONCE, MOST_JUMPS_EACH * model.target.shape[0]):
                return STUCK
            fired = run.count[PENDING]
            run.count[PENDING] = NO_TRANSITION
            parts.jump(model, method, run, record, fired, tangents, orthonormal, work)
            if model.target[fired] == NO_MODE:
                return TERMINAL
            remaining = time_left(model, run, stop_cycle, stop_phase)
            if (
                parts.finish_chatter(
                    model, method, run, record, fired, remaining, tangents, orthonormal, work
                )
                and model.accumulates_to[run.count[LAST_FIRED]] == NO_MODE
            ):
                return ACCUMULATION
            continue
        mode = run.count[MODE]
        if run.count[PHASE_OF_RUN] == ENTERING:
            if not finite(run, length):
                return NON_FINITE
            fires = parts.enter(model, run, work)
            if fires == RESTING:
                limit_mode = model.accumulates_to[run.count[LAST_FIRED]]
                if limit_mode == NO_MODE:
                    run.count[AT_REST] = 1
                    return ACCUMULATION
                parts.rest(model, run, limit_mode, tangents, orthonormal, work)
                continue
            if fires != NO_TRANSITION:
                run.count[PENDING] = fires
                continue
            if mode != run.count[PREVIOUS_MODE]:
                run.clock[NEXT_STEP] = run.first_step[mode]
                run.first_step[mode] = 0.0
            run.clock[LAST_STEP] = 0.0
            run.count[PHASE_OF_RUN] = STALE
        remaining = time_left(model, run, stop_cycle, stop_phase)
        if remaining <= 0.0:
            fired = arrived(model, run, work)
            if fired == NO_TRANSITION:
                return DONE
            run.count[PENDING] = parts.first_in_order(model, run, record, fired, work)
            continue
        if recording and record.used[0] + 1 >= record.step_time.shape[0]:
            return RECORD_FULL
        if 0 < record.grazing_time.shape[0] == record.used[2]:
            return RECORD_FULL
        if run.count[STEPS] >= max_steps:
            return MAX_STEPS
        if model.propagator[mode] == RUNGE_KUTTA:
            code, span = parts.runge_kutta_step(
                parts.attempts, model, method, run, record, tangents, orthonormal, remaining, work
            )
        else:
            code, span = series_step(parts.attempts, model, method, run, record, tangents, remaining, work)
            if code == NON_FINITE and is_forced(model, mode):
                # Terms of the series overflow far from a pulse, ``cosh`` in ``1 / cosh``; the field does not.
                run.count[PHASE_OF_RUN] = STALE
                code, span = parts.runge_kutta_step(
                    parts.attempts, model, method, run, record, tangents, orthonormal, remaining, work
                )
                run.count[PHASE_OF_RUN] = STALE
        if code != GO_ON:
            return int(code)
        forward(run, model.period, span)
        run.clock[SINCE_ENTRY] += span
        if orthonormal and 0.0 < span < remaining:
            keep_apart(model, run, mode, tangents, work.jacobian)
        fired = run.count[PENDING]
        if span > remaining or (span >= remaining and fired == NO_TRANSITION):
            set_clock(run, stop_cycle, stop_phase)
        if fired != NO_TRANSITION:
            run.count[PENDING] = parts.first_in_order(model, run, record, fired, work)
