"""Ends of ranges, rule by rule: where they lie, and whether they are taken or only approached."""

import math

import pytest
import sympy
from sympy.codegen.cfunctions import exp2, hypot

from hybrid.symbolic import ranges
from hybrid.symbolic.expressions import (
    Absolute,
    And,
    Atan2,
    CubeRoot,
    Equal,
    Less,
    LessEqual,
    Maximum,
    Minimum,
    Not,
    Or,
    Select,
    Sign,
    Step,
    Together,
)
from hybrid.symbolic.ranges import End, Range, has_one_sign, range_of

A, B = sympy.symbols("a b", real=True)
INF = math.inf
ANY = Range(End(-INF, False), End(INF, False))
# Functions with the values (-1, 1), [-1, 1], [0, 1] and (0, inf).
OPEN, CLOSED, HALF, ABOVE = sympy.tanh(A), sympy.sin(A), Step(A), sympy.exp(A)


def ends(low, high, taken):
    """``taken`` has one letter per end: ``x`` for an end that is taken."""
    return Range(End(low, taken[0] == "x"), End(high, taken[1] == "x"))


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (sympy.Integer(3), ends(3.0, 3.0, "xx")),
        (sympy.pi, ends(math.pi, math.pi, "xx")),
        (sympy.nan, ANY),
        (A, ANY),
        (CubeRoot(A), ANY),
        (CLOSED, ends(-1.0, 1.0, "xx")),
        (sympy.cos(A), ends(-1.0, 1.0, "xx")),
        (OPEN, ends(-1.0, 1.0, "--")),
        (ABOVE, ends(0.0, INF, "--")),
        (exp2(A), ends(0.0, INF, "--")),
        (sympy.cosh(A), ends(1.0, INF, "x-")),
        (sympy.acosh(A), ends(0.0, INF, "x-")),
        (hypot(A, B), ends(0.0, INF, "x-")),
        (Absolute(A), ends(0.0, INF, "x-")),
        (Sign(A), ends(-1.0, 1.0, "xx")),
        (HALF, ends(0.0, 1.0, "xx")),
        *((each, ends(0.0, 1.0, "xx")) for each in (Less(A, B), LessEqual(A, B), Equal(A, B), Not(A))),
        *((each(Less(A, B), Less(B, A)), ends(0.0, 1.0, "xx")) for each in (And, Or)),
        # Sums: both ends must be taken for the end of the sum to be.
        (CLOSED + sympy.cos(B) + 3, ends(1.0, 5.0, "xx")),
        (CLOSED + OPEN, ends(-2.0, 2.0, "--")),
        (ABOVE + 2, ends(2.0, INF, "--")),
        (2 + HALF, ends(2.0, 3.0, "xx")),
        (sympy.cosh(A) + 2, ends(3.0, INF, "x-")),
        # What cancels may be zero by rounding.
        (OPEN + 1, ends(0.0, 2.0, "x-")),
        (1 + 2 * Step(A) - 3 * Step(B), ends(-2.0, 3.0, "xx")),
        # Products.
        (2 * CLOSED, ends(-2.0, 2.0, "xx")),
        (-3 * HALF, ends(-3.0, 0.0, "xx")),
        (-2 * ABOVE, ends(-INF, 0.0, "--")),
        (CLOSED * OPEN, ends(-1.0, 1.0, "--")),
        (CLOSED * HALF, ends(-1.0, 1.0, "xx")),
        (ABOVE * sympy.exp(-B), ends(0.0, INF, "--")),
        (ABOVE * Step(B), ends(0.0, INF, "x-")),
        (A * HALF, ANY),
        (-ABOVE * sympy.cosh(B), ends(-INF, 0.0, "--")),
        (2 * (3 + CLOSED) * (4 + HALF), ends(16.0, 40.0, "xx")),
        (Together(2 * CLOSED), ends(-2.0, 2.0, "xx")),
        # Powers.
        (A**2, ends(0.0, INF, "x-")),
        (A**3, ANY),
        (A**-1, ANY),
        (A**-2, ends(0.0, INF, "--")),
        ((3 + CLOSED) ** 2, ends(4.0, 16.0, "xx")),
        ((CLOSED - 3) ** 2, ends(4.0, 16.0, "xx")),
        ((2 * CLOSED + 1) ** 2, ends(0.0, 9.0, "xx")),
        ((2 * CLOSED - 1) ** 2, ends(0.0, 9.0, "xx")),
        (OPEN**2, ends(0.0, 1.0, "x-")),
        (CLOSED**3, ANY),
        ((3 + CLOSED) ** 3, ends(8.0, 64.0, "xx")),
        ((3 + CLOSED) ** -1, ends(0.25, 0.5, "xx")),
        ((1 + ABOVE) ** -1, ends(0.0, 1.0, "--")),
        (HALF**-1, ANY),
        (ABOVE**-1, ends(0.0, INF, "--")),
        (sympy.sqrt(A), ends(0.0, INF, "x-")),
        (sympy.sqrt(4 + sympy.cosh(A)), ends(math.sqrt(5.0), INF, "x-")),
        (sympy.sqrt(9 * HALF), ends(0.0, 3.0, "xx")),
        (A ** sympy.Rational(-1, 2), ANY),
        ((2 + HALF) ** A, ends(0.0, INF, "--")),
        (A**B, ANY),
        # Absolute values.
        (Absolute(3 + CLOSED), ends(2.0, 4.0, "xx")),
        (Absolute(OPEN - 3), ends(2.0, 4.0, "--")),
        (Absolute(2 * CLOSED - 1), ends(0.0, 3.0, "xx")),
        (Absolute(CLOSED + OPEN - 1), ends(0.0, 3.0, "x-")),
        (Absolute(-HALF), ends(0.0, 1.0, "xx")),
        (Absolute(-ABOVE), ends(0.0, INF, "--")),
        # Exponentials.
        (sympy.exp(OPEN), ends(math.exp(-1.0), math.exp(1.0), "--")),
        (sympy.exp(CLOSED), ends(math.exp(-1.0), math.exp(1.0), "xx")),
        (sympy.exp(1000 + CLOSED), ends(INF, INF, "xx")),
        # Extremes: an end is taken if one of those that reach it takes it.
        (Maximum(CLOSED, OPEN), ends(-1.0, 1.0, "xx")),
        (Maximum(OPEN, 2 * HALF), ends(0.0, 2.0, "xx")),
        (Maximum(A, sympy.Integer(2)), ends(2.0, INF, "x-")),
        (Minimum(A, sympy.Integer(2)), ends(-INF, 2.0, "-x")),
        (Minimum(OPEN, 2 * HALF), ends(-1.0, 1.0, "--")),
        (Minimum(OPEN, ABOVE), ends(-1.0, 1.0, "--")),
        # Choices.
        (Select(Less(A, B), OPEN, 2 * HALF), ends(-1.0, 2.0, "-x")),
        (Select(Less(A, B), 3 + HALF, ABOVE), ends(0.0, INF, "--")),
    ],
)
def test_both_ends(expression, expected):
    found = range_of(expression)
    assert (found.low.taken, found.high.taken) == (expected.low.taken, expected.high.taken)
    assert found.low.value == pytest.approx(expected.low.value, rel=1e-15, abs=0.0)
    assert found.high.value == pytest.approx(expected.high.value, rel=1e-15, abs=0.0)


