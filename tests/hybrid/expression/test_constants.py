"""Names in generated code for values that depend only on the parameters."""

import math
from fractions import Fraction

from hybrid.expression.constants import Constants

from hybrid.expression.nodes import Symbol, number


def test_numbers_stand_for_themselves_and_expressions_have_one_name_each():
    p, q = map(Symbol, ("p", "q"))
    constants = Constants()
    assert [constants.name(number(each)) for each in (2, -1.5, number(Fraction(1, 4)), number(math.pi))] == [
        "2.0",
        "(-1.5)",
        "0.25",
        repr(math.pi),
    ]
    assert constants.statements() == []
    assert [constants.name(each) for each in (p * q, p, p * q, 2 * p)] == ["k0", "k1", "k0", "k2"]
    scope = {"p": 3.0, "q": 5.0}
    exec("\n".join(constants.statements()), scope)
    assert [scope[f"k{i}"] for i in range(3)] == [15.0, 3.0, 6.0]
