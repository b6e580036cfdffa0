"""Attractors that are known exactly: equilibria, orbits, a torus, chaos."""

import numpy as np
import pytest

import hybrid
import models
from hybrid import Guard, HybridSystem, Mode, StatusCode
from models.one_impact import one_impact_orbits
from tests.lyapunov.clocked import clocked


def double_well(**options):
    return HybridSystem(
        state=("x",),
        parameters={"h": 0.0},
        modes=[Mode("roll", lambda t, x, p: (p.h + x.x - x.x**3,))],
        **options,
    )


def test_two_equilibria():
    found = hybrid.attractors(double_well(), {"x": (-2.0, 3.0)}, starts=40)
    assert found.status.ok
    assert list(found) == [1, 2]
    for label, place in ((1, -1.0), (2, 1.0)):
        each = found[label]
        assert (each.kind, each.round, each.jumps) == ("equilibrium", 1, 0.0)
        np.testing.assert_allclose(each.points, [[place]], atol=1e-6)
        np.testing.assert_allclose(each.exponents, [-2.0], atol=1e-5)


def test_a_start_on_an_unstable_equilibrium_leads_to_no_attractor():
    found = hybrid.attractors(double_well(), {"x": 0.0}, starts=3)
    assert len(found) == 0
    assert found.status.code == StatusCode.NOT_CONVERGED
    assert "periods=" in found.status.remedy


def test_an_orbit_with_impacts_in_closed_form():
    [closed] = one_impact_orbits(k=1.0, c=0.1, A=1.0, w=1.0, d=1.0, r=0.8)
    found = hybrid.attractors(models.impact_oscillator(), {"x": (-4.0, 1.0), "v": (-4.0, 4.0)}, starts=60)
    [orbit] = found.values()
    assert (orbit.kind, orbit.round, orbit.jumps) == ("periodic", 1, 1.0)
    assert orbit.period == pytest.approx(2 * np.pi)
    exact = np.log(np.abs(closed.multipliers)) / (2 * np.pi)
    np.testing.assert_allclose(orbit.exponents, exact, atol=1e-6)
    assert orbit.mode.tolist() == ["flight"]


@pytest.mark.parametrize(("mu", "count"), [(2.8, 1), (3.2, 2), (3.5, 4), (3.83, 3)])
def test_periods_of_the_logistic_map(mu, count):
    system = clocked(("x",), lambda t, x, p: (p.mu * x.x * (1 - x.x),), parameters={"mu": mu})
    found = hybrid.attractors(system, {"x": (0.1, 0.9), "tau": 0.5}, interval=1.0, starts=20)
    [orbit] = found.values()
    assert (orbit.kind, orbit.round, orbit.jumps) == ("periodic", count, count)
    x = orbit.points[:, 0]
    assert x[0] == x.min()
    np.testing.assert_allclose(np.roll(x, -1), mu * x * (1 - x), atol=1e-8)
    rate = np.mean(np.log(np.abs(mu * (1 - 2 * x))))
    np.testing.assert_allclose(orbit.exponents, [0.0, rate], atol=1e-4)


def test_chaos():
    system = clocked(("x",), lambda t, x, p: (p.mu * x.x * (1 - x.x),), parameters={"mu": 4.0})
    found = hybrid.attractors(system, {"x": (0.1, 0.9), "tau": 0.5}, interval=1.0, starts=20)
    [chaos] = found.values()
    assert (chaos.kind, chaos.round, chaos.jumps) == ("chaotic", 0, 1.0)
    assert np.isnan(chaos.period)
    assert abs(chaos.exponents[0] - np.log(2)) < 4 * chaos.standard_error[0] + 1e-3
    assert abs(chaos.exponents[1]) < 1e-4
    assert len(chaos.points) >= 1000


