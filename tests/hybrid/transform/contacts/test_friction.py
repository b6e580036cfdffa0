"""Dry friction at contacts: sticking, slipping, static friction, and where Coulomb's law has no answer."""

import numpy as np
import pytest

import hybrid
from hybrid import Contact, mechanics, simulate
from tests.hybrid.transform.contacts.scenes import G, block, rod


class TestBlock:
    def test_slides_until_it_sticks(self):
        arc = simulate(block(), (0.0, 0.0, 2.0, 0.0), (0.0, 2.0))
        stop = 2.0 / (0.3 * G)
        assert arc.mode[0] == "floor slips +"
        assert arc.mode[-1] == "floor sticks"
        assert arc.jumps["floor stops"][0].t == pytest.approx(stop, abs=1e-13)
        assert arc["x"][-1] == pytest.approx(2.0 / 2.0 * stop, abs=1e-12)
        assert arc["floor.tangential"][0] == pytest.approx(-0.3 * G)

    @pytest.mark.parametrize(("tilt", "mode"), [(0.29, "floor sticks"), (0.30, "floor slips +")])
    def test_stays_on_a_slope_up_to_the_angle_of_friction(self, tilt, mode):
        """The angle of friction is atan(0.3) = 0.2915."""
        arc = simulate(block(), (0.0, 0.0, 0.0, 0.0), (0.0, 2.0), parameters={"tilt": tilt})
        assert set(arc.mode) == {mode}
        slides = max(np.sin(tilt) - 0.3 * np.cos(tilt), 0.0) if mode != "floor sticks" else 0.0
        assert arc["x"][-1] == pytest.approx(2.0 * G * slides, abs=1e-12)

    def test_stick_slip_on_a_belt(self):
        """The belt carries the block until the spring pulls it loose; then it swings about its rest."""
        values = {"k": 4.0, "belt": 0.5, "mu": 0.3}
        arc = simulate(block(static=0.5), (0.0, 0.0, 0.5, 0.0), (0.0, 6.0), parameters=values)
        loose, centre, omega = 0.5 * G / 4.0, 0.3 * G / 4.0, 2.0
        first = arc.jumps["floor slips"][0].t
        assert first == pytest.approx(loose / 0.5, abs=1e-12)
        angle = np.arctan2(0.5 / omega, loose - centre)
        assert arc.jumps["floor stops"][0].t - first == pytest.approx(
            (np.pi + 2.0 * angle) / omega, abs=1e-10
        )

    def test_sticks_at_once_where_a_fall_ends(self):
        arc = simulate(block(), (0.0, 1.0, 1.0, 0.0), (0.0, 3.0), parameters={"e": 0.5, "mu": 0.3})
        assert arc.status.ok
        assert arc.mode[-1] == "floor sticks"
        # The first impact has enough friction to end the slip.
        assert arc.jumps["floor"][0].x_plus[2] == pytest.approx(0.0, abs=1e-13)

    def test_friction_that_a_call_sets_to_zero(self):
        arc = simulate(block(), (0.0, 0.0, 2.0, 0.0), (0.0, 2.0), parameters={"mu": 0.0})
        assert arc["x"][-1] == pytest.approx(4.0, abs=1e-12)

    def test_static_friction_below_kinetic(self):
        with pytest.raises(hybrid.ModelError, match="no smaller than"):
            block(friction=0.5, static=0.3)


def ladder(friction):
    """A rod of mass 1 and length 2 that leans against a wall; ``phi`` is its angle to the floor."""
    return mechanics(
        coordinates=("x", "y", "phi"),
        velocities=("u", "v", "w"),
        parameters={"mu": friction, "pull": 0.0},
        mass=lambda t, x, p: (1.0, 1.0, 1.0 / 3.0),
        forces=lambda t, x, p: (p.pull * t, -G, 0.0),
        contacts=[
            Contact(
                "floor",
                gap=lambda t, x, p: x.y - np.sin(x.phi),
                slip=lambda t, x, p: x.u - np.sin(x.phi) * x.w,
                friction="mu",
            ),
            Contact(
                "wall",
                gap=lambda t, x, p: x.x - np.cos(x.phi),
                slip=lambda t, x, p: x.v + np.cos(x.phi) * x.w,
                friction="mu",
            ),
        ],
    )


