"""The follower leaves the cam at the critical speed; orbits with one impact per turn, by a map by hand."""

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

from hybrid import continue_orbit, periodic_orbit, simulate
from models import cam_follower
from models.cam_follower import PARAMETERS, critical_speed

P = PARAMETERS


def on_the_cam(w, t=0.0):
    return {"q": P["a"] * np.cos(w * t), "v": -P["a"] * w * np.sin(w * t)}


class Map:
    """The map from one impact to the next, with the flight of the damped oscillator in closed form."""

    def __init__(self, w, e=P["e"], c=P["c"]):
        self.w, self.e, self.period = w, e, 2 * np.pi / w
        self.decay = c / (2 * P["m"])
        self.own = np.sqrt(P["k"] / P["m"] - self.decay**2)
        self.rest = -P["d"] - P["m"] * P["g"] / P["k"]

    def flight(self, t, q, v):
        """Position and velocity after a time, from those at its start."""
        x = q - self.rest
        b = (v + self.decay * x) / self.own
        cos, sin, fade = np.cos(self.own * t), np.sin(self.own * t), np.exp(-self.decay * t)
        position = fade * (x * cos + b * sin)
        return self.rest + position, -self.decay * position + fade * self.own * (b * cos - x * sin)

    def cam(self, t):
        return P["a"] * np.cos(self.w * t), -P["a"] * self.w * np.sin(self.w * t)

    def __call__(self, z):
        """The next impact, as its time after a whole turn and the relative velocity after it."""
        t0, relative = z
        q, s = self.cam(t0)

        def gap(t):
            return self.flight(t, q, s + relative)[0] - self.cam(t0 + t)[0]

        times = np.linspace(0.02, 2.0, 400) * self.period
        first = next(i for i, t in enumerate(times) if gap(t) < 0.0)
        length = brentq(gap, times[first - 1], times[first], xtol=1e-15, rtol=1e-14)
        hit = self.flight(length, q, s + relative)[1] - self.cam(t0 + length)[1]
        return np.array([t0 + length - self.period, -self.e * hit])

    def fixed_point(self, guess):
        return fsolve(lambda z: self(z) - z, guess, xtol=1e-14)

    def multipliers(self, z):
        steps = np.diag([1e-5 * self.period, 1e-5 * abs(z[1])])
        slopes = [(self(z + h) - self(z - h)) / (2 * h.sum()) for h in steps]
        return np.linalg.eigvals(np.array(slopes).T)


def one_impact_orbit(w):
    system, period = cam_follower(), 2 * np.pi / w
    run = simulate(system, {"q": 0.04, "v": 1.0}, (0.0, 40 * period), parameters={"w": w})
    return periodic_orbit(system, run.x[-1], mode=run.end.mode, parameters={"w": w})


def test_critical_speed_without_damping():
    expected = (P["k"] * (P["d"] + P["a"]) + P["m"] * P["g"]) / (P["m"] * P["a"])
    assert critical_speed({"c": 0.0}) ** 2 == pytest.approx(expected, rel=1e-14)
    assert critical_speed({"c": 20.0}) < critical_speed({"c": 0.0})


@pytest.mark.parametrize("c", [0.0, 2.0, 20.0])
def test_the_follower_stays_below_the_critical_speed_and_jumps_above(c):
    w = critical_speed({"c": c})
    for factor, jumps in ((0.9999, False), (1.0001, True)):
        given = {"w": factor * w, "c": c}
        start = on_the_cam(factor * w)
        arc = simulate(cam_follower(), start, (0.0, 4 * np.pi / w), mode="cam", parameters=given)
        assert ("free" in arc.mode) is jumps


