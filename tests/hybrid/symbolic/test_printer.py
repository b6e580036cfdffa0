"""Printed code has the values of its expressions, at ties and without a value too."""

import math

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy.core.parameters import distribute

from hybrid.symbolic.derivatives import jacobian_of
from hybrid.symbolic.expressions import (
    And,
    Equal,
    Gate,
    Less,
    LessEqual,
    Maximum,
    Minimum,
    Not,
    Or,
    Select,
    Sign,
    Step,
    exp2,
)
from hybrid.symbolic.printer import assignments, power_text, unprintable

A, B, C = sympy.symbols("a b c", real=True)
PLACES = [(0.7, -1.3, 2.1), (-0.4, 0.9, -1.6), (1.9, 1.1, 0.3)]


def run(expressions, a, b, c, **options):
    """Values of the printed code."""
    out = np.zeros(len(expressions))
    lines = assignments([f"out[{i}]" for i in range(len(expressions))], expressions, **options)
    with np.errstate(all="ignore"):
        exec("\n".join(lines), {"a": a, "b": b, "c": c, "out": out, **vars(math), "abs": abs})
    return out


def printed(expression):
    """The code of one expression."""
    return assignments(["y"], [expression])[0].removeprefix("y0 = ")


def random_expression(rng, depth, place):
    """An expression, and its value at a place."""
    if depth == 0 or rng.random() < 0.1:
        numbers = (sympy.Rational(2, 3), sympy.Float(0.37), sympy.Integer(-3), sympy.Integer(2))
        k = rng.integers(0, 7)
        return ((A, B, C, *numbers)[k], float((*place, *numbers)[k]))
    (u, x), (v, y) = (random_expression(rng, depth - 1, place) for _ in range(2))
    whole, halves = int(rng.integers(2, 5)), sympy.Rational(int(rng.integers(-5, 6)), 2)
    made = [
        (u + v, x + y),
        (u - v, x - y),
        (u * v, x * y),
        (-u, -x),
        (u / (2 + v**2), x / (2 + y**2)),
        (u**whole, x**whole),
        ((1 + u**2) ** halves, (1 + x**2) ** float(halves)),
        ((1 + u**2) ** sympy.Rational(-1, 3), (1 + x**2) ** (-1 / 3)),
        (sympy.sin(u) * sympy.exp(-(v**2)), math.sin(x) * math.exp(-(y**2))),
        (Select(Less(u, v), u, v - 1), x if x < y else y - 1),
        (Maximum(u, v) - Minimum(u, sympy.Float(0.5)), max(x, y) - min(x, 0.5)),
        (Step(u) * v, float(np.heaviside(x, 0.5)) * y),
        (sympy.Mul(u, u + v, evaluate=False), x * (x + y)),
    ]
    return made[rng.integers(0, len(made))]


@pytest.mark.parametrize("thorough", [True, False])
@pytest.mark.parametrize("seed", range(8))
def test_random_expressions_keep_their_values(seed, thorough):
    for place in PLACES:
        rng = np.random.default_rng(seed)
        expressions, expected = zip(*(random_expression(rng, 4, place) for _ in range(4)), strict=True)
        found = run(expressions, *place, thorough=thorough)
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("exponent", [*range(-18, 0), *range(2, 19)])
@pytest.mark.parametrize("halves", [1, 2])
def test_powers(exponent, halves):
    power = A ** sympy.Rational(exponent, halves)
    for a in (0.7, 1.9):
        np.testing.assert_allclose(
            run([power, B * power], a, 3.0, 0.0), [a ** (exponent / halves) * k for k in (1, 3)]
        )


