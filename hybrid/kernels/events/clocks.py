"""Ticks of clocks. Their times are known: a step ends at the next one, and nothing is searched for.

The time of a tick has two parts, a rounded number and its rounding error, and counts from the start of the
current period. Tick ``k`` of a clock with a period is computed from the whole number ``k``, so that no error
grows with it.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.clock import IN_ORDER, product_in_two_parts, sum_in_two_parts
from hybrid.kernels.events.guards import allowed
from hybrid.kernels.types.codes import AFTER, AT, EVERY, NO_TRANSITION
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL


@njit(**INLINE)
def has_clocks(model, mode):
    """Whether a mode is left at known times."""
    return model.first_clock[mode + 1] > model.first_clock[mode]


@njit(**IN_ORDER)
def place_of_tick(model, run, transition, k):
    """Time of tick ``k`` from the start of the current period, in two parts; infinite after the last one."""
    kind, first = model.clock[transition], model.first_tick[transition]
    count = model.first_tick[transition + 1] - first
    cycles, high, low, more = -run.cycle, 0.0, 0.0, 0.0
    if kind == EVERY:
        high, low = product_in_two_parts(float(k), run.ticks[first])
        more = run.ticks[first + 1]
    elif k >= count:
        return math.inf, 0.0
    elif kind == AT:
        more = run.ticks[first + k]
    else:
        cycles += run.entry_cycle
        high, low, more = run.entry_phase, run.entry_low, run.ticks[first]
    whole, rest = product_in_two_parts(float(cycles), model.period)
    total, lost = sum_in_two_parts(high, whole)
    total, more_lost = sum_in_two_parts(total, more)
    return sum_in_two_parts(total, lost + more_lost + low + rest)


@njit(**IN_ORDER)
def until(run, place):
    """Time from now to a place in the current period."""
    high, low = place
    return (high - run.phase) + (low - run.phase_low)


@njit(**KERNEL)
def rounding_of_tick(model, run, transition, k):
    """How far the rounding of its numbers may move a tick: ticks within it of each other are one instant."""
    kind, first = model.clock[transition], model.first_tick[transition]
    if kind == EVERY:
        return EPSILON * (abs(k * run.ticks[first]) + abs(run.ticks[first + 1]))
    if kind == AT:
        return EPSILON * abs(run.ticks[first + min(k, model.first_tick[transition + 1] - first - 1)])
    return EPSILON * run.ticks[first]


@njit(**KERNEL)
def first_from(model, run, transition, beyond):
    """The first tick that is not behind, or with ``beyond`` the first that is ahead."""
    kind, first = model.clock[transition], model.first_tick[transition]
    now = run.cycle * model.period + run.phase
    if kind == EVERY:
        k = int(math.floor((now - run.ticks[first + 1]) / run.ticks[first])) - 1
    else:
        k, high = 0, model.first_tick[transition + 1] - first
        while k < high:
            middle = (k + high) // 2
            if run.ticks[first + middle] < now:
                k = middle + 1
            else:
                high = middle
        k = max(k - 1, 0)
    while True:
        left = until(run, place_of_tick(model, run, transition, k))
        band = rounding_of_tick(model, run, transition, k)
        if left > band or (left >= -band and not beyond):
            return k
        k += 1


@njit(**KERNEL)
def wind(model, run):
    """Wind up the clocks of the mode that has just been entered.

    A tick of this instant is still ahead, unless the clock has ticked already or the run starts here.
    """
    mode, starts = run.mode, run.last_fired == NO_TRANSITION
    if starts or model.marker[run.last_fired] == 0:
        run.entry_cycle, run.entry_phase, run.entry_low = run.cycle, run.phase, run.phase_low
    for slot in range(model.first_clock[mode], model.first_clock[mode + 1]):
        transition = model.clocks[slot]
        if model.clock[transition] == AFTER:
            if starts or model.marker[run.last_fired] == 0:
                run.tick[transition] = 0
        else:
            k = first_from(model, run, transition, starts)
            run.tick[transition] = max(run.tick[transition], k)


@njit(**KERNEL)
def next_tick(model, run):
    """The clock of the mode that ticks first, and the time until then; infinite without any."""
    mode, found, least = run.mode, NO_TRANSITION, math.inf
    for slot in range(model.first_clock[mode], model.first_clock[mode + 1]):
        transition = model.clocks[slot]
        left = until(run, place_of_tick(model, run, transition, run.tick[transition]))
        if left < least:
            found, least = transition, left
    return found, least


@njit(**KERNEL)
def go_to_tick(model, run, transition):
    """Set the clock of the run to the next tick of a clock."""
    high, low = place_of_tick(model, run, transition, run.tick[transition])
    while model.period > 0.0 and high >= model.period:
        high, lost = sum_in_two_parts(high, -model.period)
        high, low = sum_in_two_parts(high, lost + low)
        run.cycle += 1
    run.phase, run.phase_low = high, low


@njit(**KERNEL)
def ticking(model, run, work):
    """The first listed of the clocks that tick now and may fire; ticks that may not are passed over."""
    mode = run.mode
    for slot in range(model.first_clock[mode], model.first_clock[mode + 1]):
        transition = model.clocks[slot]
        k = run.tick[transition]
        left = until(run, place_of_tick(model, run, transition, k))
        if left > rounding_of_tick(model, run, transition, k):
            continue
        if allowed(model, transition, run.phase, run.y, work.scalar):
            return transition
        run.tick[transition] += 1
    return NO_TRANSITION
