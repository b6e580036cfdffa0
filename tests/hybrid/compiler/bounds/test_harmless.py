"""Forcing without bounds has no narrow pulses: powers, sums, functions of jumps, and growth in time."""

from functools import cache, reduce
from operator import mul

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hybrid import DOP853, HybridSystem, Mode, RadauIIA, Taylor, Tsit5, simulate
from hybrid.compiler.bounds.forcing import FACTORS_OF_HARMONIC, MOST_FACTORS, is_harmless
from hybrid.expression.nodes import add, multiply
from hybrid.expression.operations import Cos
from hybrid.expression.tracing import model_symbols, trace
from hybrid.expression.ufuncs import UFUNCS
from hybrid.expression.vocabulary import named

SOLVERS = (Taylor(), DOP853(), RadauIIA(rtol=1e-8, atol=1e-10), Tsit5(rtol=1e-8, atol=1e-10))
T = model_symbols(1, 0).t


def traced(function):
    [expression] = trace(lambda t, x, p: (function(t),), ("v",), ())
    return expression


def is_free(function):
    """Whether a solver needs no bounds for a function of time."""
    return is_harmless(traced(function), (T,))


JUMPING = {
    "where": lambda t: np.where(np.abs(t - 5) < 1e-3, 3.0, 0.5),
    "sign": lambda t: np.sign(t - 5) / 2,
    "heaviside": lambda t: np.heaviside(t - 5, 0.5) / 2,
    "floor": lambda t: np.floor(t / 10) / 10,
    "remainder": lambda t: np.mod(t, 10) / 10,
    "jump in a product": lambda t: (t - 5) * np.heaviside(t - 5, 0.5) / 10,
    "comparison": lambda t: (t > 5) + 0.0,
    "clip": lambda t: np.clip(t, 0.1, 0.2),
    "kink": lambda t: (t + np.abs(t - 5)) / 10,
}
FUNCTIONS = sorted(name for name in UFUNCS - {"clip"} if named(name).nin == 1)


@pytest.mark.parametrize("jumping", JUMPING)
@pytest.mark.parametrize("name", [*FUNCTIONS, "power"])
def test_no_function_of_a_jump_is_harmless(name, jumping):
    def outer(u):
        return u**3 + 2**u if name == "power" else 1.0 * named(name)(u)

    inner = JUMPING[jumping]
    for function in (
        lambda t: outer(inner(t)),
        lambda t: t * outer(inner(t)) ** 2,
        lambda t: np.exp(t) + outer(inner(t) + t),
        lambda t: np.cos(outer(t * inner(t))),
    ):
        assert not is_free(function)


@pytest.mark.parametrize(
    "function",
    [
        lambda t: np.cos(3 * t) + t**2,
        lambda t: t**8,
        lambda t: (t / 50) ** 3 * (1 - t) ** 5,
        lambda t: t**3 * np.exp(-t),
        lambda t: np.exp(-t) * np.sin(3 * t) + np.cosh(t) + np.expm1(t) + np.exp2(t) + 2**t,
        lambda t: sum(np.cos(k * t) for k in range(1, 21)),
        lambda t: sum(t**k for k in range(9)),
        lambda t: np.cos(t**2),
        lambda t: np.cos(t) * np.cos(2 * t) * np.cos(3 * t) * np.cos(4 * t),
    ],
)
def test_ordinary_forcing_is_harmless(function):
    assert is_free(function)


@pytest.mark.parametrize(
    "function",
    [
        lambda t: (1 - ((t - 50) / 100) ** 2) ** 10000,
        lambda t: (t / 50 * np.exp(1 - t / 50)) ** 100,
        lambda t: (np.exp(-t) * (2 - np.exp(-t))) ** 100,
        lambda t: np.cos(t) ** 100,
        lambda t: (1 + np.cos(t)) ** 50,
        lambda t: np.cosh(t) ** -2,
        lambda t: np.cosh(t) ** 100 * np.exp(-100 * t),
        lambda t: np.sin((1 - ((t - 50) / 100) ** 2) ** 10000),
        lambda t: np.exp(-((t - 50) ** 2)),
        lambda t: (1 + t) ** 5 * (1 - t) ** 5,
        lambda t: (1 + t**2) ** -2,
        lambda t: t**0.5,
        lambda t: 1 / t,
    ],
)
def test_what_may_have_a_pulse_is_bounded(function):
    assert not is_free(function)