def test_angles_lie_between_whole_numbers_around_them():
    for expression, low, high in (
        (sympy.atan(A), -math.pi / 2, math.pi / 2),
        (sympy.asin(A), -math.pi / 2, math.pi / 2),
        (sympy.acos(A), 0.0, math.pi),
        (Atan2(A, B), -math.pi, math.pi),
    ):
        found = range_of(expression)
        assert low - 1.0 < found.low.value <= low
        assert high <= found.high.value < high + 1.0


@pytest.mark.parametrize(
    ("found", "positive", "negative"),
    [
        (ends(0.0, 1.0, "xx"), False, False),
        (ends(0.0, 1.0, "-x"), True, False),
        (ends(0.5, 1.0, "xx"), True, False),
        (ends(-0.5, 1.0, "--"), False, False),
        (ends(-1.0, 0.0, "xx"), False, False),
        (ends(-1.0, 0.0, "x-"), False, True),
        (ends(-2.0, -1.0, "xx"), False, True),
        (ANY, False, False),
    ],
)
def test_signs_of_a_range(found, positive, negative):
    assert found.positive is positive
    assert found.negative is negative


def test_one_sign_is_either():
    assert has_one_sign(2 + CLOSED)
    assert has_one_sign(CLOSED - 2)
    assert not has_one_sign(CLOSED)


def test_a_sum_without_size_keeps_what_its_terms_say():
    """Zero that no rounding has made is taken only if all terms are."""
    assert ranges._sum_of_ends([End(0.0, False), End(0.0, True)]) == End(0.0, False)
    assert ranges._sum_of_ends([End(0.0, True), End(0.0, True)]) == End(0.0, True)
    assert ranges._sum_of_ends([End(1.0, False), End(-1.0 + 1e-13, False)]) == End(0.0, True)
    assert ranges._sum_of_ends([End(1.0, False), End(-1.0 + 1e-11, False)]).value == pytest.approx(1e-11)
    assert ranges._sum_of_ends([End(INF, False), End(1.0, True)]) == End(INF, False)
