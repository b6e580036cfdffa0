"""Bounds for a guard and for its slope over a piece of a step, from the guard's own expression.

A *program* is the expression of a guard as a list of operations, written by
``hybrid.compiler.bounds.program``. The program runs on intervals here, from the first row to the last: each
row gives the range of a subexpression over the piece, the range of its derivative along the step, and an
interval for its value in the middle of the piece. The mean value theorem derives a range from the other two
intervals; where that range is narrower, it is used. The state along the step is a *path*: a polynomial in the
step's variable, one column per component.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic import operations as op
from hybrid.kernels.arithmetic.intervals import (
    added,
    angle,
    comparison,
    fixed_power,
    hull,
    product,
    quotient,
    range_of,
    slope_of,
    truth,
    whole_power,
)
from hybrid.kernels.arithmetic.tables import table_bounds
from hybrid.kernels.types.codes import HIGH, HIGH_MIDDLE, LEAST_SLOPE, LOW, LOW_MIDDLE, MOST_SLOPE
from hybrid.kernels.types.kinds import INTEGER, MATRIX, REAL, VECTOR
from hybrid.kernels.types.layout import EPSILON, Path, Programs
from hybrid.kernels.types.options import INLINE, KERNEL, exported

# Over a radius this large the mean value theorem makes no range narrower.
ANY_RADIUS = 1e300


@njit(**INLINE)
def _narrowed(row, radius):
    """Intersect a row's range with the range that follows from its slope and its value in the middle."""
    reach = radius * max(abs(row[LEAST_SLOPE]), abs(row[MOST_SLOPE])) if radius > 0.0 else 0.0
    reach += 2.0 * EPSILON * reach
    low, high = row[LOW_MIDDLE] - reach, row[HIGH_MIDDLE] + reach
    if low > row[LOW]:
        row[LOW] = low
    if high < row[HIGH]:
        row[HIGH] = high
    # By rounding alone, two enclosures of one point may not overlap.
    if not row[LOW] <= row[HIGH]:
        row[LOW], row[HIGH] = min(row[LOW_MIDDLE], row[HIGH]), max(row[HIGH_MIDDLE], row[LOW])
    if math.isnan(row[LOW]) or math.isnan(row[HIGH]):
        row[LOW], row[HIGH] = -math.inf, math.inf


@njit(**INLINE)
def _whole_line(row):
    """Set range and slope of a subexpression to the whole line: nothing is known about them."""
    row[LOW], row[HIGH] = -math.inf, math.inf
    row[LEAST_SLOPE], row[MOST_SLOPE] = -math.inf, math.inf


@njit(**KERNEL)
def _bound_place(path, column, place, row):
    """``bound_state`` at one place; the bend is as good as a step of Halley's method needs."""
    value, slope, bend, size, steep = 0.0, 0.0, 0.0, 0.0, 0.0
    # At the start the other powers are zero.
    for k in range(path.degree if place > 0.0 else min(path.degree, 2), -1, -1):
        coefficient = path.powers[k, column]
        bend = bend * place + slope
        slope = slope * place + value
        value = value * place + coefficient
        steep = steep * place + size
        size = size * place + abs(coefficient)
    rounding = 4.0 * EPSILON * size if size > abs(path.powers[0, column]) else 0.0
    row[LOW], row[HIGH] = value - rounding, value + rounding
    row[LOW_MIDDLE], row[HIGH_MIDDLE] = value - rounding, value + rounding
    row[LEAST_SLOPE], row[MOST_SLOPE] = slope - 4.0 * EPSILON * steep, slope + 4.0 * EPSILON * steep
    return bend, bend


