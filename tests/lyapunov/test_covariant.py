"""Covariant vectors of maps and flows whose directions are known exactly."""

import numpy as np
import pytest

import hybrid
import lyapunov
import models
from tests.lyapunov.clocked import clocked


def along(vectors, directions):
    """Cosines between unit vectors ``(N, n)`` and directions ``(N, n)`` or ``(n,)``, without sign."""
    directions = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    return np.abs(np.sum(vectors * directions, axis=-1))


@pytest.fixture(scope="module")
def toral():
    """A hyperbolic map of the torus with the eigenvectors (1, sqrt 3) and (1, -sqrt 3)."""
    system = clocked(("x", "y"), lambda t, x, p: (np.mod(2 * x.x + x.y, 1.0), np.mod(3 * x.x + 2 * x.y, 1.0)))
    return lyapunov.covariant_vectors(system, (0.1, 0.2, 0.5), interval=1.0, intervals=100, transient=40)


def test_eigenvectors_of_a_linear_map(toral):
    directions = ([1.0, np.sqrt(3), 0.0], [0.0, 0.0, 1.0], [1.0, -np.sqrt(3), 0.0])
    for column, direction in enumerate(directions):
        np.testing.assert_allclose(along(toral.vectors[:, :, column], np.array(direction)), 1.0, rtol=1e-12)
    rate = np.log(2 + np.sqrt(3))
    np.testing.assert_allclose(toral.exponents, [rate, 0.0, -rate], atol=1e-12)
    np.testing.assert_allclose(toral.growths, np.tile(toral.exponents, (100, 1)), atol=1e-12)
    np.testing.assert_allclose(toral.angles, np.pi / 3, rtol=1e-12)
    assert toral.status.ok
    assert len(toral) == 100


@pytest.mark.parametrize(("a", "b"), [(0.3, 1.2), (1.2, 0.3), (0.7, 0.7)])
def test_the_angle_between_two_planes_is_the_smallest_between_their_directions(a, b):
    """Expanding directions ``e1, e2``; contracting ones at principal angles ``a`` and ``b`` to them."""
    directions = np.eye(4)
    directions[:, 2], directions[:, 3] = [np.cos(a), 0, np.sin(a), 0], [0, np.cos(b), 0, np.sin(b)]
    matrix = directions @ np.diag([3.0, 2.0, 0.5, 0.4]) @ np.linalg.inv(directions)
    names = ("w", "x", "y", "z")

    def image(t, x, p):
        return tuple(
            sum(float(each) * getattr(x, name) for each, name in zip(row, names, strict=True))
            for row in matrix
        )

    found = lyapunov.covariant_vectors(
        clocked(names, image), (0.0, 0.0, 0.0, 0.0, 0.5), interval=1.0, intervals=20, transient=200
    )
    np.testing.assert_allclose(
        found.exponents, [np.log(3), np.log(2), 0.0, np.log(0.5), np.log(0.4)], atol=1e-9
    )
    np.testing.assert_allclose(found.angles, min(a, b), rtol=1e-9)


def test_labelled(toral):
    found = toral.to_xarray()
    assert found.vectors.dims == ("sample", "state", "exponent")
    assert found.attrs["status"] == "SUCCESS"
    assert found.t.values[:2] == pytest.approx([40.0, 41.0])
    assert "100 points" in repr(toral)


def test_a_bakers_map():
    """Cut at a third: it stretches x by 3 or 1.5, and shrinks y by a fifth or a quarter."""

    def image(t, x, p):
        left = x.x < 1 / 3
        return np.where(left, 3 * x.x, 1.5 * x.x - 0.5), np.where(left, x.y / 5, 0.75 + x.y / 4)

    found = lyapunov.covariant_vectors(
        clocked(("x", "y"), image), (0.2, 0.3, 0.5), interval=1.0, intervals=2000, transient=70
    )
    left = found.x[:, 0] < 1 / 3
    np.testing.assert_allclose(found.growths[:, 0], np.log(np.where(left, 3.0, 1.5)), rtol=1e-12)
    np.testing.assert_allclose(found.growths[:, 2], np.log(np.where(left, 0.2, 0.25)), rtol=1e-12)
    np.testing.assert_allclose(found.angles, np.pi / 2, rtol=1e-12)
    exact = [np.log(3) - 2 / 3 * np.log(2), 0.0, -np.log(4) - np.log(5 / 4) / 3]
    assert np.all(np.abs(found.exponents - exact) <= 4 * found.standard_error + 1e-12)
    dimension = lyapunov.kaplan_yorke_dimension(exact)
    assert lyapunov.kaplan_yorke_dimension(found.exponents) == pytest.approx(dimension, abs=0.02)


