"""Which fields have polynomials in time as solutions, and of which degree."""

import pytest
import sympy

from hybrid.compiler.propagators.equations import Boundary, equations_of
from hybrid.compiler.propagators.polynomial import polynomial
from hybrid.kernels.types.codes import EXACT
from hybrid.expression.tracing import model_symbols

SYMBOLS = model_symbols(3, 2)
(X, Y, Z), (A, B), T = SYMBOLS.x, SYMBOLS.p, SYMBOLS.t
FALL = [Y, -A, sympy.S.Zero]


def found(field, guards=()):
    boundaries = [Boundary(guard, 1, is_affine=False) for guard in guards]
    return polynomial(equations_of(list(field), boundaries, SYMBOLS))


@pytest.mark.parametrize(
    ("field", "degree"),
    [
        (([sympy.S.Zero] * 2) + [sympy.S.One], 1),
        (FALL, 2),
        ([Y, Z, A], 3),
        ([Y, Z, A * T**2], 5),
        ([Y + T**4, sympy.S.Zero, Z * 0 + 1], 5),
        ([sympy.S.Zero] * 3, 1),
        ([Z, T**6, Y], 9),
        ([Z, T**7, Y], 10),
        # The root is real for some values of the parameter only, and may be for those of a run.
        ([sympy.sqrt(sympy.Rational(1, 2) - A) * Y, sympy.S.One, sympy.S.Zero], 2),
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
        ([Y, -X, sympy.S.Zero], "no polynomials"),
        ([X, sympy.S.Zero, sympy.S.Zero], "no polynomials"),
        ([A * (X - Y), B * (X - Y), sympy.S.Zero], "no polynomials"),
        ([Y, sympy.cos(T), sympy.S.Zero], "no polynomials"),
        # The components act back on themselves, although that cancels.
        ([2 * (X - Y), 2 * (X - Y), B], "no polynomials"),
        ([X * Y, sympy.S.Zero, sympy.S.Zero], "not affine"),
        ([Y, sympy.cos(T**2), sympy.S.Zero], "not affine"),
    ],
)
def test_other_fields(field, reason):
    assert reason in found(field)


def test_quadratic_guards_are_held_and_flatter_ones_are_not():
    guards = [X, X * Y - 1, X**3, sympy.sin(X), A - T, T**2 - X, None, A * sympy.S.One]
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