@njit(**KERNEL)
def bound_state(path, column, middle, radius, row):
    """Bound a component of the path around ``middle`` by a cubic and its remainder.

    The remainder is at most ``radius**4`` times the sum of ``C(k, 4) |c_k| end**(k - 4)``. A component that
    is constant on the path has no rounding. Returns the least and the most half of its second derivative.
    """
    if radius == 0.0:
        return _bound_place(path, column, middle, row)
    end = middle + radius
    value, slope, bend, third = 0.0, 0.0, 0.0, 0.0
    size, steep, bent, twisted, fourth = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(path.degree, -1, -1):
        coefficient = path.powers[k, column]
        third = third * middle + bend
        bend = bend * middle + slope
        slope = slope * middle + value
        value = value * middle + coefficient
        fourth = fourth * end + twisted
        twisted = twisted * end + bent
        bent = bent * end + steep
        steep = steep * end + size
        size = size * end + abs(coefficient)
    rounding = 4.0 * EPSILON * size if size > abs(path.powers[0, column]) else 0.0
    row[LOW_MIDDLE], row[HIGH_MIDDLE] = value - rounding, value + rounding
    square = radius * radius
    turn = 2.0 * abs(bend) * radius + 3.0 * abs(third) * square + 4.0 * fourth * square * radius
    turn += 4.0 * EPSILON * (steep + turn)
    row[LEAST_SLOPE], row[MOST_SLOPE] = slope - turn, slope + turn
    rest = (abs(third) + fourth * radius) * square * radius + rounding
    one, other = value + radius * (bend * radius - slope), value + radius * (bend * radius + slope)
    low, high = min(one, other), max(one, other)
    if abs(slope) < 2.0 * abs(bend) * radius:
        vertex = value - 0.25 * slope * slope / bend
        low, high = min(low, vertex), max(high, vertex)
    row[LOW], row[HIGH] = low - rest, high + rest
    change = 3.0 * abs(third) * radius + 6.0 * fourth * square + 4.0 * EPSILON * bent
    return bend - change, bend + change


@njit(**KERNEL)
def _bound_time(path, middle, radius, row):
    """Bound the time along the step."""
    start, pace = path.start, path.pace
    if path.clock >= 0:
        bound_state(path, path.clock, middle, radius, row)
    else:
        value = pace * middle
        row[LOW], row[HIGH] = value - pace * radius, value + pace * radius
        row[LEAST_SLOPE], row[MOST_SLOPE] = pace, pace
        row[LOW_MIDDLE], row[HIGH_MIDDLE] = value, value
    rounding = 2.0 * EPSILON * (abs(start) + abs(row[LOW]) + abs(row[HIGH]))
    row[LOW] += start - rounding
    row[HIGH] += start + rounding
    row[LOW_MIDDLE] += start - rounding
    row[HIGH_MIDDLE] += start + rounding


@njit(**INLINE)
def _bound_sum(row, a, b):
    row[LOW], row[HIGH] = added(a[LOW], a[HIGH], b[LOW], b[HIGH])
    row[LEAST_SLOPE], row[MOST_SLOPE] = added(a[LEAST_SLOPE], a[MOST_SLOPE], b[LEAST_SLOPE], b[MOST_SLOPE])
    row[LOW_MIDDLE], row[HIGH_MIDDLE] = added(a[LOW_MIDDLE], a[HIGH_MIDDLE], b[LOW_MIDDLE], b[HIGH_MIDDLE])


@njit(**KERNEL)
def _bound_product(row, a, b):
    row[LOW], row[HIGH] = product(a[LOW], a[HIGH], b[LOW], b[HIGH])
    one, other = product(a[LEAST_SLOPE], a[MOST_SLOPE], b[LOW], b[HIGH])
    least, most = product(a[LOW], a[HIGH], b[LEAST_SLOPE], b[MOST_SLOPE])
    row[LEAST_SLOPE], row[MOST_SLOPE] = added(one, other, least, most)
    row[LOW_MIDDLE], row[HIGH_MIDDLE] = product(a[LOW_MIDDLE], a[HIGH_MIDDLE], b[LOW_MIDDLE], b[HIGH_MIDDLE])


@njit(**KERNEL)
def _bound_quotient(row, a, b):
    row[LOW], row[HIGH] = quotient(a[LOW], a[HIGH], b[LOW], b[HIGH])
    row[LOW_MIDDLE], row[HIGH_MIDDLE] = quotient(a[LOW_MIDDLE], a[HIGH_MIDDLE], b[LOW_MIDDLE], b[HIGH_MIDDLE])
    # (a / b)' = (a' - (a / b) b') / b
    low, high = product(row[LOW], row[HIGH], b[LEAST_SLOPE], b[MOST_SLOPE])
    low, high = added(a[LEAST_SLOPE], a[MOST_SLOPE], -high, -low)
    row[LEAST_SLOPE], row[MOST_SLOPE] = quotient(low, high, b[LOW], b[HIGH])
    if b[LOW] <= 0.0 <= b[HIGH]:
        row[LEAST_SLOPE], row[MOST_SLOPE] = -math.inf, math.inf


