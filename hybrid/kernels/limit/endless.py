"""Components that jumps move for ever, such as counters of impacts: whether a limit may leave them behind.

Each jump of a chatter adds one to a counter, so that the counter has no limit while all other components have
one. It keeps the value that it has after the last jump that is made. The others have their limit only if
nothing depends on the counter: no rate, no other component of a reset, no guard and no condition. At one
instant, where all else is at rest, only guards and conditions could still make a difference.
"""

from numba import njit

from hybrid.kernels.jumps.past import fired_before, visit_before
from hybrid.kernels.jumps.rest import RESOLVED, ROUNDED
from hybrid.kernels.types.codes import BY_FLOW, BY_NOTHING, ENDLESS, HELD, NO_MODE
from hybrid.kernels.types.options import KERNEL

# A component is moved at the limit if a round moves it by this share of what the last round did: one that has
# a limit stays there up to the error of that limit.
MOVES_ON = 0.1


@njit(**KERNEL)
def follow_resets(model, run, turn, t, x, work):
    """The resets of the last ``turn`` jumps, in order, from ``x (n,)`` into ``x``."""
    for back in range(turn - 1, -1, -1):
        model.reset(fired_before(run, back), t, x, model.parameters, work.state)
        for i in range(model.dimension):
            x[i] = work.state[i]


@njit(**KERNEL)
def mark_endless(model, run, turn, t, x, work):
    """Mark the components that rounds of ``turn`` jumps move for ever, though all others rest at ``x (n,)``.

    A second round moves them as far as the first: a component whose moves shrink has a limit of its own.
    """
    n, once, twice = model.dimension, work.second_error, work.new
    last, before = run.visits[visit_before(run, 0)], run.visits[visit_before(run, turn)]
    found = False
    for i in range(n):
        once[i] = x[i]
    follow_resets(model, run, turn, t, once, work)
    for i in range(n):
        least = max(MOVES_ON * abs(last[i] - before[i]), ROUNDED * run.scale[i])
        moves = abs(once[i] - x[i]) > least
        run.trail[ENDLESS, i] = 1.0 if moves else 0.0
        twice[i] = once[i] if moves else x[i]
        found = found or moves
    if not found:
        return
    follow_resets(model, run, turn, t, twice, work)
    for i in range(n):
        if abs(twice[i] - once[i]) < (1.0 - RESOLVED) * abs(once[i] - x[i]):
            run.trail[ENDLESS, i] = 0.0


@njit(**KERNEL)
def hold_endless(model, run, left, work):
    """Let the marked components keep their last values in ``work.settled (n,)``, but for their own rate."""
    model.field(run.mode, run.phase, run.y, model.parameters, work.field)
    for i in range(model.dimension):
        if run.trail[ENDLESS, i] != 0.0:
            work.settled[i] = run.y[i] + left * work.field[i]


@njit(**KERNEL)
def may_be_held(model, run, turn, left):
    """Whether the marked components may keep their values at the limit of the last ``turn`` jumps.

    The limit is reached after the time ``left``. If they may, they are marked as held, for the status of the
    run.
    """
    most = BY_NOTHING if left > 0.0 else BY_FLOW
    for i in range(model.dimension):
        if run.trail[ENDLESS, i] == 0.0:
            continue
        for back in range(turn):
            mode = model.target[fired_before(run, back)]
            if mode == NO_MODE or model.read_by[mode, i] > most:
                return False
    for i in range(model.dimension):
        if run.trail[ENDLESS, i] != 0.0:
            run.trail[HELD, i] = 1.0
    return True
