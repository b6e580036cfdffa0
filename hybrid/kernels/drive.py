"""The driver: smooth steps, events, jumps, until a given time. All runs are calls of ``advance``."""

import math

from numba import boolean, float64, int64, njit

from hybrid.kernels.codes import (
    ACCUMULATION,
    CYCLE,
    DIVERGENCE,
    DONE,
    ENTERING,
    GRAZING_GUARD,
    GRAZING_PLACE,
    GRAZING_VALUE,
    JUMPS,
    JUMPS_HERE,
    LAST_FIRED,
    LAST_RATIO,
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
    READY,
    RECORD_FULL,
    REJECTED,
    RESTING,
    STALE,
    STEP_TOO_SMALL,
    STEPS,
    STUCK,
    TERMINAL,
)
from hybrid.kernels.guards import (
    NOT_THERE,
    allowed,
    earliest_crossing,
    guard_speed,
    guard_value,
    keep_grazing,
    land,
    rounding_band,
    value_on_interpolant,
    widen_scale,
)
from hybrid.kernels.jump import forward
from hybrid.kernels.layout import ENTRY, INLINE, KERNEL, METHOD, MODEL, PARTS, RECORD, RUN, WORK
from hybrid.kernels.step import (
    attempt,
    attempt_again,
    interpolate,
    interpolation_stages,
    rates,
    starting_step,
)

SAFETY = 0.9
SHRINK = 0.2
GROW = 6.0
# An event resets the pace: a flight that is a polynomial has no error to hold its steps back, and one step
# across many bounces, each much shorter than it, would drown them in its rounding.
LONGEST_AFTER_EVENT = 100.0
EPSILON = 2.220446049250313e-16
# More jumps than this at one instant are not going to end.
MOST_JUMPS_AT_ONCE = 100


@njit(**KERNEL)
def arrived(model, run, work):
    """Transition whose guard is reached, up to rounding, at the end of a run: it belongs to this run."""
    mode, t = run.count[MODE], run.clock[PHASE]
    model.flow(mode, t, run.y, model.parameters, work.field)
    widen_scale(model, run, work)
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        value = guard_value(model, transition, t, run.y, work.scalar)
        speed = guard_speed(model, transition, t, run.y, work.field, work.gradient)
        if run.on_guard[transition] == 0 and abs(value) <= rounding_band(model, run, t, work.gradient):
            after = 1 if speed > 0.0 else -1
            direction = model.direction[transition]
            crossed = speed != 0.0 and after != run.side[transition] and direction in (0, after)
            if crossed and allowed(model, transition, t, run.y, work.scalar):
                return transition
    return NO_TRANSITION


@njit(**INLINE)
def all_affine(model, mode):
    """Whether every guard of the mode is affine, so that following them needs no interpolant of the state."""
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        if model.affine_guard[model.outgoing[slot]] == 0:
            return False
    return True


@njit(**KERNEL)
def remember_step(model, method, run, record, t, h, work):
    """Write the step just taken from ``run.y`` into the record; its stages are those of ``work``."""
    slot = record.used[0]
    mode = run.count[MODE]
    record.step_time[slot, 0], record.step_time[slot, 1] = t, h
    record.step_place[slot, 0], record.step_place[slot, 1] = run.count[CYCLE], mode
    record.step_place[slot, 2] = run.count[JUMPS]
    interpolation_stages(model, method, mode, t, h, run.y, work)
    interpolate(method, h, run.y, model.dimension, work)
    # Element by element: an array assignment brings its error message along, seconds of compilation.
    for i in range(work.coefficients.shape[0]):
        for j in range(model.dimension):
            record.step_coefficients[slot, i, j] = work.coefficients[i, j]
    record.used[0] = slot + 1


