"""The tangent map of a run as triangles between bases."""

from functools import reduce

import numpy as np

import hybrid
import models
from hybrid.kernels.types import codes
from hybrid.orbits.triangles import Triangles
from hybrid.simulation.trajectory import start


def test_their_product_is_the_fundamental_matrix():
    system, x0, period = models.impact_oscillator(), (0.3, 0.2), 2 * np.pi
    basis = np.linalg.qr(np.array([[1.0, 2.0], [3.0, -1.0]]))[0]
    triangles = Triangles(start(system, x0, 0.0, tangent=basis), period, basis)
    found = list(triangles.following(3))
    assert [each.t for each in found] == [0.0, period, 2 * period]
    arc = hybrid.simulate(system, x0, (0.0, 3 * period), tangent=np.eye(2))
    product = reduce(lambda done, each: each @ done, (tri for each in found for tri in each.triangles))
    np.testing.assert_allclose(triangles.basis @ product @ basis.T, arc.fundamental, atol=1e-9)
    np.testing.assert_allclose(
        np.sum([each.growth for each in found]), np.log(np.linalg.det(arc.fundamental))
    )
    np.testing.assert_allclose(found[2].x, hybrid.simulate(system, x0, (0.0, 2 * period)).x[-1], atol=1e-12)


def test_they_end_where_the_run_ends():
    trajectory = start(models.bouncing_ball(), (1.0, 0.0), 0.0, tangent=np.eye(2))
    triangles = Triangles(trajectory, 1.0, np.eye(2))
    assert len(list(triangles.following(10))) == 4
    assert triangles.code == codes.ACCUMULATION
