"""Texts of expressions read as Python: they have the values of the expressions."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings

from hybrid.expression import operations as ops
from hybrid.expression.nodes import HALF, number
from hybrid.expression.text import text
from tests.hybrid.expression.formulas import X, Y, Z, anything, at, expression_of, places

NAMES = {kind.word: kind.numpy for kind in vars(ops).values() if hasattr(kind, "numpy")} | {"sqrt": np.sqrt}


def read(written, place):
    with np.errstate(all="ignore"):
        return eval(written, {**NAMES, "x": np.array(place[:2]), "p": np.array(place[2:])})


@settings(max_examples=300)
@given(anything, places)
def test_a_text_has_the_value_of_its_expression(formula, place):
    expression = expression_of(formula)
    [wanted] = at([expression], place)
    assume(abs(wanted) < 1e6)
    assert read(text(expression), place) == pytest.approx(wanted, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    "expression",
    [
        *(X - (Y - Z), -X * Y, -(X**2), (-X) ** Y, X ** (-Y), X**Y**Z, (X**Y) ** Z, (X + Y) ** -2),
        *(number(Fraction(1, 3)) ** X, number(-2) ** X, 2 * X / (3 * Y), X / (Y * Z), X / Y / 7, 1 / (X + 1)),
        *(1e-20 * X, 1.5e20 * X, number(-2.5), X**HALF * Y**-HALF, X ** Fraction(-2, 3), X ** number(0.3)),
        *(ops.Less(X, Y) - ops.Select(X, -Y, Z), ops.Sin(X - 1) ** 2, 2 ** ops.Exp(X), -ops.Sin(X) / 3),
    ],
)
def test_brackets_stand_where_they_must(expression):
    place = (0.7, 1.2, 0.4)
    assert read(text(expression), place) == pytest.approx(at([expression], place)[0], rel=1e-14, nan_ok=True)


def test_it_is_written_as_people_write():
    assert text(X**2 - 3 * Y) == "x[0]**2 - 3*x[1]"
    assert text(Z * (X - Y) / 2, {X: "q", Y: "v", Z: "k"}) == "k*(q - v)/2"
    assert text(-X + Y) == "x[1] - x[0]"
    assert text(0.1 * X + 0.2 * X) == "0.3*x[0]"
