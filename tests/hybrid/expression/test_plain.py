"""The plain form of a guard has its sign, and a gradient where the guard is zero."""

import pytest

from hybrid.expression.nodes import Symbol
from hybrid.expression.operations import Absolute, CubeRoot, Exp, Floor, Less, Select, Sign, Sin, Step
from hybrid.expression.plain import plain

X, Y = Symbol("x"), Symbol("y")
E = X - Y / 2

PLAIN = {
    "odd power": (E**3, E),
    "pole": (1 / E, E),
    "cubic root": (CubeRoot(E), E),
    "nested": (CubeRoot(E**5), E),
    "sign": (Sign(E), E),
    "step": (Step(E) - 0.5, E),
    "comparison": (Less(Y, X) - 0.25, X - Y),
    "choice": (Select(Less(0, E), 1 + Y**2, -2), E),
    "choice downwards": (Select(Less(0, E), -3.0, Exp(Y)), -E),
    "parabolas": (E * Absolute(E), E),
    "whole part": (Floor(E) + 0.5, E),
    "signed root": (Sign(E) * Absolute(E) ** 0.5, E),
    "positive factor": (E**3 * (2 + Sin(Y)), E),
}
SAME = {
    "smooth": Exp(E) - 1,
    "even power": E**2,
    "with a positive factor": E * (2 + Sin(Y)),
    "other signs": Select(Less(0, E), 1 + Y, -1),
    "size of another": E * Absolute(Y),
    "steps of steps": Select(Less(Y, Floor(X)), 1, -1),
    "sum with no sign": Sign(E) + 2 * Sin(Y),
}


@pytest.mark.parametrize("name", PLAIN)
def test_what_hides_the_gradient_goes(name):
    guard, form = PLAIN[name]
    assert plain(guard) == form


@pytest.mark.parametrize("name", SAME)
def test_what_has_a_gradient_or_no_proved_sign_stays(name):
    assert plain(SAME[name]) is SAME[name]