@njit(**KERNEL)
def _bound_whole_power(row, a, exponent):
    row[LOW], row[HIGH] = whole_power(a[LOW], a[HIGH], exponent)
    row[LOW_MIDDLE], row[HIGH_MIDDLE] = whole_power(a[LOW_MIDDLE], a[HIGH_MIDDLE], exponent)
    low, high = whole_power(a[LOW], a[HIGH], exponent - 1)
    low, high = product(low, high, float(exponent), float(exponent))
    row[LEAST_SLOPE], row[MOST_SLOPE] = product(low, high, a[LEAST_SLOPE], a[MOST_SLOPE])
    if exponent < 0 and a[LOW] <= 0.0 <= a[HIGH]:
        _whole_line(row)


@njit(**KERNEL)
def _bound_fixed_power(row, a, exponent):
    row[LOW], row[HIGH] = fixed_power(a[LOW], a[HIGH], exponent)
    row[LOW_MIDDLE], row[HIGH_MIDDLE] = fixed_power(a[LOW_MIDDLE], a[HIGH_MIDDLE], exponent)
    low, high = fixed_power(a[LOW], a[HIGH], exponent - 1.0)
    low, high = product(low, high, exponent, exponent)
    row[LEAST_SLOPE], row[MOST_SLOPE] = product(low, high, a[LEAST_SLOPE], a[MOST_SLOPE])


@njit(**KERNEL)
def _bound_larger(row, a, b):
    """Bound the larger of two; if neither is larger throughout, the slope is that of either."""
    row[LOW], row[HIGH] = max(a[LOW], b[LOW]), max(a[HIGH], b[HIGH])
    row[LOW_MIDDLE], row[HIGH_MIDDLE] = (
        max(a[LOW_MIDDLE], b[LOW_MIDDLE]),
        max(a[HIGH_MIDDLE], b[HIGH_MIDDLE]),
    )
    _slope_of_either(row, a, b, a[LOW] > b[HIGH], b[LOW] > a[HIGH])


@njit(**KERNEL)
def _bound_smaller(row, a, b):
    row[LOW], row[HIGH] = min(a[LOW], b[LOW]), min(a[HIGH], b[HIGH])
    row[LOW_MIDDLE], row[HIGH_MIDDLE] = (
        min(a[LOW_MIDDLE], b[LOW_MIDDLE]),
        min(a[HIGH_MIDDLE], b[HIGH_MIDDLE]),
    )
    _slope_of_either(row, a, b, a[HIGH] < b[LOW], b[HIGH] < a[LOW])


@njit(**INLINE)
def _slope_of_either(row, a, b, first, second):
    if first:
        row[LEAST_SLOPE], row[MOST_SLOPE] = a[LEAST_SLOPE], a[MOST_SLOPE]
    elif second:
        row[LEAST_SLOPE], row[MOST_SLOPE] = b[LEAST_SLOPE], b[MOST_SLOPE]
    else:
        row[LEAST_SLOPE], row[MOST_SLOPE] = hull(a[LEAST_SLOPE], a[MOST_SLOPE], b[LEAST_SLOPE], b[MOST_SLOPE])


