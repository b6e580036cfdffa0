"""The reference for piecewise-affine Filippov systems against closed forms and a regularised integration."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from tests.reference.piecewise_affine import System, as_function, random_system, solve

STATUSES = {"ended", "undecided", "grazing", "too many events"}


def additive(A, b, C, normals, offsets):
    """The system ``A x + b + C sign(normals x - offsets)``."""
    A, b, C, normals, offsets = (np.array(a, float) for a in (A, b, C, normals, offsets))
    m, n = normals.shape
    constants = np.empty((2,) * m + (n,))
    for cell in np.ndindex((2,) * m):
        constants[cell] = b + C @ (2.0 * np.array(cell) - 1)
    return System(normals, offsets, np.broadcast_to(A, (2,) * m + (n, n)), constants, (A, b, C))


def affine_sliding(system, mode):
    """The augmented matrix of the field in a mode of an additive system."""
    A, b, C = system.additive
    on = [k for k, s in enumerate(mode) if s == 0]
    flow = np.column_stack([A, b + C @ mode])
    normals = system.normals[on]
    flow = flow - C[:, on] @ np.linalg.solve(normals @ C[:, on], normals @ flow) if on else flow
    return np.vstack([flow, np.zeros(len(b) + 1)])


def plane(C, b=(0.0, 0.0)):
    return additive(np.zeros((2, 2)), b, C, np.eye(2), [0, 0])


def regularised(system, x0, times, width):
    """Each sign replaced by ``tanh(h / width)``."""
    field = lambda t, x: system.field(x, np.tanh(system.heights(x) / width))  # noqa: E731
    run = solve_ivp(field, (0, times[-1]), x0, "LSODA", times, rtol=1e-8, atol=1e-10)
    return run.y.T


class TestRelay:
    def test_slides_at_zero(self):
        run = solve(additive([[0]], [0.3], [[-1]], [[1]], [0]), [0.7], 3.0, [0.5, 1.0, 2.0])
        assert (run.status, run.modes) == ("ended", [(1,), (0,)])
        assert run.times == pytest.approx([1.0], abs=1e-13)
        np.testing.assert_allclose(run.states[:, 0], [0.35, 0.0, 0.0], atol=1e-13)

    def test_repelling_surface_at_the_start_is_undecided(self):
        system = additive([[0]], [0.3], [[1]], [[1]], [0])
        assert solve(system, [0.0], 1.0).status == "undecided"
        run = solve(system, [0.0], 1.0, mode=(1,))
        assert run.x == pytest.approx([1.3])

    def test_grazing(self):
        """The parabola ``y = (t - 1)^2 / 2`` touches ``y = 0``."""
        A = np.array([[0, 1], [0, 0]])
        system = additive(A, [0, 1], [[0], [-0.0]], [[1, 0]], [0])
        run = solve(system, [0.5, -1.0], 3.0)
        assert (run.status, run.t) == ("grazing", pytest.approx(1.0, abs=1e-4))

    def test_two_crossings_close_together_are_seen(self):
        depth = 1e-6
        system = additive([[0, 1], [0, 0]], [0, 1], [[0], [0]], [[1, 0]], [0])
        run = solve(system, [0.5 - depth, -1.0], 3.0)
        half = np.sqrt(2 * depth)
        assert run.times == pytest.approx([1 - half, 1 + half], abs=1e-11)


class TestBelt:
    """``x'' = -x + F``: on the slower side ``F = 1 + g (v - belt)``, on the faster side ``F = -1``."""

    belt, g = 0.2, 0.4

    def system(self):
        matrices = np.array([[[0, 1], [-1, self.g]], [[0, 1], [-1, 0]]], float)
        constants = np.array([[0, 1 - self.g * self.belt], [0, -1]])
        return System(np.array([[0.0, 1.0]]), np.array([self.belt]), matrices, constants)

    def slip(self):
        """Duration of a slip from ``(1, belt)``, and where it ends."""
        middle, damping = 1 - self.g * self.belt, self.g / 2
        w = np.sqrt(1 - damping**2)
        p, q = 1 - middle, (self.belt - damping * (1 - middle)) / w
        x = lambda t: middle + np.exp(damping * t) * (p * np.cos(w * t) + q * np.sin(w * t))  # noqa: E731
        turned = lambda t: (damping * p + w * q) * np.cos(w * t) + (damping * q - w * p) * np.sin(w * t)  # noqa: E731
        end = brentq(
            lambda t: np.exp(damping * t) * turned(t) - self.belt, 1.5 * np.pi, 2 * np.pi, xtol=1e-14
        )
        return end, x(end)

    def test_stick_slip(self):
        end, restick = self.slip()
        stick = (1 - restick) / self.belt
        run = solve(self.system(), [0.5, self.belt], 30.0)
        assert run.modes[:3] == [(0,), (-1,), (0,)]
        np.testing.assert_allclose(np.diff(run.times)[:4], [end, stick, end, stick], atol=1e-10)


class TestIntersection:
    def test_reached_through_sliding(self):
        """From (1, 2): y' = -0.8 and x' = -0.7 until x = 0, then u = 0.3 and y' = -0.94."""
        run = solve(plane([[-1, 0.3], [0.2, -1]]), [1.0, 2.0], 5.0, [5.0])
        assert run.modes == [(1, 1), (0, 1), (0, 0)]
        first = 1 / 0.7
        np.testing.assert_allclose(run.times, [first, first + (2 - 0.8 * first) / 0.94], atol=1e-12)
        np.testing.assert_allclose(run.states, [[0, 0]], atol=1e-12)

    def test_left_where_the_equivalent_control_reaches_one(self):
        """A third state drives ``y' = -sign(y) + z`` with ``z' = 1``: the orbit leaves at ``z = 1``."""
        A = np.zeros((3, 3))
        A[1, 2] = 1
        system = additive(A, [0.2, 0, 1], [[-1, 0], [0, -1], [0, 0]], np.eye(3)[:2], [0, 0])
        run = solve(system, [0.0, 0.0, -0.5], 2.5)
        assert (run.status, run.modes) == ("ended", [(0, 0), (0, 1)])
        assert run.times == pytest.approx([1.5], abs=1e-11)
        np.testing.assert_allclose(run.x, [0, 0.5, 2.0], atol=1e-11)

    def test_additive_sliding_is_affine(self):
        """In each mode the orbit is an exponential: the equivalent control is affine."""
        met = 0
        for seed in range(8):
            rng = np.random.default_rng(seed)
            system, x0 = random_system(rng, 4, 3, "additive", attraction=1.0), rng.normal(size=4)
            ends = solve(system, x0, 4.0)
            times = [0.0, *ends.times, ends.t]
            states = solve(system, x0, 4.0, times).states
            for i, mode in enumerate(ends.modes):
                met += mode.count(0) > 1
                expected = expm((times[i + 1] - times[i]) * affine_sliding(system, mode)) @ [*states[i], 1]
                np.testing.assert_allclose(states[i + 1], expected[:-1], atol=1e-10)
        assert met > 3

    def test_inward_spiral_stops_as_grazing(self):
        run = solve(plane([[-0.5, -2], [2, -0.5]]), [1.0, 0.4], 9.0)
        assert run.status == "grazing"
        assert np.abs(run.x).max() < 1e-4

    def test_bilinear(self):
        """Vertex fields without an additive form, against the rest of the regularised orbit."""
        rng = np.random.default_rng(7)
        met = 0
        for _ in range(15):
            system = random_system(rng, 3, 2, "general", attraction=1.0)
            x = np.linalg.lstsq(system.normals, system.offsets)[0]
            run = solve(system, x, 1e-3)
            if run.status == "ended" and run.modes[0] == (0, 0):
                met += 1
                u = np.tanh(system.heights(_settled(system, x)) / 1e-6)
                speed = system.normals @ system.field(x, u)
                assert np.abs(speed).max() < 1e-2
                step = (run.x - x) / run.t
                np.testing.assert_allclose(step, system.field(x, u), atol=1e-2)
        assert met > 5


