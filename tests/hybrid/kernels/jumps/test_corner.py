"""Guards reached at one instant: both fire, and where their order matters the status says so."""

from functools import cache

import attrs
import numpy as np
import pytest

import hybrid
from hybrid import Guard, HybridSystem, Mode, Reset, StatusCode, Transition, simulate


@cache
def corner(order=1, e=1.0):
    """A puck in a quadrant with reflecting walls."""
    walls = [
        Transition(
            "slide",
            "slide",
            Guard(lambda t, x, p: x.x, direction=-1),
            Reset(lambda t, x, p: (x.x, x.y, -p.e * x.u, x.v)),
            name="left",
        ),
        Transition(
            "slide",
            "slide",
            Guard(lambda t, x, p: x.y, direction=-1),
            Reset(lambda t, x, p: (x.x, x.y, x.u, -p.e * x.v)),
            name="bottom",
        ),
    ]
    return HybridSystem(
        state=("x", "y", "u", "v"),
        parameters={"e": e},
        modes=[Mode("slide", lambda t, x, p: (x.u, x.v, 0.0, 0.0))],
        transitions=walls[::order],
    )


@cache
def three_balls(masses=(1.0, 1.0, 1.0), e=1.0):
    """Three balls on a line; neighbours collide with the coefficient of restitution ``e``."""

    def collide(a, b):
        def reset(t, x, p):
            v = [x.v1, x.v2, x.v3]
            impulse = (1 + p.e) * (v[a] - v[b]) * masses[a] * masses[b] / (masses[a] + masses[b])
            v[a], v[b] = v[a] - impulse / masses[a], v[b] + impulse / masses[b]
            return (x.x1, x.x2, x.x3, *v)

        return Reset(reset)

    return HybridSystem(
        state=("x1", "x2", "x3", "v1", "v2", "v3"),
        parameters={"e": e},
        modes=[Mode("free", lambda t, x, p: (x.v1, x.v2, x.v3, 0.0, 0.0, 0.0))],
        transitions=[
            Transition(
                "free", "free", Guard(lambda t, x, p: x.x2 - x.x1, direction=-1), collide(0, 1), name="12"
            ),
            Transition(
                "free", "free", Guard(lambda t, x, p: x.x3 - x.x2, direction=-1), collide(1, 2), name="23"
            ),
        ],
    )


class TestCorner:
    @pytest.mark.parametrize("order", [1, -1])
    @pytest.mark.parametrize("e", [1.0, 0.5])
    @pytest.mark.parametrize("start", [1.0, 0.1, 1 / 3])
    def test_both_walls_fire_at_one_instant(self, order, e, start):
        arc = simulate(corner(order), (start, start, -1.0, -1.0), (0.0, 2.0), parameters={"e": e})
        assert arc.status.ok
        assert sorted(jump.transition for jump in arc.jumps) == ["bottom", "left"]
        assert arc.jumps[0].t == arc.jumps[1].t
        expected = [e * (2 - start), e * (2 - start), e, e]
        np.testing.assert_allclose(arc.x[-1], expected, rtol=0, atol=1e-14)

    @pytest.mark.parametrize("order", [1, -1])
    def test_the_one_listed_first_fires_first(self, order):
        arc = simulate(corner(order), (1.0, 1.0, -1.0, -1.0), (0.0, 2.0))
        assert [jump.transition for jump in arc.jumps] == ["left", "bottom"][::order]

    @pytest.mark.parametrize("apart", [1e-3, 1e-8, 1e-12, -1e-12, -1e-8, -1e-3])
    def test_close_to_the_corner_each_wall_fires_once_in_order(self, apart):
        arc = simulate(corner(), (1.0, 1.0 + apart, -1.0, -1.0), (0.0, 2.0))
        expected = ["left", "bottom"] if apart > 0 else ["bottom", "left"]
        assert [jump.transition for jump in arc.jumps] == expected
        np.testing.assert_allclose(arc.x[-1], [1.0, 1.0 - apart, 1.0, 1.0], rtol=0, atol=1e-14)

    def test_the_tangent_does_not_depend_on_the_order(self):
        ends = [
            simulate(corner(order), (1.0, 1.0, -1.0, -1.0), (0.0, 2.0), tangent=True).fundamental
            for order in (1, -1)
        ]
        np.testing.assert_allclose(ends[0], ends[1], atol=1e-14)
        np.testing.assert_allclose(
            ends[0], np.block([[-np.eye(2), -2 * np.eye(2)], [0 * np.eye(2), -np.eye(2)]])
        )


class TestThreeBalls:
    def test_unequal_masses_make_the_order_matter(self):
        arc = simulate(three_balls((1.0, 2.0, 3.0), 0.5), (-1.0, 0.0, 1.0, 1.0, 0.0, -1.0), (0.0, 2.0))
        assert arc.status.code == StatusCode.AMBIGUOUS_ORDER
        assert not arc.status.ok
        assert arc.t[-1] == pytest.approx(2.0, rel=1e-14)
        assert arc.jumps[0].transition == "12"

    @pytest.mark.parametrize("derived", [lambda system: system, hybrid.split], ids=["itself", "split"])
    def test_a_listed_order_that_is_meant_is_not_ambiguous(self, derived):
        start, span = (-1.0, 0.0, 1.0, 1.0, 0.0, -1.0), (0.0, 2.0)
        balls = three_balls((1.0, 2.0, 3.0), 0.5)
        meant = derived(attrs.evolve(balls, listed_order=True))
        plain, arc = simulate(balls, start, span), simulate(meant, start, span)
        assert arc.status.code == StatusCode.SUCCESS
        np.testing.assert_array_equal(arc.x, plain.x)
        assert "listed order: decides" in repr(meant)
        assert "listed_order=True" in plain.status.remedy
        carried = simulate(meant, start, span, sensitivities=("e",))
        marked = hybrid.poincare_section(meant, start, Guard(lambda t, x, p: x.x1 + 0.5, +1), points=1)
        assert carried.status.ok
        assert "AMBIGUOUS" not in marked.status.code.name

    def test_equal_elastic_balls_do_not(self):
        arc = simulate(three_balls(), (-1.0, 0.0, 1.0, 1.0, 0.0, -1.0), (0.0, 2.0))
        assert arc.status.ok
        np.testing.assert_allclose(arc.x[-1, 3:], [-1.0, 0.0, 1.0], atol=1e-14)

    def test_a_blow_goes_through_balls_that_touch(self):
        arc = simulate(three_balls(), (-1.0, 0.0, 0.0, 1.0, 0.0, 0.0), (0.0, 2.0))
        assert [jump.transition for jump in arc.jumps] == ["12", "23"]
        np.testing.assert_allclose(arc.x[-1, 3:], [0.0, 0.0, 1.0], atol=1e-14)

    @pytest.mark.parametrize("masses", [(1.0, 1.0, 1.0), (1.0, 2.0, 3.0)])
    def test_momentum_is_kept(self, masses):
        arc = simulate(three_balls(masses, 0.5), (-1.0, 0.0, 1.0, 1.0, 0.0, -1.0), (0.0, 2.0))
        m = np.array(masses)
        assert arc.x[-1, 3:] @ m == pytest.approx(m[0] - m[2], abs=1e-14)
