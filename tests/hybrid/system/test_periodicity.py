"""A declared period is a period of every function, or the model is refused."""

from types import SimpleNamespace

import numpy as np
import pytest

import models
from hybrid import (
    ArgumentError,
    Guard,
    HybridSystem,
    Mode,
    ModelError,
    Reset,
    Transition,
    compile_system,
    simulate,
    simulate_many,
)
from hybrid.compiler.emission import emitted_of


def forced(
    period,
    force=lambda t, p: np.cos(p.w * t),
    *,
    guard=lambda t, x, p: x.q - 2,
    when=None,
    reset=lambda t, x, p: (x.q, -x.v),
    state=1.0,
):
    return HybridSystem(
        state=("q", "v"),
        parameters={"w": 1.3},
        modes=[Mode("a", lambda t, x, p: (x.v, -x.q + state * force(t, p)))],
        transitions=[Transition("a", "a", Guard(guard, +1, when=when), Reset(reset), name="wall")],
        period=period,
    )


def right(p):
    return 2 * np.pi / p.w


@pytest.mark.parametrize("harmonic", [1, 2, 40])
@pytest.mark.parametrize("size", [1.0, 1e-12, 1e9])
def test_a_right_period_is_accepted(harmonic, size):
    forced(right, lambda t, p: np.cos(harmonic * p.w * t + 0.3), state=size)
    forced(2 * np.pi / 1.3, lambda t, p: np.cos(harmonic * p.w * t + 0.3), state=size)


@pytest.mark.parametrize(
    "force",
    [
        lambda t, p: np.sign(np.sin(p.w * t)),
        lambda t, p: np.mod(p.w * t / (2 * np.pi), 1.0),
        lambda t, p: np.abs(np.sin(p.w * t / 2)),
        lambda t, p: np.exp(np.cos(p.w * t)) + np.tan(p.w * t / 2) ** 2,
        lambda t, p: np.cos(p.w * t) ** 3 * np.cos(2 * p.w * t),
        lambda t, p: 1.0,
    ],
)
def test_periodic_functions_of_many_kinds(force):
    forced(right, force)


@pytest.mark.parametrize("size", [1.0, 1e4, 1e8])
def test_terms_that_cancel_are_compared_up_to_their_rounding(size):
    """Large terms leave a rounding error, which is not the same one period later."""
    forced(right, lambda t, p: (size + np.cos(p.w * t)) ** 2 - size**2 - 2 * size * np.cos(p.w * t))
    forced(right, lambda t, p: size * np.cos(p.w * t + 0.1) - size * np.cos(p.w * t + 0.1 + 1e-9))
    with pytest.raises(ModelError, match="is not a period"):
        forced(right, lambda t, p: size * np.cos(p.w * t) + 1e-6 * size * np.cos(1.01 * p.w * t))


@pytest.mark.parametrize("period", [4.83, 4.8332, 2 * np.pi / 1.3 * (1 + 1e-9), 2 * np.pi, 1e-3])
def test_a_wrong_period_is_refused_when_the_system_is_made(period):
    with pytest.raises(ModelError, match=r"period = .* is not a period of the functions. Mode 'a': field is"):
        forced(period)


@pytest.mark.parametrize("unit", [1e-15, 1e-6, 1e6, 1e15])
def test_a_wrong_period_is_refused_in_any_units_of_the_rates(unit):
    def of(period):
        return HybridSystem(
            state=("q", "v"),
            parameters={"w": 1.3},
            modes=[Mode("a", lambda t, x, p: (unit * x.v, unit * np.cos(p.w * t)))],
            period=period,
        )

    of(right)
    with pytest.raises(ModelError, match="is not a period of the functions"):
        of(2 * np.pi / 1.3 * (1 + 1e-9))


@pytest.mark.parametrize(
    ("name", "functions"),
    [
        ("guard", {"guard": lambda t, x, p: x.q - 2 - 0.1 * np.sin(t)}),
        ("when", {"when": lambda t, x, p: np.cos(2.9 * t)}),
        ("reset", {"reset": lambda t, x, p: (x.q, -x.v + t)}),
    ],
)
def test_every_function_is_looked_at(name, functions):
    with pytest.raises(ModelError, match=f"Transition 'wall': {name} is"):
        forced(right, **functions)


def test_a_period_that_is_one_at_the_declared_parameters_only():
    system = forced(2 * np.pi / 1.3)
    assert not emitted_of(system).proved_period
    assert simulate(system, (0.0, 0.0), (0.0, 1.0)).status.ok
    assert simulate(system, (0.0, 0.0), (0.0, 1.0), parameters={"w": 2.6}).status.ok
    with pytest.raises(ModelError, match=r"not a period of the functions.*w = 1\.4.*period=lambda p"):
        simulate(system, (0.0, 0.0), (0.0, 1.0), parameters={"w": 1.4})


@pytest.mark.parametrize("model", [models.vibroimpact, models.impact_oscillator, models.stop_oscillator])
def test_the_period_of_the_models_is_proved_once_for_all_parameters(model):
    system = model()
    assert system.period is not None
    compiled = compile_system(system)
    assert compiled.emitted.proved_period
    compiled.model({next(iter(system.parameters)): 0.7})
    assert not compiled.periodic_at


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "period", [lambda p: 2 * np.pi / p.w, lambda p: 6 // int(p.w + 0.5) + 1.0, lambda p: -p.w]
)
def test_default_parameters_without_a_period(period):
    """Defaults may be names with zeros; every run gives its own values."""
    system = HybridSystem(
        state=("q",),
        parameters={"w": 0.0, "a": 1.0},
        modes=[Mode("m", lambda t, x, p: (-p.a * x.q,))],
        period=period,
    )
    one = {"w": -1.0} if period(SimpleNamespace(w=1.0)) < 0 else {"w": 1.0}
    arc = simulate(system, (1.0,), (0.0, 1.0), parameters=one)
    assert arc.x[-1, 0] == pytest.approx(np.exp(-1.0), rel=1e-12)
    assert simulate_many(system, {"q": [1.0]}, (0.0, 1.0), parameters=one).x_end == pytest.approx(
        arc.x[-1, 0]
    )
    for parameters in (None, {}, {"a": 2.0}):
        with pytest.raises(ArgumentError, match="HybridSystem: period"):
            simulate(system, (1.0,), (0.0, 1.0), parameters=parameters)


@pytest.mark.as_given
@pytest.mark.parametrize(
    ("period", "told"),
    [
        (lambda p: p.w - 2.0, r"must be positive; got -1\.0\. Check the parameters"),
        (lambda p: 1e300 / (p.w * 1e-300), "must be finite; got inf"),
        (lambda p: 1 / (p.w - 1), "must be finite; got inf"),
    ],
)
def test_parameters_at_which_the_period_is_none(period, told):
    modes = [Mode("m", lambda t, x, p: (-p.w * x.q,))]
    system = HybridSystem(state=("q",), parameters={"w": 3.0}, modes=modes, period=period)
    with pytest.raises(ArgumentError, match=f"HybridSystem: period {told}"):
        simulate(system, (1.0,), (0.0, 1.0), parameters={"w": 1.0})
