"""Newton's cradle: impacts of all balls at once and of one after another, its period, and its end."""

import math

import numpy as np
import pytest

import hybrid
from models import newtons_cradle

A, W = 0.1, 2 * math.pi
LAWS = ("newton", "poisson")


def pulled(balls, count=1):
    """The first ball, or the first ones, pulled aside."""
    return [*[-A] * count, *[0.0] * (2 * balls - count)]


def velocities(cradle, start, t, **parameters):
    """Speeds at a time, over that of the first ball at the bottom."""
    arc = hybrid.simulate(cradle, start, (0.0, t), parameters=parameters)
    assert arc.status.ok
    balls = len(start) // 2
    return arc.x[-1, balls:] / (A * W)


@pytest.mark.parametrize("impacts", LAWS)
@pytest.mark.parametrize("balls", [2, 3, 5])
@pytest.mark.parametrize("e", [1.0, 0.6])
def test_touching_balls_share_the_impact(impacts, balls, e):
    """A quarter of a swing to the impact and half a swing more: speeds are the opposite of those after it."""
    found = -velocities(newtons_cradle(balls, impacts), pulled(balls), 0.7499, e=e)
    share = (1 + e) / balls
    np.testing.assert_allclose(found, [share - e, *[share] * (balls - 1)], atol=1e-5)


def test_three_touching_balls():
    [first] = hybrid.simulate(newtons_cradle(), pulled(3), (0.0, 0.3)).jumps["1-2+2-3"]
    assert first.t == pytest.approx(0.25, abs=1e-8)
    np.testing.assert_allclose(first.x_plus[3:] / (A * W), [-1 / 3, 2 / 3, 2 / 3], atol=1e-8)


def test_the_balls_come_back_and_the_first_flies_as_it_came():
    arc = hybrid.simulate(newtons_cradle(), pulled(3), (0.0, 10.0))
    assert arc.status.ok
    for period in range(1, 11):
        np.testing.assert_allclose(arc(float(period))[:3], [-A, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(arc["energy"], (A * W) ** 2 / 2, rtol=1e-9)


@pytest.mark.parametrize(
    ("impacts", "gap"), [("newton", 1e-7), ("sequential", 1e-7), ("sequential", 1e-10), ("poisson", 1e-7)]
)
@pytest.mark.parametrize("count", [1, 2])
def test_with_small_gaps_as_many_fly_as_came(impacts, gap, count):
    balls = 4
    found = -velocities(newtons_cradle(balls, impacts), pulled(balls, count), 0.7499, d=gap)
    np.testing.assert_allclose(found, [*[0.0] * (balls - count), *[1.0] * count], atol=1e-4)


def test_balls_that_lose_energy_swing_together_in_the_end():
    arc = hybrid.simulate(newtons_cradle(), pulled(3), (0.0, 40.0), parameters={"e": 0.5})
    assert arc.status.ok
    np.testing.assert_allclose(arc.x[-1], [*[-A / 3] * 3, 0.0, 0.0, 0.0], atol=1e-6)


def test_there_are_two_balls_or_more():
    with pytest.raises(hybrid.ArgumentError, match="balls must be"):
        newtons_cradle(1)
