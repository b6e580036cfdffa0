"""Which fields have polynomials in time as solutions, and of which degree."""

import pytest

from hybrid.compiler.propagators.equations import Boundary, equations_of
from hybrid.compiler.propagators.polynomial import polynomial
from hybrid.expression.nodes import HALF, ONE, ZERO
from hybrid.expression.operations import Cos, Sin, sqrt
from hybrid.expression.tracing import model_symbols
from hybrid.kernels.types.codes import EXACT

SYMBOLS = model_symbols(3, 2)
(X, Y, Z), (A, B), T = SYMBOLS.x, SYMBOLS.p, SYMBOLS.t
FALL = [Y, -A, ZERO]


def found(field, guards=()):
    boundaries = [Boundary(guard, 1, is_affine=False) for guard in guards]
    return polynomial(equations_of(list(field), boundaries, SYMBOLS))


@pytest.mark.parametrize(
    ("field", "degree"),
    [
        (([ZERO] * 2) + [ONE], 1),
        (FALL, 2),
        ([Y, Z, A], 3),
        ([Y, Z, A * T**2], 5),
        ([Y + T**4, ZERO, Z * 0 + 1], 5),
        ([ZERO] * 3, 1),
        ([Z, T**6, Y], 9),
        ([Z, T**7, Y], 10),
        # The root is real for some values of the parameter only, and may be for those of a run.
        ([sqrt(HALF - A) * Y, ONE, ZERO], 2),
    ],
)
def test_degrees(field, degree):
    """The solutions of a chain of integrations have the degree of its forcing and one more per link."""
    propagator = found(field)
    assert (propagator.kind, propagator.degree) == (EXACT, degree)
    assert propagator.reason == f"polynomials of degree {degree}"


@pytest.mark.parametrize(
    ("field", "reason"),
    [
        ([Y, -X, ZERO], "no polynomials"),
        ([X, ZERO, ZERO], "no polynomials"),
        ([A * (X - Y), B * (X - Y), ZERO], "no polynomials"),
        ([Y, Cos(T), ZERO], "no polynomials"),
        # The components act back on themselves, although that cancels.
        ([2 * (X - Y), 2 * (X - Y), B], "no polynomials"),
        ([X * Y, ZERO, ZERO], "not affine"),
        ([Y, Cos(T**2), ZERO], "not affine"),
    ],
)
def test_other_fields(field, reason):
    assert reason in found(field)


def test_quadratic_guards_are_held_and_flatter_ones_are_not():
    guards = [X, X * Y - 1, X**3, Sin(X), A - T, T**2 - X, None, A]
    propagator = found(FALL, guards)
    assert propagator.guards == (True, True, False, False, True, True, False, True)
    # Flights of degree two in a guard of degree two.
    assert propagator.degree == 4
    assert found(FALL, [X, X**3]).degree == 2


def test_a_guard_beyond_the_highest_order_of_a_step_is_not_held():
    """Eight integrations of ``t^k`` have the degree ``k + 8``; a quadratic guard has twice that."""
    symbols = model_symbols(8, 0)
    for power, held in ((8, True), (9, False)):
        field = [*symbols.x[1:], symbols.t**power]
        boundaries = [Boundary(symbols.x[0] ** 2, 1), Boundary(symbols.x[0], 1)]
        propagator = polynomial(equations_of(field, boundaries, symbols))
        assert propagator.guards == (held, True)
        assert propagator.degree == (power + 8) * (2 if held else 1)
