"""High powers of products, roots of powers and powers of zero, traced and differentiated."""

from fractions import Fraction
from math import inf
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hybrid import DOP853, HybridSystem, Mode, Taylor, simulate, split
from hybrid.expression.derivatives import jacobian_of
from hybrid.expression.tracing import model_symbols, trace
from tests.hybrid.code import values_of


def printed(function, value):
    """The value and the slope of a function of one variable, by the generated code."""
    [expression] = trace(lambda t, x, p: (function(x.a),), ("a",), ())
    [[slope]] = jacobian_of([expression], model_symbols(1, 0).x)
    return tuple(map(float, values_of([expression, slope], [value])))


def loop(base, n):
    value = 1.0
    for _ in range(n):
        value = value * base
    return value


HIGH = {
    "power": lambda a, c, n: (a * c) ** n,
    "power of quotient": lambda a, c, n: (a / (1 / c)) ** n,
    "nested": lambda a, c, n: ((a * c) ** 5) ** (n // 5),
    "loop": lambda a, c, n: loop(a * c, min(n, 200)),
    "loop with growth": lambda a, c, n: loop(a * c * np.exp(1 - a * c), min(n, 200)),
    "with growth": lambda a, c, n: (a * c * np.exp(1 - a * c)) ** n,
    "even root": lambda a, c, n: ((a * c) ** 2) ** (n / 2),
    "inverse": lambda a, c, n: (a * c) ** -n,
    "fraction": lambda a, c, n: np.abs(a * c) ** (n + 0.25),
    "two": lambda a, c, n: 3 * (a * c) ** n * (1 / (a * c)) ** (n - 5),
}


@pytest.mark.parametrize("shape", HIGH)
@settings(max_examples=20)
@given(
    size=st.floats(0.9, 1.1),
    sign=st.sampled_from([1, -1]),
    scale=st.floats(-290.0, 290.0),
    n=st.sampled_from([5, 10, 15, 30, 100, 205, 1000, 5001]),
)
def test_a_high_power_is_as_accurate_as_that_of_floats(shape, size, sign, scale, n):
    """``(t/50)**200`` is 1 at ``t = 50``; neither ``50**200`` nor ``t**200`` need be in range."""
    constant = 10.0**-scale
    value = np.float64(size * sign * 10.0**scale)
    with np.errstate(all="ignore"):
        wanted = HIGH[shape](value, constant, n)
    found, _ = printed(lambda a: HIGH[shape](a, constant, n), value)
    if 1e-250 < abs(wanted) < 1e250:
        assert found == pytest.approx(wanted, rel=4e-16 * (n + 10), abs=0)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7])
@pytest.mark.parametrize("constant", [3.0, 50.0, 0.1, -7.0])
@settings(max_examples=20)
@given(value=st.floats(-100.0, 100.0))
def test_low_powers_stay_within_some_roundings(n, constant, value):
    exact = (Fraction(value) / Fraction(constant)) ** n
    found, _ = printed(lambda a: (a / constant) ** n, value)
    assert found == pytest.approx(float(exact), rel=1e-15 * n, abs=1e-290)


@pytest.mark.parametrize("solver", [Taylor(), DOP853()])
def test_a_high_power_of_a_quotient_in_a_model(solver):
    """As ``t**200`` times a number it would leave the range of floats."""
    system = HybridSystem(
        state=("u", "v", "s"),
        modes=[Mode("rise", lambda t, x, p: ((t / 50) ** 200, (x.s / 50) ** 200, 1.0))],
    )
    arc = simulate(system, (0.0, 0.0, 0.0), (0.0, 50.0), solver=solver)
    assert arc.x[-1] == pytest.approx([50 / 201, 50 / 201, 50.0], rel=1e-9)


def test_the_slope_of_a_high_power():
    assert printed(lambda a: (a / 50) ** 200, 50.0) == (1.0, 4.0)
    assert printed(lambda a: (a / 50) ** -200, 50.0) == (1.0, -4.0)
    assert printed(lambda a: (a / -50) ** 201, 50.0) == (-1.0, pytest.approx(-4.02))
    assert printed(lambda a: (a * 2) ** 5000, 1.0)[0] == inf


@pytest.mark.parametrize(
    "exponent", [lambda q: np.abs(q), lambda q: -q, lambda q: 2 * q, lambda q: -np.abs(q), np.sin]
)
@pytest.mark.parametrize("transform", [lambda system: system, split])
def test_powers_of_zero(exponent, transform):
    """They are 0, 1 or infinite, as the exponent's sign says."""
    field = lambda t, x, p: (1.0 + np.minimum(0.0 ** exponent(x.q), 3.0),)  # noqa: E731
    for start in (-2.5, 0.5):
        system = transform(HybridSystem(state=("q",), modes=[Mode("m", field)]))
        with np.errstate(all="ignore"):
            rate = field(0.0, SimpleNamespace(q=np.float64(start)), None)[0]
        arc = simulate(system, (start,), (0.0, 0.25))
        assert arc.status.ok
        assert arc.x[-1, 0] == pytest.approx(start + 0.25 * rate, rel=1e-14)
