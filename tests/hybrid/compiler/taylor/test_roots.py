"""Tanks that empty: the field is a fractional power of the guard, and the speed vanishes with it."""

import math
from fractions import Fraction

import numpy as np
import pytest

import hybrid
from hybrid import Guard, HybridSystem, Mode, StatusCode, Transition
from hybrid.compiler.taylor import roots
from hybrid.compiler.taylor.roots import ROOT, is_multiple
from hybrid.expression.graph import nodes_of, replaced
from hybrid.expression.nodes import HALF, ONE, ZERO, Power, Symbol, node, number
from hybrid.expression.operations import sqrt
from hybrid.expression.polynomials import is_zero
from hybrid.expression.tracing import model_symbols
from hybrid.kernels.types import codes

symbols = model_symbols(2, 2)


def tank(field, guard=lambda t, x, p: x.h, state=("h",), direction=-1, **options):
    mode = Mode("emptying", field)
    empty = Transition("emptying", None, Guard(guard, direction), name="empty")
    return HybridSystem(
        state=state, parameters={"c": 1.0, "q": 0.0}, modes=[mode], transitions=[empty], **options
    )


def with_overflow(t, x, p):
    """The level of a second tank, which the first one fills."""
    return -p.c * np.sqrt(x.h), p.c * np.sqrt(x.h) - x.k


@pytest.mark.parametrize(
    ("field", "guard", "direction", "time"),
    [
        (lambda t, x, p: (-np.sqrt(x.h),), lambda t, x, p: x.h, -1, 2.0),
        (lambda t, x, p: (-p.c * x.h**0.5 * 4,), lambda t, x, p: -3 * x.h, +1, 0.5),
        (lambda t, x, p: (-np.sqrt(np.maximum(x.h, 0)),), lambda t, x, p: x.h, -1, 2.0),
        (lambda t, x, p: (-np.sqrt(np.abs(x.h)) * np.sign(x.h),), lambda t, x, p: x.h, -1, 2.0),
        (lambda t, x, p: (-np.sqrt(x.h - 0.25),), lambda t, x, p: x.h - 0.25, -1, math.sqrt(3)),
        (
            lambda t, x, p: (-np.sqrt(2 * x.h) * (1 + x.h / 10),),
            lambda t, x, p: 2 * x.h,
            -1,
            math.sqrt(20) * math.atan(math.sqrt(0.1)),
        ),
        (lambda t, x, p: (-np.sqrt(x.h) / (1 + t),), lambda t, x, p: x.h, -1, math.exp(2) - 1),
    ],
)
def test_a_tank_empties_when_it_should(field, guard, direction, time):
    system = tank(field, guard, direction=direction)
    arc = hybrid.simulate(system, (1.0,), (0.0, 10.0))
    assert hybrid.compile_system(system).emitted.propagators[0].kind == codes.ROOTED
    assert arc.status.code == StatusCode.TERMINAL
    [empty] = arc.jumps
    assert empty.t == pytest.approx(time, rel=1e-14 if time == 2.0 else 1e-10)
    assert abs(guard(0.0, type("X", (), {"h": empty.x_minus[0]}), None)) <= 1e-16
    assert arc.steps < 100


def test_two_tanks_and_their_derivatives():
    """``k' = w - k`` with ``w = 1 - t/2`` until 2; a higher start fills the second tank by ``1/(2 w)``."""
    system = HybridSystem(
        state=("h", "k"),
        parameters={"c": 1.0},
        modes=[Mode("both", with_overflow), Mode("one", lambda t, x, p: (0.0, -x.k))],
        transitions=[Transition("both", "one", Guard(lambda t, x, p: x.h, -1), name="empty")],
    )
    arc = hybrid.simulate(system, (1.0, 0.0), (0.0, 3.0), mode="both", tangent=True)
    assert arc.status.ok
    assert arc.jumps[0].t == pytest.approx(2.0, abs=1e-12)
    assert arc.jumps[0].x_plus[0] == 0.0
    level = 0.5 - 1.5 * math.exp(-2) + 0.0
    # k(2) = integral of exp(s - 2) (1 - s/2) over [0, 2]
    assert arc.jumps[0].x_plus[1] == pytest.approx(0.5 * (1 - 3 * math.exp(-2)), abs=1e-10)
    assert arc.x[-1][1] == pytest.approx(level * math.exp(-1), abs=1e-10)
    expected = [[0.0, 0.0], [0.5 * (math.exp(-1) - math.exp(-3)), math.exp(-3)]]
    np.testing.assert_allclose(arc.fundamental, expected, atol=1e-9)


