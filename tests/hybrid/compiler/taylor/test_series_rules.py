"""Recurrences one by one, run order by order in plain Python with sums for the convolutions."""

import math

import mpmath as mp
import numpy as np
import pytest
import sympy
from sympy.codegen.cfunctions import exp2, expm1, hypot, log1p, log2, log10

from hybrid.compiler.taylor.series import ONE_THEN_ZERO, NoSeries, Recurrences
from hybrid.kernels.types.codes import NARROW
from hybrid.symbolic.constants import Constants
from hybrid.symbolic.expressions import Sign, Together

X, Y, T, K, V = sympy.symbols("x y t k v", real=True)
ORDER, A = 7, 1.375
NAMES = {name: getattr(math, name) for name in dir(math) if name[0] != "_"}
# Column 0 has the series of X = A + s, column 1 that of Y = 2 - s + s^2, where s is the time since the start.
START = {0: [A, 1.0], 1: [2.0, -1.0, 1.0]}


class Series:
    """The coefficients of a few expressions, with the columns that they fill."""

    def __init__(self, rows=None, time=(T, ONE_THEN_ZERO), **options):
        self.next = 2
        self.block = Recurrences(rows or {X: "0", Y: "1"}, time, self.allot, "s", Constants(), **options)

    def allot(self, width=1):
        self.next += width
        return str(self.next - width)

    def started(self):
        """The coefficients that are known, and the names of the code with the columns of convolutions."""
        columns = {f"sc{place}": int(self.allot()) for place in self.block.places.values()}
        out = np.zeros((ORDER + 1, self.next))
        for column, start in START.items():
            out[: len(start), column] = start
        return out, {"out": out, **NAMES, **columns}

    def advance(self, o, out, scope):
        """Compute order ``o``. Convolutions come first, without both ends; their factors are written last."""
        block = self.block
        scope |= {"o": o, "shrink": 1.0 / max(o, 1)}
        pairs = [(eval(left, scope), scope[f"sc{i}"], i) for (left, _), i in block.places.items()]
        for left, right, i in pairs:
            scope[f"ss{i}"] = sum(out[j, left] * out[o - j, right] for j in range(1, o))
        for line in block.higher if o else block.first:
            exec(line, scope)
        for pair, i in block.places.items():
            out[o, scope[f"sc{i}"]] = eval(block.pairs[pair], scope)

    def of(self, expression, t=A, k=0.5):
        """The coefficients of an expression at a time and a value of the parameter ``k``."""
        text = self.block.coefficient(expression)
        out, scope = self.started()
        scope |= {"t": t, "k": k}
        exec("\n".join(self.block.constants.statements()), scope)
        found = []
        for o in range(ORDER + 1):
            self.advance(o, out, scope)
            found.append(float(eval(text, scope)))
        return found


def taylor(function, at=A):
    with mp.workdps(30):
        return [float(each) for each in mp.taylor(function, mp.mpf(at), ORDER)]


