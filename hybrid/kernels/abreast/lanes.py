"""Where the runs that are abreast are: a run comes aboard, takes steps, and leaves when something happens.

The entries of a lane are those of the state and the tangent vectors, the parameters, the numbers that
``types.abreast`` names, the sizes of the state's components over the last step, and those of each guard.
"""

from typing import NamedTuple

from numba import njit

from hybrid.kernels.arithmetic.clock import measured_time
from hybrid.kernels.events.onset import BY_SPEED
from hybrid.kernels.guards.touch import forget_touches
from hybrid.kernels.steps.series import (
    AHEAD,
    NEXT_TO_NOTHING,
    holds_roots,
    number_of_guards,
    order_of,
)
from hybrid.kernels.types.abreast import (
    AHEAD_OF_STAY,
    CYCLE,
    DIVERGENCE,
    FOLLOWS,
    LANE_NUMBERS,
    LONGEST_STEP,
    PER_GUARD,
    PERIOD,
    PHASE_LOW,
    ROOM,
    SINCE,
    STAY,
    STEPS,
    T,
)
from hybrid.kernels.types.codes import ABREAST, READY
from hybrid.kernels.types.kinds import INTEGER
from hybrid.kernels.types.options import INLINE, KERNEL


class Places(NamedTuple):
    """The first entries of parameters, numbers, sizes and guards; and the number of guards."""

    parameters: INTEGER
    numbers: INTEGER
    sizes: INTEGER
    guards: INTEGER
    count: INTEGER


@njit(**INLINE)
def places_in(model, tangents, parameters, mode):
    """Where the entries of a lane are."""
    n = model.dimension
    first = n * (1 + tangents)
    numbers = first + parameters
    sizes = numbers + LANE_NUMBERS
    return Places(first, numbers, sizes, sizes + n, number_of_guards(model, mode))


@njit(**KERNEL)
def come_aboard(lane, places, task, room, row):
    """Write where a run is, at the start of a step, into its place in a lane."""
    model, run, method, series = task.model, task.run, task.method, task.work.series
    n, mode, order = model.dimension, run.mode, order_of(model, method, run.mode)
    for i in range(places.parameters):
        lane[i * ABREAST + row] = run.y[i]
    for i in range(places.numbers - places.parameters):
        lane[(places.parameters + i) * ABREAST + row] = model.parameters[i]
    first = places.numbers * ABREAST + row
    lane[first + T * ABREAST], lane[first + PHASE_LOW * ABREAST] = run.phase, run.phase_low
    lane[first + CYCLE * ABREAST], lane[first + SINCE * ABREAST] = 0.0, run.since_entry
    lane[first + LONGEST_STEP * ABREAST], lane[first + ROOM * ABREAST] = run.longest_step, room
    beyond = AHEAD * run.stay[mode]
    if not beyond > NEXT_TO_NOTHING * measured_time(model, run, mode):
        beyond = -1.0
    lane[first + STAY * ABREAST], lane[first + AHEAD_OF_STAY * ABREAST] = run.stay[mode], beyond
    lane[first + STEPS * ABREAST], lane[first + DIVERGENCE * ABREAST] = 0.0, 0.0
    lane[first + FOLLOWS * ABREAST] = 1.0 if run.stage == READY else 0.0
    lane[first + PERIOD * ABREAST] = model.period
    for i in range(n):
        lane[(places.sizes + i) * ABREAST + row] = run.scale[i]
    slot, place = model.first_outgoing[mode], places.guards * ABREAST + row
    rooted = holds_roots(model, mode)
    for g in range(places.count):
        transition = model.outgoing[slot + g]
        lane[place] = run.side[transition]
        lane[place + ABREAST] = 1.0 if run.on_guard[transition] == BY_SPEED else 0.0
        lane[place + 2 * ABREAST] = series[order + 1, n + g] if rooted else 0.0
        place += PER_GUARD * ABREAST


@njit(**KERNEL)
def leave_lane(lane, places, task, row):
    """Write where a run is at the end of its last step from a lane back to the run, clear of all guards."""
    model, run, method, series = task.model, task.run, task.method, task.work.series
    n, mode, order = model.dimension, run.mode, order_of(model, method, run.mode)
    first = places.numbers * ABREAST + row
    steps = int(lane[first + STEPS * ABREAST])
    if steps == 0:
        return
    for i in range(places.parameters):
        run.y[i] = lane[i * ABREAST + row]
    run.phase, run.phase_low = lane[first + T * ABREAST], lane[first + PHASE_LOW * ABREAST]
    run.cycle += int(lane[first + CYCLE * ABREAST])
    run.since_entry, run.longest_step = lane[first + SINCE * ABREAST], lane[first + LONGEST_STEP * ABREAST]
    run.divergence += lane[first + DIVERGENCE * ABREAST]
    run.steps += steps
    run.unchecked += steps
    for i in range(n):
        run.scale[i] = lane[(places.sizes + i) * ABREAST + row]
    for g in range(places.count if holds_roots(model, mode) else 0):
        series[order + 1, n + g] = lane[(places.guards + PER_GUARD * g + 2) * ABREAST + row]
    clear_guards(model, run, steps)


@njit(**INLINE)
def clear_guards(model, run, steps):
    """Let a run be at the end of a step, clear of all guards, after so many steps in its lane."""
    run.stage = READY
    forget_touches(run)
    for slot in range(model.first_outgoing[run.mode], model.first_outgoing[run.mode + 1]):
        transition = model.outgoing[slot]
        # Only the first step may have begun on a guard.
        run.order_before[transition] = run.on_guard[transition] if steps == 1 else 0
        run.on_guard[transition] = 0