@njit(**INLINE)
def accept(model, method, run, tangents, h, correction, work):
    """Move the run to the end of the attempted step in ``work.new``."""
    n = model.dimension
    mode = run.count[MODE]
    on_guard = 0
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        on_guard += run.on_guard[model.outgoing[slot]]
    for i in range(n):
        before = run.scale[i] if on_guard > 0 else 0.0
        run.scale[i] = max(before, abs(run.y[i]), abs(work.new[i]), abs(h * work.stages[0, i]))
    for i in range(n * (1 + tangents)):
        run.y[i] = work.new[i]
    if tangents > 0:
        s, place = method.b.shape[0], n * (1 + tangents)
        total = 0.0
        for j in range(s + 1):
            total += method.quadrature[j] * work.stages[j, place]
        run.clock[DIVERGENCE] += h * total + correction * work.stages[s, place]
    forward(run, model.period, h + correction)


@njit(**INLINE)
def time_left(model, run, stop_cycle, stop_phase):
    """Time until the stop; periods are counted, not measured, so that none of their digits is lost."""
    return (stop_cycle - run.count[CYCLE]) * model.period + (stop_phase - run.clock[PHASE])


@njit(**KERNEL)
def remember_grazing(model, method, run, record, t, h, work):
    """Keep the grazing found on the attempted step, if its transition might have fired there."""
    transition, theta = run.count[GRAZING_GUARD], run.clock[GRAZING_PLACE]
    interpolate(method, h, run.y, model.dimension, work)
    value_on_interpolant(model, transition, t, h, theta, work)
    if not allowed(model, transition, t + theta * h, work.state, work.scalar):
        return
    value = run.clock[GRAZING_VALUE]
    keep_grazing(model, run, record, transition, t + theta * h, work.state, value, work)


@njit(**INLINE)
def find_event(parts, model, method, run, record, tangents, h, work):
    """Shorten the attempted step to its first event, if there is one.

    Returns its length, the Euler step that completes it, and the transition. A crossing that the interpolant
    has and the solution has not is a grazing; the step is then searched again without that guard.
    """
    mode, t = run.count[MODE], run.clock[PHASE]
    ignored = NO_TRANSITION
    for _ in range(2):
        interpolation_stages(model, method, mode, t, h, run.y, work)
        if not all_affine(model, mode):
            interpolate(method, h, run.y, model.dimension, work)
        theta, fired = earliest_crossing(model, method, run, t, h, ignored, work)
        if run.clock[GRAZING_PLACE] < theta:
            remember_grazing(model, method, run, record, t, h, work)
        if fired == NO_TRANSITION:
            break
        direction = model.direction[fired]
        side = run.side[fired] if direction == 0 else -direction
        shortened, correction = land(
            parts, model, method, fired, side, mode, t, h, theta, run.y, tangents, work
        )
        if shortened != NOT_THERE:
            return shortened, correction, fired
        ignored = fired
        attempt_again(parts, model, method, mode, t, h, run.y, tangents, work)
        run.clock[GRAZING_PLACE], run.clock[GRAZING_VALUE] = theta, 0.0
        run.count[GRAZING_GUARD] = fired
        remember_grazing(model, method, run, record, t, h, work)
    return h, 0.0, NO_TRANSITION


@njit(**INLINE)
def carry_rates(method, length, work):
    """The rates at the end of a step are those at the start of the next."""
    s = method.b.shape[0]
    for i in range(length + 1):
        work.stages[0, i] = work.stages[s, i]


@njit(**INLINE)
def growth_factor(method, run, h, ratio):
    """Factor to the next step from this error ratio, and from its trend over the last two steps.

    The trend (Gustafsson 1994, doi:10.1145/198429.198437) foresees the shrinking steps towards a singularity,
    such as the end of a Hertz contact, where each step would otherwise be tried too long.
    """
    factor = ratio ** (-method.exponent)
    if run.clock[LAST_STEP] > 0.0:
        trend = h / run.clock[LAST_STEP] * (run.clock[LAST_RATIO] / ratio) ** method.exponent
        factor = min(factor, factor * trend)
    return min(GROW, max(SHRINK, SAFETY * factor))