def test_a_tank_whose_inflow_is_switched_off_by_a_parameter_runs_dry():
    system = tank(lambda t, x, p: (p.q - np.sqrt(x.h),))
    arc = hybrid.simulate(system, (1.0,), (0.0, 3.0))
    assert arc.status.code == StatusCode.TERMINAL
    assert arc.t[-1] == pytest.approx(2.0, rel=1e-10)
    assert arc.steps < 1000
    np.testing.assert_allclose(arc.x[-1], 0.0, atol=1e-9)
    drained = hybrid.simulate(system, (1.0,), (0.0, 3.0), parameters={"q": -0.5})
    assert drained.jumps[0].t == pytest.approx(2 - math.log(3), abs=1e-10)
    filled = hybrid.simulate(system, (1.0,), (0.0, 60.0), parameters={"q": 0.5})
    np.testing.assert_allclose(filled.x[-1], 0.25, atol=1e-9)


@pytest.mark.parametrize("power", [0.5, 2.0 / 3.0])
def test_without_a_guard_the_field_ends_where_its_root_does(power):
    """The series of ``(1 - t/2)**2`` would go on to rise again."""
    system = HybridSystem(
        state=("h",), parameters={}, modes=[Mode("only", lambda t, x, p: (-(x.h**power),))], transitions=[]
    )
    arc = hybrid.simulate(system, (1.0,), (0.0, 5.0))
    assert not arc.status.ok
    assert arc.t[-1] == pytest.approx(1 / (1 - power), abs=1e-3)
    assert arc.steps < 1000


def test_roots_of_what_keeps_its_sign_have_series():
    system = HybridSystem(
        state=("x", "y"),
        parameters={},
        modes=[Mode("only", lambda t, x, p: (x.y / np.sqrt(1 + x.y**2), -x.x))],
        transitions=[],
    )
    assert hybrid.compile_system(system).emitted.propagators[0].kind == codes.TAYLOR


class TestIsMultiple:
    x, y, a, b = symbols.x[0], symbols.x[1], *symbols.p

    @pytest.mark.parametrize(
        ("expression", "other"),
        [
            (3 * x, x),
            (a * x - a * y, x - y),
            ((x - y) * (a + b) ** 2, b * x - b * y),
            (x**2 - x, x * (1 - x)),
            (1e15 * a * x - 1e15 * a * y, x - y),
            (x / 7 - y / 7, 1e-15 * x - 1e-15 * y),
        ],
    )
    def test_factor_of_parameters(self, expression, other):
        assert is_multiple(expression, other, symbols)

    @pytest.mark.parametrize(
        ("expression", "other"),
        [
            *[(x + 0.01, x), (x * y, x), (symbols.t * x, x)],
            *[(1e-15 * x + 1e-17, x), (1e15 * x * y, 1e-15 * x)],
            # Without values where all is positive.
            (sqrt(-x) + y, -x),
        ],
    )
    def test_factor_of_the_state(self, expression, other):
        assert not is_multiple(expression, other, symbols)


THIRD = number(Fraction(1, 3))
X, Y = symbols.x
C = symbols.p[0]


@pytest.mark.parametrize(
    ("exponent", "fraction"),
    [
        (number(Fraction(2, 11)), number(Fraction(2, 11))),
        (number(3), 3),
        (number(1 / 3), THIRD),
        (number(-5 / 7), -number(Fraction(5, 7))),
        (number(0.125), number(0.125)),
        (number(0.3), None),
        (number(math.pi), None),
        (C, None),
    ],
)
def test_exponents_that_are_fractions(exponent, fraction):
    assert roots.fraction_of(exponent) == fraction


