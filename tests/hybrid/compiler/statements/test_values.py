"""Statements have the values of their expressions, at ties and infinities, too."""

import itertools
import math
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hybrid.compiler.llvm.wanted import VECTOR_SIGNATURE
from hybrid.compiler.statements.code import at as entry
from hybrid.compiler.statements.code import get, put
from hybrid.compiler.statements.values import Constants, assignments, root_power, unprintable
from hybrid.expression.derivatives import jacobian_of
from hybrid.expression.nodes import ONE, TWO, Function, number
from hybrid.expression.operations import (
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
    Sin,
    Step,
)
from tests.hybrid.code import both, interpreted, values_of
from tests.hybrid.expression.formulas import X, Y, Z, anything, at, expression_of, places, smooth


def run(expressions, x, y, z=0.0):
    """Values of the code."""
    return values_of(expressions, (x, y), (z,))


@settings(max_examples=200)
@given(st.lists(anything, min_size=1, max_size=4), places)
def test_random_expressions_keep_their_values(several, place):
    expressions = [*map(expression_of, several)]
    wanted = at(expressions, place)
    assume(max(map(abs, wanted)) < 1e6)
    assert run(expressions, *place) == pytest.approx(wanted, rel=1e-9, abs=1e-9)


@given(smooth, smooth, places)
def test_shared_parts_keep_the_values_of_expressions_and_derivatives(one, other, place):
    field = [*map(expression_of, (one, other))]
    everything = [*field, *(entry for row in jacobian_of(field, (X, Y)) for entry in row)]
    wanted = at(everything, place)
    assume(max(map(abs, wanted)) < 1e6)
    assert run(everything, *place) == pytest.approx(wanted, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("exponent", [*range(-18, 19), 31, 32, -40])
@pytest.mark.parametrize("parts", [1, 2, 3])
def test_powers(exponent, parts):
    power = X ** Fraction(exponent, parts)
    for x in (0.7, 1.9) if parts > 1 else (0.7, -1.9):
        wanted = x**exponent if parts == 1 else x ** (exponent / parts)
        assert run([power, 2 * power, Y * power, Y / power], x, 3.0) == pytest.approx(
            [wanted, 2 * wanted, 3 * wanted, 3 / wanted], rel=1e-13
        )


@pytest.mark.parametrize("exponent", [-7, -3, -1, 1, 3, 7])
def test_half_integer_powers_are_products_with_a_root(exponent):
    code = root_power(entry("x", 0), number(Fraction(exponent, 2)), get("t"))
    assert "**" not in str(code)
    for run in both([put(entry("out", 0), code)], kind=VECTOR_SIGNATURE):
        out = np.zeros(1)
        run(0, 0.0, np.array([1.7]), np.zeros(1), out)
        assert out[0] == pytest.approx(1.7 ** (exponent / 2), rel=1e-15)
    assert root_power(get("z"), number(Fraction(exponent, 3)), get("n")) == ("**", get("z"), get("n"))


@pytest.mark.parametrize(
    ("expression", "function"),
    [
        (Maximum(X, 1), lambda x, y: np.maximum(x, 1.0)),
        (Minimum(1, X), lambda x, y: np.minimum(x, 1.0)),
        (Gate(X, Y), lambda x, y: 0.0 if x < 0 else np.heaviside(x, 0.5) * y),
        (3 * Step(X) - Y, lambda x, y: 3 * np.heaviside(x, 0.5) - y),
    ],
)
def test_ties_infinities_and_nan(expression, function):
    values = (-np.inf, -1.0, 0.0, 1.0, 2.0, np.inf, np.nan)
    for x, y in itertools.product(values, values):
        with np.errstate(invalid="ignore"):
            wanted = function(x, y)
        np.testing.assert_equal(run([expression], x, y)[0], float(wanted))


@pytest.mark.parametrize(
    ("condition", "holds"),
    [
        (Equal(X, Y), lambda x, y: x == y),
        (And(Less(X, Y), Less(X, ONE)), lambda x, y: x < y and x < 1),
        (Not(Or(LessEqual(X, Y), Not(Less(X, ONE)))), lambda x, y: not (x <= y or not x < 1)),
        (And(Or(Less(X, Y), Less(ONE, Y)), Less(X, ONE)), lambda x, y: (x < y or y > 1) and x < 1),
        # A number is true unless it is zero.
        (And(X, Y), lambda x, y: bool(x and y)),
        (Or(X - 1, Y), lambda x, y: bool(x - 1 or y)),
        (Not(X), lambda x, y: not x),
    ],
)
def test_conditions(condition, holds):
    for x, y in itertools.product((-1.0, 0.0, 1.0, 2.0), (0.0, 1.0, 3.0)):
        true = float(holds(x, y))
        found = run([condition, 3 * condition + X, Select(condition, X, TWO)], x, y)
        assert [*found] == [true, 3.0 * true + x, x if true else 2.0]


def test_what_is_used_twice_is_computed_once():
    long = Sin(X * Y + Z)
    assert str(assignments([get("a"), get("b")], [long + 1, long * X])).count("'sin'") == 1


def test_functions_without_code_are_named():
    class Gamma(Function):
        __slots__ = ()

    assert unprintable([Sin(X) + X * math.pi, Maximum(X, Y)]) is None
    assert unprintable([X, Gamma(X)]) == "Gamma"


def test_a_divisor_of_two_products_is_divided_by_once():
    """That of a single product is not inverted first, which would round twice."""
    below = Sin(X) + Y
    twice, once = (str(assignments([get("a"), get("b")], [X / below, each])) for each in (Y / below, Y * X))
    assert twice.count("'/'") == once.count("'/'") == 1
    assert "('/', 1.0," not in once


def test_the_code_does_not_depend_on_what_was_computed_before():
    """It is a key of the cache of compiled code."""
    code = (
        "from hybrid.expression.nodes import Symbol; from hybrid.expression.operations import *\n"
        "from hybrid.compiler.statements.code import get\n"
        "from hybrid.compiler.statements.values import assignments\n"
        "x, y, z, w = map(Symbol, ('x[10]', 'x[2]', 'p[0]', 'w'))\n"
        "sum = Sin(x*y + w) + x*Cos(y*z) - z**2*w + Exp(x - y)*Sin(y) + 0.3*w*y\n"
        "print(assignments([get('a')], [sum]))"
    )
    before = (
        "",
        "from hybrid.expression.nodes import Symbol; w = Symbol('w') * Symbol('p[0]') - Symbol('x[2]')\n",
    )
    found = {
        subprocess.run([sys.executable, "-c", each + code], capture_output=True, text=True, check=True).stdout
        for each in before
    }
    assert len(found) == 1


def test_constants_have_one_name_each_and_numbers_are_numbers():
    constants = Constants()
    numbers = (2, -1.5, Fraction(1, 4), math.pi)
    assert [constants.name(number(each)) for each in numbers] == [*map(float, numbers)]
    assert constants.statements() == []
    names = [constants.name(each) for each in (X * Y, X, X * Y, 2 * X)]
    assert names[0] == names[2]
    out = np.zeros(3)
    stores = [put(entry("out", i), name) for i, name in enumerate(names[1:])]
    statements = [*constants.statements(), *stores]
    interpreted([((), statements)], VECTOR_SIGNATURE)(0, 0.0, np.array([3.0, 5.0]), np.zeros(0), out)
    assert [*out] == [3.0, 15.0, 6.0]
