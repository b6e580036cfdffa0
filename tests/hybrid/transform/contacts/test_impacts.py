"""Impacts of one contact and of several at once, by the laws of Newton and Poisson."""

import numpy as np
import pytest

import hybrid
from hybrid import Contact, mechanics, simulate
from tests.hybrid.transform.contacts.scenes import G, cradle, slender, touching


class TestCradle:
    @pytest.mark.parametrize(
        ("count", "after"),
        [(3, np.array([-1.0, 2.0, 2.0]) / 3.0), (5, np.array([-3.0, 2.0, 2.0, 2.0, 2.0]) / 5.0)],
    )
    def test_balls_that_touch(self, count, after):
        arc = simulate(cradle(count), touching(count), (0.0, 3.0))
        assert arc.status.ok
        np.testing.assert_allclose(arc.x[-1][count:], after, atol=1e-13)

    def test_small_gaps_hand_the_speed_on(self):
        arc = simulate(cradle(4), touching(4, gap=1e-4), (0.0, 3.0))
        np.testing.assert_allclose(arc.x[-1][4:], [0.0, 0.0, 0.0, 1.0], atol=1e-12)

    def test_one_after_another(self):
        arc = simulate(cradle(3, impacts="sequential"), touching(3), (0.0, 3.0))
        np.testing.assert_allclose(arc.x[-1][3:], [0.0, 0.0, 1.0], atol=1e-13)

    @pytest.mark.parametrize("e", [0.0, 0.4, 1.0])
    @pytest.mark.parametrize("impacts", ["newton", "poisson"])
    def test_momentum_and_energy(self, impacts, e):
        arc = simulate(cradle(3, impacts, e), touching(3), (0.0, 3.0))
        after = arc.x[-1][3:]
        assert after.sum() == pytest.approx(1.0, abs=1e-13)
        assert (after**2).sum() <= 1.0 + 1e-12
        if e == 1.0:
            assert (after**2).sum() == pytest.approx(1.0, abs=1e-12)
        assert (np.diff(after) >= -1e-12).all()


class TestHousner:
    @pytest.mark.parametrize(("b", "h"), [(0.25, 1.0), (0.5, 1.0)])
    def test_a_slender_block_rocks(self, b, h):
        """Each change of corner leaves 1 - 3/2 sin^2 alpha of the speed (Housner 1963)."""
        alpha, tilt = np.arctan2(b, h), 0.05
        start = (0.0, h * np.cos(tilt) + b * np.sin(tilt), tilt, 0.0, 0.0, 0.0)
        arc = simulate(slender(b, h, friction=5.0), start, (0.0, 2.0))
        kept = [jump.x_plus[5] / jump.x_minus[5] for jump in arc.jumps[:6]]
        np.testing.assert_allclose(kept, 1.0 - 1.5 * np.sin(alpha) ** 2, atol=1e-9)

    def test_a_broad_block_stops_dead(self):
        """With b^2 > 2 h^2 the corner about which it turns stays down."""
        b, h, tilt = 1.5, 1.0, 0.05
        start = (0.0, h * np.cos(tilt) + b * np.sin(tilt), tilt, 0.0, 0.0, 0.0)
        arc = simulate(slender(b, h, friction=5.0), start, (0.0, 2.0))
        assert arc.mode[-1] == "left sticks, right sticks"
        np.testing.assert_allclose(arc.x[-1][2:], 0.0, atol=1e-9)

    def test_rocks_until_it_stands(self):
        b, h = 0.25, 1.0
        start = (0.0, h * np.cos(0.05) + b * np.sin(0.05), 0.05, 0.0, 0.0, 0.0)
        arc = simulate(slender(b, h, friction=5.0), start, (0.0, 20.0))
        assert arc.status.ok
        assert arc.mode[-1] == "left sticks, right sticks"
        assert arc["left.normal"][-1] == pytest.approx(G / 2.0, abs=1e-9)
        assert np.isnan(arc["left.tangential"][-1])


def disc(impacts, e=0.8, mu=0.2):
    """A ball of mass 1 and radius 1 that falls onto the floor while it spins."""
    return mechanics(
        coordinates=("x", "y", "phi"),
        velocities=("u", "v", "w"),
        mass=lambda t, x, p: (1.0, 1.0, 0.4),
        forces=lambda t, x, p: (0.0, -G, 0.0),
        contacts=[
            Contact(
                "floor",
                gap=lambda t, x, p: x.y - 1.0,
                slip=lambda t, x, p: x.u + x.w,
                friction=mu,
                restitution=e,
            )
        ],
        impacts=impacts,
    )


class TestBallThatSpins:
    fall = np.sqrt(2.0 * G)

    @pytest.mark.parametrize("impacts", ["newton", "poisson"])
    def test_slips_through_the_impact(self, impacts):
        """The impulse of friction is mu times that of the floor."""
        arc = simulate(disc(impacts), (0.0, 2.0, 0.0, 5.0, 0.0, 8.0), (0.0, 0.5))
        push = 1.8 * self.fall
        expected = [5.0 - 0.2 * push, 0.8 * self.fall, 8.0 - 0.2 * push / 0.4]
        np.testing.assert_allclose(arc.jumps[0].x_plus[3:], expected, atol=1e-12)

    @pytest.mark.parametrize("impacts", ["newton", "poisson"])
    def test_sticks_in_the_impact(self, impacts):
        """The impulse of friction ends the slip, which needs 2/7 of its mass."""
        arc = simulate(disc(impacts), (0.0, 2.0, 0.0, 1.0, 0.0, 0.5), (0.0, 0.5))
        grip = 1.5 * 2.0 / 7.0
        expected = [1.0 - grip, 0.8 * self.fall, 0.5 - grip / 0.4]
        np.testing.assert_allclose(arc.jumps[0].x_plus[3:], expected, atol=1e-12)


