"""Guards along a step: their polynomials, the earliest crossing, and landing on it."""

import math

from numba import njit

from hybrid.kernels.bernstein import (
    NO_ROOT,
    divide_by_theta,
    first_crossing,
    lowest,
    stays,
    value_and_slope,
)
from hybrid.kernels.codes import (
    CYCLE,
    GRAZING_GUARD,
    GRAZING_PLACE,
    GRAZING_VALUE,
    GRAZINGS,
    JUMPS,
    MODE,
    NO_TRANSITION,
    PHASE,
)
from hybrid.kernels.layout import EPSILON, INLINE, KERNEL
from hybrid.kernels.step import attempt_again

# A fitted guard polynomial is believed where it misses the guard by less than this, relative to its size: two
# crossings that reach no farther beyond zero than the misfit are lost.
FIT_TOLERANCE = 1e-12
# A guard that has just been met is followed off zero only where it rises this far above rounding: closer in,
# the shape of its fit is noise.
CLEAR_OF_ROUNDING = 64.0
# Instead of a place on [0, 1]: the step is too short to leave the guard it started on.
STILL_ON_GUARD = 3.0
# Guards with a kink on the step are cut around it down to this share of the step.
SHORTEST_CUT = 1e-12
# A correction this small, relative to the step, is finished by one Euler step: the error left is its square.
EULER_IS_ENOUGH = 1e-8
# Newton's steps take half of these at most, halvings of the bracket down to rounding the rest.
MOST_LANDINGS = 120
NOT_THERE = -1.0


@njit(**INLINE)
def guard_value(model, transition, t, x, scalar):
    """``g(t, x, p)``; ``scalar (1,)`` is scratch."""
    model.guard(transition, t, x, model.parameters, scalar)
    return scalar[0]


@njit(**KERNEL)
def allowed(model, transition, t, x, scalar):
    """Whether the condition of a transition holds; one without a condition always does."""
    scalar[0] = 1.0
    return guard_value(model, transition + model.target.shape[0], t, x, scalar) > 0.0


@njit(**INLINE)
def guard_speed(model, transition, t, x, field, gradient):
    """Transversality ``D_t g + D_x g f``; leaves ``(D_x g, D_t g)`` in ``gradient (n + 1,)``."""
    model.guard_gradient(transition, t, x, model.parameters, gradient)
    speed = gradient[model.dimension]
    for i in range(model.dimension):
        speed += gradient[i] * field[i]
    return speed


@njit(**KERNEL)
def rounding_band(model, run, t, gradient):
    """How far from zero rounding alone can leave a guard whose state has the sizes in ``run.scale``."""
    n = model.dimension
    size = abs(gradient[n] * t)
    for i in range(n):
        size += abs(gradient[i]) * run.scale[i]
    return 16 * EPSILON * size


@njit(**KERNEL)
def widen_scale(model, run, work):
    """Judge rounding at the start and the end of a run alike, whatever steps lead there.

    Each component is taken to be at least as large as it becomes while the state changes by its own size;
    ``work.field`` is current. A run that ends on a guard and the run that starts there then agree on that.
    """
    size, pace = 0.0, 0.0
    for i in range(model.dimension):
        size, pace = max(size, abs(run.y[i])), max(pace, abs(work.field[i]))
    for i in range(model.dimension if pace > 0.0 else 0):
        run.scale[i] = max(run.scale[i], abs(work.field[i]) * (size / pace))


@njit(**KERNEL)
def sides_at_point(model, run, work):
    """Bring the sides of the mode's guards, known at the ends of a step only, to where the run has landed.

    A guard that is zero there has not been crossed yet: it keeps the side it had before, and has none if the
    next step has to show it. One that fires both ways is followed no further than that: its side is 0 away
    from the guard.
    """
    mode, t = run.count[MODE], run.clock[PHASE]
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        direction = model.direction[transition]
        value = guard_value(model, transition, t, run.y, work.scalar)
        model.guard_gradient(transition, t, run.y, model.parameters, work.gradient)
        beyond = value * direction > 0.0
        if abs(value) > rounding_band(model, run, t, work.gradient):
            run.side[transition] = direction if beyond else -direction
        elif direction != 0 and run.side[transition] != 0:
            run.side[transition] = -direction


@njit(**KERNEL)
def speed_rounding(model, run, mode, t, work):
    """How far from zero rounding of the state alone can leave the speed of the guard in ``work.gradient``."""
    n = model.dimension
    model.flow_jacobian(mode, t, run.y, model.parameters, work.jacobian)
    size = abs(work.gradient[n])
    for i in range(n):
        spread = abs(work.field[i])
        for j in range(n):
            spread += abs(work.jacobian[i, j]) * run.scale[j]
        size += abs(work.gradient[i]) * spread
    return 16 * EPSILON * size


