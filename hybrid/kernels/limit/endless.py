"""Components that jumps move for ever, such as counters of impacts: whether a limit may leave them behind.

Each jump of a chatter adds one to a counter, so that the counter has no limit while all other components have
one. It keeps the value that it has after the last jump that is made. The others have their limit only if
nothing depends on the counter: no rate, no other component of a reset, no guard and no condition. At one
instant, where all else is at rest, only guards and conditions could still make a difference.
"""

from numba import njit

from hybrid.kernels.jumps.past import fired_before, visit_before
from hybrid.kernels.jumps.rest import RESOLVED, ROUNDED
from hybrid.kernels.types.codes import BY_FLOW, BY_NOTHING, ENDLESS, HELD, IMPULSE, NO_MODE
from hybrid.kernels.types.options import KERNEL

# A component is moved at the limit if a round moves it by this share of what the last round did: one that has
# a limit stays there up to the error of that limit.
MOVES_ON = 0.1


@njit(**KERNEL)
def hold_endless(model, run, turn, left, work):
    """Find what rounds of ``turn`` jumps move for ever, though all else rests at the limit ``work.settled``.

    These components are marked. They keep their last values but for their own rate, and have no impulse.
    """
    n, t, x, once, after = model.dimension, run.phase + left, work.second_error, work.new, work.state
    last, before = run.visits[visit_before(run, 0)], run.visits[visit_before(run, turn)]
    for i in range(n):
        x[i] = work.settled[i]
    for back in range(2 * turn - 1, -1, -1):
        model.reset(fired_before(run, back % turn), t, x, model.parameters, after)
        for i in range(n):
            x[i] = after[i]
        for i in range(n if back == turn else 0):
            once[i] = x[i]
    model.field(run.mode, run.phase, run.y, model.parameters, work.field)
    for i in range(n):
        least = max(MOVES_ON * abs(last[i] - before[i]), ROUNDED * run.scale[i])
        first, second = abs(once[i] - work.settled[i]), abs(x[i] - once[i])
        # A component whose moves shrink has a limit of its own.
        endless = first > least and second >= (1.0 - RESOLVED) * first
        run.trail[ENDLESS, i] = 1.0 if endless else 0.0
        if endless:
            run.trail[IMPULSE, i], work.settled[i] = 0.0, run.y[i] + left * work.field[i]


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
