"""The linear form of affine modes: starts, rates and guards, and which modes have none."""

import pytest

from hybrid.compiler.taylor.linear import LARGEST, linear_form
from hybrid.expression.nodes import Symbol
from hybrid.expression.operations import Cos, Sign, Sin
from hybrid.expression.tracing import model_symbols

SYMBOLS = model_symbols(2, 2)
(Q, V), (K, W), T = SYMBOLS.x, SYMBOLS.p, SYMBOLS.t
SINE, COSINE = Sin(W * T), Cos(W * T)
S, C = map(Symbol, "sc")
HARMONICS = {SINE: S, COSINE: C}


def form(field, guards=(), harmonics=None):
    return linear_form(field, guards, HARMONICS if harmonics is None else harmonics, SYMBOLS)


def test_a_driven_oscillator():
    found = form([V, -K * Q - 0.5 * V + 3 * COSINE + 2], [Q - 1 + SINE])
    assert found.starts == [Q, V, SINE, COSINE, 1]
    assert found.rates == [[0, 1, 0, 0, 0], [-K, -0.5, 0, 3, 2], [0, 0, 0, W, 0], [0, 0, -W, 0, 0], [0] * 5]
    assert found.guards == [[1, 0, 1, 0, -1]]
    assert found.trace(2) == -0.5


def test_without_a_drive():
    found = form([V + K, 0 * Q], [V, Q - 2 * V], {})
    assert found.starts == [Q, V, 1]
    assert found.rates == [[0, 1, K], [0, 0, 0], [0, 0, 0]]
    assert found.guards == [[0, 1, 0], [1, -2, 0]]
    assert found.trace(2) == 0


@pytest.mark.parametrize(
    ("field", "guards"),
    [
        ([V, -(Q**2)], []),
        ([V, -Q * V], []),
        ([V, Sign(Q)], []),
        ([V, -Q + T], []),
        ([V, -T * Q], []),
        ([V, SINE * Q], []),
        ([V, -Q], [Q * V]),
        ([V, -Q], [Q - T]),
    ],
)
def test_others_have_none(field, guards):
    assert form(field, guards) is None


@pytest.mark.parametrize(("count", "has_one"), [(LARGEST - 3, True), (LARGEST - 2, False), (LARGEST, False)])
def test_large_tables_do_not_pay(count, has_one):
    drives = [Sin(W * i) for i in range(1, count + 1)]
    harmonics = {drive: Symbol(f"h{i}") for i, drive in enumerate(drives)}
    assert (form([V, -Q], harmonics=harmonics) is not None) == has_one
