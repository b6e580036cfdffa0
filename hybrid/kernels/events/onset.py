"""How a guard that is zero at the start of a step leaves zero: one rule for all guards and all methods.

A guard that rounding cannot tell from zero at the start of a step counts as zero there. The run knows the
side to which the flow takes it (``moments``). One that leaves zero by its speed is shifted by its value at
the start, which is rounding. Any other one is searched from the moment on at which it has left zero: before,
its signs are noise.

A guard whose first certain sign is not its side has crossed: at the start of the step if its side there is
not certain, otherwise after the start. The transition that has just fired does not fire again at the start.

If a guard lies beyond zero at the start by more than rounding, the rounding of the last step has passed it:
it crosses at the start. If no other step follows, its transition fires at the end of the run.
"""

from numba import njit

from hybrid.kernels.types.options import INLINE

# How a guard that is zero leaves zero: by its speed; some moments later, by a higher derivative or since it
# jumps; not at all, as far as its moments tell.
BY_SPEED, LATER, AT_REST = range(1, 4)
# Returned instead of a share of a step if there is no crossing: beyond the end of every step.
NO_ROOT = 2.0


@njit(**INLINE)
def crosses_towards(direction, side):
    """Whether a transition with this ``direction`` fires on a crossing to ``side``."""
    return direction == 0 or direction == side


@njit(**INLINE)
def has_just_fired(run, transition, on_guard):
    """Whether the state is on a guard whose transition has just fired, with no time passed since."""
    return on_guard > 0 and run.last_fired == transition and run.since_entry == 0.0
