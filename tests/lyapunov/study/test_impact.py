"""One impact by several methods: what is right in each, and what the exponents follow from."""

import numpy as np
import pytest

import models
from lyapunov.study.impact import (
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
    assert measure(windows[0], by_uncontrolled_dop853(1e-6)).map_error > 0.1
    assert measure(windows[0], by_straight_dop853(1e-8)).map_error < 1e-3
