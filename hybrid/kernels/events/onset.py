"""How a guard leaves zero where a step starts: one rule for all guards and all methods.

A guard that rounding cannot tell from zero at the start of a step *is* zero there, and so are its derivatives
below its order (``Run.on_guard``). Only what is left of it, ``g(s) - sum(g_k s^k, k < order)``, decides what
follows. A guard that is a polynomial is divided by its variable (``bernstein.divide_by_theta``); any other
guard is shifted by its ``known_part``, until the guard itself is certain to be on its side.

The run knows a side of the guard from the derivative of that order. Where rounding hides three derivatives,
the side is the one from which the guard has not crossed yet. A guard whose first certain sign is not its side
has crossed: at the start of the step if its side there is not certain, else in between. The transition that
has just fired does not fire again at the start.

A guard that jumps across zero has no derivative to go by, and is never small: its side is its sign.

A guard that lies on the other side of zero at the start, beyond rounding, has been passed by the rounding of
the last step: it crosses at the start. Where no other step follows, the end of the run fires it.
"""

import math

from numba import njit

from hybrid.kernels.types.layout import INLINE

# Orders of a guard that is zero: its speed says on which side it leaves, its acceleration, or the next step.
# A guard of the last order jumps across zero, and is not small.
BY_SPEED, BY_ACCELERATION, BY_STEP, JUMPING = range(1, 5)


@njit(**INLINE)
def is_zero(on_guard):
    """Whether a guard of this order is taken to be zero at the start of a step."""
    return on_guard in (BY_SPEED, BY_ACCELERATION, BY_STEP)


@njit(**INLINE)
def known_part(value, slope, on_guard):
    """What rounding has made of a guard at the start of a step: its value, and a slope that is hidden.

    Nothing of it where the guard jumps.
    """
    if not is_zero(on_guard) or not abs(slope) < math.inf:
        return 0.0, 0.0
    return value, slope if on_guard != BY_SPEED else 0.0


@njit(**INLINE)
def side_is_certain(on_guard, least_slope, most_slope):
    """Whether a guard that is zero leaves to the side that the run knows: not if it has a kink there."""
    kink = on_guard == BY_SPEED and least_slope < 0.0 < most_slope
    return is_zero(on_guard) and on_guard != BY_STEP and not kink


@njit(**INLINE)
def has_just_fired(run, transition, on_guard):
    """Whether the state stands on the guard, which has led here: no time has passed since."""
    return on_guard > 0 and run.last_fired == transition and run.since_entry == 0.0
