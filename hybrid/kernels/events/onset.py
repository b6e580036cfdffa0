"""How a guard leaves zero at the start of a step: one rule for all guards and all methods.

A guard that rounding cannot tell from zero at the start of a step counts as zero there, and so do its
derivatives below its order (``Run.on_guard``). Only the rest, ``g(s) - sum(g_k s^k, k < order)``, decides
what follows. A guard that is a polynomial is divided by its variable (``bernstein.divide_by_theta``). Any
other guard is shifted by its ``known_part``, until the whole guard is certain to be on its side.

The run knows the side of the guard from the derivative of that order. If rounding hides the value, speed and
acceleration, the side is the one on which the guard has not crossed yet. A guard whose first certain sign is
not its side has crossed: at the start of the step if its side there is not certain, otherwise after the
start. The transition that has just fired does not fire again at the start.

A guard that jumps across zero has no derivative that shows its side, and is never small: its side is its
sign.

If a guard lies beyond zero at the start by more than rounding, the rounding of the last step has passed it:
it crosses at the start. If no other step follows, its transition fires at the end of the run.
"""

import math

from numba import njit

from hybrid.kernels.types.options import INLINE

# Orders of a guard that is zero: its speed, its acceleration or the next step shows the side to which it
# leaves. The signs of a guard of the last order are no noise: it jumps across zero, or the flow leaves it
# after its own jump, and the signs a moment before and after tell to which side.
BY_SPEED, BY_ACCELERATION, BY_STEP, JUMPING = range(1, 5)


@njit(**INLINE)
def is_zero(on_guard):
    """Whether a guard of this order counts as zero at the start of a step."""
    return on_guard in (BY_SPEED, BY_ACCELERATION, BY_STEP)


@njit(**INLINE)
def known_part(value, slope, on_guard):
    """Value and slope of a guard at the start of a step that are only rounding: they count as zero.

    The slope is left alone for order ``BY_SPEED``. Both results are zero for a guard that jumps.
    """
    if not is_zero(on_guard) or not abs(slope) < math.inf:
        return 0.0, 0.0
    return value, slope if on_guard != BY_SPEED else 0.0


@njit(**INLINE)
def side_is_certain(on_guard, least_slope, most_slope):
    """Whether a guard that is zero is certain to leave to the known side: not if it has a kink there."""
    kink = on_guard == BY_SPEED and least_slope < 0.0 < most_slope
    return is_zero(on_guard) and on_guard != BY_STEP and not kink


@njit(**INLINE)
def has_just_fired(run, transition, on_guard):
    """Whether the state is on a guard whose transition has just fired, with no time passed since."""
    return on_guard > 0 and run.last_fired == transition and run.since_entry == 0.0
