"""The functions of a surface and the fields on its sides, compared with NumPy and with closed forms."""

import numpy as np
import pytest

from hybrid import HybridSystem, Mode
from hybrid.system.derivatives import evaluate
from hybrid.transform.surface import SLIDING_BAND, TOUCH, SwitchingSurface

VARIABLES = HybridSystem(
    state=("x", "y"), parameters={"a": 0.7}, modes=[Mode("m", lambda t, x, p: (0.0, 0.0))]
).variables


def surface(below, above, height=lambda t, x, p: x.y):
    return SwitchingSurface(VARIABLES, below, above, height)


def value(function, t=0.0, x=(0.0, 0.0), a=0.7):
    found = evaluate(VARIABLES, function, t, np.array(x), np.array([a]))
    return found if len(found) > 1 else found[0]


class TestCurved:
    """``h = y + a x^2 - sin t`` with fields that depend on everything."""

    SURFACE = surface(
        lambda t, x, p: (1.0 + x.y, x.x - t),
        lambda t, x, p: (x.x * x.y, -2.0 - x.y),
        lambda t, x, p: x.y + p.a * x.x**2 - np.sin(t),
    )

    @pytest.mark.parametrize("seed", range(4))
    def test_rates_and_turns(self, seed):
        t, x, y, a = np.random.default_rng(seed).uniform(-1.0, 1.0, 4)
        given = {"t": t, "x": (x, y), "a": a}
        np.testing.assert_allclose(value(self.SURFACE.gradient, **given), [2 * a * x, 1.0, -np.cos(t)])
        L_b = 2 * a * x * (1 + y) + x - t - np.cos(t)
        L_a = 2 * a * x * x * y - 2 - y - np.cos(t)
        assert value(self.SURFACE.speed_below, **given) == pytest.approx(L_b, rel=1e-13)
        assert value(self.SURFACE.speed_above, **given) == pytest.approx(L_a, rel=1e-13)
        assert value(self.SURFACE.attraction, **given) == pytest.approx(L_b - L_a, rel=1e-13)
        np.testing.assert_allclose(value(self.SURFACE.speeds, **given), [L_b, L_a], rtol=1e-13)
        turn_b = (2 * a * (1 + y) + 1) * (1 + y) + 2 * a * x * (x - t) - 1 + np.sin(t)
        turn_a = 4 * a * x * y * (x * y) + (2 * a * x * x - 1) * (-2 - y) + np.sin(t)
        assert value(self.SURFACE.turn_below, **given) == pytest.approx(turn_b, rel=1e-12)
        assert value(self.SURFACE.turn_above, **given) == pytest.approx(turn_a, rel=1e-12)

    @pytest.mark.parametrize("seed", range(4))
    def test_the_sliding_field_keeps_the_height(self, seed):
        """It is ``(1 - s) below + s above`` with the share ``s`` for which the height has no rate."""
        t, x, y, a = np.random.default_rng(seed).uniform(-1.0, 1.0, 4)
        given = {"t": t, "x": (x, y), "a": a}
        L_b, L_a = value(self.SURFACE.speeds, **given)
        share = L_b / (L_b - L_a)
        below, above = np.array([1 + y, x - t]), np.array([x * y, -2 - y])
        field = value(self.SURFACE.sliding_field, **given)
        np.testing.assert_allclose(field, (1 - share) * below + share * above, rtol=1e-12)
        assert 2 * a * x * field[0] + field[1] == pytest.approx(np.cos(t), abs=1e-12)

    def test_projection_onto_the_surface(self):
        """To first order: the remainder is quadratic in the distance."""
        for distance in (1e-3, -1e-3):
            x = (0.6, np.sin(0.4) - 0.7 * 0.36 + distance)
            onto = value(self.SURFACE.projection, t=0.4, x=x)
            height = onto[1] + 0.7 * onto[0] ** 2 - np.sin(0.4)
            slope = 2 * 0.7 * 0.6
            assert abs(height) < 2 * distance**2
            moved = -distance / (1 + slope**2) * np.array([slope, 1.0])
            np.testing.assert_allclose(onto - x, moved, rtol=1e-12)