class TestPoissonAndNewtonDiffer:
    """A rod whose end hits: normal and tangential direction act on each other."""

    @staticmethod
    def hit(impacts, mu):
        system = mechanics(
            coordinates=("x", "y", "phi"),
            velocities=("u", "v", "w"),
            mass=lambda t, x, p: (1.0, 1.0, 1.0 / 3.0),
            forces=lambda t, x, p: (0.0, -G, 0.0),
            contacts=[
                Contact(
                    "tip",
                    gap=lambda t, x, p: x.y - np.sin(x.phi),
                    slip=lambda t, x, p: x.u + np.sin(x.phi) * x.w,
                    friction=mu,
                    restitution=0.6,
                )
            ],
            impacts=impacts,
        )
        arc = simulate(system, (0.0, 1.5, 0.9, 1.0, 0.0, -1.0), (0.0, 0.6))
        before, after = arc.jumps["tip"][0].x_minus, arc.jumps["tip"][0].x_plus
        rate = [x[4] - np.cos(x[2]) * x[5] for x in (before, after)]
        return arc, before, after, rate

    def test_newtons_law_is_of_rates(self):
        _, _, _, (before, after) = self.hit("newton", 0.5)
        assert after == pytest.approx(-0.6 * before, abs=1e-12)

    @pytest.mark.parametrize("impacts", ["newton", "poisson"])
    def test_without_friction_they_agree(self, impacts):
        _, _, _, (before, after) = self.hit(impacts, 0.0)
        assert after == pytest.approx(-0.6 * before, abs=1e-12)

    def test_poissons_law_is_of_impulses(self):
        """The impulse of compression, by hand, comes back 0.6-fold, here with a slip that has ended."""
        _, before, after, _ = self.hit("poisson", 0.5)
        c, s = np.cos(before[2]), np.sin(before[2])
        W = np.array([[0.0, 1.0, -c], [1.0, 0.0, s]])
        inverse = np.diag([1.0, 1.0, 3.0])
        G2 = W @ inverse @ W.T
        v = W @ before[3:]
        stuck = np.linalg.solve(G2, -v)
        if abs(stuck[1]) <= 0.5 * stuck[0]:
            compression = stuck
        else:
            sign = np.sign(v[1])
            column = G2 @ np.array([1.0, -0.5 * sign])
            push = -v[0] / column[0]
            compression = np.array([push, -0.5 * sign * push])
        between = v + G2 @ compression
        # In expansion the contact pushes 0.6 times as much; friction keeps the slip at zero if it can.
        push = 0.6 * compression[0]
        grip = -(between[1] + G2[1, 0] * push) / G2[1, 1]
        if abs(grip) > 0.5 * push:
            grip = np.sign(grip) * 0.5 * push
        end = between + G2 @ np.array([push, grip])
        np.testing.assert_allclose(W @ after[3:], end, atol=1e-11)


class TestEnergy:
    def test_a_gain_is_told(self):
        """Kane's example: with Newton's law of rates a double pendulum's tip gains energy by friction."""

        def arms(impacts):
            return mechanics(
                coordinates=("a", "b"),
                velocities=("u", "w"),
                kinetic=lambda t, x, p: (
                    0.5 * (x.u**2 / 3.0 + x.u**2 + x.u * x.w * np.cos(x.a - x.b) + x.w**2 / 3.0)
                ),
                forces=lambda t, x, p: (0.0, 0.0),
                contacts=[
                    Contact(
                        "floor",
                        gap=lambda t, x, p: np.cos(np.pi / 9) + np.cos(np.pi / 6) - np.cos(x.a) - np.cos(x.b),
                        slip=lambda t, x, p: np.cos(x.a) * x.u + np.cos(x.b) * x.w,
                        friction=0.7,
                        restitution=0.5,
                    )
                ],
                impacts=impacts,
            )

        start = (np.pi / 9 + 0.01, np.pi / 6 + 0.02, -0.1, -0.2)
        newton = simulate(arms("newton"), start, (0.0, 0.3))
        poisson = simulate(arms("poisson"), start, (0.0, 0.3))

        def energy(x):
            a, b, u, w = x
            return 0.5 * (4.0 * u * u / 3.0 + u * w * np.cos(a - b) + w * w / 3.0)

        gains = {
            name: energy(arc.jumps["floor"][0].x_plus) - energy(arc.jumps["floor"][0].x_minus)
            for name, arc in (("newton", newton), ("poisson", poisson))
        }
        assert gains["poisson"] <= 1e-15
        assert (gains["newton"] > 0.0) == any("gains energy" in note for note in newton.system.notes)
        assert gains["newton"] > 0.0


class TestTangents:
    @pytest.mark.parametrize("impacts", ["newton", "poisson"])
    def test_an_impact_with_friction(self, impacts):
        """The derivative of the run by its start, by differences."""
        system, span = disc(impacts), (0.0, 0.7)
        start = np.array([0.0, 2.0, 0.0, 5.0, 0.0, 8.0])
        arc = simulate(system, start, span, tangent=np.eye(6))
        h = 1e-6
        for i, unit in enumerate(np.eye(6)):
            ends = [simulate(system, start + sign * h * unit, span).x[-1] for sign in (1.0, -1.0)]
            np.testing.assert_allclose(
                arc.fundamental[:, i], (ends[0] - ends[1]) / (2.0 * h), rtol=1e-6, atol=1e-6
            )


def test_an_unknown_law():
    with pytest.raises(hybrid.ArgumentError, match="newton"):
        cradle(3, impacts="hertz")