def _settled(system, x):
    """Where the regularised orbit comes to rest relative to the surfaces."""
    return regularised(system, x, np.array([0.0, 1e-4]), 1e-6)[-1]


class TestFunction:
    @pytest.mark.parametrize("kind", ["additive", "general"])
    @pytest.mark.parametrize("m", [1, 2, 3])
    def test_equals_the_table(self, kind, m):
        rng = np.random.default_rng(m)
        system = random_system(rng, 3, m, kind)
        f = as_function(system)
        for x in rng.normal(size=(20, 3)):
            cell = tuple((system.heights(x) > 0).astype(int))
            expected = system.matrices[cell] @ x + system.constants[cell]
            np.testing.assert_allclose(np.array(f(0.0, list(x), None), float), expected, atol=1e-13)


class TestRandomSystems:
    @pytest.mark.parametrize(
        ("n", "m", "kind"), [(2, 1, "general"), (2, 2, "additive"), (3, 2, "general"), (4, 3, "additive")]
    )
    def test_regularised_orbits_are_close(self, n, m, kind):
        rng = np.random.default_rng(n * 10 + m)
        compared = 0
        while compared < 2:
            system, x0 = random_system(rng, n, m, kind), rng.normal(size=n)
            times = np.linspace(0, 5, 11)
            run = solve(system, x0, 5.0, times)
            assert run.status in STATUSES
            if run.status != "ended" or not any(0 in mode for mode in run.modes):
                continue
            compared += 1
            np.testing.assert_allclose(run.states, regularised(system, x0, times, 1e-5), atol=1e-3)

    def test_modes_hold(self):
        rng = np.random.default_rng(5)
        times = np.linspace(0, 5, 101)
        for _ in range(5):
            system = random_system(rng, 3, 2, "general")
            run = solve(system, rng.normal(size=3), 5.0, times)
            for t, x in zip(times[times < run.t], run.states[times < run.t], strict=True):
                mode = run.modes[np.searchsorted(run.times, t)]
                heights = system.heights(x)
                assert all(
                    abs(h) < 1e-10 if s == 0 else s * h > -1e-10 for s, h in zip(mode, heights, strict=True)
                )
