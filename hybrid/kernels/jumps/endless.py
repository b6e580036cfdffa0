"""Components that jumps move for ever, such as counters of impacts: whether a limit may leave them behind.

Each jump of a chatter adds one to a counter, so that the counter has no limit while all other components have
one. It keeps the value that it has after the last jump that is made. The others have their limit only if
nothing depends on the counter: no rate, no other component of a reset, no guard and no condition. At one
instant, where all else is at rest, only guards and conditions could still make a difference.
"""

from numba import njit

from hybrid.kernels.jumps.rounds import fired_before
from hybrid.kernels.types.codes import BY_FLOW, BY_NOTHING, ENDLESS, HELD, NO_MODE
from hybrid.kernels.types.options import KERNEL


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