def test_floats_in_exponents_become_fractions():
    before = X**1.5 * Y + 1.5 * X**0.3
    assert roots.with_fractions(before, []) == X ** Fraction(3, 2) * Y + 1.5 * X**0.3
    assert roots.with_fractions(X + Y, []) == X + Y
    cube = roots.CubeRoot(X)
    assert roots.with_fractions(cube + 1, [X]) == X**THIRD + 1
    assert roots.with_fractions(cube + 1, [-X]) == 1 - (-X) ** THIRD
    assert roots.with_fractions(cube + 1, [Y]) == cube + 1


@pytest.mark.parametrize(
    ("exponents", "order"),
    [
        (["1/2"], 2),
        (["5/2"], 2),
        (["15/2"], 2),
        (["1/3", "5/3"], 3),
        (["1/2", "1/3"], 6),
        (["1/2", "2/3"], None),
        (["5/3"], 3),
        (["2"], 1),
        (["7/3"], None),
        (["1/7"], 7),
        (["2/7"], None),
        (["1/8"], None),
    ],
)
def test_the_order_of_the_root(exponents, order):
    exponents = [*map(Fraction, exponents)]
    if order is None:
        with pytest.raises(roots.NoSeries, match="series in its root have wide gaps"):
            roots._order(exponents)
    else:
        assert roots._order(exponents) == order


def test_guards_with_fractional_powers():
    base = 2 * X - 1
    field = [sqrt(base) * Y**2, base**THIRD + C ** Fraction(1, 5) + (X**2) ** math.pi]
    assert roots.singular_bases(field, [X - HALF], symbols) == {base: 6}
    assert roots.singular_bases([X, Y**2], [X], symbols) == {}
    with pytest.raises(roots.NoSeries, match="power 1/2 of an expression that may change sign"):
        roots.singular_bases([sqrt(Y), X], [X], symbols)
    with pytest.raises(roots.NoSeries, match="has the power -1/2 of a guard"):
        roots.singular_bases([1 / sqrt(X), X], [X], symbols)
    with pytest.raises(roots.NoSeries, match=r"has the power .* of a guard"):
        roots.singular_bases([X**C, X], [X], symbols)


@pytest.mark.parametrize(
    ("field", "z", "order", "rate"),
    [
        ((-sqrt(X), 0), X, 2, -HALF),
        ((-(X ** Fraction(2, 3)), 0), X, 3, -THIRD),
        ((-(X**THIRD), 0), X, 3, None),
        ((-1 - sqrt(X), 0), X, 2, None),
        ((-C * sqrt(2 * X - 1), 0), 2 * X - 1, 2, -C),
        (
            (-sqrt(X) - Y * X, 0),
            X,
            2,
            -HALF - Y * Symbol("w5", positive=True) / 2,
        ),
        ((1, 1), symbols.t, 2, None),
    ],
)
def test_roots_that_are_smooth_in_time(field, z, order, rate):
    """``w' = z'/(q w**(q - 1))`` along the field, for ``z = w**q``."""
    field = [*map(node, field)]
    found = roots.regular_root(field, z, order, 5, symbols)
    if rate is None:
        assert found is None
    else:
        assert (str(found.symbol), found.base, found.order) == ("w5", z, order)
        assert is_zero(found.rate - rate)


def test_guards_that_are_crossed_at_a_root():
    assert roots.is_crossed([-1 - sqrt(X), ZERO], X, 2, symbols)
    assert not roots.is_crossed([-sqrt(X), ZERO], X, 2, symbols)
    assert not roots.is_crossed([ONE, ZERO], symbols.t, 2, symbols)


@pytest.mark.parametrize("order", [2, 3])
def test_rates_on_the_clock_of_a_root(order):
    """Times ``w**(q - 1)``, whatever powers of the guard there are; no negative power is left."""
    part = number(Fraction(1, order))
    for rate in (X**part, X ** (-part) * Y, (1 + X ** (-part)) * C * Y, Y + X ** (-part), X ** (1 + part)):
        found = roots.on_clock(rate, X, order)
        assert is_zero(replaced(found - ROOT ** (order - 1) * rate, {X: ROOT**order}))
        assert not any(each.exponent.leads_with_minus for each in nodes_of(Power, found))