def test_force_of_the_cam():
    w, t = 30.0, np.linspace(0.0, 0.4, 50)
    arc = simulate(cam_follower(), on_the_cam(w), (0.0, 0.4), mode="cam", parameters={"w": w})
    phase = w * arc.t
    expected = P["k"] * P["d"] + P["m"] * P["g"] - P["a"] * P["c"] * w * np.sin(phase)
    expected += P["a"] * (P["k"] - P["m"] * w**2) * np.cos(phase)
    np.testing.assert_allclose(arc["cam.normal"], expected, rtol=1e-9)
    np.testing.assert_allclose(arc(t, "q"), P["a"] * np.cos(w * t), atol=1e-10)


@pytest.mark.parametrize("c", [0.0, 2.0])
def test_a_branch_on_the_cam_ends_at_the_critical_speed(c):
    orbit = periodic_orbit(cam_follower(), on_the_cam(25.0), mode="cam", parameters={"w": 25.0, "c": c})
    branch = continue_orbit(orbit, "w", (10.0, 60.0))
    [lift] = branch.bifurcations
    assert lift.kind == "grazing"
    assert lift.value == pytest.approx(critical_speed({"c": c}), rel=1e-10)


def test_a_branch_of_orbits_that_bounce_and_come_to_rest():
    system, least = cam_follower(), critical_speed()
    turn = 2 * np.pi / (1.1 * least)
    run = simulate(system, {"q": 0.03, "v": 0.0}, (0.0, 20 * turn), parameters={"w": 1.1 * least})
    orbit = periodic_orbit(system, run.x[-1], mode=run.end.mode, t0=run.t[-1], parameters={"w": 1.1 * least})
    branch = continue_orbit(orbit, "w", (1.02 * least, 1.15 * least))
    assert branch.status.ok
    assert branch.parameter[[0, -1]] == pytest.approx([1.02 * least, 1.15 * least])
    assert len(branch.bifurcations) == 0
    for each in (branch.orbit(0), branch.orbit(-1)):
        np.testing.assert_allclose(each.multipliers, 0.0, atol=1e-12)
        assert len(each.arc().jumps["cam opens"]) == 1


def test_an_orbit_with_one_impact_per_turn():
    w = 60.0
    orbit, turn = one_impact_orbit(w), Map(60.0)
    assert orbit.status.ok
    [hit] = orbit.arc().jumps
    assert hit.transition == "free->free by cam"
    relative = hit.x_plus[1] - turn.cam(hit.t)[1]
    expected = turn.fixed_point((hit.t, relative))
    assert (hit.t, relative) == pytest.approx(tuple(expected), abs=1e-10)
    multipliers = np.sort_complex(turn.multipliers(expected))
    np.testing.assert_allclose(np.sort_complex(orbit.multipliers), multipliers, atol=1e-6)
    product = P["e"] ** 2 * np.exp(-P["c"] / P["m"] * turn.period)
    assert np.prod(orbit.multipliers).real == pytest.approx(product, rel=1e-9)


def test_the_period_doubles_where_the_map_says():
    branch = continue_orbit(one_impact_orbit(60.0), "w", (58.0, 80.0))
    flip = branch.of("flip")[0]
    turn = Map(flip.value)
    [hit] = flip.orbit.arc().jumps
    z = turn.fixed_point((hit.t, hit.x_plus[1] - turn.cam(hit.t)[1]))
    assert min(turn.multipliers(z).real) == pytest.approx(-1.0, abs=1e-6)


def test_slower_the_follower_comes_to_rest_on_the_cam_in_each_turn():
    w = 1.1 * critical_speed()
    period = 2 * np.pi / w
    arc = simulate(cam_follower(), {"q": 0.03, "v": 0.0}, (0.0, 20 * period), parameters={"w": w})
    assert arc.status.ok
    np.testing.assert_allclose(arc["cam.gap"][arc.mode == "cam"], 0.0, atol=1e-12)
    lifts = np.array([jump.t for jump in arc.jumps["cam opens"]])
    assert len(lifts) > 15
    assert np.diff(lifts) == pytest.approx(period, rel=1e-9)
