"""Rates of heights along flows, and what follows from them for one surface."""

import numpy as np
import pytest
import sympy

from hybrid.symbolic.tracing import model_symbols
from hybrid.transform import corners
from tests.hybrid.transform.test_cells import pieces_of

X, Y = model_symbols(2, 1).x
[K] = model_symbols(2, 1).p
T = model_symbols(2, 1).t


def oblique(t, x, p):
    """A step across ``2 x + 3 y^2 - 4 k t = 0``: below it the velocity is ``(1, y)``, above ``(-2, 5)``."""
    above = 2.0 * x.x + 3.0 * x.y**2 - 4.0 * p.k * t > 0.0
    return np.where(above, -2.0, 1.0), np.where(above, 5.0, x.y)


@pytest.fixture
def pieces():
    return pieces_of(oblique, parameters={"k": 0.5})[0]


def test_rates_of_a_height(pieces):
    """They are the slopes of the height times the velocity, and the slope in time."""
    assert pieces.surfaces.known[0].height == 2 * X + 3 * Y**2 - 4 * K * T
    rate = corners.rate_of(pieces, 0, lambda t, x, p: (x.y, 7.0 * t))
    assert sympy.expand(rate - (2 * Y + 42 * Y * T - 4 * K)) == 0
    below, above = corners.speeds(pieces, {0: 0}, 0)
    assert sympy.expand(below - (2 + 6 * Y**2 - 4 * K)) == 0
    assert sympy.expand(above - (-4 + 30 * Y - 4 * K)) == 0


def test_a_surface_attracts_from_both_sides(pieces):
    """The height grows below and falls above, and the attraction is the difference of these rates."""
    below, above = corners.speeds(pieces, {0: 0}, 0)
    assert corners.slides(pieces, {0: 0}) == [below, -above]
    assert corners.attraction(pieces, {0: 0}) == below - above
    assert corners.slides(pieces, {0: 1}) == []
    assert corners.slides(pieces, {}) == []
