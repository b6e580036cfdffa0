"""Touches: places of a step where a guard comes within its band of zero and turns back.

A run records every touch, and a step holds one: a step with more is cut between the first two. Which touches
are recorded does not depend on the steps then. A touch at the end of a step belongs to that step.
"""

from numba import njit

from hybrid.kernels.events.guards import allowed, keep_grazing
from hybrid.kernels.events.onset import NO_ROOT
from hybrid.kernels.types.options import INLINE, KERNEL

# A step is cut at this share of the way from its first touch to its second one: the middle may be a crossing.
CUT = 0.3819
# Share of a step between two touches. Closer ones are the same: two transitions may watch one guard.
TOUCHES_APART = 1e-6


@njit(**INLINE)
def forget_touches(run):
    """Begin to search a step for touches."""
    run.grazing_place, run.next_grazing = NO_ROOT, NO_ROOT


@njit(**INLINE)
def note_touch(run, transition, place, value):
    """Keep the first touch of the step, and the place of the second one; ``place`` is a share of the step."""
    if place < run.grazing_place:
        if place < run.grazing_place - TOUCHES_APART:
            run.next_grazing = run.grazing_place
        run.grazing_place, run.grazing_value = place, value
        run.grazing_guard = transition
    elif place > run.grazing_place + TOUCHES_APART:
        run.next_grazing = min(run.next_grazing, place)


@njit(**INLINE)
def share_with_one_touch(run):
    """The share of the step up to a place between its first two touches; more than 1 without them."""
    first, second = run.grazing_place, run.next_grazing
    return first + CUT * (second - first) if second < NO_ROOT else NO_ROOT


@njit(**KERNEL)
def remember_touch(model, run, record, place, time, work):
    """Record the touch found at a share of the step just taken, at ``work.state``, if it is allowed there.

    A touch at the start of a step has been recorded if the last step ended with it.
    """
    transition, step = run.grazing_guard, run.steps - run.rejected
    again = place <= TOUCHES_APART and run.touched_step == step - 1 and run.touched_guard == transition + 1
    if place >= 1.0 - TOUCHES_APART:
        run.touched_step, run.touched_guard = step, transition + 1
    if not again and allowed(model, transition, time, work.state, work.scalar):
        keep_grazing(model, run, record, transition, time, work.state, run.grazing_value, work)
