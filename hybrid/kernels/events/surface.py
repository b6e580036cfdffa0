"""Guards that jump across zero: their gradient says nothing of the surface on which they do."""

from numba import njit

from hybrid.kernels.events.guards import guard_speed, guard_value
from hybrid.kernels.types.options import KERNEL

# A guard is looked at so far before and behind its crossing, as a share of the time in which the state
# changes by its size: the square root of rounding is what bends least and is rounded least.
BESIDE_CROSSING = 1e-7
# A guard jumps if it changes by so many times what its speeds there explain: a smooth one changes by half.
UNEXPLAINED_JUMP = 1e3


@njit(**KERNEL)
def unit_of_path(model, x, work):
    """The time in which the state changes by its size; components at rest have no say."""
    size, pace = 0.0, 0.0
    for i in range(model.dimension):
        if work.field[i] != 0.0:
            size, pace = max(size, abs(x[i])), max(pace, abs(work.field[i]))
    return size / pace if size * pace > 0.0 else 1.0


@njit(**KERNEL)
def jumps_across(model, transition, t, x, work):
    """Whether a guard jumps across zero at ``x (n,)``, on the path of the field in ``work.field``.

    ``work.gradient`` is that at ``x`` on return.
    """
    if model.affine_guard[transition] == 1:
        return False
    s, before, behind, explained = BESIDE_CROSSING * unit_of_path(model, x, work), 0.0, 0.0, 0.0
    for way in (-1.0, 1.0):
        for i in range(model.dimension):
            work.state[i] = x[i] + way * s * work.field[i]
        before, behind = behind, guard_value(model, transition, t + way * s, work.state, work.scalar)
        explained += s * abs(
            guard_speed(model, transition, t + way * s, work.state, work.field, work.gradient)
        )
    model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    return before * behind < 0.0 and abs(behind - before) > UNEXPLAINED_JUMP * explained
