"""Contacts that close, hold and open: times and forces in closed form."""

import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hybrid
from hybrid import Contact, mechanics, simulate
from lyapunov import lyapunov_spectrum
from tests.hybrid.transform.contacts.scenes import A, G, K, ball, bead, beam, track


class TestBall:
    def test_comes_to_rest_when_the_bounces_are_over(self):
        arc = simulate(ball(), (1.0, 0.0), (0.0, 3.0))
        first = np.sqrt(2.0 / G)
        assert arc.status.ok
        assert arc.jumps[0].t == pytest.approx(first, abs=1e-13)
        assert arc.jumps[-1].t == pytest.approx(3.0 * first, abs=1e-12)
        assert arc.mode[-1] == "floor"
        assert arc["floor.normal"][-1] == pytest.approx(G, abs=1e-12)
        np.testing.assert_allclose(arc.x[-1], 0.0, atol=1e-15)

    def test_stays_at_once_without_restitution(self):
        arc = simulate(ball(restitution=0.0), (1.0, 0.0), (0.0, 3.0))
        assert [str(each) for each in arc.jumps.transition] == ["free->floor by floor"]

    @pytest.mark.parametrize("e", [0.0, 0.9])
    def test_one_system_serves_every_restitution(self, e):
        system = ball()
        for value in (0.0, 0.9, e):
            arc = simulate(system, (1.0, 0.0), (0.0, 0.6), parameters={"e": value})
            bounced = value * np.sqrt(2.0 * G)
            assert arc.jumps["floor"][0].x_plus[1] == pytest.approx(bounced, abs=1e-12)

    def test_starts_at_rest_and_stays(self):
        arc = simulate(ball(), (0.0, 0.0), (0.0, 2.0))
        assert set(arc.mode) == {"floor"}
        assert len(arc.jumps) == 0

    def test_an_impact_at_the_very_start(self):
        arc = simulate(ball(), (0.0, -2.0), (0.0, 0.1))
        assert len(arc.jumps) == len(arc.jumps["floor"]) == 1
        assert arc.jumps[0].x_plus[1] == pytest.approx(1.0)

    def test_outputs_by_mode(self):
        arc = simulate(ball(), (1.0, 0.0), (0.0, 0.2))
        assert set(arc["floor.normal"]) == {0.0}
        np.testing.assert_allclose(arc["floor.gap"], arc["y"])


@pytest.fixture(scope="module")
def table():
    return mechanics(
        coordinates=("y",),
        velocities=("v",),
        parameters={"A": 0.1, "omega": 15.0},
        period=lambda p: 2.0 * np.pi / p.omega,
        mass=lambda t, x, p: (1.0,),
        forces=lambda t, x, p: (-G,),
        contacts=[Contact("table", gap=lambda t, x, p: x.y - p.A * np.sin(p.omega * t))],
    )


def height(t, x, p):
    return x.y


def one(t, x, p):
    return (1.0,)


def weight(t, x, p):
    return (-G,)


def portable(**given):
    """A ball made of functions that can be imported, which can be pickled."""
    floor = Contact("floor", gap=height, restitution=0.5)
    return mechanics(
        coordinates=("y",), velocities=("v",), mass=one, forces=weight, contacts=[floor], **given
    )


