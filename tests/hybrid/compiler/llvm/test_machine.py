"""Long functions are emitted in haste, and compute the same."""

import numpy as np
import pytest

from hybrid.compiler.llvm import machine
from hybrid.compiler.llvm.engine import HASTE, SPEED, target
from hybrid.compiler.llvm.wanted import VECTOR_SIGNATURE
from hybrid.compiler.statements.code import at, call, get, put
from tests.hybrid.code import both


@pytest.mark.parametrize("longest", [100, 10**9])
def test_long_functions_are_emitted_in_haste_and_compute_the_same(monkeypatch, longest):
    levels = []
    monkeypatch.setattr(machine, "LONG", longest)
    monkeypatch.setattr(machine, "target", lambda level=SPEED: levels.append(level) or target(level))
    size = 60
    x, y = [at("x", i) for i in range(size)], [get(f"y{i}") for i in range(size)]
    body = [put(y[i], x[i] * x[(7 * i + 3) % size] / (1.0 + x[i] * x[i])) for i in range(size)]
    body += [put(at("out", i), y[i] - y[(11 * i + 5) % size] * call("sqrt", x[i])) for i in range(size)]
    found = []
    for run in both(body, kind=VECTOR_SIGNATURE):
        out = np.zeros(size)
        run(0, 0.25, np.linspace(0.2, 1.5, size), np.array([0.3]), out)
        found.append(out)
    np.testing.assert_array_equal(*found)
    assert (HASTE in levels) == (longest == 100)
