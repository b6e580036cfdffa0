"""Taylor series of smooth modes: why they are taken, and whether they may fail where the field does not."""

import pytest

from hybrid.compiler.propagators.equations import Boundary, equations_of
from hybrid.compiler.propagators.taylor import taylor
from hybrid.expression.nodes import HALF
from hybrid.expression.operations import Exp, Hypot, Sin
from hybrid.expression.tracing import model_symbols
from hybrid.kernels.types.codes import TAYLOR

SYMBOLS = model_symbols(2, 1)
(X, Y), T = SYMBOLS.x, SYMBOLS.t


def made(*field, guard=X - 1):
    return taylor(equations_of(field, [Boundary(guard, 1, is_affine=True)], SYMBOLS))


@pytest.mark.parametrize(
    ("field", "fragile"),
    [
        ((Y, -Sin(X)), False),
        ((Y, X**3 - Y**2), False),
        ((Y, -X / (1 + X**2)), False),
        # Roots have no series where their base is zero, in any component.
        ((Y, -X * (1 + X**2) ** HALF), True),
        ((-X * (1 + X**2) ** -HALF, Y), True),
        ((-X / Hypot(X, Y), Y), True),
        ((Y, X * Hypot(X, Y)), True),
    ],
)
def test_series_that_may_fail(field, fragile):
    found = made(*field)
    assert (found.kind, found.degree, found.guards) == (TAYLOR, 0, (True,))
    assert found.fragile is fragile
    assert found.reason == "smooth, nonlinear in the state"


def test_reasons():
    assert made(Y, Exp(-(T**2)) - X).reason == "affine, its forcing has no short series"
    assert made(Y, -((X - 1) ** (3 * HALF))) == "it has fractional powers of more than one guard"
