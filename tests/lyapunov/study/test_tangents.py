"""The tangent vector as a state, exponents from it, and the candidates for the paper's figures."""

from types import SimpleNamespace

import numpy as np
import pytest

import models
from hybrid import DOP853, Taylor
from hybrid.system.derivatives import evaluate
from lyapunov.study import tangents
from lyapunov.study.ode23s import Ode23s
from lyapunov.study.paper import DOUBTFUL
from lyapunov.study.runs import STARTS, Settings
from lyapunov.study.tangents import (
    Explanation,
    StraightCandidate,
    candidates,
    straight_candidates,
    uncontrolled_exponents,
    with_tangent,
)

SYSTEM = models.vibroimpact()


def field_of(system, mode, x, **parameters):
    function = system.modes[system.mode_index(mode)].field
    return evaluate(system.variables, function, 0.3, np.array(x), system.parameter_values(parameters))


@pytest.mark.parametrize("mode", ["free", "contact"])
@pytest.mark.parametrize("seed", range(3))
def test_the_vector_obeys_the_jacobian(mode, seed):
    """Against central differences of the field; with ``slip`` one entry lacks its factor."""
    rng, extended = np.random.default_rng(seed), with_tangent(SYSTEM)
    x, u = rng.uniform(-1.0, 1.0, (2, 4))
    x[1] = x[0] + (0.2 if mode == "free" else -0.01)
    found = field_of(extended, mode, [*u, *x])
    np.testing.assert_array_equal(found[4:], field_of(SYSTEM, mode, x))
    ends = [field_of(SYSTEM, mode, x + sign * 1e-7 * u) for sign in (1.0, -1.0)]
    size = np.abs(found[:4]).max()
    np.testing.assert_allclose(found[:4], (ends[0] - ends[1]) / 2e-7, rtol=1e-5, atol=1e-6 * size)
    p = SYSTEM.parameters
    slipped = field_of(extended, mode, [*u, *x], slip=1.0) - found
    wanted = 2 * p["xi2"] * p["omega2"] * (1 - p["m2"] / p["m1"]) * u[3]
    np.testing.assert_allclose(slipped, [0.0, 0.0, wanted, *[0.0] * 5], rtol=1e-6, atol=1e-9)


def test_exponents_outside_the_error_control_are_right_at_a_tight_tolerance():
    found = uncontrolled_exponents(with_tangent(SYSTEM), 7.40, DOP853(rtol=1e-11, atol=1e-11), 60)
    pair, other = -0.05489357, -0.39487603
    assert found.sum() == pytest.approx(2 * (pair + other), abs=1e-6)
    assert found[:2].mean() == pytest.approx(pair, abs=1e-2)
    assert found[2:].mean() == pytest.approx(other, abs=1e-2)


@pytest.mark.parametrize(("periods", "bursts"), [(3, 1), (10, 1), (59, 5), (60, 6)])
def test_growth_outside_the_error_control_is_that_of_ten_periods_at_once(periods, bursts, monkeypatch):
    """The first fifth of the bursts does not count; each goes on where the last one ended."""
    ends = []

    def run(system, x0, t_span, *, mode, parameters, solver, samples):
        assert (system, parameters, solver) == ("extended", {"omega": 4 * np.pi}, "solver")
        assert t_span == (0.0, samples[0]) == (0.0, pytest.approx(5.0))
        burst = len(ends) // 4
        assert (mode, x0[4]) == (("free", STARTS[0].x0[0]) if burst == 0 else ("contact", float(burst)))
        ends.append(x0)
        # Only the first burst grows by another factor.
        growth = np.exp([5.0, 10.0, -5.0, 0.0]) * (7.0 if burst == 0 else 1.0)
        end = np.concatenate([growth * x0[:4], [burst + 1.0, 0.0, 0.0, 0.0]])
        return SimpleNamespace(x=np.array([end]), mode=["contact"])

    monkeypatch.setattr(tangents, "simulate", run)
    found = uncontrolled_exponents("extended", 4 * np.pi, "solver", periods)
    assert len(ends) == 4 * bursts
    first = np.log(7.0) / 5.0 if bursts < 5 else 0.0
    np.testing.assert_allclose(found, np.add([1.0, 2.0, -1.0, 0.0], first), atol=1e-12)


def test_candidates_differ_in_one_thing_each():
    solver = Taylor()
    truth, slip, *loose, third, second = candidates(SYSTEM, solver)
    assert (truth.system, truth.x0, truth.solver, truth.index) == (SYSTEM, STARTS[0].x0, solver, 0)
    assert (slip.parameters, slip.x0) == ({"slip": 1.0}, (0.0, 0.0, 0.0, 0.0, *STARTS[0].x0))
    assert slip.system.state_names[:4] == ("u1", "u2", "w1", "w2")
    assert len(loose) == 10
    assert all(each.solver.rtol == each.solver.atol >= 1e-6 for each in loose)
    assert all(f"{each.solver.rtol:.0e}" in each.text for each in loose)
    assert (third.x0, third.index) == (STARTS[2].x0, 0)
    assert (second.x0, second.index) == (STARTS[0].x0, 1)
    methods = [each.method for each in straight_candidates(SYSTEM)]
    assert methods[0] == Ode23s(1e-3, 1e-6)
    assert len(set(methods)) == 5


def test_the_misfit_is_the_largest_distance_from_the_doubtful_figures():
    (one, first), (two, second) = DOUBTFUL.items()
    assert Explanation("", {one: first + 0.01, two: second - 0.03}).misfit == pytest.approx(0.03)
    assert Explanation("", {one: first - 0.02, two: second, 7.92: 5.0}).misfit == pytest.approx(0.02)
    assert np.isnan(Explanation("", {one: first, 7.92: 5.0}).misfit)


@pytest.mark.parametrize(("intervals", "mean"), [(1000, 249.5), (50, 37.0), (150, 112.0)])
def test_the_first_periods_of_the_paper_s_method_are_left_out(monkeypatch, intervals, mean):
    """Growth rates that count up: a hundred periods are left out, or the first half of a short run."""

    def growths(system, method, omega, start, periods):
        assert start is STARTS[0]
        assert omega == 7.4
        return np.arange(float(periods))

    monkeypatch.setattr(tangents, "growths_from", growths)
    candidate = StraightCandidate("", SYSTEM, Ode23s(), 400)
    assert candidate.exponent(7.4, Settings(intervals=intervals)) == mean


def test_each_candidate_is_computed_at_each_frequency(monkeypatch):
    class Made:
        def __init__(self, text, value):
            self.text, self.value = text, value

        def exponent(self, omega, settings):
            return self.value + omega

    monkeypatch.setattr(tangents, "candidates", lambda system, solver: [Made("a", 0.0), Made("b", 1.0)])
    monkeypatch.setattr(tangents, "straight_candidates", lambda system: [Made("c", 2.0), Made("d", 3.0)])
    found = tangents.explanations(SYSTEM, [10.0, 20.0], Settings())
    assert [(each.text, each.papers_method) for each in found] == [
        ("a", False),
        ("b", False),
        ("c", True),
        ("d", True),
    ]
    assert [each.exponents for each in found] == [{10.0: k + 10.0, 20.0: k + 20.0} for k in range(4)]
