"""What a propagator knows of a mode: signs of guards inside it, roots of guards, and kinds of forcing."""

from fractions import Fraction

import pytest

from hybrid.compiler.propagators.equations import Boundary, equations_of, in_terms_of_root, known_positive
from hybrid.compiler.taylor.series import NoSeries
from hybrid.expression.derivatives import derivative
from hybrid.expression.nodes import ZERO, Symbol, add
from hybrid.expression.operations import Absolute, Cos, Exp, Maximum, Sign, Sin, sqrt
from hybrid.expression.polynomials import expanded
from hybrid.expression.tracing import model_symbols

SYMBOLS = model_symbols(2, 2)
(X, Y), (A, B), T = SYMBOLS.x, SYMBOLS.p, SYMBOLS.t
HEIGHT = X - A


def boundary(guard, inside):
    return Boundary(guard, inside, is_affine=True)


class TestSigns:
    """The same contact written with a guard that falls or rises out of the mode."""

    def test_guards_and_their_opposites_are_positive_inside(self):
        given = [boundary(X, 1), boundary(Y, -1), boundary(X + Y, 0), boundary(None, 1)]
        assert known_positive(given) == [X, -Y]

    @pytest.mark.parametrize("end", [boundary(HEIGHT, 1), boundary(-HEIGHT, -1)])
    def test_inside_above_the_guard(self, end):
        field = [Maximum(HEIGHT, ZERO), Absolute(HEIGHT) + Sign(HEIGHT)]
        found = equations_of(field, [end], SYMBOLS).field
        assert [expanded(each) for each in found] == [HEIGHT, HEIGHT + 1]

    @pytest.mark.parametrize("end", [boundary(HEIGHT, -1), boundary(-HEIGHT, 1)])
    def test_inside_below_the_guard(self, end):
        field = [Maximum(HEIGHT, ZERO), Absolute(HEIGHT) + Sign(HEIGHT)]
        found = equations_of(field, [end], SYMBOLS).field
        assert [expanded(each) for each in found] == [0, -HEIGHT - 1]

    def test_a_guard_that_does_not_end_the_mode_says_nothing(self):
        field = [Maximum(HEIGHT, ZERO), Y]
        assert list(equations_of(field, [boundary(HEIGHT, 0)], SYMBOLS).field) == field


class TestRoots:
    def test_guards_that_are_multiples_have_the_sign_of_their_side(self):
        w = Symbol("w", positive=True)
        guards = [(Y, 1), (3 * HEIGHT, 1), (-B * HEIGHT, -1), (-HEIGHT, 0), (None, 1)]
        given = [boundary(*each) for each in guards]
        assert in_terms_of_root(given, HEIGHT, w, SYMBOLS) == {1: w, 2: -w, 3: -w}
        assert in_terms_of_root([boundary(HEIGHT, 0)], HEIGHT, w, SYMBOLS) == {0: w}

    def test_fractional_powers_are_of_guards_only(self):
        power = HEIGHT ** Fraction(3, 2)
        for end in (boundary(HEIGHT, 1), boundary(-2 * HEIGHT, -1)):
            found = equations_of([Y, -power], [end], SYMBOLS)
            assert found.bases == {HEIGHT: 2}
            assert found.held == (True,)
        with pytest.raises(NoSeries, match="3/2 of an expression that may change sign"):
            equations_of([Y, -power], [boundary(Y, 1)], SYMBOLS)
        for exponent in (0.45, SYMBOLS.p[0]):
            with pytest.raises(NoSeries, match="of a guard"):
                equations_of([Y, HEIGHT**exponent], [boundary(HEIGHT, 1)], SYMBOLS)

    @pytest.mark.parametrize(
        ("powers", "order"),
        [((1 / 3,), 3), ((0.25, 1.5), 4), ((1 / 6, 0.5), 6), ((0.5, 7.5), 2), ((4 / 3,), 3)],
    )
    def test_the_order_of_the_root_that_makes_powers_whole(self, powers, order):
        field = [Y, add(*(HEIGHT**power for power in powers))]
        assert equations_of(field, [boundary(HEIGHT, 1)], SYMBOLS).bases == {HEIGHT: order}

    @pytest.mark.parametrize("powers", [(1.25,), (0.75, 1 / 3)])
    def test_series_with_wide_gaps_are_not_taken(self, powers):
        field = [Y, add(*(HEIGHT**power for power in powers))]
        with pytest.raises(NoSeries, match="wide gaps"):
            equations_of(field, [boundary(HEIGHT, 1)], SYMBOLS)

    def test_series_hold_guards_that_are_affine_or_roots(self):
        ends = [Boundary(HEIGHT, 1), Boundary(X**2, 1), Boundary(Y, 1, is_affine=True), Boundary(None, 1)]
        assert equations_of([Y, HEIGHT ** Fraction(3, 2)], ends, SYMBOLS).held == (
            True,
            False,
            True,
            False,
        )
        found = equations_of([Y, X], ends, SYMBOLS)
        assert found.held == (False, False, True, False)
        assert found.guards == [0, 0, Y, 0]


@pytest.mark.parametrize(
    ("field", "affine", "elementary"),
    [
        ([Y, -X], True, True),
        ([Y, A * X + B * T**2 + Cos(B * T)], True, True),
        ([Y, Exp(-A * T) * Sin(T) - X], True, True),
        ([Y, Cos(T**2)], True, False),
        ([Y, Exp(Sin(T))], True, False),
        ([Y, 1 / (1 + T)], True, False),
        ([Y, sqrt(1 + T**2)], True, False),
        ([Y, T * X], False, True),
        ([Y, X**2], False, True),
        ([X * Y, X], False, True),
    ],
)
def test_affine_fields_and_elementary_forcing(field, affine, elementary):
    found = equations_of(field, [], SYMBOLS)
    assert (found.is_affine, found.has_elementary_forcing) == (affine, elementary)
    assert found.jacobian == [[derivative(each, x) for x in (X, Y)] for each in field]