class TestSystem:
    @pytest.mark.as_given
    def test_is_pickled_with_what_it_needs(self):
        system = portable()
        arc = simulate(system, (1.0, 0.0), (0.0, 3.0))
        for each in (system, arc.system):
            again = simulate(pickle.loads(pickle.dumps(each)), (1.0, 0.0), (0.0, 3.0))
            assert again.mode[-1] == "floor"
            assert again.jumps[-1].t == pytest.approx(arc.jumps[-1].t, abs=1e-13)
        end = pickle.loads(pickle.dumps(arc)).end
        assert set(simulate(portable(), end, (end.t, 4.0)).mode) == {"floor"}

    def test_a_start_that_the_system_names(self):
        assert set(simulate(portable(start="floor"), (0.0, 0.0), (0.0, 1.0)).mode) == {"floor"}
        with pytest.raises(hybrid.ModelError, match="start mode 'ceiling'"):
            portable(start="ceiling")

    def test_a_start_with_a_negative_gap(self):
        with pytest.raises(hybrid.ArgumentError, match=r"gap of contact 'floor' is -0\.1"):
            simulate(portable(), (-0.1, 0.0), (0.0, 1.0))

    @pytest.mark.parametrize("gap", [-1e-17, -5e-10, 0.0, 5e-10])
    def test_a_gap_that_is_closed_up_to_rounding(self, gap):
        arc = simulate(portable(), (gap, -1.0), (0.0, 0.05))
        assert len(arc.jumps["floor"]) == 1
        assert arc["v"][-1] == pytest.approx(0.5 - 0.05 * G, abs=1e-6)

    def test_a_mode_that_holds_an_open_contact(self):
        with pytest.raises(hybrid.ArgumentError, match="holds it closed"):
            simulate(portable(), (1.0, 0.0), (0.0, 1.0), mode="floor")

    def test_coefficients_out_of_range(self):
        with pytest.raises(hybrid.ArgumentError, match="restitution must be between 0 and 1"):
            simulate(ball(), (1.0, 0.0), (0.0, 1.0), parameters={"e": 1.5})

    def test_coefficients_out_of_range_by_rounding(self):
        arc = simulate(ball(), (1.0, 0.0), (0.0, 1.0), parameters={"e": np.nextafter(1.0, 2.0)})
        assert arc.status.ok
        [bounce] = arc.jumps["floor"]
        assert bounce.x_plus[1] == pytest.approx(-bounce.x_minus[1], rel=1e-12)

    @pytest.mark.parametrize("name", ["free", "settles", "a sticks", "a,b", "a+b", ""])
    def test_names_that_modes_have(self, name):
        with pytest.raises(hybrid.ModelError, match="Contact: name"):
            Contact(name, gap=height)

    def test_many_runs_and_orbits(self):
        """A ball on a table: the runs of a crew, and an orbit of one impact a period."""
        system = mechanics(
            coordinates=("y",),
            velocities=("v",),
            parameters={"A": 0.02, "omega": 25.0, "e": 0.8},
            period=lambda p: 2.0 * np.pi / p.omega,
            mass=one,
            forces=weight,
            contacts=[Contact("table", gap=lambda t, x, p: x.y - p.A * np.sin(p.omega * t), restitution="e")],
        )
        ends = hybrid.simulate_many(system, {"y": [0.5, 1.0], "v": 0.0}, (0.0, 1.0))
        alone = simulate(system, (1.0, 0.0), (0.0, 1.0))
        np.testing.assert_allclose(ends.x_end[1], alone.x[-1], atol=1e-10)
        assert hybrid.equilibrium(beam(), (0.0, 0.0, 0.0, 0.0)).mode == "left+right"
        # The ball leaves with g T / 2, so cos(phase) = (1 - e) / (1 + e) g T / (2 A omega).
        period = 2.0 * np.pi / 25.0
        phase = np.arccos(0.2 / 1.8 * G * period / 2.0 / (0.02 * 25.0))
        orbit = hybrid.periodic_orbit(
            system,
            (0.02 * np.sin(phase) + 1e-9, G * period / 2.0),
            t0=phase / 25.0,
        )
        assert orbit.status.ok
        trace = np.prod(orbit.multipliers)
        assert trace.real == pytest.approx(0.64, abs=1e-8)


class TestVibratingTable:
    """A ball on a table that moves: it leaves where the table's acceleration is that of gravity."""

    def test_leaves_at_the_acceleration_of_gravity(self, table):
        amplitude, omega = table.parameters["A"], table.parameters["omega"]
        arc = simulate(table, (0.0, amplitude * omega), (0.0, 0.3))
        leaving = np.arcsin(G / (amplitude * omega**2)) / omega
        assert arc.jumps["table opens"][0].t == arc.jumps[0].t
        assert arc.jumps[0].t == pytest.approx(leaving, abs=1e-13)

    def test_never_passes_the_table(self, table):
        arc = simulate(table, (0.5, 0.0), (0.0, 4.0))
        assert arc["table.gap"].min() > -1e-12
        assert arc["table.normal"].min() > -1e-12