FUNCTIONS = {
    "sine": (sympy.sin, mp.sin),
    "cosine": (sympy.cos, mp.cos),
    "tangent": (sympy.tan, mp.tan),
    "hyperbolic sine": (sympy.sinh, mp.sinh),
    "hyperbolic cosine": (sympy.cosh, mp.cosh),
    "hyperbolic tangent": (sympy.tanh, mp.tanh),
    "exponential": (sympy.exp, mp.exp),
    "logarithm": (sympy.log, mp.log),
    "arc tangent": (sympy.atan, mp.atan),
    "expm1": (expm1, mp.expm1),
    "log1p": (log1p, mp.log1p),
    "log2": (log2, lambda u: mp.log(u, 2)),
    "log10": (log10, mp.log10),
    "exp2": (exp2, lambda u: mp.mpf(2) ** u),
    "length": (lambda u: hypot(u, sympy.Integer(2)), lambda u: mp.hypot(u, 2)),
    "together": (lambda u: Together(3 * u), lambda u: 3 * u),
    "root": (sympy.sqrt, mp.sqrt),
    "power": (lambda u: u ** sympy.Rational(7, 3), lambda u: u ** (mp.mpf(7) / 3)),
    "power of the parameter": (lambda u: u**K, mp.sqrt),
    "variable power": (lambda u: u**u, lambda u: u**u),
    "square": (lambda u: u**2, lambda u: u**2),
    "cube": (lambda u: u**3, lambda u: u**3),
    "sixth power": (lambda u: u**6, lambda u: u**6),
    "reciprocal": (lambda u: 1 / u, lambda u: 1 / u),
    "inverse cube": (lambda u: u**-3, lambda u: u**-3),
    "quotient": (lambda u: sympy.sin(u) / (2 + u), lambda u: mp.sin(u) / (2 + u)),
    "two divisors": (lambda u: 1 / (u * (2 + u)), lambda u: 1 / (u * (2 + u))),
    "product": (lambda u: u * sympy.exp(u) * sympy.sin(u), lambda u: u * mp.exp(u) * mp.sin(u)),
    "multiple": (lambda u: 3 * K * u, lambda u: 1.5 * u),
    "multiple of a sum": (lambda u: 3 * (K * u + 2), lambda u: 1.5 * u + 6),
    "sum": (lambda u: u + K * sympy.sin(u) - 3 + u**2, lambda u: u + mp.sin(u) / 2 - 3 + u**2),
    "inner sums": (
        lambda u: 2 * (u**2 + 3 * (sympy.sin(u) + 1)) - u,
        lambda u: 2 * (u**2 + 3 * (mp.sin(u) + 1)) - u,
    ),
    "nested": (lambda u: sympy.exp(sympy.sin(u * u)), lambda u: mp.exp(mp.sin(u * u))),
    "shared parts": (
        lambda u: sympy.sin(u) * sympy.cos(u) + sympy.sin(u) ** 2,
        lambda u: mp.sin(u) * mp.cos(u) + mp.sin(u) ** 2,
    ),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_of_a_state(name):
    made, exact = FUNCTIONS[name]
    np.testing.assert_allclose(Series().of(made(X)), taylor(exact), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_of_a_sum_of_states(name):
    """``X + Y/2`` is ``A + 1 + s/2 + s^2/2``."""
    made, exact = FUNCTIONS[name]
    expected = taylor(lambda s: exact(A + 1 + s / 2 + s**2 / 2), 0)
    np.testing.assert_allclose(Series().of(made(X + Y / 2)), expected, rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("clock", [False, True], ids=["time", "clock"])
def test_of_time(name, clock):
    """Of a linear function of time, or where time itself moves like ``Y`` on another clock."""
    made, exact = FUNCTIONS[name]
    if clock:
        found = Series(time=(T, "out[o, 1]")).of(made(T), t=2.0)
        expected = taylor(lambda s: exact(2 - s + s**2), 0)
    else:
        found = Series().of(made(3 * T - 1), t=A)
        expected = taylor(lambda t: exact(3 * t - 1))
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-12)


def test_of_two_states():
    for made, exact in (
        (X * Y, lambda s: (A + s) * (2 - s + s**2)),
        (X / Y, lambda s: (A + s) / (2 - s + s**2)),
        (K / (X * Y), lambda s: mp.mpf(0.5) / ((A + s) * (2 - s + s**2))),
        (X**2 * Y + Y**2 * X, lambda s: (A + s) ** 2 * (2 - s + s**2) + (2 - s + s**2) ** 2 * (A + s)),
        (sympy.sin(X) * sympy.exp(Y), lambda s: mp.sin(A + s) * mp.exp(2 - s + s**2)),
        (X - Y, lambda s: A + s - 2 + s - s**2),
        (sympy.Integer(3) + K, lambda s: mp.mpf(3.5)),
        (X**Y, lambda s: (A + s) ** (2 - s + s**2)),
        (X * Y * T, lambda s: (A + s) ** 2 * (2 - s + s**2)),
    ):
        np.testing.assert_allclose(Series().of(made), taylor(exact, 0), rtol=1e-12, atol=1e-13)


def test_of_inverse_functions():
    """Their arguments are less than 1 in size, or more."""
    for made, exact in (
        (sympy.asin(X / 3), lambda u: mp.asin(u / 3)),
        (sympy.acos(X / 3), lambda u: mp.acos(u / 3)),
        (sympy.atanh(X / 3), lambda u: mp.atanh(u / 3)),
        (sympy.asinh(X), mp.asinh),
        (sympy.acosh(X + 1), lambda u: mp.acosh(u + 1)),
    ):
        np.testing.assert_allclose(Series().of(made), taylor(exact), rtol=1e-12, atol=1e-14)


def test_a_better_start_replaces_that_of_the_operations():
    """Here the square of the state is known to start with 5."""
    found = Series(at_start={X**2: "5.0"}).of(X**2)
    np.testing.assert_allclose(found, [5.0, 2 * A, 1.0, *[0.0] * (ORDER - 2)], atol=1e-14)


@pytest.mark.parametrize("power", [2, 4])
@pytest.mark.parametrize(("function", "sign"), [(sympy.tanh, -1), (sympy.tan, 1)])
def test_the_slope_of_a_hyperbolic_tangent_serves_again(function, sign, power):
    """It is ``1 - tanh(u)^2``, and no other power."""
    series = Series()
    series.block.coefficient(function(X))
    found = series.of(1 + sign * function(X) ** power)
    exact = getattr(mp, function.__name__)
    expected = taylor(lambda u: 1 + sign * exact(u) ** power)
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-13)


def test_what_is_not_analytic_has_no_series():
    for expression in (Sign(X), X * Sign(Y), sympy.exp(Sign(X))):
        with pytest.raises(NoSeries, match="Sign is not analytic"):
            Series().of(expression)
    assert Series().of(Sign(K) * X, k=-2.0)[:2] == [-A, -1.0]


def test_which_arguments_are_linear_in_time():
    """Their exponentials and sines need no convolution; on another clock they do."""
    for time, u, rate in (
        ((T, ONE_THEN_ZERO), 2 * T + K, "2.0"),
        ((T, ONE_THEN_ZERO), -T, "(-1.0)"),
        ((T, ONE_THEN_ZERO), K * T, "k0"),
        ((T, ONE_THEN_ZERO), T**2, None),
        ((T, ONE_THEN_ZERO), T + X, None),
        ((T, ONE_THEN_ZERO), X, None),
        ((T, "out[o, 1]"), 2 * T, None),
        (None, X, None),
    ):
        assert Series(time=time).block._rate(u) == rate


def test_one_column_for_each_series_that_is_read_again():
    series = Series()
    block = series.block
    assert block.row(X) == "0"
    column = block.row(sympy.sin(X))
    assert block.row(sympy.sin(X)) == column
    assert block.row(sympy.cos(X)) != column
    assert block.coefficient(sympy.sin(X)) == block.coefficient(sympy.sin(X))
    assert block.common_left is not None
    assert Series().block.common_left is None
    two = Series()
    two.block.coefficient(sympy.sin(X) + sympy.sin(Y))
    assert two.block.common_left is None


class TestTangents:
    """A tangent vector has four lanes; the series of the state are known."""

    def vectors(self, expression):
        series = Series()
        known = series.block
        lanes = Recurrences(
            {V: "v"}, None, lambda: series.allot(NARROW), "b", known.constants, known=known, lanes=True
        )
        text = lanes.coefficient(expression)
        return series, lanes, text

    @pytest.mark.parametrize(
        ("expression", "exact"),
        [
            (V, lambda s: 1),
            (X * V, lambda s: A + s),
            (3 * K * V, lambda s: mp.mpf(1.5)),
            (sympy.sin(X) * V + Y * V, lambda s: mp.sin(A + s) + 2 - s + s**2),
            (V * X / Y, lambda s: (A + s) / (2 - s + s**2)),
            (V * (X * Y + sympy.cos(T)), lambda s: (A + s) * (2 - s + s**2) + mp.cos(A + s)),
        ],
    )
    def test_products_with_what_the_state_has(self, expression, exact):
        """The vector has the series ``(1, 2, 3, 4) (1 + s)``."""
        series, lanes, text = self.vectors(expression)
        place = int(series.allot(NARROW))
        blocks = {
            f"bb{i}": int(series.allot(NARROW * len(rights)))
            for i, rights in enumerate(lanes.blocks.values())
        }
        out, scope = series.started()
        vector = np.arange(1.0, NARROW + 1.0)
        out[:2, place : place + NARROW] = vector

        def load(out, o, column):
            return out[o, column : column + NARROW].copy()

        def store(out, o, column, value):
            out[o, column : column + NARROW] = value

        scope |= {"t": A, "k": 0.5, "v": place, "load": load, "store": store, **blocks}
        exec("\n".join(lanes.constants.statements()), scope)
        for o in range(ORDER + 1):
            series.advance(o, out, scope)
            for i, (left, rights) in enumerate(lanes.blocks.items()):
                for k in range(len(rights)):
                    first = blocks[f"bb{i}"] + NARROW * k
                    scope[f"bs{i}_{k}"] = sum(
                        (out[j, eval(left, scope)] * load(out, o - j, first) for j in range(1, o)),
                        np.zeros(NARROW),
                    )
            for line in lanes.higher if o else lanes.first:
                exec(line, scope)
            found = np.broadcast_to(eval(text, scope), NARROW)
            expected = taylor(lambda s: exact(s) * (1 + s), 0)[o]
            np.testing.assert_allclose(found, expected * vector, rtol=1e-12, atol=1e-13)
