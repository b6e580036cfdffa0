"""The code of conditions and of repeated factors, piece by piece."""

import math

import numpy as np
import pytest
import sympy

from hybrid.symbolic.expressions import And, Equal, Gate, Less, LessEqual, Not, Or, Select, Sign, Step
from hybrid.symbolic.printer import assignments

x, y = sympy.Symbol("x[0]", real=True), sympy.Symbol("x[1]", real=True)
ONE, TWO = sympy.Integer(1), sympy.Integer(2)


def value(expression, a, b):
    out = np.zeros(1)
    code = "\n".join(assignments(["out[0]"], [expression]))
    exec(code, {"x": (a, b), "p": (), "t": 0.0, "out": out, "np": np, **vars(math)})
    return out[0]


@pytest.mark.parametrize(
    ("condition", "holds"),
    [
        (Less(x, y), lambda a, b: a < b),
        (LessEqual(x, y), lambda a, b: a <= b),
        (Equal(x, y), lambda a, b: a == b),
        (Not(Less(x, y)), lambda a, b: not a < b),
        (And(Less(x, y), Less(x, ONE)), lambda a, b: a < b and a < 1),
        (Or(Less(x, y), Less(x, ONE)), lambda a, b: a < b or a < 1),
        (Not(Or(Less(x, y), Not(Less(x, ONE)))), lambda a, b: not (a < b or not a < 1)),
        (And(Or(Less(x, y), Less(ONE, y)), Less(x, ONE)), lambda a, b: (a < b or b > 1) and a < 1),
        # A number is true unless it is zero.
        (And(x, y), lambda a, b: bool(a and b)),
        (Or(x - 1, y), lambda a, b: bool(a - 1 or b)),
        (Not(x), lambda a, b: not a),
    ],
)
def test_conditions(condition, holds):
    for a in (-1.0, 0.0, 1.0, 2.0):
        for b in (0.0, 1.0, 3.0):
            assert value(condition, a, b) == float(holds(a, b))
            assert value(3 * condition + x, a, b) == 3.0 * holds(a, b) + a
            assert value(Select(condition, x, TWO), a, b) == (a if holds(a, b) else 2.0)


@pytest.mark.parametrize("power", [*range(-9, 10), 17, 31, 32, -40])
def test_whole_powers(power):
    for a in (1.5, -0.75):
        assert value(2 * x**power, a, 0.0) == pytest.approx(2 * a**power, rel=1e-14)


@pytest.mark.parametrize("halves", [-7, -5, -3, -1, 1, 3, 5, 7, 9])
def test_half_powers(halves):
    assert value(x ** sympy.Rational(halves, 2) * y, 2.25, 3.0) == pytest.approx(3 * 1.5**halves, rel=1e-14)


@pytest.mark.parametrize(("a", "step", "sign"), [(-2.0, 0.0, -1.0), (0.0, 0.5, 0.0), (3.0, 1.0, 1.0)])
def test_steps_and_signs(a, step, sign):
    assert value(Step(x), a, 0.0) == step
    assert value(Sign(x), a, 0.0) == sign
    assert value(Gate(x, y), a, 5.0) == 5.0 * step
    # Behind a closed gate nothing counts.
    assert value(Gate(x, y), -1.0, math.inf) == 0.0


def test_nan_stays():
    for expression in (Step(x), Sign(x), Gate(x, ONE + y)):
        assert math.isnan(value(expression, math.nan, 1.0))


@pytest.mark.parametrize("thorough", [False, True])
def test_a_divisor_of_two_products_is_divided_by_once(thorough):
    """That of a single product is not inverted first, which would round twice."""
    below = sympy.sin(x) + y
    twice = "\n".join(assignments(["a", "b"], [x / below, y / below], thorough=thorough))
    assert twice.count("/") == 1
    once = "\n".join(assignments(["a", "b"], [x / below, y * x], thorough=thorough))
    assert once.count("/") == 1
    assert "1.0/" not in once