class TestLadder:
    """Four forces of contacts for three coordinates: what each end bears is not determined."""

    @pytest.mark.parametrize("mu", [0.3, 0.6])
    @pytest.mark.parametrize("beside", [-0.01, 0.01])
    def test_stands_above_the_smallest_angle(self, mu, beside):
        """It stands if ``tan(phi) >= (1 - mu^2) / (2 mu)``: then both ends together can bear it."""
        phi = np.arctan2(1.0 - mu * mu, 2.0 * mu) + beside
        arc = simulate(ladder(mu), (np.cos(phi), np.sin(phi), phi, 0.0, 0.0, 0.0), (0.0, 0.2))
        assert arc.status.ok
        if beside > 0.0:
            assert all(str(mode).startswith("floor sticks, wall sticks") for mode in arc.mode)
            np.testing.assert_allclose(arc.x[-1][3:], 0.0, atol=1e-12)
            assert np.isnan(arc["floor.tangential"]).all()
        else:
            assert set(arc.mode) == {"floor slips +, wall slips -"}
            assert np.abs(arc["floor.gap"]).max() < 1e-12

    def test_is_pulled_off_where_no_share_is_left(self):
        """A force that grows pulls it from the wall: it leaves where the wall pushes no more."""
        mu, phi = 0.6, 1.2
        start = (np.cos(phi), np.sin(phi), phi, 0.0, 0.0, 0.0)
        arc = simulate(ladder(mu), start, (0.0, 10.0), parameters={"pull": 1.0}, max_jumps=3)
        # Without a force at the wall: floor T = pull, N = G, and the moments of N and T balance.
        moves = [jump for jump in arc.jumps if not jump.target.startswith("floor sticks, wall sticks")]
        assert moves[0].t <= min(mu * G, G / np.tan(phi)) + 1e-9
        assert moves[0].t > 0.0

    def test_in_a_groove(self):
        """A disc in a groove of two planes rests, and a moment turns it where both planes let go."""
        alpha, mu, turn = np.pi / 4, 0.3, 1.0
        normal = {"left": (np.sin(alpha), np.cos(alpha)), "right": (-np.sin(alpha), np.cos(alpha))}
        system = mechanics(
            coordinates=("x", "y", "phi"),
            velocities=("u", "v", "w"),
            parameters={"moment": turn},
            mass=lambda t, x, p: (1.0, 1.0, 0.5),
            forces=lambda t, x, p: (0.0, -G, p.moment * t),
            contacts=[
                Contact(
                    name,
                    gap=lambda t, x, p, n=n: n[0] * x.x + n[1] * x.y - 1.0,
                    slip=lambda t, x, p, n=n: n[1] * x.u - n[0] * x.v + x.w,
                    friction=mu,
                )
                for name, n in normal.items()
            ],
        )
        arc = simulate(system, (0.0, 1.0 / np.cos(alpha), 0.0, 0.0, 0.0, 0.0), (0.0, 6.0))
        turning = [jump.t for jump in arc.jumps if "slips" in str(jump.target)]
        # Both at their bounds: N_l + N_r = W sqrt(2) / (1 + mu^2) at 45 degrees.
        largest = mu * G * np.sqrt(2.0) / (1.0 + mu * mu)
        assert turning[0] == pytest.approx(largest / turn, abs=1e-9)


