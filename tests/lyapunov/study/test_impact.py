"""One impact by several methods: what is right in each, and what the exponents follow from."""

from types import SimpleNamespace

import numpy as np
import pytest

import models
from hybrid import simulate
from lyapunov.study import impact as study
from lyapunov.study.impact import (
    LAG,
    Measured,
    by_library,
    by_ode23s,
    by_straight_dop853,
    by_uncontrolled_dop853,
    impacts,
    measure,
)
from lyapunov.study.ode23s import Ode23s
from lyapunov.study.runs import STARTS

EXACT = (-0.05489357, -0.05489357, -0.39487603, -0.39487603)
PAPERS = Ode23s(1e-6, 1e-7)


@pytest.fixture(scope="module")
def windows():
    return impacts(models.vibroimpact(), 7.40, leads=(0.1, 0.25, 0.4))


def test_the_exact_map_gives_the_floquet_exponents(windows):
    for impact in windows:
        found = measure(impact, lambda impact: (impact.end, impact.after @ impact.contact @ impact.before))
        np.testing.assert_allclose(found.predicted_exponents(), EXACT, atol=1e-7)
        assert abs(found.map_error) < 1e-10


def test_an_elastic_impact_reverses_gap_and_rate_and_shears(windows):
    relative = windows[0].relative(windows[0].contact)
    np.testing.assert_allclose(relative, [[-1.0, 0.0], [-4.891, -1.0]], atol=1e-3)
    # Halfway the rate is a thousand times as large as what remains of it.
    assert windows[0].halfway()[1, 0] == pytest.approx(-4679.0, abs=1.0)


def test_the_map_of_the_gap_of_two_masses():
    """With the center of mass at rest, ``x1 = m2 gap / M`` and ``x2 = -m1 gap / M``, and so the speeds."""
    made = SimpleNamespace(system=SimpleNamespace(parameters={"m1": 1.0, "m2": 3.0}))
    contact = np.arange(16.0).reshape(4, 4) ** 2
    parts = np.array([[0.75, 0.0], [-0.25, 0.0], [0.0, 0.75], [0.0, -0.25]])
    expected = np.array([contact[0] - contact[1], contact[2] - contact[3]]) @ parts
    np.testing.assert_allclose(study.Impact.relative(made, contact), expected, rtol=1e-15)


def test_ode23s_errs_in_the_shear_alone(windows):
    for impact in windows:
        found = measure(impact, by_ode23s(PAPERS))
        assert found.map_error > 0.02
        assert abs(found.restitution_error) < 1e-5
        assert abs(found.volume_error) < 1e-5
        error = impact.relative(found.contact) - impact.relative(impact.contact)
        assert 0.1 < error[1, 0] < 0.2
        error[1, 0] = 0.0
        assert np.abs(error).max() < 1e-4


def test_the_measured_map_predicts_the_exponents_of_a_long_run(windows):
    predicted = np.mean([measure(each, by_ode23s(PAPERS)).predicted_exponents() for each in windows], axis=0)
    growths = PAPERS.growths(models.vibroimpact(), STARTS[0].x0, omega=7.40, k=4, periods=240, transient=60)
    assert predicted[0] == pytest.approx(-0.068, abs=5e-4)
    assert growths.mean(axis=0)[:2].mean() == pytest.approx(predicted[0], abs=1.5e-3)
    assert predicted.sum() == pytest.approx(sum(EXACT), abs=1e-4)


def test_one_vector_at_a_time_is_a_little_better_or_worse(windows):
    one = measure(windows[0], by_ode23s(PAPERS, at_once=1))
    four = measure(windows[0], by_ode23s(PAPERS, at_once=4))
    assert one.map_error == pytest.approx(four.map_error, rel=0.3)
    assert one.map_error != four.map_error


def test_controlled_tangents_at_events_are_right_and_uncontrolled_ones_are_not(windows):
    assert measure(windows[0], by_library(1e-6)).map_error < 1e-5
    assert measure(windows[0], by_uncontrolled_dop853(1e-6)).map_error == pytest.approx(2.39, abs=0.02)
    assert measure(windows[0], by_straight_dop853(1e-8)).map_error < 1e-3


@pytest.mark.parametrize("carry", [by_library(1e-6), by_uncontrolled_dop853(1e-6), by_straight_dop853(1e-8)])
def test_methods_arrive_where_the_exact_run_does(windows, carry):
    found = measure(windows[0], carry)
    np.testing.assert_allclose(found.end, windows[0].end, rtol=1e-4, atol=1e-7)
    assert abs(found.restitution_error) < 1e-4


@pytest.mark.parametrize(("omega", "touch"), [(7.40, 2.010243718), (7.50, 2.057722819), (7.60, 4.115301816)])
def test_the_first_impact_with_free_flights_around_it(omega, touch):
    """The window has one contact, ``lead`` after its start, and ends ``LAG`` after the release."""
    system, period = models.vibroimpact(), 2 * np.pi / omega
    for lead, impact in zip((0.05, 0.3), impacts(system, omega, leads=(0.05, 0.3)), strict=True):
        assert impact.t_impact / period == pytest.approx(touch, abs=1e-6)
        begin, end = impact.t_span
        assert impact.t_impact - begin == pytest.approx(lead * period, rel=1e-9)
        assert end - impact.t_release == pytest.approx(LAG * period, rel=1e-9)
        run = simulate(
            system, impact.x, impact.t_span, mode="free", parameters={"omega": omega}, solver=study.EXACT,
            tangent=np.eye(4),
        )  # fmt: skip
        assert [jump.transition for jump in run.jumps] == ["impact", "release"]
        np.testing.assert_allclose(run.jumps.t, [impact.t_impact, impact.t_release], atol=1e-11)
        np.testing.assert_allclose(run.x[-1], impact.end, atol=1e-9)
        np.testing.assert_allclose(run.jumps[0].x_minus, impact.x_impact, atol=1e-9)
        whole = impact.after @ impact.contact @ impact.before
        np.testing.assert_allclose(run.fundamental, whole, rtol=1e-4, atol=1e-4 * np.abs(whole).max())
        rest = simulate(
            system, impact.end, (end, begin + period), mode="free", parameters={"omega": omega},
            solver=study.EXACT, tangent=np.eye(4),
        )  # fmt: skip
        np.testing.assert_allclose(impact.rest_of_the_period, rest.fundamental, atol=1e-9)


def test_no_impact_with_so_long_flights():
    with pytest.raises(ValueError, match=r"no impact with free flights around it at omega = 7.4"):
        impacts(models.vibroimpact(), 7.40, leads=(0.99,))


def test_errors_are_relative_and_have_signs(windows):
    impact = windows[0]
    end = impact.end.copy()
    end[2:] *= 1.01
    found = Measured(impact, end, 0.9 * impact.contact)
    assert found.restitution_error == pytest.approx(0.01, rel=1e-9)
    assert found.map_error == pytest.approx(0.1, rel=1e-9)
    assert found.volume_error == pytest.approx(0.9**4 - 1, rel=1e-6)
