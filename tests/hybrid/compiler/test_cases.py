"""Functions of an index as text, and stages of a growing system that share their cases."""

import numpy as np
import pytest

from hybrid import from_equations, simulate
from hybrid.compiler.cases import cases_of, function_of_index
from hybrid.compiler.llvm import functions

BODIES = [["out[0] = 1.0"], ["for i in range(2):", "    out[i] = x[i]"], [], ["out[0] = 1.0"]]


def test_indices_with_equal_statements_share_a_case():
    text = function_of_index("field", BODIES) + "\n\n" + function_of_index("reset", [])
    assert cases_of(text, "field") == [
        ((0, 3), ("out[0] = 1.0",)),
        ((1,), ("for i in range(2):", "    out[i] = x[i]")),
    ]
    assert cases_of(text, "reset") == []


def chain(blocks):
    """Blocks in a row on springs, each with dry friction: 3^n modes, of which a run visits a few."""

    def rates(t, x, p):
        q, v = x[:blocks], x[blocks:]
        padded = np.concatenate([[0.0], q, [0.0]])
        force = padded[:-2] + padded[2:] - 2.2 * q + p.A * np.cos(0.8 * t + 0.3 * np.arange(blocks))
        return np.concatenate([v, force - p.mu * np.sign(v)])

    return from_equations(rates, state=2 * blocks, parameters={"A": 1.0, "mu": 0.3}, period=2 * np.pi / 0.8)


def test_stages_compile_each_case_once(monkeypatch):
    """A stage takes what earlier stages have compiled, and its orbit is that of the whole system."""
    compiled = []
    whole = functions.shared_functions

    def noted(source, names):
        stems = [name.partition(functions.CASE)[0] for name in names]
        compiled.extend((stem, *cases_of_one(source, name)) for stem, name in zip(stems, names, strict=True))
        return whole(source, names)

    monkeypatch.setattr(functions, "shared_functions", noted)
    system = chain(3)
    arc = simulate(system, [0.1, 0.3, 0.5, 1.1, 0.1, -0.9], (0.0, 12.0))
    assert arc.status.ok
    assert len(arc.system.modes) > len(system.modes)
    assert len(compiled) == len(set(compiled)) > 0
    # An independent check of the last stage: the energy that the forces and the friction account for.
    t = np.linspace(0.0, 12.0, 20001)
    q, v = np.split(arc(t), 2, axis=1)
    power = (v * np.cos(0.8 * t[:, None] + 0.3 * np.arange(3))).sum(1) - 0.3 * np.abs(v).sum(1)
    padded = np.pad(q, ((0, 0), (1, 1)))
    energy = (v**2).sum(1) / 2 + (np.diff(padded, axis=1) ** 2).sum(1) / 2 + 0.1 * (q**2).sum(1)
    worked = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2 * np.diff(t))])
    assert energy - energy[0] == pytest.approx(worked, abs=2e-6)


def cases_of_one(source, name):
    """The statements of a function with one case for all indices."""
    lines = source.split(f"def {name}(", 1)[1].split("\n\n", 1)[0].splitlines()[1:]
    return tuple(lines)
