"""Exponents of stiff systems: an implicit solver takes the last one from the sum rule."""

import numpy as np
import pytest

import hybrid
import lyapunov
from hybrid import Guard, HybridSystem, Mode, RadauIIA, Reset, Transition

SOLVER = RadauIIA(rtol=1e-8, atol=1e-10)


def oscillator(wall=False):
    """A driven oscillator, perhaps above a wall, and a component that follows it at a fast rate."""
    hit = Transition(
        "m", "m", Guard(lambda t, x, p: x.q, -1), Reset(lambda t, x, p: {"v": -p.e * x.v}), name="hit"
    )
    return HybridSystem(
        state=("q", "v", "z"),
        parameters={"rate": 1e5, "e": 0.8},
        modes=[
            Mode("m", lambda t, x, p: (x.v, 2 * np.cos(t) - 0.2 * x.v - x.q - wall, -p.rate * (x.z - x.q)))
        ],
        transitions=[hit] if wall else [],
        period=2 * np.pi,
    )


@pytest.mark.parametrize("rate", [1e1, 1e3, 1e5])
def test_a_stiff_direction_takes_no_more_steps_than_the_run(rate):
    given = {"parameters": {"rate": rate}, "solver": SOLVER}
    found = lyapunov.lyapunov_spectrum(oscillator(), (0.5, 0.0, 0.5), intervals=30, transient=5, **given)
    assert found.status.ok
    np.testing.assert_allclose(found.exponents, [-0.1, -0.1, -rate], rtol=1e-2)
    assert found.exponents.sum() == pytest.approx(-0.2 - rate, rel=1e-12)
    run = hybrid.simulate(oscillator(), (0.5, 0.0, 0.5), (0.0, 35 * 2 * np.pi), **given)
    assert found.steps_per_interval * 35 < 2 * run.steps


def test_the_last_exponent_is_that_of_a_carried_vector():
    """Where the rate is moderate, an explicit solver carries all vectors."""
    given = {"parameters": {"rate": 10.0}, "intervals": 30, "transient": 10}
    start = (1.0, 0.0, 1.0)
    explicit = lyapunov.lyapunov_spectrum(oscillator(wall=True), start, **given)
    implicit = lyapunov.lyapunov_spectrum(oscillator(wall=True), start, solver=SOLVER, **given)
    assert explicit.jumps_per_interval == implicit.jumps_per_interval > 0
    assert explicit.exponents[0] < -0.01
    np.testing.assert_allclose(implicit.exponents, explicit.exponents, atol=1e-6)
    np.testing.assert_allclose(implicit.growths, explicit.growths, atol=1e-4)
    np.testing.assert_allclose(implicit.per("hit").exponents, explicit.per("hit").exponents, atol=1e-5)
    # Nothing is left to compare the sum with.
    assert np.isnan(implicit.sum_defect)
    assert abs(explicit.sum_defect) < 1e-9


def test_a_reset_that_annihilates_leaves_minus_infinity():
    forgets = HybridSystem(
        state=("x", "z"),
        parameters={"rate": 1e5},
        modes=[Mode("m", lambda t, x, p: (1.0 - x.x, -p.rate * (x.z - x.x)))],
        transitions=[Transition("m", "m", hybrid.Every(1.0), Reset(lambda t, x, p: {"z": 0.0}))],
    )
    found = lyapunov.lyapunov_spectrum(
        forgets, (0.0, 0.0), interval=1.0, intervals=20, transient=2, solver=SOLVER
    )
    assert found.exponents[0] == pytest.approx(-1.0, rel=1e-6)
    assert found.exponents[1] == -np.inf


def test_rows_of_a_chart_of_a_stiff_system_are_its_spectra():
    rates = np.array([1e2, 1e5])
    short = {"intervals": 10, "transient": 2, "solver": SOLVER}
    chart = lyapunov.chart(oscillator(), {"rate": rates}, (0.5, 0.0, 0.5), k=3, executor=1, **short)
    for i, rate in enumerate(rates):
        row = lyapunov.lyapunov_spectrum(oscillator(), (0.5, 0.0, 0.5), parameters={"rate": rate}, **short)
        np.testing.assert_array_equal(chart.exponents[i], row.exponents)