@njit(**KERNEL)
def acceleration_rounding(model, run, t, work):
    """How far from zero rounding of state and time alone can leave the acceleration of the same guard.

    Its Jacobian and field are current: ``guard_acceleration`` has just been called.
    """
    n = model.dimension
    size = 0.0
    for i in range(n):
        bend = abs(work.jacobian[i, n])
        for j in range(n):
            spread = abs(work.field[j]) + abs(work.jacobian[j, n] * t)
            for k in range(n):
                spread += abs(work.jacobian[j, k]) * run.scale[k]
            bend += abs(work.jacobian[i, j]) * spread
        size += abs(work.gradient[i]) * bend
    return 16 * EPSILON * size


@njit(**INLINE)
def affine_polynomial(model, method, transition, t, h, x, value, work):
    """Bernstein coefficients of an affine guard on the interpolant, exactly; returns their degree."""
    n = model.dimension
    model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    degree, count = method.interpolant.shape[0] - 1, method.a.shape[0]
    for j in range(count):
        speed = 0.0
        for i in range(n):
            speed += work.gradient[i] * work.stages[j, i]
        work.speeds[j] = h * speed
    for i in range(degree + 1):
        total = value + h * work.gradient[n] * i / degree
        for j in range(count):
            total += method.interpolant[i, j] * work.speeds[j]
        work.polynomial[i] = total
    return degree


@njit(**KERNEL)
def value_on_interpolant(model, transition, t, h, theta, work):
    """The guard on the interpolant at ``t + theta h``; ``work.coefficients`` holds the interpolant."""
    degree = work.coefficients.shape[0] - 1
    for i in range(model.dimension):
        work.state[i] = 0.0
    # From the nearer end on, each member of the basis is the one before times a ratio of at most the degree.
    backwards = theta > 0.5
    distance = 1.0 - theta if backwards else theta
    basis, ratio = (1.0 - distance) ** degree, distance / (1.0 - distance)
    for j in range(degree + 1):
        row = degree - j if backwards else j
        for i in range(model.dimension):
            work.state[i] += basis * work.coefficients[row, i]
        basis *= ratio * (degree - j) / (j + 1.0)
    return guard_value(model, transition, t + theta * h, work.state, work.scalar)


@njit(**KERNEL)
def fit_polynomial(model, transition, t, h, start, end, offset, work):
    """Fit a polynomial to ``g - offset`` over ``[start, end]`` of the step; returns its misfit between nodes.

    The values at ``work.nodes`` determine it; it is checked half-way between each pair of nodes.
    """
    degree = work.nodes.shape[0] - 1
    values = work.stack[work.stack.shape[0] - 1]
    for i in range(degree + 1):
        theta = start + (end - start) * work.nodes[i]
        values[i] = value_on_interpolant(model, transition, t, h, theta, work) - offset
    for i in range(degree + 1):
        total = 0.0
        for j in range(degree + 1):
            total += work.fit[i, j] * values[j]
        work.polynomial[i] = total
    misfit = 0.0
    for i in range(degree):
        theta = 0.5 * (work.nodes[i] + work.nodes[i + 1])
        fitted, _ = value_and_slope(work.polynomial, degree, theta)
        value = value_on_interpolant(model, transition, t, h, start + (end - start) * theta, work) - offset
        misfit = max(misfit, abs(fitted - value))
        if not math.isfinite(value):
            return math.inf
    return misfit


@njit(**INLINE)
def error_band(method, run, gradient, n):
    """How far the tolerances can move a guard with this gradient: closer to zero than that is a grazing."""
    size = 0.0
    for i in range(n):
        size += abs(gradient[i]) * (method.atol + method.rtol * run.scale[i])
    return size


@njit(**KERNEL)
def note_grazing(run, transition, degree, side, band, start, end, work):
    """Keep the earliest place of the step where a guard comes within ``band`` of zero and turns back.

    ``work.polynomial`` is the guard on the part ``[start, end]`` of the step.
    """
    theta, value = lowest(work.polynomial, degree, side, work.stack)
    place = start + (end - start) * theta
    if 0.0 < theta < 1.0 and abs(value) <= band and place < run.clock[GRAZING_PLACE]:
        run.clock[GRAZING_PLACE], run.clock[GRAZING_VALUE] = place, value
        run.count[GRAZING_GUARD] = transition