@njit(**KERNEL)
def _bound_angle(row, y, x):
    row[LOW], row[HIGH] = angle(y[LOW], y[HIGH], x[LOW], x[HIGH])
    row[LOW_MIDDLE], row[HIGH_MIDDLE] = angle(y[LOW_MIDDLE], y[HIGH_MIDDLE], x[LOW_MIDDLE], x[HIGH_MIDDLE])
    if y[LOW] <= 0.0 <= y[HIGH] and x[LOW] <= 0.0:
        row[LEAST_SLOPE], row[MOST_SLOPE] = -math.inf, math.inf
        return
    # (x y' - y x') / (x^2 + y^2)
    one, other = product(x[LOW], x[HIGH], y[LEAST_SLOPE], y[MOST_SLOPE])
    low, high = product(y[LOW], y[HIGH], x[LEAST_SLOPE], x[MOST_SLOPE])
    one, other = added(one, other, -high, -low)
    low, high = whole_power(x[LOW], x[HIGH], 2)
    below, above = whole_power(y[LOW], y[HIGH], 2)
    low, high = added(low, high, below, above)
    row[LEAST_SLOPE], row[MOST_SLOPE] = quotient(one, other, low, high)


@njit(**KERNEL)
def _bound_comparison(code, row, a, b):
    row[LOW], row[HIGH] = comparison(code, a[LOW], a[HIGH], b[LOW], b[HIGH])
    row[LOW_MIDDLE], row[HIGH_MIDDLE] = comparison(
        code, a[LOW_MIDDLE], a[HIGH_MIDDLE], b[LOW_MIDDLE], b[HIGH_MIDDLE]
    )
    certain = row[LOW] == row[HIGH]
    row[LEAST_SLOPE], row[MOST_SLOPE] = (0.0, 0.0) if certain else (-math.inf, math.inf)


@njit(**KERNEL)
def _bound_choice(row, condition, a, b):
    holds = truth(condition[LOW], condition[HIGH])
    if holds == 0.5:
        row[LOW], row[HIGH] = hull(a[LOW], a[HIGH], b[LOW], b[HIGH])
        row[LEAST_SLOPE], row[MOST_SLOPE] = -math.inf, math.inf
    else:
        chosen = a if holds == 1.0 else b
        row[LOW], row[HIGH] = chosen[LOW], chosen[HIGH]
        row[LEAST_SLOPE], row[MOST_SLOPE] = chosen[LEAST_SLOPE], chosen[MOST_SLOPE]
    holds = truth(condition[LOW_MIDDLE], condition[HIGH_MIDDLE])
    if holds == 0.5:
        row[LOW_MIDDLE], row[HIGH_MIDDLE] = hull(a[LOW_MIDDLE], a[HIGH_MIDDLE], b[LOW_MIDDLE], b[HIGH_MIDDLE])
    else:
        chosen = a if holds == 1.0 else b
        row[LOW_MIDDLE], row[HIGH_MIDDLE] = chosen[LOW_MIDDLE], chosen[HIGH_MIDDLE]


@njit(**KERNEL)
def _bound_function(code, row, a):
    row[LOW], row[HIGH] = range_of(code, a[LOW], a[HIGH])
    row[LOW_MIDDLE], row[HIGH_MIDDLE] = range_of(code, a[LOW_MIDDLE], a[HIGH_MIDDLE])
    least, most = slope_of(code, a[LOW], a[HIGH], row[LOW], row[HIGH])
    row[LEAST_SLOPE], row[MOST_SLOPE] = product(least, most, a[LEAST_SLOPE], a[MOST_SLOPE])


@njit(**KERNEL)
def _bound_binary(code, row, a, b):
    if code == op.SUM:
        _bound_sum(row, a, b)
    elif code == op.PRODUCT:
        _bound_product(row, a, b)
    elif code == op.QUOTIENT:
        _bound_quotient(row, a, b)
    elif code == op.MAXIMUM:
        _bound_larger(row, a, b)
    elif code == op.MINIMUM:
        _bound_smaller(row, a, b)
    elif code == op.ANGLE:
        _bound_angle(row, a, b)
    else:
        _bound_comparison(code, row, a, b)


@njit(**KERNEL)
def _bound_table(programs, place, row, a):
    data, first, order = programs.parameters, programs.rows[place, 2], programs.rows[place, 3]
    row[LOW], row[HIGH], jumps = table_bounds(data, first, order, a[LOW], a[HIGH])
    row[LOW_MIDDLE], row[HIGH_MIDDLE], _ = table_bounds(data, first, order, a[LOW_MIDDLE], a[HIGH_MIDDLE])
    least, most, _ = table_bounds(data, first, order + 1, a[LOW], a[HIGH])
    if jumps:
        least, most = -math.inf, math.inf
    row[LEAST_SLOPE], row[MOST_SLOPE] = product(least, most, a[LEAST_SLOPE], a[MOST_SLOPE])


