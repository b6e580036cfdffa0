"""Signs of a guard's speed and acceleration, as far as the rounding of state and time leaves them.

Near a flat root or a bend the speed at one place says little: rounding may have put the state on the other
side of a place where the speed vanishes. What counts is whether any state that rounding cannot tell from this
one may have a speed of the other sign. With the guards ``q**3`` and ``q * abs(q)`` none has, so their speed
decides, however small it is; with ``q**2`` one has, and the acceleration decides.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.slopes import spread_of_rate
from hybrid.kernels.events.guards import (
    PLACE,
    ROUNDING_OF_STATE,
    guard_acceleration,
    size_of_time,
    slopes_at_guard,
    spread_of_terms,
)
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Relative rounding of a state.
SHARE = ROUNDING_OF_STATE * EPSILON
# Rows of ``work.rounding``.
SPREADS, BENDS, SPREADS_OF_BENDS = range(3)


@njit(**INLINE)
def _spread(model, run, mode, t, i, work):
    """How far state and time, moved by their own sizes, move the rate of one component."""
    spread = abs(work.field[i]) + abs(work.jacobian[i, model.dimension]) * size_of_time(model, t)
    return spread + spread_of_rate(model, mode, i, work.jacobian, run.scale)


@njit(**INLINE)
def _matters(model, transition, i, work):
    """Whether a derivative of a guard depends on the rate of a component; if the guard bends, it may."""
    return model.affine_guard[transition] == 0 or work.gradient[i] != 0.0


@njit(**KERNEL)
def spread_rates(model, run, transition, mode, t, x, work):
    """How far rounding moves each rate that matters to a guard, into a row of ``work.rounding``.

    ``work.field`` and ``work.gradient`` are current; ``work.jacobian`` is on return.
    """
    n, spreads = model.dimension, work.rounding[SPREADS]
    slopes_at_guard(model, run, transition, mode, t, x, work)
    for i in range(n):
        spreads[i] = _spread(model, run, mode, t, i, work) if _matters(model, transition, i, work) else 0.0
    first = model.target.shape[0] + model.first_forcing[-1]
    for residue in range(model.first_residue[mode], model.first_residue[mode + 1]):
        component = model.residue_component[residue]
        if _matters(model, transition, component, work):
            # Terms in time and parameters alone that may cancel.
            spreads[component] += spread_of_terms(model, run, first + residue, SHARE, t, x, work) / SHARE


@njit(**KERNEL)
def _bend_rates(model, run, transition, mode, t, work):
    """Time derivatives of these rates along the flow, and how far they move, into ``work.rounding``.

    ``work.field``, ``work.gradient`` and ``work.jacobian`` are current.
    """
    n, spreads = model.dimension, work.rounding[SPREADS]
    bent = model.affine_guard[transition] == 0
    for i in range(n if bent else 0):
        spreads[i] = _spread(model, run, mode, t, i, work)
    for i in range(n):
        bend, spread = 0.0, 0.0
        if _matters(model, transition, i, work):
            bend = work.jacobian[i, n]
            spread = abs(bend)
            for place in range(model.first_slope[mode, i], model.first_slope[mode, i + 1]):
                j = model.slope_column[place]
                slope = work.jacobian[i, j]
                if slope != 0.0:
                    bend += slope * work.field[j]
                    spread += abs(slope) * (spreads[j] if bent else _spread(model, run, mode, t, j, work))
        work.rounding[BENDS, i], work.rounding[SPREADS_OF_BENDS, i] = bend, spread


@njit(**INLINE)
def _size(gradient, spreads, n):
    """How far a derivative with this gradient moves with the rates."""
    size = 0.0
    for i in range(n):
        size += abs(gradient[i]) * spreads[i]
    return size


@njit(**KERNEL)
def speed_rounding(model, run, transition, mode, t, x, work):
    """How far rounding of state and time can move the speed of a guard; ``work.gradient`` is current."""
    n = model.dimension
    spread_rates(model, run, transition, mode, t, x, work)
    size = abs(work.gradient[n]) + _size(work.gradient, work.rounding[SPREADS], n)
    return SHARE * size + _turned_by_rounding(model, run, transition, t, x, work)


@njit(**KERNEL)
def acceleration_rounding(model, run, transition, mode, t, x, work):
    """How far rounding can move the acceleration of a guard that is affine.

    ``work.field`` and ``work.gradient`` are current.
    """
    slopes_at_guard(model, run, transition, mode, t, x, work)
    _bend_rates(model, run, transition, mode, t, work)
    return SHARE * _size(work.gradient, work.rounding[SPREADS_OF_BENDS], model.dimension)


@njit(**KERNEL)
def _turned_by_rounding(model, run, transition, t, x, work):
    """How far rounding of state and time can move the speed of a guard by turning its gradient."""
    if model.affine_guard[transition] == 1:
        return 0.0
    n, place, turned = model.dimension, work.rounding[PLACE], 0.0
    for i in range(n):
        place[i] = x[i]
    here, _ = _derivative(model, transition, t, place, False, work)
    for i in range(n + 1):
        moved = SHARE * (run.scale[i] if i < n else size_of_time(model, t))
        if i < n:
            place[i] = x[i] + moved
        speed, _ = _derivative(model, transition, t if i < n else t + moved, place, False, work)
        if i < n:
            place[i] = x[i]
        turned += abs(speed - here)
    model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    return turned if turned < math.inf else 0.0


@njit(**KERNEL)
def _derivative(model, transition, t, x, second, work):
    """Speed of a guard, or its acceleration with ``second``, along given rates, and its rounding."""
    n, gradient = model.dimension, work.gradient
    model.guard_gradient(transition, t, x, model.parameters, gradient)
    if not second:
        speed = gradient[n]
        for i in range(n):
            speed += gradient[i] * work.field[i]
        return speed, SHARE * (abs(gradient[n]) + _size(gradient, work.rounding[SPREADS], n))
    acceleration = 0.0
    if model.affine_guard[transition] == 0:
        for i in range(n):
            work.state[i] = work.field[i]
        model.guard_curvature(transition, t, x, model.parameters, work.state)
        acceleration = work.state[0]
    size = abs(acceleration)
    for i in range(n):
        acceleration += gradient[i] * work.rounding[BENDS, i]
    return acceleration, SHARE * (size + _size(gradient, work.rounding[SPREADS_OF_BENDS], n))


@njit(**INLINE)
def _certain(value, rounding):
    """Sign of a value, 0 if rounding leaves it open."""
    return (1 if value > 0.0 else -1) if abs(value) > rounding else 0


@njit(**INLINE)
def _is_open(value, rounding, sign):
    """Whether a derivative is not certain of its ``sign``; one that is flat does not tell."""
    return value * sign <= rounding and (value != 0.0 or rounding > 0.0)


@njit(**KERNEL)
def _may_reverse(model, run, transition, t, x, sign, second, work):
    """Whether a state that rounding cannot tell from ``x`` may have a derivative without the ``sign``.

    One after another, each argument is moved to where the derivative is farthest from that sign.
    """
    n, place, moment = model.dimension, work.rounding[PLACE], t
    for i in range(n):
        place[i] = x[i]
    least, rounding = _derivative(model, transition, t, place, second, work)
    if _is_open(least, rounding, sign):
        return True
    for i in range(n + 1):
        moved = SHARE * (run.scale[i] if i < n else size_of_time(model, t))
        here = place[i] if i < n else t
        best = here
        for way in (-1.0, 1.0):
            if i < n:
                place[i] = here + way * moved
            else:
                moment = here + way * moved
            value, rounding = _derivative(model, transition, moment, place, second, work)
            if _is_open(value, rounding, sign):
                return True
            if (value - least) * sign < 0.0:
                least, best = value, here + way * moved
        if i < n:
            place[i] = best
    return False


@njit(**INLINE)
def moment_of_rounding(model, run, t, work):
    """The time in which the state moves as far as its rounding; ``work.field`` is current."""
    size, pace = 0.0, 0.0
    for i in range(model.dimension):
        if work.field[i] != 0.0:
            size, pace = max(size, run.scale[i]), max(pace, abs(work.field[i]))
    return EPSILON * max(size / pace if pace > 0.0 else 0.0, size_of_time(model, t))


@njit(**KERNEL)
def speed_sign(model, run, transition, mode, t, x, speed, work):
    """Sign of a guard's ``speed`` at ``(t, x)``, 0 if rounding may hide or reverse it.

    ``work.field`` and ``work.gradient`` are current, and ``work.gradient`` is on return. At a flat root the
    speed is zero itself: then it has the sign of a moment later.
    """
    n = model.dimension
    spread_rates(model, run, transition, mode, t, x, work)
    size = abs(work.gradient[n]) + _size(work.gradient, work.rounding[SPREADS], n)
    sign = _certain(speed, SHARE * size)
    if model.affine_guard[transition] == 1:
        return sign
    if sign == 0:
        place, moment = work.rounding[PLACE], ROUNDING_OF_STATE * moment_of_rounding(model, run, t, work)
        for i in range(n):
            place[i] = x[i] + moment * work.field[i]
        later, rounding = _derivative(model, transition, t + moment, place, False, work)
        sign = _certain(later, rounding)
    if sign != 0 and _may_reverse(model, run, transition, t, x, sign, False, work):
        sign = 0
    model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    return sign


@njit(**KERNEL)
def acceleration_sign(model, run, transition, mode, t, x, work):
    """Sign of a guard's acceleration at ``(t, x)``, 0 if rounding may hide or reverse it.

    ``work.field`` and ``work.gradient`` are current. The curvature of a guard that could not be traced counts
    as exact.
    """
    slopes_at_guard(model, run, transition, mode, t, x, work)
    _bend_rates(model, run, transition, mode, t, work)
    acceleration, rounding = _derivative(model, transition, t, x, True, work)
    if math.isnan(acceleration):
        acceleration = guard_acceleration(model, run, transition, mode, t, x, work)
        rounding = SHARE * _size(work.gradient, work.rounding[SPREADS_OF_BENDS], model.dimension)
        return _certain(acceleration, rounding)
    sign = _certain(acceleration, rounding)
    if model.affine_guard[transition] == 1:
        return sign
    if sign != 0 and _may_reverse(model, run, transition, t, x, sign, True, work):
        sign = 0
    model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    return sign