@pytest.mark.parametrize(
    ("expression", "text"),
    [
        (A - 1, "a - 1.0"),
        (-A, "-a"),
        (-A - B, "-(b + a)"),
        (A - (B - C) * 2, "-2.0*b + 2.0*c + a"),
        ((A + B) * C, "c*(b + a)"),
        (A / (B * C), "a/(b*c)"),
        (1 / A, "1.0/a"),
        (2 * A / 3, "2.0*a/3.0"),
        (A / 4, "0.25*a"),
        (-2 / (3 * A), "-2.0/(a*3.0)"),
        (sympy.sqrt(A), "sqrt(a)"),
        (1 / sympy.sqrt(A), "1.0/sqrt(a)"),
        (A**3, "a*a*a"),
        (A ** sympy.Rational(3, 2), "a*sqrt(a)"),
        (A**B, "a**b"),
        ((A + 1) ** B, "(a + 1.0)**b"),
        (A ** (-B), "a**(-b)"),
        (A ** sympy.Rational(1, 3), "a**0.3333333333333333"),
        (exp2(A + B), "2.0**(b + a)"),
        (sympy.exp(A + B), "exp(b + a)"),
        (Less(A, B), "(1.0 if a < b else 0.0)"),
        (LessEqual(A, B), "(1.0 if a <= b else 0.0)"),
        (Equal(A, B), "(1.0 if a == b else 0.0)"),
        (Or(Less(A, B), Not(Less(B, C))), "(1.0 if (a < b) or (not (b < c)) else 0.0)"),
        (Select(A, B, C), "(b if a != 0.0 else c)"),
    ],
)
def test_texts(expression, text):
    shown = printed(expression)
    assert shown.replace(" ", "") == text.replace(" ", "")


@pytest.mark.parametrize(
    ("expression", "function"),
    [
        (Step(A), lambda a, b: np.heaviside(a, 0.5)),
        (Sign(A), lambda a, b: np.sign(a)),
        (Maximum(A, B), np.maximum),
        (Minimum(A, B), np.minimum),
        (Maximum(A, sympy.Float(1)), lambda a, b: np.maximum(a, 1.0)),
        (Minimum(sympy.Float(1), A), lambda a, b: np.minimum(a, 1.0)),
        (Gate(A, B), lambda a, b: 0.0 if a < 0 else np.heaviside(a, 0.5) * b),
    ],
)
def test_ties_infinities_and_nan(expression, function):
    values = (-np.inf, -1.0, 0.0, 1.0, 2.0, np.inf, np.nan)
    for a in values:
        for b in values:
            with np.errstate(invalid="ignore"):
                expected = function(a, b)
            np.testing.assert_equal(float(run([expression], a, b, 0.0)[0]), float(expected))


def test_stores_come_after_all_values():
    """Targets may be variables that the expressions read."""
    lines = assignments(["a", "b"], [A + B, A - B])
    space = {"a": 3.0, "b": 1.0}
    exec("\n".join(lines), space)
    assert (space["a"], space["b"]) == (4.0, 2.0)


@pytest.mark.parametrize("thorough", [True, False])
def test_what_is_used_twice_is_computed_once(thorough):
    long = sympy.sin(A * B + C)
    text = "\n".join(assignments(["y", "z"], [long + 1, long * A], thorough=thorough))
    assert text.count("sin(") == 1


def test_functions_without_code_are_named():
    assert unprintable([sympy.sin(A) + A * sympy.pi, Maximum(A, B)]) is None
    assert unprintable([A, sympy.gamma(A)]) == "gamma"


@pytest.mark.parametrize("exponent", [-7, -3, -1, 1, 3, 7])
def test_half_integer_powers_in_series(exponent):
    text = power_text("z", sympy.Rational(exponent, 2), "n")
    assert eval(text, {"z": 1.7, "sqrt": math.sqrt}) == pytest.approx(1.7 ** (exponent / 2), rel=1e-15)
    assert power_text("z", sympy.Rational(exponent, 3), "n") == "z**n"


@st.composite
def sliding_fields(draw):
    """The field that slides along a circle between two linear fields; numbers stay in front of sums."""
    number = st.sampled_from([-1, 1, 2])
    with distribute(False):
        below, above = ([draw(number) * A + draw(number) * B for _ in range(2)] for _ in range(2))
        speeds = [2 * A * field[0] + 2 * B * field[1] for field in (below, above)]
        closing = 2 * A * (below[0] - above[0]) + 2 * B * (below[1] - above[1])
        return [(a * speeds[0] - b * speeds[1]) / closing for a, b in zip(above, below, strict=True)]


@settings(max_examples=15)
@given(sliding_fields())
def test_shared_parts_keep_the_values_of_expressions_and_derivatives(field):
    everything = [*field, *(entry for row in jacobian_of(field, (A, B)) for entry in row)]
    for place in PLACES:
        numbers = dict(zip((A, B, C), place, strict=True))
        wanted = [float(each.subs(numbers)) for each in everything]
        if np.isfinite(wanted).all():
            assert run(everything, *place) == pytest.approx(wanted, rel=1e-8, abs=1e-8)


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