@njit(**KERNEL)
def composed_crossing(model, method, run, transition, t, h, offset, on_guard, side, work):
    """First crossing of a guard that is not affine, by polynomials fitted piecewise along the interpolant.

    Only where a fit neither excludes a zero nor follows the guard is the interval cut, so a kink away from
    zero costs nothing, and below the guard's rounding no fit can follow it. Returns the place on [0, 1] (or
    ``NO_ROOT``, or ``STILL_ON_GUARD``) and the side after it.
    """
    direction = model.direction[transition]
    model.guard_gradient(transition, t, run.y, model.parameters, work.gradient)
    band = rounding_band(model, run, t, work.gradient)
    close = error_band(method, run, work.gradient, model.dimension)
    values = work.stack[work.stack.shape[0] - 1]
    top = 0
    work.intervals[0, 0], work.intervals[0, 1] = 0.0, 1.0
    while top >= 0:
        start, end = work.intervals[top, 0], work.intervals[top, 1]
        misfit = fit_polynomial(model, transition, t, h, start, end, offset, work)
        degree = work.nodes.shape[0] - 1
        low, high, farthest = math.inf, -math.inf, 0.0
        for i in range(degree + 1):
            farthest = max(farthest, abs(values[i]))
            low, high = min(low, work.polynomial[i]), max(high, work.polynomial[i])
        if on_guard > 0 and start == 0.0 and end == 1.0 and farthest <= CLEAR_OF_ROUNDING * band:
            return STILL_ON_GUARD, side
        excluded = low > misfit or high < -misfit
        rough = misfit > max(FIT_TOLERANCE * farthest, 8.0 * band)
        if rough and not excluded and end - start > SHORTEST_CUT:
            middle = 0.5 * (start + end)
            work.intervals[top, 0] = middle
            top += 1
            work.intervals[top, 0], work.intervals[top, 1] = start, middle
            continue
        top -= 1
        if not math.isfinite(high - low):
            continue
        for _ in range(on_guard if start == 0.0 else 0):
            degree = divide_by_theta(work.polynomial, degree)
        before = side
        theta, side = first_crossing(work.polynomial, degree, side, direction, work.stack)
        if theta <= 1.0:
            return start + (end - start) * theta, side
        if side == before and on_guard == 0 and not stays(work.polynomial, degree, side, close):
            note_grazing(run, transition, degree, side, close, start, end, work)
    return NO_ROOT, side


@njit(**KERNEL)
def leave_guard(model, run, transition, t, work):
    """Put a guard on the side it has at the end of the attempted step, ``work.new``, whatever came before."""
    value = guard_value(model, transition, t, work.new, work.scalar)
    model.guard_gradient(transition, t, work.new, model.parameters, work.gradient)
    if abs(value) > rounding_band(model, run, t, work.gradient):
        run.side[transition] = 1 if value > 0.0 else -1
        run.on_guard[transition] = 0


@njit(**INLINE)
def earliest_crossing(model, method, run, t, h, ignored, work):
    """Earliest crossing on the attempted step over the mode's guards but ``ignored``, and its transition.

    Returns ``(theta, transition)``, or ``(NO_ROOT, NO_TRANSITION)``; the sides of guards without a crossing
    are brought up to date, to the end of the step, and guards that were left are no longer held to be zero at
    its start. ``work.coefficients`` must hold the interpolant if any guard of the mode is not affine.
    """
    mode = run.count[MODE]
    earliest, fired = NO_ROOT, NO_TRANSITION
    run.clock[GRAZING_PLACE] = NO_ROOT
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        if transition == ignored:
            leave_guard(model, run, transition, t + h, work)
            continue
        value = guard_value(model, transition, t, run.y, work.scalar)
        on_guard = run.on_guard[transition]
        side = run.side[transition]
        if model.affine_guard[transition] == 1:
            start = 0.0 if on_guard > 0 else value
            degree = affine_polynomial(model, method, transition, t, h, run.y, start, work)
            if on_guard > 0:
                band, farthest = rounding_band(model, run, t, work.gradient), 0.0
                for i in range(degree + 1):
                    farthest = max(farthest, abs(work.polynomial[i]))
                if farthest <= band:
                    continue
                run.on_guard[transition] = 0
            for _ in range(on_guard):
                degree = divide_by_theta(work.polynomial, degree)
            band = error_band(method, run, work.gradient, model.dimension)
            if stays(work.polynomial, degree, side, band):
                continue
            theta, side = first_crossing(
                work.polynomial, degree, side, model.direction[transition], work.stack
            )
            if theta > 1.0 and side == run.side[transition] and on_guard == 0:
                note_grazing(run, transition, degree, side, band, 0.0, 1.0, work)
        else:
            offset = value if on_guard > 0 else 0.0
            theta, side = composed_crossing(
                model, method, run, transition, t, h, offset, on_guard, side, work
            )
            if theta == STILL_ON_GUARD:
                continue
            run.on_guard[transition] = 0
        if theta == NO_ROOT:
            run.side[transition] = side
        elif theta < earliest:
            earliest, fired = theta, transition
    return earliest, fired


