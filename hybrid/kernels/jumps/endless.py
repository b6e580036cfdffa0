"""Components that jumps move for ever, such as counters of impacts: whether a limit may leave them behind.

Each jump of a chatter adds one to a counter, so that the counter has no limit while all other components have
one. It keeps the value that it has after the last jump that is made. The others have their limit only if
nothing depends on the counter: no field, no reset, no guard.
"""

from numba import njit

from hybrid.kernels.arithmetic.bernstein import crosses_towards
from hybrid.kernels.events.guards import allowed, guard_value
from hybrid.kernels.jumps.rounds import fired_before, follow_resets, slot_of
from hybrid.kernels.jumps.skipped import takes_turns
from hybrid.kernels.types.codes import ENDLESS, HELD, NO_MODE
from hybrid.kernels.types.options import KERNEL

# Values of a counter that are tried: one after the other at first, then as many doublings.
ONE_BY_ONE = 8
DOUBLINGS = 30


@njit(**KERNEL)
def count_on(model, run, turn, t, limit, first, second, work):
    """What the next two rounds add to the marked components, into ``first`` and ``second (n,)``."""
    n, place = model.dimension, work.trial
    for i in range(n):
        place[i] = limit[i]
    follow_resets(model, run, turn, t, place, work)
    for i in range(n):
        first[i] = place[i] - limit[i] if run.trail[ENDLESS, i] != 0.0 else 0.0
        place[i] = limit[i] + first[i]
    follow_resets(model, run, turn, t, place, work)
    for i in range(n):
        second[i] = place[i] - limit[i] - first[i] if run.trail[ENDLESS, i] != 0.0 else 0.0


@njit(**KERNEL)
def place_later(model, base, first, second, trial, out):
    """The place ``base (n,)`` as the marked components change it until a trial, into ``out (n,)``."""
    rounds = trial if trial <= ONE_BY_ONE else ONE_BY_ONE * 2 ** (trial - ONE_BY_ONE)
    for i in range(model.dimension):
        out[i] = base[i] + first[i] * ((rounds + 1) // 2) + second[i] * (rounds // 2)


@njit(**KERNEL)
def is_unmoved(model, run, one, other):
    """Whether two vectors ``(n,)`` are the same but for the marked components."""
    for i in range(model.dimension):  # noqa: SIM110 (no generators in kernels)
        if run.trail[ENDLESS, i] == 0.0 and one[i] != other[i]:
            return False
    return True


@njit(**KERNEL)
def is_read(model, run, transition, at_once, t, base, first, second, work):
    """Whether a transition, or a field on one of its sides, depends on the marked components near ``base``.

    If the limit is reached ``at_once``, only the guard and its condition still matter.
    """
    place, other = work.trial, work.error
    before, behind = model.field_before[transition], model.field_behind[transition]
    value = guard_value(model, transition, t, base, work.scalar)
    allows = allowed(model, transition, t, base, work.scalar)
    for trial in range(1, ONE_BY_ONE + DOUBLINGS):
        place_later(model, base, first, second, trial, place)
        if guard_value(model, transition, t, place, work.scalar) != value:
            return True
        if allowed(model, transition, t, place, work.scalar) != allows:
            return True
        if at_once:
            continue
        model.reset(transition, t, base, model.parameters, work.state)
        model.reset(transition, t, place, model.parameters, other)
        if not is_unmoved(model, run, work.state, other):
            return True
        for side in range(2 if behind != NO_MODE else 1):
            mode = before if side == 0 else behind
            model.field(mode, t, base, model.parameters, work.state)
            model.field(mode, t, place, model.parameters, other)
            if not is_unmoved(model, run, work.state, other):
                return True
    return False


@njit(**KERNEL)
def counts_to_guard(model, run, turn, t, limit, first, second, work):
    """Whether the marked components take the state across the guard of a transition that waits for them."""
    place = work.trial
    for slot in range(model.first_outgoing[run.mode], model.first_outgoing[run.mode + 1]):
        other = model.outgoing[slot]
        if takes_turns(model, run, other, turn):
            continue
        value = guard_value(model, other, t, limit, work.scalar)
        side = 1 if value > 0.0 else -1
        if value == 0.0 or not crosses_towards(model.direction[other], -side):
            continue
        for trial in range(1, ONE_BY_ONE + DOUBLINGS):
            place_later(model, limit, first, second, trial, place)
            if not guard_value(model, other, t, place, work.scalar) * side > 0.0:
                return True
    return False


@njit(**KERNEL)
def may_be_held(model, run, turn, left, limit, work):
    """Whether the marked components may keep their values at the ``limit (n,)`` of the last ``turn`` jumps.

    The limit is reached after the time ``left``. If they may, they are marked as held, for the status of the
    run. Resets are compared at the states right after the jumps before, and at their mirror images: these are
    as fast, towards the guards.
    """
    n, t, found = model.dimension, run.phase + left, False
    first, second, base = work.second_error, work.new, work.field_after
    for i in range(n):
        found = found or run.trail[ENDLESS, i] != 0.0
    if not found:
        return True
    count_on(model, run, turn, t, limit, first, second, work)
    for back in range(turn):
        visit = run.visits[slot_of(run, run.jumps - back - 1)]
        for image in range(2):
            for i in range(n):
                away = visit[i] - limit[i]
                base[i] = limit[i] + (away if image == 0 else -away)
            if is_read(model, run, fired_before(run, back), left == 0.0, t, base, first, second, work):
                return False
    if counts_to_guard(model, run, turn, t, limit, first, second, work):
        return False
    for i in range(n):
        if run.trail[ENDLESS, i] != 0.0:
            run.trail[HELD, i] = 1.0
    return True