def test_a_product_of_many_harmonics_is_no_harmless_forcing():
    """A sum of as many harmonics is harmless."""
    most = MOST_FACTORS // FACTORS_OF_HARMONIC
    many = [Cos(k * T) for k in range(1, most + 2)]
    assert is_harmless(add(*many), (T,))
    assert is_harmless(multiply(*many[:-1]), (T,))
    assert not is_harmless(multiply(*many), (T,))


# Samples of an interval; a pulse is found on fewer of them than this share.
SAMPLES = np.linspace(0.0, 10.0, 4001)
NARROW = 0.01
centres = st.floats(0.0, 10.0)
rates = st.floats(-1.0, 1.0)
factors = st.one_of(
    st.builds(lambda c: lambda t: t - c, centres),
    st.builds(lambda c: lambda t: 1 - ((t - c) / 10) ** 2, centres),
    st.builds(lambda c: lambda t: (t / (c + 1)) * np.exp(1 - t / (c + 1)), centres),
    st.builds(lambda c, w: lambda t: np.cos(w * (t - c)), centres, st.floats(0.1, 1.0)),
    st.builds(lambda c, w: lambda t: 1 + np.cos(w * (t - c)), centres, st.floats(0.1, 1.0)),
    st.builds(lambda c: lambda t: np.exp(np.where(np.abs(t - c) < 1e-2, 9.0, 0.0)) - 1, centres),
    st.builds(lambda c: lambda t: np.cosh((t - c) / 10), centres),
)
# An exponential is seen where it is large, at the start of a step or in its growth, however steep it is.
exponentials = st.builds(lambda r: lambda t: np.exp(r * t), rates)
powers = st.one_of(
    st.builds(lambda f, n: lambda t: f(t) ** n, factors, st.sampled_from([1, 1, 2, 3, 4, 8, 30, 300, 3000])),
    st.builds(lambda f, n: lambda t: f(t) ** n, exponentials, st.sampled_from([1, 2, 3, 4, 8])),
)
products = st.lists(powers, min_size=1, max_size=3).map(
    lambda each: lambda t: reduce(mul, [f(t) for f in each])
)


@settings(max_examples=100)
@given(product=products)
def test_a_harmless_product_is_not_small_almost_everywhere(product):
    with np.errstate(over="ignore", invalid="ignore"):
        size = np.abs(product(SAMPLES))
    assume(np.all(np.isfinite(size)) and np.max(size) > 0)
    is_narrow = np.mean(size > 1e-3 * np.max(size)) < NARROW
    assert not (is_narrow and is_free(product))


PULSES = {
    "parabola**n": lambda t, p, n: (1 - ((t - p.a) / 100) ** 2) ** n,
    "(t*exp(-t))**n": lambda t, p, n: ((t / p.a) * np.exp(1 - t / p.a)) ** n,
    "exp of a window": lambda t, p, n: np.expm1(np.where(np.abs(t - p.a) < 10.0 / n, 1.0, 0.0)),
    "exp of signs": lambda t, p, n: (
        np.exp((np.sign(t - p.a + 10.0 / n) - np.sign(t - p.a - 10.0 / n)) / 2) - 1.0
    ),
    "growth": lambda t, p, n: np.exp(n * (t - p.a - 1.0)),
}


@cache
def lag(pulse, n):
    return HybridSystem(
        state=("v", "u"),
        parameters={"a": 50.0},
        modes=[Mode("lag", lambda t, x, p: (-x.v + PULSES[pulse](t, p, n), -x.u / 10))],
    )