@pytest.mark.parametrize("below", [-1.0, 0.0, 1.0])
@pytest.mark.parametrize("above", [-1.0, 0.0, 1.0])
def test_arrivals_and_crossings_by_the_signs_of_both_speeds(below, above):
    at = surface(lambda t, x, p: (1.0, below), lambda t, x, p: (1.0, above))
    # With a speed of zero that does not turn, the field runs along the surface and has not turned back.
    assert bool(value(at.arrives_from_below)) == (above <= 0)
    assert bool(value(at.crosses_up)) == (above > 0)
    assert bool(value(at.arrives_from_above)) == (below >= 0)
    assert bool(value(at.crosses_down)) == (below < 0)


@pytest.mark.parametrize("side", [1, -1])
def test_an_orbit_that_turns_back_as_slowly_as_rounding_only_touches(side):
    """Rising or falling at a share of the speed of both fields, and turning back into its side."""

    def own(share):
        return lambda t, x, p: (0.0, side * (share * 5.0 + 0 * t) - side * 1.0 * t)

    def other(t, x, p):
        return 0.0, -4.0 * side

    for share, arrives in ((0.5 * TOUCH, False), (2.0 * TOUCH, True)):
        fields = (own(share), other) if side > 0 else (other, own(share))
        at = surface(*fields)
        function = at.arrives_from_below if side > 0 else at.arrives_from_above
        assert bool(value(function)) == arrives


def test_speeds_along_the_surface_do_not_count():
    """The first state has a unit of its own; the speed through the surface is that of a real arrival."""
    at = surface(lambda t, x, p: (1e300, 1e-3 - t), lambda t, x, p: (-1e300, -1.0))
    assert bool(value(at.arrives_from_below))


def test_the_same_speeds_do_not_attract():
    assert not surface(lambda t, x, p: (1.0, x.x), lambda t, x, p: (-1.0, x.x)).may_attract()
    assert surface(lambda t, x, p: (1.0, x.x), lambda t, x, p: (1.0, x.y)).may_attract()
    same = surface(lambda t, x, p: (1.0, 2.0), lambda t, x, p: (-1.0, 2.0))
    assert value(same.attraction) < 0.0


@pytest.mark.parametrize("unit", [1.0, 2.0**-60, 2.0**60])
@pytest.mark.parametrize("sign", [1.0, -1.0])
class TestOff:
    """A state slides if its distance from the surface is a small share of the terms of the height."""

    def test_terms_of_the_height(self, unit, sign):
        at = surface(
            lambda t, x, p: (unit, 2 * unit), lambda t, x, p: (unit, -2 * unit), lambda t, x, p: x.y - x.x
        )
        for share, off in ((0.5, False), (2.0, True)):
            x = unit * np.array([3.0, 3.0 + sign * 6.0 * share * SLIDING_BAND])
            assert bool(value(at.is_off, x=x)) == off

    def test_a_height_that_is_one_state(self, unit, sign):
        """Near is where the fields, at a speed of 4 in all, arrive before x = 3 has changed at rate 2."""
        at = surface(lambda t, x, p: (unit, 2 * unit), lambda t, x, p: (unit, -2 * unit))
        for share, off in ((0.5, False), (2.0, True)):
            height = share * SLIDING_BAND**2 * 4.0 * 3.0 / 2.0
            assert bool(value(at.is_off, x=unit * np.array([3.0, sign * height]))) == off
        # A state that does not move, or has no size, gives no measure.
        assert bool(value(at.is_off, x=unit * np.array([0.0, sign * 1e-30])))
        still = surface(lambda t, x, p: (0.0, 2 * unit), lambda t, x, p: (0.0, -2 * unit))
        assert bool(value(still.is_off, x=unit * np.array([3.0, sign * 1e-30])))
