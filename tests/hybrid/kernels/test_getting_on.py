"""Runs whose steps lead nowhere end soon, and the status says what helps; short steps that get on go on."""

import numpy as np
import pytest

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    Reset,
    StatusCode,
    Taylor,
    Transition,
    Tsit5,
    simulate,
)

METHODS = [Taylor(max_steps=200_000), DOP853(max_steps=200_000), Tsit5(max_steps=200_000)]


def plain(state, field, *transitions):
    return HybridSystem(state=state, modes=[Mode("m", field)], transitions=transitions)


@pytest.mark.parametrize("solver", METHODS)
def test_dry_friction_in_a_plain_mode(solver):
    block = plain(("x", "v"), lambda t, x, p: (x.v, 0.5 * np.cos(t) - np.sign(x.v)))
    arc = simulate(block, (0.0, 1.0), (0.0, 10.0), solver=solver)
    assert arc.status.code == StatusCode.STEP_TOO_SMALL
    assert "sign" in arc.status.message
    assert "hybrid.split" in arc.status.remedy
    assert arc.t[-1] == pytest.approx(1.4987011, abs=1e-4)


@pytest.mark.parametrize("solver", METHODS)
def test_isotropic_friction_that_stops(solver):
    def field(t, x, p):
        speed = np.hypot(x.u, x.v)
        return -x.u / speed, -x.v / speed

    arc = simulate(plain(("u", "v"), field), (0.3, 0.4), (0.0, 10.0), solver=solver)
    assert arc.status.code in (StatusCode.STEP_TOO_SMALL, StatusCode.NON_FINITE)
    assert arc.t[-1] == pytest.approx(0.5, abs=1e-4)


def test_an_infinite_slope():
    level = plain(("d",), lambda t, x, p: (-np.cbrt(x.d),))
    arc = simulate(level, (1.0,), (0.0, 10.0), solver=Taylor(max_steps=200_000))
    assert arc.status.code == StatusCode.STEP_TOO_SMALL
    assert "cbrt" in arc.status.message
    assert arc.t[-1] == pytest.approx(1.5, abs=1e-2)


@pytest.mark.parametrize("solver", [*METHODS, RadauIIA()])
def test_a_solution_that_grows_without_bound(solver):
    guard = Transition("m", "m", Guard(lambda t, x, p: x.q, -1), Reset(lambda t, x, p: (1.0,)))
    arc = simulate(plain(("q",), lambda t, x, p: (x.q**2,), guard), (1.0,), (0.0, 3.0), solver=solver)
    assert not arc.status.ok
    assert "grows without bound at t = " in arc.status.message
    assert arc.t[-1] == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("solver", [*METHODS, RadauIIA()])
def test_spikes_faster_than_the_rounding_of_the_time(solver):
    """An adaptive exponential neuron: its voltage would be infinite 1e-16 ms after the guard."""
    neuron = plain(
        ("V", "w"),
        lambda t, x, p: (
            (-30.0 * (x.V + 70.6) + 60.0 * np.exp((x.V + 50.4) / 2.0) - x.w + 1000.0) / 281.0,
            (4.0 * (x.V + 70.6) - x.w) / 144.0,
        ),
        Transition(
            "m", "m", Guard(lambda t, x, p: x.V - 20.0, +1), Reset(lambda t, x, p: (-60.0, x.w + 80.5))
        ),
    )
    arc = simulate(neuron, (-70.6, 0.0), (0.0, 400.0), solver=solver)
    assert arc.status.ok
    assert len(arc.jumps) == 15
    assert arc.x[-1] == pytest.approx([-54.396073, 417.899307], abs=1e-5)


def test_a_stiff_mode_gets_on():
    stiff = plain(("q",), lambda t, x, p: (-1e5 * (x.q - 1.0),))
    arc = simulate(stiff, (2.0,), (0.0, 1.0), solver=Tsit5(), samples=[1.0])
    assert arc.status.ok
    assert arc.x[-1] == pytest.approx([1.0], abs=1e-9)


def test_a_long_run_gets_on():
    pendulum = plain(("q", "v"), lambda t, x, p: (x.v, -np.sin(x.q)))
    arc = simulate(pendulum, (1.0, 0.0), (0.0, 1e12), solver=Tsit5(max_steps=30_000), samples=[1e12])
    assert arc.status.code == StatusCode.MAX_STEPS
