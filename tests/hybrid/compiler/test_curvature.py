"""The compiled second derivative of guards along a vector and time."""

import numpy as np
import pytest

from hybrid.compiler.curvature import UNKNOWN, curvature
from hybrid.compiler.llvm.wanted import VECTOR_SIGNATURE
from hybrid.compiler.statements.code import at, put
from hybrid.expression.tracing import model_symbols, trace
from tests.hybrid.code import interpreted

GUARDS = {
    "quadratic": lambda t, x, p: x.a**2 - p.c * x.a * x.b + t * x.b,
    "sine in time": lambda t, x, p: x.a - p.c * np.sin(3.0 * t + x.b),
    "contact": lambda t, x, p: np.maximum(x.a - x.b, 0.0) ** 2.5 - t**3,
    "quotient": lambda t, x, p: np.exp(-x.a * t) / (1.0 + x.b**2) - p.c,
    "choice": lambda t, x, p: np.where(x.a > x.b, x.a**2 * t, x.b) + np.abs(x.b - t**2) * x.a,
    "distance": lambda t, x, p: np.sqrt((x.a - np.cos(t)) ** 2 + x.b**2) - p.c,
}


@pytest.mark.parametrize("name", GUARDS)
def test_curvature(name):
    symbols = model_symbols(2, 1)
    [guard] = trace(GUARDS[name], ("a", "b"), ("c",))
    run = interpreted([((), curvature(guard, False, symbols))], VECTOR_SIGNATURE)
    rng = np.random.default_rng(1)
    for _ in range(5):
        t, x, p, v = rng.uniform(0.2, 1.0), rng.uniform([1.0, 0.1], [2.0, 0.9]), [0.7], rng.normal(size=2)

        def along(s, t=t, x=x, p=p, v=v):
            point = type("State", (), dict(zip("ab", x + s * v, strict=True)))
            return GUARDS[name](t + s, point, type("Parameters", (), {"c": p[0]}))

        out = np.array(v)
        run(0, t, x, np.array(p), out)
        h = 1e-4
        assert out[0] == pytest.approx((along(h) - 2.0 * along(0.0) + along(-h)) / h**2, rel=1e-5, abs=1e-5)


def test_a_difference_is_taken_before_its_multiple():
    """``3 (a - b)`` is exact where ``a = b + u`` and ``u`` is the last bit of 1; ``3 a - 3 b`` is ``4 u``."""
    symbols = model_symbols(2, 0)
    [guard] = trace(lambda t, x, p: 1.5 * (x.a - x.b) * t**2, ("a", "b"), ())
    u = np.finfo(float).eps
    out = np.zeros(2)
    run = interpreted([((), curvature(guard, False, symbols))], VECTOR_SIGNATURE)
    run(0, 0.7, np.array([1.0 + u, 1.0]), np.zeros(0), out)
    assert out[0] == 3.0 * u


def test_affine_guards_have_none_and_opaque_ones_an_unknown_one():
    symbols = model_symbols(2, 0)
    assert curvature(symbols.x[0], True, symbols) == [put(at("out", 0), 0.0)]
    assert curvature(None, False, symbols) == UNKNOWN
