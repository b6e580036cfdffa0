"""Clocks whose numbers resets change: a held duration, a due time. They are read again at each entry."""

import math

from numba import njit

from hybrid.kernels.events.clocks import first_from, is_behind, ticks_now
from hybrid.kernels.types.codes import AFTER, AT, EVERY, FIRST_TICK, NO_TRANSITION, UNDER_WAY
from hybrid.kernels.types.options import KERNEL


@njit(**KERNEL)
def renew(model, run, scalar):
    """Read the numbers of clocks that resets may change; whether all are numbers that a clock can have."""
    first_number = 2 * model.target.shape[0]
    run.reading_cycle, run.reading_phase, run.reading_low = run.cycle, run.phase, run.phase_low
    for i in range(model.moving.shape[0]):
        place, transition = model.moving[i], model.mover[i]
        model.guard(first_number + i, run.phase, run.y, model.parameters, scalar)
        number, kind, first = scalar[0], model.clock[transition], model.first_tick[transition]
        if not abs(number) < math.inf or (kind == EVERY and place == first and not number > 0.0):
            return False
        if kind == AT:
            put_time(model, run, transition, place - first, number)
        elif number != run.ticks[place] and kind == EVERY:
            put_number(model, run, transition, place, number)
        else:
            run.ticks[place] = number
    return True


@njit(**KERNEL)
def is_cut_short(model, run, transition, k):
    """Whether a reset at this instant has made a duration shorter than the time that had passed."""
    may_be = model.moving.shape[0] > 0 and AFTER <= model.clock[transition] < UNDER_WAY
    return may_be and is_behind(model, run, transition, k)


@njit(**KERNEL)
def put_number(model, run, transition, place, number):
    """Change the period or the offset of a clock, and find its next tick.

    A tick of this instant is over if it has just fired. With another offset it is also over if the tick of
    its number is: a duty of 1 that is set where a period begins ends the period that begins there, one of 0
    ends it at once.
    """
    own, first = model.tick_of[transition], model.first_tick[transition]
    if run.last_fired == NO_TRANSITION:
        run.ticks[place] = number
        return
    next_number = FIRST_TICK
    if place > first:
        next_number = max(run.tick[own], first_from(model, run, transition, False))
    run.ticks[place] = number
    run.ticked[model.clock_of[transition]] = FIRST_TICK
    run.tick[own] = first_from(model, run, transition, model.tick_of[run.last_fired] == own)
    if run.tick[own] < next_number and ticks_now(model, run, transition):
        run.tick[own] = first_from(model, run, transition, True)


@njit(**KERNEL)
def put_time(model, run, transition, row, time):
    """Put the time of a row of a schedule in order; a time that has passed is over, any other is ahead."""
    first, own = model.first_tick[transition], model.tick_of[transition]
    last = model.first_tick[transition + 1] - first - 1
    k = 0
    while run.rows[first + k] != row:
        k += 1
    if run.ticks[first + k] == time:
        return
    passed = min(max(run.tick[own], 0), last + 1)
    if k < passed:
        passed -= 1
    for j in range(first + k, first + last):
        run.ticks[j], run.rows[j] = run.ticks[j + 1], run.rows[j + 1]
    run.ticks[first + last] = time
    over = is_behind(model, run, transition, last)
    place, least = last, 0 if over else passed
    while place > least and run.ticks[first + place - 1] > time:
        run.ticks[first + place] = run.ticks[first + place - 1]
        run.rows[first + place] = run.rows[first + place - 1]
        place -= 1
    run.ticks[first + place], run.rows[first + place] = time, row
    if over and place <= passed:
        passed += 1
    if run.last_fired != NO_TRANSITION:
        run.tick[own] = passed
    run.ticked[model.clock_of[transition]] = FIRST_TICK