def test_an_annihilated_direction():
    """The map forgets y: that direction is mapped to zero; the other vector is the image of one along x."""
    system = clocked(("x", "y"), lambda t, x, p: (4 * x.x * (1 - x.x), x.x))
    found = lyapunov.covariant_vectors(system, (0.1, 0.2, 0.5), interval=1.0, intervals=400, transient=50)
    x = found.x[:, 0]
    assert found.exponents[2] == -np.inf
    assert np.all(found.growths[:, 2] == -np.inf)
    np.testing.assert_allclose(along(found.vectors[:, :, 2], np.array([0.0, 1.0, 0.0])), 1.0, rtol=1e-12)
    slope = np.column_stack([4 - 8 * x[:-1], np.ones(399), np.zeros(399)])
    np.testing.assert_allclose(along(found.vectors[1:, :, 0], slope), 1.0, rtol=1e-10)
    assert abs(found.exponents[0] - np.log(2)) < 4 * found.standard_error[0]
    # The map takes (a, b) to (4 - 8 x, 1) a.
    length = np.hypot(slope[:, 0], 1)
    expected = np.log(np.abs(slope[:-1, 0]) * length[1:] / length[:-1])
    np.testing.assert_allclose(found.growths[1:-1, 0], expected, atol=1e-8)


def test_eigenvectors_of_an_orbit_with_impacts():
    """On a periodic orbit the vectors are the eigenvectors of its fundamental matrix."""
    system, parameters = models.impact_oscillator(), {"w": 0.65, "r": 0.4}
    section = hybrid.stroboscopic_section(system, (0.0, 0.0), periods=200, parameters=parameters)
    orbit = hybrid.periodic_orbit(system, section.x[-1], parameters=parameters)
    values, directions = np.linalg.eig(orbit.fundamental)
    order = np.argsort(-np.abs(values))
    assert orbit.transitions == ("impact", "impact")
    found = lyapunov.covariant_vectors(system, orbit.x0, parameters=parameters, intervals=20, transient=60)
    np.testing.assert_allclose(found.exponents, lyapunov.floquet_exponents(orbit), rtol=1e-6)
    for column, index in enumerate(order):
        cosines = along(found.vectors[:, :, column], directions[:, index])
        np.testing.assert_allclose(cosines, 1.0, rtol=1e-6)


def test_each_vector_is_taken_to_a_multiple_of_the_next():
    """Also through grazing-prone chaos with a stiff contact: by the fundamental matrix of each interval."""
    system = models.impact_oscillator()
    parameters = {"c": 0.01, "r": 0.9, "w": 0.85}
    found = lyapunov.covariant_vectors(system, (0.3, 0.0), parameters=parameters, intervals=30, transient=60)
    for i in range(29):
        span = (found.t[i], found.t[i] + found.interval)
        arc = hybrid.simulate(system, found.x[i], span, parameters=parameters, tangent=np.eye(2))
        images = arc.fundamental @ found.vectors[i]
        sizes = np.linalg.norm(images, axis=0)
        np.testing.assert_allclose(along((images / sizes).T, found.vectors[i + 1].T), 1.0, atol=1e-7)
        np.testing.assert_allclose(np.log(sizes), found.growths[i] * found.interval, atol=1e-6)


def test_the_flow_is_a_neutral_direction():
    system = models.solvable_oscillator()
    arc = hybrid.simulate(system, (0.3, 0.0), (0.0, 0.2))
    # Between the jumps, which are at integer times.
    found = lyapunov.covariant_vectors(
        system, arc.x[-1], mode=str(arc.mode[-1]), interval=1.0, intervals=200, transient=40
    )
    assert found.exponents[0] == pytest.approx(0.5, abs=1e-8)
    assert abs(found.exponents[1]) < 1e-3
    # The flow's own direction is neutral, and there is no stable one.
    assert np.isnan(found.angles).all()
    flow = np.column_stack([found.x[:, 1], found.x[:, 1] - (4 * np.pi**2 + 0.25) * (found.x[:, 0] - 1)])
    inside = found.mode == "plus"
    np.testing.assert_allclose(along(found.vectors[inside, :, 1], flow[inside]), 1.0, atol=1e-6)


def test_a_run_that_ends_keeps_its_vectors():
    ball = lyapunov.covariant_vectors(
        models.bouncing_ball(), (1.0, 0.0), interval=0.25, intervals=100, transient=2
    )
    assert not ball.status.ok
    assert 5 < len(ball) < 20
    nothing = lyapunov.covariant_vectors(
        models.bouncing_ball(), (1.0, 0.0), interval=0.25, intervals=10, transient=100
    )
    assert nothing.vectors.shape == (0, 2, 2)
    assert "0 points" in repr(nothing)
