"""Touches: places of a step where a guard comes within its band of zero and turns back.

A run records every touch, and a step holds one: a step with more is cut between the first two. Which touches
are recorded does not depend on the steps then. A touch at the end of a step belongs to that step.
"""

from numba import njit

from hybrid.kernels.arithmetic.bernstein import (
    NO_ROOT,
    multiply_by_theta,
    next_turn,
    value_and_slope,
)
from hybrid.kernels.events.guards import allowed, keep_grazing
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# A step is cut at this share of the way from its first touch to its second one: the middle may be a crossing.
CUT = 0.3819
# Share of a step between two touches. Closer ones are the same: two transitions may watch one guard.
APART = 1e-6
# Rounding of a polynomial, in units of EPSILON times its largest coefficient.
ROUNDING = 16.0


@njit(**INLINE)
def forget_touches(run):
    """Begin to search a step for touches."""
    run.grazing_place, run.next_grazing = NO_ROOT, NO_ROOT


@njit(**INLINE)
def note_touch(run, transition, place, value):
    """Keep the first touch of the step, and the place of the second one; ``place`` is a share of the step."""
    if place < run.grazing_place:
        if place < run.grazing_place - APART:
            run.next_grazing = run.grazing_place
        run.grazing_place, run.grazing_value = place, value
        run.grazing_guard = transition
    elif place > run.grazing_place + APART:
        run.next_grazing = min(run.next_grazing, place)


@njit(**INLINE)
def share_with_one_touch(run):
    """The share of the step up to a place between its first two touches; more than 1 without them."""
    first, second = run.grazing_place, run.next_grazing
    return first + CUT * (second - first) if second < NO_ROOT else NO_ROOT


@njit(**KERNEL)
def turn_at_end(coefficients, degree, rounding, stack):
    """The kind of the turn that a polynomial has at 1, as in ``next_turn``; 0 if it has none there.

    The first derivative that is more than rounding tells. ``stack`` is scratch.
    """
    differences = stack[stack.shape[0] - 2]
    for i in range(degree + 1):
        differences[i] = coefficients[i]
    for order in range(1, degree + 1):
        for i in range(degree + 1 - order):
            differences[i] = differences[i + 1] - differences[i]
        rounding *= 2.0
        last = differences[degree - order]
        if abs(last) > rounding:
            return 0 if order % 2 == 1 else (1 if last > 0.0 else -1)
    return 0


@njit(**KERNEL)
def note_touches(run, transition, degree, known_roots, start, theta, band, work):
    """Note the touches of a guard that is a polynomial on a step, from ``start`` to its crossing ``theta``.

    ``work.polynomial`` holds the guard divided by the step's variable for each known root at the start.
    """
    coefficients = work.polynomial
    for _ in range(known_roots):
        degree = multiply_by_theta(coefficients, degree)
    size = 0.0
    for i in range(degree + 1):
        size = max(size, abs(coefficients[i]))
    rounding = ROUNDING * EPSILON * size
    touch, depth, way = NO_ROOT, 0.0, 1
    # The derivative has fewer roots than the polynomial.
    for _ in range(2 * degree):
        place, value, kind = next_turn(coefficients, degree, start, work.stack)
        if not place < min(theta, 1.0):
            break
        start = place + APART
        if touch < NO_ROOT and value * way > max(depth * way, 0.0) + rounding:
            note_touch(run, transition, touch, depth)
            touch = NO_ROOT
        # Of turns between which the guard moves by rounding alone, the deepest counts.
        near = place > 0.0 and abs(value) <= band and value * kind >= -rounding
        if near and (touch == NO_ROOT or value * kind < depth * way):
            touch, depth, way = place, value, kind
    if touch < NO_ROOT:
        # The bottom of a dip no deeper than rounding is no touch if the guard crosses zero there.
        beyond, _ = value_and_slope(coefficients, degree, 0.5 * (touch + min(theta, 1.0)))
        if theta > 1.0 or beyond * way > max(depth * way, 0.0) + rounding:
            note_touch(run, transition, touch, depth)
    last = coefficients[degree]
    if theta > 1.0 and abs(last) <= band:
        kind = turn_at_end(coefficients, degree, rounding, work.stack)
        if kind != 0 and last * kind >= -rounding:
            note_touch(run, transition, 1.0, last)


@njit(**KERNEL)
def remember_touch(model, run, record, place, time, work):
    """Record the touch found at a share of the step just taken, at ``work.state``, if it is allowed there.

    A touch at the start of a step has been recorded if the last step ended with it.
    """
    transition, step = run.grazing_guard, run.steps - run.rejected
    again = place <= APART and run.touched_step == step - 1 and run.touched_guard == transition + 1
    if place >= 1.0 - APART:
        run.touched_step, run.touched_guard = step, transition + 1
    if not again and allowed(model, transition, time, work.state, work.scalar):
        keep_grazing(model, run, record, transition, time, work.state, run.grazing_value, work)
