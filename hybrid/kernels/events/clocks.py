"""Ticks of clocks. Their times are known: a step ends at the next one, and nothing is searched for.

The time of a tick has two parts, a rounded number and its rounding error, and counts from the start of the
current period. Tick ``k`` of a clock with a period is computed from the whole number ``k``, so that no error
grows with it.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.clock import (
    IN_ORDER,
    forward,
    product_in_two_parts,
    sum_in_two_parts,
    time_until,
)
from hybrid.kernels.arithmetic.tables import knots_passed
from hybrid.kernels.events.guards import allowed
from hybrid.kernels.types.codes import AFTER, AT, EVERY, NO_MODE, NO_TRANSITION, UNDER_WAY
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Relative rounding of a time that a user computes, and of the number that it is compared with.
ROUNDING_OF_TICK = 2 * EPSILON


@njit(**INLINE)
def begin_of_count(model, run, transition):
    """The period, the phase, and its rounding, from which a clock counts that begins at an instant."""
    if model.clock[transition] == AFTER:
        return run.entry_cycle, run.entry_phase, run.entry_low
    if model.clock[transition] == UNDER_WAY:
        return run.reading_cycle, run.reading_phase, run.reading_low
    return run.arrival_cycle, run.arrival_phase, run.arrival_low


@njit(**IN_ORDER)
def place_of_tick(model, run, transition, k):
    """Time of tick ``k`` from the start of the current period, in two parts; infinite after the last one."""
    kind, first = model.clock[transition], model.first_tick[transition]
    count = model.first_tick[transition + 1] - first - (kind == UNDER_WAY)
    cycles, high, low, more = -run.cycle, 0.0, 0.0, 0.0
    if kind == EVERY:
        high, low = product_in_two_parts(float(k), run.ticks[first])
        more = run.ticks[first + 1]
    elif k >= count:
        return math.inf, 0.0
    elif kind == AT:
        more = run.ticks[first + k]
    else:
        begin, high, low = begin_of_count(model, run, transition)
        cycles, more = cycles + begin, run.ticks[first + k]
    whole, rest = product_in_two_parts(float(cycles), model.period)
    total, lost = sum_in_two_parts(high, whole)
    total, more_lost = sum_in_two_parts(total, more)
    return sum_in_two_parts(total, lost + more_lost + low + rest)


@njit(**KERNEL)
def time_to_tick(model, run, transition, k):
    """Time from now to tick ``k``."""
    high, low = place_of_tick(model, run, transition, k)
    return time_until(run, high, low)


@njit(**KERNEL)
def rounding_of_tick(model, run, transition, k):
    """How far the rounding of its numbers may move a tick: ticks within it of each other are one instant.

    A number that is computed is a last bit away from the one that is meant, on either side.
    """
    kind, first = model.clock[transition], model.first_tick[transition]
    if kind == EVERY:
        return ROUNDING_OF_TICK * (abs(k * run.ticks[first]) + abs(run.ticks[first + 1]))
    if kind == AT:
        return ROUNDING_OF_TICK * abs(run.ticks[first + min(k, model.first_tick[transition + 1] - first - 1)])
    begin, phase, _ = begin_of_count(model, run, transition)
    number = abs(run.ticks[first + min(k, model.first_tick[transition + 1] - first - 1)])
    return ROUNDING_OF_TICK * (abs(begin * model.period + phase) + number)


@njit(**KERNEL)
def is_behind(model, run, transition, k):
    """Whether tick ``k`` is over, by more than its rounding."""
    return time_to_tick(model, run, transition, k) < -rounding_of_tick(model, run, transition, k)


@njit(**KERNEL)
def first_from(model, run, transition, beyond):
    """The first tick that is not behind, or with ``beyond`` the first that is ahead."""
    kind, first = model.clock[transition], model.first_tick[transition]
    now = run.cycle * model.period + run.phase
    if kind == EVERY:
        k = math.floor((now - run.ticks[first + 1]) / run.ticks[first]) - 1
    else:
        # One tick earlier than the last that has passed: that one may be of this instant.
        k = max(knots_passed(run.ticks, first, model.first_tick[transition + 1], now) - 2, 0)
        # Several times may be equal.
        while k > 0 and not is_behind(model, run, transition, k):
            k -= 1
    while True:
        left = time_to_tick(model, run, transition, k)
        band = rounding_of_tick(model, run, transition, k)
        if left > band or (left >= -band and not beyond):
            return k
        k += 1


@njit(**KERNEL)
def first_under_way(model, run, transition):
    """The first tick under way that is not missed: what has fired is no longer in the list.

    The last number of the clock tells how far a tick may be behind, since the times left are rounded.
    """
    k, late = 0, run.ticks[model.first_tick[transition + 1] - 1]
    while time_to_tick(model, run, transition, k) < -max(late, rounding_of_tick(model, run, transition, k)):
        k += 1
    return k


@njit(**INLINE)
def leads_to_part(model, transition):
    """Whether a transition leads to another part of its mode."""
    onward = model.target[transition] != NO_MODE and model.marker[transition] == 0
    return onward and model.enters[transition] == 0


@njit(**IN_ORDER)
def keep_entry(model, run, arrives):
    """Keep the time at which the mode has been entered: now, or as long ago as the state says.

    The run ``arrives`` if it comes from another mode, or starts.
    """
    run.entry_cycle, run.entry_phase, run.entry_low = run.cycle, run.phase, run.phase_low
    if model.age >= 0:
        run.entry_phase, lost = sum_in_two_parts(run.phase, -run.y[model.age])
        run.entry_low += lost
    if arrives:
        run.arrival_cycle, run.arrival_phase = run.entry_cycle, run.entry_phase
        run.arrival_low = run.entry_low


@njit(**KERNEL)
def wind(model, run):
    """Wind up the clocks of the mode that has just been entered.

    A tick of this instant is still ahead, unless the transition has fired at it or the run starts here. If
    another mode was left at a tick of the same clock, that was its tick: two modes may take turns. From part
    to part of a mode that has been split, a tick at the start fires as well: the run has begun in the part
    that ends there.
    """
    mode, starts = run.mode, run.last_fired == NO_TRANSITION
    moved = not starts and model.whole_mode[run.previous_mode] != model.whole_mode[mode]
    entered = starts or moved or model.enters[run.last_fired] == 1
    if entered:
        keep_entry(model, run, starts or moved)
    for slot in range(model.first_clock[mode], model.first_clock[mode + 1]):
        transition = model.clocks[slot]
        own = model.tick_of[transition]
        if model.clock[transition] == UNDER_WAY:
            run.tick[own] = first_under_way(model, run, transition)
            continue
        if model.clock[transition] >= AFTER:
            begins = entered if model.clock[transition] == AFTER else starts or moved
            run.tick[own] = 0 if begins else run.tick[own]
            continue
        if starts or mode != run.previous_mode:
            # In the mode itself the count goes on: an event may land a last bit behind a tick that is due.
            ahead = starts and not leads_to_part(model, transition)
            run.tick[own] = max(run.tick[own], first_from(model, run, transition, ahead))
        if moved:
            run.tick[own] = max(run.tick[own], run.ticked[model.clock_of[transition]])


@njit(**INLINE)
def number_of_tick(model, run, transition):
    """The number of the next tick of a clock."""
    return run.tick[model.tick_of[transition]]


@njit(**KERNEL)
def show_row(model, run, transition, k):
    """Tell which row of its schedule tick ``k`` is; the functions of the model, too, if they ask."""
    if model.clock[transition] == AT:
        run.row = run.rows[model.first_tick[transition] + k]
        if model.row >= 0:
            model.parameters[model.row] = float(run.row)


@njit(**INLINE)
def may_fire(model, run, transition, x, scalar):
    """Whether the next tick of a clock, which is at this instant, may fire at a state ``x``."""
    show_row(model, run, transition, number_of_tick(model, run, transition))
    return allowed(model, transition, run.phase, x, scalar)


@njit(**KERNEL)
def pass_tick(model, run, transition, fires):
    """Count the next tick of a clock as over; ``fires`` if it has fired the transition."""
    own, clock = model.tick_of[transition], model.clock_of[transition]
    run.tick[own] += 1
    if fires:
        run.ticked[clock] = max(run.ticked[clock], run.tick[own])


@njit(**KERNEL)
def next_tick(model, run):
    """The clock of the mode that ticks first, the time until then, and how far rounding may move it.

    Without any clock the time is infinite.
    """
    mode, found, least = run.mode, NO_TRANSITION, math.inf
    for slot in range(model.first_clock[mode], model.first_clock[mode + 1]):
        transition = model.clocks[slot]
        k = number_of_tick(model, run, transition)
        left = time_to_tick(model, run, transition, k)
        if left < least:
            found, least = transition, left
    if found == NO_TRANSITION:
        return found, least, 0.0
    return found, least, rounding_of_tick(model, run, found, number_of_tick(model, run, found))


@njit(**KERNEL)
def go_to_tick(model, run, transition):
    """Set the clock of the run to the next tick of a clock."""
    k = number_of_tick(model, run, transition)
    run.phase, run.phase_low = place_of_tick(model, run, transition, k)
    forward(run, model.period, 0.0)


@njit(**KERNEL)
def ticks_now(model, run, transition):
    """Whether the next tick of a clock is at this instant."""
    k = number_of_tick(model, run, transition)
    return time_to_tick(model, run, transition, k) <= rounding_of_tick(model, run, transition, k)


@njit(**KERNEL)
def ticking(model, run, work):
    """The first listed of the clocks that tick now and may fire; ticks that may not are passed over.

    Copies of one transition have one tick, which is not passed over if one of them may fire.
    """
    first, last, fires = model.first_clock[run.mode], model.first_clock[run.mode + 1], NO_TRANSITION
    for slot in range(first, last):
        transition = model.clocks[slot]
        if ticks_now(model, run, transition) and may_fire(model, run, transition, run.y, work.scalar):
            last, fires = slot, transition
            break
    for slot in range(first, last):
        transition = model.clocks[slot]
        copy = fires != NO_TRANSITION and model.tick_of[transition] == model.tick_of[fires]
        if not copy and ticks_now(model, run, transition):
            pass_tick(model, run, transition, False)
    return fires


@njit(**KERNEL)
def turned_to(model, run, fired, x_minus, scalar):
    """The transition that takes the turn of one that has just fired at the same tick of its clock, if any.

    Of two conditions exactly one held before the jump at the state ``x_minus``, and exactly the other one
    holds after it: they choose one of two transitions, and the reset of the first has made both fire.
    """
    mode = run.mode
    # Where the mode is entered anew, its dwell times begin anew.
    restarts = model.clock[fired] == AFTER and model.enters[fired] == 1
    if restarts or mode != run.previous_mode or allowed(model, fired, run.phase, run.y, scalar):
        return NO_TRANSITION
    for slot in range(model.first_clock[mode], model.first_clock[mode + 1]):
        other = model.clocks[slot]
        if model.clock_of[other] != model.clock_of[fired] or model.tick_of[other] == model.tick_of[fired]:
            continue
        if not ticks_now(model, run, other) or may_fire(model, run, other, x_minus, scalar):
            continue
        if may_fire(model, run, other, run.y, scalar):
            return other
    return NO_TRANSITION
