"""Whether the jumps before a limit may be skipped, and whether jumps at one instant have come to a limit."""

from numba import njit

from hybrid.kernels.arithmetic.bernstein import crosses_towards
from hybrid.kernels.arithmetic.slopes import spread_of_rate
from hybrid.kernels.events.crossings import Begin, first_change
from hybrid.kernels.events.guards import (
    ROUNDING_OF_STATE,
    guard_speed,
    guard_value,
    has_program,
    rounding_band,
    size_of_time,
)
from hybrid.kernels.events.moments import speed_rounding
from hybrid.kernels.events.sampled import NOWHERE
from hybrid.kernels.jumps.rounds import fired_before, mark_endless
from hybrid.kernels.types.codes import ENDLESS
from hybrid.kernels.types.layout import EPSILON, Path
from hybrid.kernels.types.options import KERNEL

# Jumps at one instant are not examined for a limit before there are this many.
MANY_AT_ONCE = 100
# A state at rest may be this many times as far from its guards, and as fast, as rounding.
AT_REST = 4.0


@njit(**KERNEL)
def takes_turns(model, run, transition, turn):
    """Whether a transition's guard is that of one of the last ``turn`` jumps."""
    for back in range(turn):  # noqa: SIM110 (no generators in kernels)
        if model.surface[fired_before(run, back)] == model.surface[transition]:
            return True
    return False


@njit(**KERNEL)
def way_is_free(model, method, run, turn, span, work):
    """Whether no other guard is crossed on the straight way from the state to ``work.settled (n,)``.

    The last ``turn`` jumps are those that accumulate, ``span`` is the time that the way takes. If another
    guard is crossed before the limit, the jumps do not reach that limit. Nor do they if the last reset has
    crossed another guard, whose transition is due.
    """
    t, path = run.phase, work.path
    for i in range(model.dimension):
        path[0, i], path[1, i] = run.y[i], work.settled[i] - run.y[i]
    for slot in range(model.first_outgoing[run.mode], model.first_outgoing[run.mode + 1]):
        other = model.outgoing[slot]
        if takes_turns(model, run, other, turn):
            continue
        value = guard_value(model, other, t, run.y, work.scalar)
        model.guard_gradient(other, t, run.y, model.parameters, work.gradient)
        if abs(value) <= rounding_band(model, run, other, t, run.y, work):
            continue
        side = 1 if value > 0.0 else -1
        turned = run.mode == run.previous_mode and run.side[other] == -side
        if run.due[other] == 1 or (turned and crosses_towards(model.direction[other], side)):
            return False
        if has_program(model, other):
            way = Path(path, 1, -1, t, span, 1.0, True)
            place, _, _ = first_change(model, method, run, other, way, Begin(side, 0, 0.0), work)
            crossed = place != NOWHERE
        else:
            end = guard_value(model, other, t + span, work.settled, work.scalar)
            crossed = end * side <= 0.0 and crosses_towards(model.direction[other], -side)
        if crossed:
            return False
    return True


@njit(**KERNEL)
def has_come_to_rest(model, run, turn, x, work):
    """Whether a state ``x (n,)`` rests on the guards of the last ``turn`` jumps, and no reset moves it.

    So ends a chatter whose flights shorten without a steady ratio, such as that of two balls on a floor that
    take turns in varying order: its last jumps happen within the rounding of time. Counters, which each
    round moves, are marked.
    """
    n, mode, t = model.dimension, run.mode, run.phase
    share, clock, moved = AT_REST * ROUNDING_OF_STATE * EPSILON, size_of_time(model, t), work.trial
    model.field(mode, t, x, model.parameters, work.field)
    for i in range(n):
        size = run.scale[i]
        for row in range(min(run.jumps, run.visits.shape[0])):
            size = max(size, abs(run.visits[row, i]))
        moved[i] = share * (size + clock * abs(work.field[i]))
        work.rounding[0, i] = 2.0 * moved[i]
    mark_endless(model, run, turn, t, x, work.rounding[0], work)
    for back in range(turn):
        transition = fired_before(run, back)
        value = guard_value(model, transition, t, x, work.scalar)
        speed = guard_speed(model, transition, t, x, work.field, work.gradient)
        height = AT_REST * rounding_band(model, run, transition, t, x, work)
        fastest = AT_REST * speed_rounding(model, run, transition, mode, t, x, work)
        for i in range(n):
            height += abs(work.gradient[i]) * moved[i]
            fastest += abs(work.gradient[i]) * spread_of_rate(model, mode, i, work.jacobian, moved)
        if not (abs(value) <= height and abs(speed) <= fastest):
            return False
        model.reset(transition, t, x, model.parameters, work.state)
        for i in range(n):
            moves = not abs(work.state[i] - x[i]) <= 2.0 * moved[i]
            if moves and run.trail[ENDLESS, i] == 0.0:
                return False
    return True


@njit(**KERNEL)
def jumps_in_turn(run):
    """The fewest last jumps among which are all transitions that the run remembers."""
    seen = min(run.jumps, run.recent.shape[0])
    turn = 1
    for back in range(1, seen):
        known = False
        for later in range(back):
            known = known or fired_before(run, later) == fired_before(run, back)
        if not known:
            turn = back + 1
    return turn