@njit(**KERNEL)
def finite(run, length):
    """Whether the first ``length`` entries of the run's vector are finite."""
    total = 0.0
    for i in range(length):
        total += abs(run.y[i])
    return math.isfinite(total)


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
    n = model.dimension
    length = n * (1 + tangents)
    recording = record.step_time.shape[0] > 0
    while True:
        if run.count[PENDING] != NO_TRANSITION:
            if run.count[JUMPS] >= max_jumps:
                return MAX_JUMPS
            # One more than this jump: it may turn out to be the last of a chatter, whose limit follows at
            # once.
            if 0 < record.jump_time.shape[0] <= record.used[1] + 1:
                return RECORD_FULL
            if run.count[JUMPS_HERE] > MOST_JUMPS_AT_ONCE:
                return ACCUMULATION
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
                and model.accumulates_to[fired] == NO_MODE
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
                    return ACCUMULATION
                parts.rest(model, run, limit_mode, tangents, orthonormal, work)
                continue
            if fires != NO_TRANSITION:
                if run.count[JUMPS_HERE] > MOST_JUMPS_AT_ONCE:
                    return STUCK
                run.count[PENDING] = fires
                continue
            if mode != run.count[PREVIOUS_MODE]:
                run.clock[NEXT_STEP] = run.first_step[mode]
                run.first_step[mode] = 0.0
            run.clock[LAST_STEP] = 0.0
            run.count[PHASE_OF_RUN] = STALE
        t = run.clock[PHASE]
        remaining = time_left(model, run, stop_cycle, stop_phase)
        if remaining <= 0.0:
            run.count[PENDING] = arrived(model, run, work)
            if run.count[PENDING] != NO_TRANSITION:
                continue
            return DONE
        if run.count[PHASE_OF_RUN] == STALE:
            rates(model, mode, t, run.y, tangents, work.stages[0])
            if run.clock[NEXT_STEP] <= 0.0:
                run.clock[NEXT_STEP] = starting_step(model, method, mode, t, run.y, tangents, work)
            if not run.clock[NEXT_STEP] > 0.0:
                return NON_FINITE
            run.count[PHASE_OF_RUN] = READY
        if recording and record.used[0] + 1 >= record.step_time.shape[0]:
            return RECORD_FULL
        if 0 < record.grazing_time.shape[0] == record.used[2]:
            return RECORD_FULL
        if run.count[STEPS] >= max_steps:
            return MAX_STEPS
        proposed = min(run.clock[NEXT_STEP], method.max_step)
        last = proposed >= remaining
        h = remaining if last else proposed
        ratio = attempt(parts, model, method, mode, t, h, run.y, tangents, work)
        run.count[STEPS] += 1
        if not ratio <= 1.0:
            run.count[REJECTED] += 1
            shrink = max(SHRINK, SAFETY * ratio ** (-method.exponent)) if ratio > 1.0 else 0.1
            run.clock[NEXT_STEP] = h * shrink
            if h * shrink <= 4.0 * EPSILON * abs(t) or h * shrink < 1e-200:
                return STEP_TOO_SMALL if ratio > 1.0 else NON_FINITE
            continue
        grow = growth_factor(method, run, h, max(ratio, 1e-16))
        run.clock[NEXT_STEP] = max(proposed, h * grow) if last else h * grow
        run.clock[LAST_STEP], run.clock[LAST_RATIO] = h, max(ratio, 1e-16)
        fired, correction = NO_TRANSITION, 0.0
        if model.first_outgoing[mode + 1] > model.first_outgoing[mode]:
            h, correction, fired = find_event(parts, model, method, run, record, tangents, h, work)
        if fired != NO_TRANSITION:
            run.clock[NEXT_STEP] = min(run.clock[NEXT_STEP], LONGEST_AFTER_EVENT * h)
        if fired == NO_TRANSITION and run.first_step[mode] <= 0.0:
            run.first_step[mode] = h
        if recording and h > 0.0:
            remember_step(model, method, run, record, t, h, work)
        accept(model, method, run, tangents, h, correction, work)
        past = time_left(model, run, stop_cycle, stop_phase) < 0.0
        if last and (fired == NO_TRANSITION or past):
            run.count[CYCLE] = stop_cycle
            run.clock[PHASE] = stop_phase
        if fired != NO_TRANSITION:
            run.count[PENDING] = parts.first_in_order(model, run, record, fired, work)
        else:
            carry_rates(method, length, work)