class Place:
    """The parameter of a pulse for use outside a model."""

    def __init__(self, a):
        self.a = a


def response(pulse, n, a):
    """The lag from rest at ``a + 1``, by Gauss quadrature on pieces that are short near the pulse."""
    reach = 10.0 / n * 1.5 ** np.arange(-20, 60)
    edges = np.concatenate([a - reach, a + reach, a + 1 - reach, [0.0, a, a + 1]])
    edges = np.unique(np.clip(np.concatenate([edges, a + np.linspace(-2, 1, 301)]), 0.0, a + 1))
    nodes, weights = np.polynomial.legendre.leggauss(20)
    half, middle = np.diff(edges) / 2, (edges[1:] + edges[:-1]) / 2
    s = middle[:, None] + half[:, None] * nodes
    return np.sum(np.exp(s - a - 1) * PULSES[pulse](s, Place(a), n) * weights * half[:, None])


@pytest.mark.parametrize("n", [30, 10**5])
@pytest.mark.parametrize("pulse", PULSES)
@settings(max_examples=15)
@given(a=st.floats(20.0, 90.0), solver=st.sampled_from(SOLVERS))
def test_no_power_and_no_function_of_a_jump_is_stepped_over(pulse, n, a, solver):
    arc = simulate(lag(pulse, n), (0.0, 1.0), (0.0, a + 1.0), parameters={"a": a}, solver=solver)
    assert arc.status.ok
    expected = response(pulse, n, a)
    width = 10.0 / n if pulse.startswith("exp of") else expected
    share = 1e-3 if pulse.startswith("exp of") or isinstance(solver, Tsit5) else 1e-5
    assert arc.x[-1, 0] == pytest.approx(expected, rel=0, abs=share * width + 100 * solver.atol)
    assert arc.steps < 3000


@pytest.mark.parametrize(
    "power",
    [
        lambda s: (s / 50) ** 40,
        lambda s: (1 - ((s - 50) / 100) ** 2) ** 300,
        lambda s: (1 - ((s - 50) / 100)) ** 8 * (1 + ((s - 50) / 100)) ** 8,
        lambda s: (1 + ((s - 50) / 100) ** 2) ** -3000,
    ],
)
def test_a_series_sees_a_high_power_of_the_state(power):
    system = HybridSystem(
        state=("v", "s"), modes=[Mode("lag", lambda t, x, p: (-x.v + power(x.s), 1.0 + 0 * x.s))]
    )
    arc = simulate(system, (0.0, 0.0), (0.0, 51.0))
    s = np.linspace(1.0, 51.0, 500_001)
    expected = np.trapezoid(np.exp(s - 51.0) * power(s), s)
    assert arc.x[-1, 0] == pytest.approx(expected, rel=1e-7)


# Functions of time by the number of factors that they count as.
COUNTED = {
    "power": (lambda t, k: t**k, 1),
    "power of a difference": (lambda t, k: (t - 5.0) ** k / 7.0, 1),
    "power of a sum": (lambda t, k: (2.0 * t + 1.0) ** k + t, 1),
    "product with an exponential": (lambda t, k: t**k * np.exp(-3.0 * t), 1),
    "harmonics": (lambda t, k: np.sin(2.0 * t) ** k, 2),
    "sum of harmonics": (lambda t, k: np.cos(t) ** k + np.sin(t) * t, 2),
    "chirps": (lambda t, k: np.sin(t**2) ** k, 4),
    "hyperbolic functions": (lambda t, k: np.sinh(t) ** k, 1),
    "mixed": (lambda t, k: (t * np.cos(t)) ** k, 3),
}


@pytest.mark.parametrize("name", COUNTED)
def test_as_many_factors_as_are_allowed_are_harmless_and_not_one_more(name):
    function, factors = COUNTED[name]
    for k in range(1, MOST_FACTORS + 3):
        assert is_free(lambda t, k=k: function(t, k)) == (factors * k <= MOST_FACTORS), k