def test_a_limit_cycle_on_a_section():
    """The other exponent of a planar cycle is the mean divergence, here -1.0594 (mu = 1)."""
    system = HybridSystem(
        state=("x", "y"), modes=[Mode("turn", lambda t, x, p: (x.y, (1 - x.x**2) * x.y - x.x))]
    )
    given = {"x": (-3.0, 3.0), "y": (-3.0, 3.0)}
    [cycle] = hybrid.attractors(system, given, section=Guard(lambda t, x, p: x.y, -1), starts=30).values()
    assert (cycle.kind, cycle.round, cycle.jumps) == ("periodic", 1, 0.0)
    assert cycle.period == pytest.approx(6.6632869, abs=1e-6)
    np.testing.assert_allclose(cycle.points, [[2.0086, 0.0]], atol=1e-4)
    np.testing.assert_allclose(cycle.exponents, [0.0, -1.0594], atol=1e-4)
    [by_time] = hybrid.attractors(system, given, starts=10).values()
    assert (by_time.kind, by_time.round, by_time.jumps) == ("periodic", 0, 0.0)
    assert by_time.period == pytest.approx(cycle.period, abs=1e-6)
    np.testing.assert_allclose(by_time.exponents, cycle.exponents, atol=1e-6)


def test_a_torus():
    """Two clocks of incommensurate frequencies, of which the section sees one."""
    system = HybridSystem(
        state=("x", "y"),
        modes=[
            Mode(
                "turn",
                lambda t, x, p: (
                    x.x - p.w * x.y - x.x * (x.x**2 + x.y**2) + 0.01 * np.cos(t),
                    p.w * x.x + x.y - x.y * (x.x**2 + x.y**2),
                ),
            )
        ],
        parameters={"w": np.sqrt(2) / 3},
        period=2 * np.pi,
    )
    [torus] = hybrid.attractors(system, {"x": (-2.0, 2.0), "y": (0.1, 1.0)}, starts=10).values()
    assert torus.kind == "torus"
    assert abs(torus.exponents[0]) <= 2 * torus.standard_error[0]
    assert torus.exponents[1] == pytest.approx(-2.0, abs=0.02)
    np.testing.assert_allclose(np.hypot(*torus.points.T), 1.0, atol=0.02)


def test_runs_that_end_lead_nowhere():
    found = hybrid.attractors(models.bouncing_ball(), {"q": (0.5, 1.0), "v": 0.0}, interval=0.5, starts=5)
    assert len(found) == 0
    assert found.status.ok
    assert "The runs of 5 of 5 starts end" in found.status.message


def test_starts_that_take_longer_than_they_may_make_no_second_attractor():
    """At this amplitude chaos is a transient of some thousand periods, of an orbit of four."""
    found = hybrid.attractors(
        models.impact_oscillator(),
        {"x": (-4.0, 1.0), "v": (-4.0, 4.0)},
        parameters={"w": 2.6, "A": 4.95},
        starts=60,
        periods=300,
    )
    assert [each.round for each in found.values() if each.kind == "periodic"].count(4) == 1
    assert found.status.code == StatusCode.NOT_CONVERGED


def test_what_comes_back():
    found = hybrid.attractors(double_well(units={"x": "m"}), {"x": (-2.0, 3.0)}, starts=40)
    assert repr(found).startswith("<2 attractors, SUCCESS")
    assert "equilibrium" in found._repr_html_()
    labelled = found.to_xarray()
    assert labelled.kind.values.tolist() == ["equilibrium", "equilibrium"]
    assert labelled.points.attrs["units"] == "m"
    with pytest.raises(KeyError):
        found[3]
    none = hybrid.attractors(double_well(), {"x": 0.0}, starts=1)
    assert none.to_xarray().sizes["attractor"] == 0


def test_what_is_missing_is_told():
    with pytest.raises(hybrid.ArgumentError, match=r"it lacks v. Give a number to start all runs there."):
        hybrid.attractors(models.impact_oscillator(), {"x": (0.0, 1.0)})
    with pytest.raises(hybrid.ArgumentError, match=r"interval must be None here; got 1.0: points are taken"):
        hybrid.attractors(models.impact_oscillator(), {"x": 0.0, "v": 0.0}, interval=1.0)
