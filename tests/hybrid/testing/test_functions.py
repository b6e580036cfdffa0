"""Compiled functions against Python's, and functions one period later."""

import numpy as np
import pytest

import hybrid
from hybrid import HybridSystem, Mode
from hybrid.testing import Case, PropertyError, check_system, functions

SWING = hybrid.HybridSystem(
    state=("q", "v"),
    parameters={"a": 0.5, "w": 2.0},
    modes=[hybrid.Mode("m", lambda t, x, p: (x.v, p.a * np.sin(p.w * t) - x.q))],
    transitions=[hybrid.Transition("m", "m", hybrid.Guard(lambda t, x, p: x.q - 1.0), name="wall")],
    period=lambda p: 2 * np.pi / p.w,
)


@pytest.mark.parametrize(("t0", "phase"), [(0.25, 0.25), (7.0, 7.0 % np.pi), (-1.0, np.pi - 1.0)])
def test_functions_are_compared_at_the_phase_of_the_start(t0, phase, monkeypatch):
    """A start far from zero has rounding of its own in the time."""
    asked = []

    def asked_for(variables, function, t, x, values, period):
        asked.append((function.owner, t, x.tolist(), values.tolist(), period))

    monkeypatch.setattr(functions, "period_fault_at", asked_for)
    functions.check_period(Case(SWING, {"a": 0.25, "w": 2.0}, "m", (0.5, -1.0), t0, t0 + 1.0))
    assert asked == [
        (each, phase, [0.5, -1.0], [0.25, 2.0], np.pi) for each in ("Mode 'm'", "Transition 'wall'")
    ]


def test_a_fault_is_told(monkeypatch):
    monkeypatch.setattr(functions, "period_fault_at", lambda *given: "one period later it differs")
    with pytest.raises(hybrid.testing.PropertyError, match="one period later it differs"):
        functions.check_period(Case(SWING, {"a": 0.25, "w": 2.0}, "m", (0.5, -1.0), 0.0, 1.0))


def test_compiled_functions_are_compared_at_the_start(monkeypatch):
    asked = []

    def disagreement(compiled, function, index, t, x, values, value):
        asked.append((compiled is hybrid.compile_system(SWING), index, t, x.tolist(), values.tolist()))
        return "it is 2, not 3" if len(asked) == 3 else None

    monkeypatch.setattr(functions, "disagreement", disagreement)
    case = Case(SWING, {"a": 0.25, "w": 2.0}, "m", (0.5, -1.0), 7.0, 8.0)
    functions.check_compiled(case)
    assert asked == [(True, 0, 7.0, [0.5, -1.0], [0.25, 2.0])] * 2
    with pytest.raises(hybrid.testing.PropertyError, match="it is 2, not 3"):
        functions.check_compiled(case)


def forced(period, force=lambda t, x, p: np.cos(p.w * t)):
    return HybridSystem(
        state=("q", "v"),
        parameters={"w": 2.0},
        modes=[Mode("free", lambda t, x, p: (x.v, force(t, x, p) - x.q))],
        period=period,
    )


@pytest.mark.parametrize(("factor", "part"), [(2, 2), (3, 3), (6, 2)])
def test_a_part_of_the_period_is_a_period(factor, part):
    message = rf"every function has the period .*, too\n  likely: a factor {part} in period="
    with pytest.raises(PropertyError, match=message):
        check_system(forced(lambda p: factor * 2 * np.pi / p.w), examples=3)


def test_a_pulse_needs_its_whole_period():
    pulse = forced(1.0, lambda t, x, p: np.where(np.mod(t, 1.0) < 0.1, p.w, 0.0))
    check_system(pulse, examples=3)


def test_a_period_of_what_does_not_depend_on_time():
    with pytest.raises(PropertyError, match="a period is declared, and no function reads t"):
        check_system(forced(1.0, lambda t, x, p: p.w), examples=3)


def test_forcing_without_amplitude_is_no_fault():
    check_system(forced(lambda p: 4 * np.pi / p.w, lambda t, x, p: 0.0 * np.cos(p.w * t)), examples=3)
