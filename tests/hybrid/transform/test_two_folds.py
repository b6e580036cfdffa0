"""Points where the fields on both sides of a surface are tangent to it, and arrivals near them."""

import math

import numpy as np
import pytest

import hybrid
from hybrid.transform.filippov import filippov
from tests.hybrid.transform.planes import events, planar


def two_fold(below, above):
    """Speeds ``-b x`` from below and ``a x`` from above: attracting for ``x < 0``, repelling for ``x > 0``.

    The fold of a field with ``x' > 0`` is visible, with ``x' < 0`` invisible.
    """
    return planar(
        lambda t, x, p: (below, -p.b * x.x),
        lambda t, x, p: (above, p.a * x.x),
        parameters={"a": 1.3, "b": 2.7},
    )


class TestTwoFolds:
    VISIBLE = two_fold(1.0, 1.0)
    MIXED = two_fold(-1.0, 1.0)
    INVISIBLE = two_fold(-1.0, -1.0)

    def test_visible_both(self):
        """The orbit slides into the two-fold, from which it might leave above, below, or not at all."""
        arc = hybrid.simulate(self.VISIBLE, (-0.7, 0.0), (0.0, 5.0))
        assert arc.status.code == hybrid.StatusCode.TERMINAL
        assert events(arc) == ["two-fold"]
        assert arc.jumps[0].t == pytest.approx(0.7, abs=1e-8)
        np.testing.assert_allclose(arc.jumps[0].x_minus, [0.0, 0.0], atol=1e-8)

    def test_visible_and_invisible(self):
        """Sliding at ``(b - a) / (b + a)``: towards the two-fold if ``b > a``, else away from it."""
        arc = hybrid.simulate(self.MIXED, (-0.7, 0.0), (0.0, 5.0))
        assert arc.status.code == hybrid.StatusCode.TERMINAL
        assert events(arc) == ["two-fold"]
        assert arc.jumps[0].t == pytest.approx(2.0, abs=1e-7)
        arc = hybrid.simulate(self.MIXED, (-0.7, 0.0), (0.0, 5.0), parameters={"b": 0.65})
        assert arc.status.ok
        np.testing.assert_allclose(arc.x[-1], [-0.7 - 5 / 3, 0.0], atol=1e-11)

    def test_invisible_both(self):
        """Sliding leads away from the two-fold, on the attracting side."""
        arc = hybrid.simulate(self.INVISIBLE, (-0.7, 0.0), (0.0, 5.0))
        assert arc.status.ok
        assert arc.mode[0] == "sliding"
        np.testing.assert_allclose(arc.x[-1], [-5.7, 0.0], atol=1e-11)

    @pytest.mark.parametrize("system", [VISIBLE, MIXED, INVISIBLE])
    def test_start_where_both_fields_leave(self, system):
        with pytest.raises(hybrid.ArgumentError, match="allowed in more than one mode: below, above"):
            hybrid.simulate(system, (1.0, 0.0), (0.0, 1.0))

    def test_start_at_the_two_fold(self):
        with pytest.raises(hybrid.ArgumentError, match="more than one mode: below, above"):
            hybrid.simulate(self.VISIBLE, (0.0, 0.0), (0.0, 1.0))
        with pytest.raises(hybrid.ArgumentError, match="left through 'two-fold at start', 'two-fold'"):
            hybrid.simulate(self.INVISIBLE, (0.0, 0.0), (0.0, 1.0))

    def test_start_at_the_two_fold_with_one_way_out(self):
        """The field below points into the surface, the field above away from it."""
        arc = hybrid.simulate(self.MIXED, (0.0, 0.0), (0.0, 1.0))
        assert arc.mode[0] == "above"
        np.testing.assert_allclose(arc.x[-1], [1.0, 0.65], atol=1e-12)

    def test_sliding_where_both_fields_leave_ends_the_run(self):
        arc = hybrid.simulate(self.VISIBLE, (1.0, 0.0), (0.0, 1.0), mode="sliding")
        assert arc.status.code == hybrid.StatusCode.TERMINAL
        assert events(arc) == ["two-fold at start"]

    @pytest.mark.parametrize(("mode", "sign"), [("below", -2.7), ("above", 1.3)])
    def test_a_named_mode_decides(self, mode, sign):
        arc = hybrid.simulate(self.VISIBLE, (1.0, 0.0), (0.0, 1.0), mode=mode)
        assert not arc.jumps
        np.testing.assert_allclose(arc.x[-1], [2.0, sign * 1.5], atol=1e-10)

    @pytest.mark.parametrize("speed", [1e-3, 1e-6, 1e-9, 1e-12])
    def test_a_slow_arrival_is_not_lost(self, speed):
        """A straight arrival at a very small angle."""
        system = planar(lambda t, x, p: (1.0, p.v), lambda t, x, p: (1.0, -1.0), parameters={"v": speed})
        arc = hybrid.simulate(system, (0.0, -speed), (0.0, 2.0), mode="below")
        assert events(arc) == ["below->sliding"]
        assert arc.jumps[0].t == pytest.approx(1.0, abs=1e-3)
        np.testing.assert_allclose(arc.x[-1], [2.0, 0.0], atol=1e-15)

    @pytest.mark.parametrize("depth", [1e-4, 1e-8, 1e-12])
    def test_an_arrival_that_would_soon_turn_back(self, depth):
        """``y = depth - (x - 1)^2`` from below: slides from its first zero to the fold at 1."""
        system = planar(lambda t, x, p: (1.0, -2.0 * (x.x - 1)), lambda t, x, p: (1.0, -1.0))
        arc = hybrid.simulate(system, (0.0, depth - 1.0), (0.0, 2.0))
        assert events(arc) == ["below->sliding", "sliding->below"]
        np.testing.assert_allclose(
            arc.jumps.t, [1.0 - math.sqrt(depth), 1.0], atol=1e-7 * math.sqrt(depth) + 1e-9
        )
        np.testing.assert_allclose(arc.x[-1], [2.0, -1.0], atol=1e-11)

    @pytest.mark.parametrize("apart", [1e-3, 1e-6, -1e-6, -1e-3])
    def test_the_nearer_fold_decides(self, apart):
        """Folds of the two fields at ``x = -y`` and ``x = 0``."""
        system = filippov(
            ("x", "y", "z"),
            {},
            lambda t, x, p: (1.0, 0.0, -x.x),
            lambda t, x, p: (1.0, 0.0, x.x + x.y),
            lambda t, x, p: x.z,
        )
        arc = hybrid.simulate(system, (-1.0, apart, 0.0), (0.0, 2.0))
        assert arc.status.ok
        if apart > 0:
            assert events(arc) == ["sliding->above"]
            expected = (1.0 + apart) ** 2 / 2
        else:
            assert events(arc) == ["sliding->below"]
            expected = -0.5
        assert arc.x[-1][2] == pytest.approx(expected, abs=1e-10)