class TestBeam:
    def test_each_foot_comes_to_rest_by_itself(self):
        """The bounces of one foot are over while the other is in the air."""
        arc = simulate(beam(), (1.0, 0.3, 0.0, 0.0), (0.0, 3.0))
        assert arc.status.ok
        modes, first = np.unique(arc.mode, return_index=True)
        entered = dict(zip(modes.tolist(), arc.t[first], strict=True))
        assert entered["left"] == pytest.approx(0.685255765, abs=1e-8)
        hits = [jump.t for jump in arc.jumps["right"] if jump.t > entered["left"]]
        assert hits[0] == pytest.approx(0.80936286, abs=1e-8)
        assert entered["left+right"] == pytest.approx(0.93931536, abs=1e-8)
        np.testing.assert_allclose(arc.x[-1], 0.0, atol=1e-14)
        total = arc["left.normal"][-1] + arc["right.normal"][-1]
        assert total == pytest.approx(G, abs=1e-12)

    def test_falls_flat(self):
        """Both feet hit at once, again and again; after one after the other it would lie otherwise."""
        arc = simulate(beam(), (1.0, 0.0, 0.0, 0.0), (0.0, 3.0))
        assert arc.status.code == hybrid.StatusCode.AMBIGUOUS_ORDER
        assert "'left', 'right'" in arc.status.message
        assert arc.mode[-1] == "left+right"
        assert arc.jumps[-1].t == pytest.approx(np.sqrt(2.0 / G) * (1.0 + 2.0 * 0.3 / 0.7), abs=1e-10)

    def test_a_mode_is_named_by_the_call(self):
        arc = simulate(beam(), (0.0, 0.0, 0.0, 0.0), (0.0, 1.0), mode="left+right")
        assert set(arc.mode) == {"left+right"}

    def test_an_unknown_mode(self):
        with pytest.raises(hybrid.ModelError, match="'left', 'left idle', 'right'"):
            simulate(beam(), (0.0, 0.0, 0.0, 0.0), (0.0, 1.0), mode="middle")


class TestBead:
    def test_follows_the_track(self):
        """The same motion in one coordinate, by SciPy."""
        start = (0.3, track(0.3), 2.0, -A * K * np.sin(K * 0.3) * 2.0)
        arc = simulate(bead(), start, (0.0, 10.0))

        def along(t, state):
            x, u = state
            slope, bend = -A * K * np.sin(K * x), -A * K * K * np.cos(K * x)
            return u, -slope * (G + bend * u * u) / (1.0 + slope * slope)

        peer = solve_ivp(along, (0.0, 10.0), (0.3, 2.0), method="DOP853", rtol=1e-12, atol=1e-13)
        assert set(arc.mode) == {"track"}
        assert arc["x"][-1] == pytest.approx(peer.y[0, -1], abs=1e-8)

    @pytest.mark.parametrize("span", [10.0, 1000.0])
    def test_does_not_drift(self, span):
        start = (0.3, track(0.3), 2.0, -A * K * np.sin(K * 0.3) * 2.0)
        arc = simulate(bead(), start, (0.0, span))
        assert np.abs(arc["track.gap"]).max() < 1e-10

    def test_leaves_a_track_that_falls_away(self):
        """At the top the track bends by A K^2: faster than sqrt(g / (A K^2)) the bead flies."""
        fast = 1.01 * np.sqrt(G / (A * K * K))
        assert str(simulate(bead(), (0.0, A, fast, 0.0), (0.0, 0.01)).mode[-1]) == "free"
        slow = 0.99 * np.sqrt(G / (A * K * K))
        assert str(simulate(bead(), (0.0, A, slow, 0.0), (0.0, 0.01)).mode[-1]) == "track"

    def test_exponents_of_what_the_track_forbids(self):
        well = np.pi / 2 + 0.5
        spectrum = lyapunov_spectrum(bead(), (well, track(well), 0.0, 0.0), interval=1.0, intervals=200)
        assert spectrum.status.ok
        assert sum(spectrum.exponents[:2]) == pytest.approx(0.0, abs=1e-5)
        np.testing.assert_array_equal(spectrum.exponents[2:], -np.inf)

    def test_tangent_vectors_lie_in_the_track(self):
        start = np.array([0.3, track(0.3), 0.0, 0.0])
        arc = simulate(bead(), start, (0.0, 3.0), tangent=np.eye(4))
        x = arc.x[-1, 0]
        across = np.array([A * K * np.sin(K * x), 1.0, 0.0, 0.0])
        np.testing.assert_allclose(across @ arc.fundamental, 0.0, atol=1e-9)