@njit(**KERNEL)
def land(parts, model, method, transition, side, mode, t, h, theta, y, tangents, work):
    """Shorten the step so that it ends on the guard, with the end in ``work.new``.

    The step is taken again up to the root of the interpolant and corrected by Newton's method on the guard,
    so that the state and the tangents at the event carry the error of the method, not that of its
    interpolant. The guard comes from ``side``; Newton is kept in a bracket as soon as both sides have been
    seen. Returns the length of the step last taken and the small Euler step that completed it; ``NOT_THERE``
    instead of the length if the guard of the step, unlike that of its interpolant, only comes close to zero.
    """
    s = method.b.shape[0]
    low, high = 0.0, h
    before = guard_value(model, transition, t, y, work.scalar) * side > 0.0
    after = guard_value(model, transition, t + h, work.new, work.scalar) * side <= 0.0
    length = theta * h
    for trial in range(MOST_LANDINGS):
        attempt_again(parts, model, method, mode, t, length, y, tangents, work)
        if length == 0.0:
            return 0.0, 0.0
        value = guard_value(model, transition, t + length, work.new, work.scalar)
        speed = guard_speed(model, transition, t + length, work.new, work.stages[s], work.gradient)
        correction = -value / speed
        if speed * side < 0.0 and abs(correction) <= EULER_IS_ENOUGH * length:
            for i in range(model.dimension * (1 + tangents)):
                work.new[i] += correction * work.stages[s, i]
            return length, correction
        if value * side > 0.0:
            low, before = length, True
        else:
            high, after = length, True
        if before and after and high - low <= 4e-16 * max(high, abs(t)):
            return length, 0.0
        newton = length + correction
        if low < newton < high and trial < MOST_LANDINGS // 2:
            length = newton
        elif before and after:
            length = 0.5 * (low + high)
        else:
            break
    return NOT_THERE, 0.0


@njit(**KERNEL)
def guard_acceleration(model, transition, mode, t, x, work):
    """Second Lie derivative of a guard along the flow; ``work.field`` and ``work.gradient`` are current.

    ``D_x g (D_x f f + D_t f)`` is exact; the curvature of the guard itself is a difference of its gradient
    along the flow.
    """
    n = model.dimension
    model.flow_jacobian(mode, t, x, model.parameters, work.jacobian)
    total = 0.0
    for i in range(n):
        bend = work.jacobian[i, n]
        for j in range(n):
            bend += work.jacobian[i, j] * work.field[j]
        total += work.gradient[i] * bend
    if model.affine_guard[transition] == 1:
        return total
    size, speed = 1e-3, 0.0
    for i in range(n):
        size = max(size, abs(x[i]))
        speed = max(speed, abs(work.field[i]))
    epsilon = 1e-7 * size / speed if speed > 0.0 else 1e-7
    for i in range(n):
        work.state[i] = x[i] + epsilon * work.field[i]
    before = guard_speed(model, transition, t, x, work.field, work.gradient)
    after = guard_speed(model, transition, t + epsilon, work.state, work.field, work.gradient)
    model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    return total + (after - before) / epsilon


@njit(**KERNEL)
def keep_grazing(model, run, record, transition, t, x, value, work):
    """Count a touch of a guard at the state ``x (n,)``, and write it into the record if that keeps any."""
    run.count[GRAZINGS] += 1
    slot, mode = record.used[2], run.count[MODE]
    if slot == record.grazing_time.shape[0]:
        return
    for i in range(model.dimension):
        record.grazing_state[slot, i] = x[i]
    place = record.grazing_state[slot]
    model.flow(mode, t, place, model.parameters, work.field)
    guard_speed(model, transition, t, place, work.field, work.gradient)
    record.grazing_time[slot, 0], record.grazing_time[slot, 1] = t, value
    record.grazing_time[slot, 2] = guard_acceleration(model, transition, mode, t, place, work)
    record.grazing_place[slot, 0], record.grazing_place[slot, 1] = run.count[CYCLE], transition
    record.grazing_place[slot, 2] = run.count[JUMPS]
    record.used[2] = slot + 1