class TestSeveralAtOnce:
    def test_two_contacts_stop_together(self):
        """A plate between two pads stops, sticks until the pull is twice the friction, and slides back."""
        system = mechanics(
            coordinates=("x", "a", "b"),
            velocities=("u", "va", "vb"),
            mass=lambda t, x, p: (1.0, 1.0, 1.0),
            forces=lambda t, x, p: (-3.0 * t, -10.0, -10.0),
            contacts=[
                Contact(name, gap=gap, slip=lambda t, x, p: x.u, friction=0.3)
                for name, gap in (("top", lambda t, x, p: x.a), ("bottom", lambda t, x, p: x.b))
            ],
        )
        arc = simulate(system, (0.0, 0.0, 0.0, 0.5, 0.0, 0.0), (0.0, 4.0))
        assert arc.status.ok
        assert arc["u"][-1] == pytest.approx(-6.0, abs=1e-12)

    @pytest.mark.parametrize(
        ("radius", "begins", "speed"), [(0.1, 5.5 / 6.0, 13.0208333333), (2.0, 2.5, 0.75)]
    )
    def test_brake_pads_at_two_radii(self, radius, begins, speed):
        """The moment of friction is at most the sum of both, each with its own arm."""
        system = mechanics(
            coordinates=("th", "a", "b"),
            velocities=("w", "va", "vb"),
            mass=lambda t, x, p: (1.0, 1.0, 1.0),
            forces=lambda t, x, p: (6.0 * t, -10.0, -10.0),
            contacts=[
                Contact("near", gap=lambda t, x, p: x.a, slip=lambda t, x, p: x.w, friction=0.5),
                Contact("far", gap=lambda t, x, p: x.b, slip=lambda t, x, p: radius * x.w, friction=0.5),
            ],
        )
        arc = simulate(system, (0.0,) * 6, (0.0, 3.0))
        assert arc.jumps[0].t == pytest.approx(begins, abs=1e-12)
        assert arc["w"][-1] == pytest.approx(speed, abs=1e-9)

    def test_two_feet_that_open_together(self):
        system = mechanics(
            coordinates=("y", "phi"),
            velocities=("v", "w"),
            mass=lambda t, x, p: (1.0, 0.1),
            forces=lambda t, x, p: (20.0 * t - G, 0.0),
            contacts=[
                Contact(name, gap=lambda t, x, p, s=s: x.y + s * x.phi)
                for name, s in (("left", -0.1), ("right", 0.1))
            ],
        )
        arc = simulate(system, (0.0, 0.0, 0.0, 0.0), (0.0, 1.0))
        assert arc.status.ok
        rise = 1.0 - G / 20.0
        assert arc["v"][-1] == pytest.approx(10.0 * rise**2, abs=1e-12)


class TestPainleve:
    """A rod that slides on its tip: with much friction no acceleration, or several, obey Coulomb's law."""

    start = (0.0, np.sin(0.9), 0.9)

    def test_no_acceleration_is_consistent(self):
        """Slipping to the left, the tip digs in: 1 + 3 c^2 + 3 mu s c is negative there."""
        arc = simulate(rod(3.0), (*self.start, -5.0, 0.0, 0.0), (0.0, 1.0))
        assert arc.status.code == hybrid.StatusCode.TERMINAL
        assert arc.jumps[-1].transition == "painleve"
        assert "'tip'" in arc.status.message
        assert arc.jumps[-1].t == 0.0

    def test_it_is_well_posed_with_less_friction(self):
        arc = simulate(rod(0.3), (*self.start, -5.0, 0.0, 0.0), (0.0, 0.1))
        assert arc.status.ok
        assert set(arc.mode) == {"tip slips -"}

    def test_the_other_direction_is_well_posed(self):
        arc = simulate(rod(3.0), (*self.start, 5.0, 0.0, 0.0), (0.0, 0.1))
        assert arc.status.ok
        assert set(arc.mode) == {"tip slips +"}

    def test_forces_by_hand(self):
        """``l = (g - s w^2) / (1 + 3 c (c - mu s))`` for a slip to the left at the start."""
        arc = simulate(rod(0.3), (*self.start, -5.0, 0.0, 0.0), (0.0, 0.1))
        s, c = np.sin(0.9), np.cos(0.9)
        assert arc["tip.normal"][0] == pytest.approx(G / (1.0 + 3.0 * c * (c - 0.3 * s)), abs=1e-10)

    def test_it_is_reached_in_the_middle_of_a_run(self):
        """Where ``1 + 3 c^2 - 3 mu s c`` becomes zero, the forces grow beyond all bounds."""
        start = (0.0, np.sin(0.3), 0.3, -8.0 - 2.5 * np.sin(0.3), 2.5 * np.cos(0.3), 2.5)
        arc = simulate(rod(2.5), start, (0.0, 2.0))
        assert arc.status.code == hybrid.StatusCode.TERMINAL
        assert arc.jumps[-1].transition == "painleve"
        assert "friction 2.5" in arc.status.message
        s, c = np.sin(arc.x[-1][2]), np.cos(arc.x[-1][2])
        assert 1.0 + 3.0 * c * c - 7.5 * s * c == pytest.approx(0.0, abs=1e-5)

    def test_several_are_told_and_named(self):
        """A rod that would rise meets neither: it flies, or it digs in."""
        spin = 6.0
        start = (*self.start, -5.0 - np.sin(0.9) * spin, np.cos(0.9) * spin, spin)
        with pytest.raises(hybrid.ArgumentError, match="'free' or 'tip slips -'"):
            simulate(rod(3.0), start, (0.0, 1.0))
        arc = simulate(rod(3.0), start, (0.0, 0.01), mode="free")
        assert arc.mode[0] == "free"