class TestRope:
    def test_taut_and_slack(self):
        """A pendulum on a rope leaves the circle where the force of the rope is zero."""
        system = mechanics(
            coordinates=("x", "y"),
            velocities=("u", "v"),
            mass=lambda t, x, p: (1.0, 1.0),
            forces=lambda t, x, p: (0.0, -G),
            contacts=[Contact("rope", gap=lambda t, x, p: 1.0 - np.hypot(x.x, x.y))],
        )
        speed = 6.5
        arc = simulate(system, (0.0, -1.0, speed, 0.0), (0.0, 1.0))
        height = (speed**2 - 2.0 * G) / (3.0 * G)
        assert arc.jumps["rope opens"][0].t == arc.jumps[0].t
        assert arc.jumps[0].x_minus[1] == pytest.approx(height, abs=1e-10)
        arc = simulate(system, (0.6, -0.8, 0.0, 0.0), (0.0, 200.0))
        assert set(arc.mode) == {"rope"}
        assert np.abs(arc["rope.gap"]).max() < 1e-11


class TestStack:
    def test_comes_to_rest_floor_by_floor(self):
        """Bounces of two contacts in turn, then a stack onto which a third body falls."""
        system = mechanics(
            coordinates=("y1", "y2", "y3"),
            velocities=("v1", "v2", "v3"),
            mass=lambda t, x, p: (1.0, 2.0, 3.0),
            forces=lambda t, x, p: (-G, -2.0 * G, -3.0 * G),
            contacts=[
                Contact("floor", gap=lambda t, x, p: x.y1, restitution=0.3),
                Contact("low", gap=lambda t, x, p: x.y2 - x.y1 - 1.0, restitution=0.3),
                Contact("high", gap=lambda t, x, p: x.y3 - x.y2 - 1.0, restitution=0.3),
                Contact("roof", gap=lambda t, x, p: 8.0 - x.y3, restitution=0.5),
            ],
        )
        arc = simulate(system, (0.5, 2.0, 4.0, 0.0, 0.0, 0.0), (0.0, 5.0))
        assert arc.status.ok
        assert arc.mode[-1] == "floor+low+high"
        np.testing.assert_allclose(arc.x[-1], [0.0, 1.0, 2.0, 0.0, 0.0, 0.0], atol=1e-14)
        weights = [arc[f"{name}.normal"][-1] for name in ("floor", "low", "high")]
        np.testing.assert_allclose(weights, np.array([6.0, 5.0, 3.0]) * G, rtol=1e-12)
        # A run that makes no modes gives the same.
        again = simulate(system, (0.5, 2.0, 4.0, 0.0, 0.0, 0.0), (0.0, 5.0))
        assert again.jumps[-1].t == pytest.approx(arc.jumps[-1].t, abs=1e-12)

    def test_three_feet_on_a_line(self):
        """What the feet of a table bear is not determined, if there are more of them than needed."""
        system = mechanics(
            coordinates=("y", "phi"),
            velocities=("v", "w"),
            mass=lambda t, x, p: (1.0, 1.0),
            forces=lambda t, x, p: (-G, 0.2 * G),
            contacts=[
                Contact(name, gap=lambda t, x, p, at=at: x.y + at * x.phi)
                for name, at in (("left", -1.0), ("middle", 0.0), ("right", 1.0))
            ],
        )
        arc = simulate(system, (0.0, 0.0, 0.0, 0.0), (0.0, 10.0))
        assert len(arc.jumps) == 0
        np.testing.assert_allclose(arc.x[-1], 0.0, atol=1e-14)
        assert np.isnan(arc["middle.normal"]).all()
        assert any("not determined" in note for note in arc.system.notes)