@njit(**KERNEL)
def _run(programs, transition, registers, radius):
    """Run the operations of a guard's program, whose leaves are set; returns the index of its last row."""
    first, stop = programs.first[transition], programs.first[transition + 1]
    for place in range(first, stop):
        code = programs.rows[place, 0]
        row = registers[place - first]
        if code > op.TIME:
            a = registers[programs.rows[place, 1]]
            if code >= op.EXP:
                _bound_function(code, row, a)
            elif code == op.TABLE:
                _bound_table(programs, place, row, a)
            elif code == op.WHOLE_POWER:
                _bound_whole_power(row, a, programs.rows[place, 2])
            elif code == op.FIXED_POWER:
                _bound_fixed_power(row, a, programs.numbers[programs.rows[place, 2]])
            elif code == op.SELECT:
                b, c = registers[programs.rows[place, 2]], registers[programs.rows[place, 3]]
                _bound_choice(row, a, b, c)
            else:
                _bound_binary(code, row, a, registers[programs.rows[place, 2]])
            _narrowed(row, radius)
    return stop - 1 - first


@njit(**INLINE)
def _bound_constant(row, value):
    row[LOW], row[HIGH] = value, value
    row[LEAST_SLOPE], row[MOST_SLOPE] = 0.0, 0.0
    row[LOW_MIDDLE], row[HIGH_MIDDLE] = value, value


@njit(**INLINE)
def _constant_leaf(programs, place, row):
    """Set the row of a number or a parameter; other rows are left alone."""
    code, a = programs.rows[place, 0], programs.rows[place, 1]
    if code == op.NUMBER:
        _bound_constant(row, programs.numbers[a])
    elif code == op.PARAMETER:
        _bound_constant(row, programs.parameters[a])


@exported(INTEGER, Programs, INTEGER, Path, REAL, REAL, MATRIX)
def bound_guard(programs, transition, path, middle, radius, registers):
    """Bounds of a guard over ``middle +- radius`` on a path; returns their row in ``registers``.

    The slope is the derivative by the step's variable.
    """
    first = programs.first[transition]
    for place in range(first, programs.first[transition + 1]):
        row = registers[place - first]
        code = programs.rows[place, 0]
        if code == op.STATE:
            bound_state(path, programs.rows[place, 1], middle, radius, row)
        elif code == op.TIME:
            _bound_time(path, middle, radius, row)
        else:
            _constant_leaf(programs, place, row)
    return _run(programs, transition, registers, radius)


@exported(REAL, Programs, INTEGER, REAL, REAL, VECTOR, VECTOR, REAL, MATRIX)
def spread_by_rounding(programs, transition, t, clock, x, scale, share, registers):
    """How far a guard may be from its value at ``(t, x)`` when each argument is off by its rounding.

    A component of the state may be off by ``share`` times its size in ``scale (n,)``, the time by ``share``
    times ``clock``. The returned distance is negative if the guard may jump across zero within this rounding.
    It is zero for a jump on one side of zero: the guard is on that side, however large the jump is.
    """
    first = programs.first[transition]
    for place in range(first, programs.first[transition + 1]):
        row, a = registers[place - first], programs.rows[place, 1]
        code = programs.rows[place, 0]
        if code == op.STATE or code == op.TIME:
            value = x[a] if code == op.STATE else t
            spread = share * (scale[a] if code == op.STATE else clock)
            _bound_constant(row, value)
            row[LOW], row[HIGH] = value - spread, value + spread
            row[LEAST_SLOPE], row[MOST_SLOPE] = -spread, spread
        else:
            _constant_leaf(programs, place, row)
    last = registers[_run(programs, transition, registers, ANY_RADIUS)]
    distance = max(last[HIGH_MIDDLE] - last[LOW], last[HIGH] - last[LOW_MIDDLE])
    if last[MOST_SLOPE] - last[LEAST_SLOPE] < math.inf:
        return distance
    return 0.0 if last[LOW] > 0.0 or last[HIGH] < 0.0 else -distance
