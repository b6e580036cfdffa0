"""How far rounding and tolerances move a guard, its speed and its acceleration, compared with NumPy."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from numba import njit

from hybrid import DOP853, Guard, HybridSystem, Mode, Transition
from hybrid.kernels.events import derivatives, guards
from hybrid.kernels.types.layout import EPSILON
from hybrid.simulation.trajectory import start
from tests.hybrid.kernels.plain import plain

_band, _smooth, _tolerated = guards.rounding_band, guards.smooth_band, guards.error_band
_speed, _speed_rounding = guards.guard_speed, derivatives.speed_rounding
_acceleration, _acceleration_rounding = guards.guard_acceleration, derivatives.acceleration_rounding
_widen, _time = guards.widen_scale, guards.size_of_time
T, X, SCALE = 0.7, np.array([0.4, -1.2, 2.0]), np.array([3.0, 1.5, 2.5])


@njit
def judged(model, method, run, transition, t, x, work, out):
    model.field(0, t, x, model.parameters, work.field)
    out[0] = _speed(model, transition, t, x, work.field, work.gradient)
    out[1] = _band(model, run, transition, t, x, work)
    out[2] = _smooth(model, run, transition, t, x, work)
    out[3] = _tolerated(method, run, work.gradient, model.dimension)
    out[4] = _speed_rounding(model, run, transition, 0, t, x, work)
    out[5] = _acceleration(model, run, transition, 0, t, x, work)
    out[6] = _acceleration_rounding(model, run, transition, 0, t, x, work)


@njit
def widened(model, run, t, work):
    model.field(0, t, run.y, model.parameters, work.field)
    _widen(model, run, work)


def flat(t, x, p):
    return 0.5 * x.a - 2.0 * x.b + 0.25 * x.c - 3.0 * t


def hidden(t, x, p):
    if x.a > 1e9:
        return 0.0
    return x.a * x.b + 0.3 * x.c * x.c - 0.5 * t


@cache
def system(period=0.0):
    return HybridSystem(
        state=("a", "b", "c"),
        modes=[Mode("m", lambda t, x, p: (x.b * x.c, x.c * t * t - x.a * x.a, -0.4 * x.a * x.c))],
        transitions=[
            Transition(
                "m", "m", Guard(flat, +1), name="affine"
            ),
            Transition(
                "m", "m", Guard(lambda t, x, p: x.a * x.b + 0.3 * x.c * x.c - 0.5 * t, +1), name="bent"
            ),
            Transition(
                "m", "m",
                Guard(hidden, +1, gradient=lambda t, x, p: (x.b, x.a, 0.6 * x.c, -0.5 + 0.0 * t)),
                name="hidden",
            ),
            Transition("m", "m", Guard(lambda t, x, p: x.a * t * t - x.b, +1), name="turning"),
        ],
    )  # fmt: skip


def field(t, x):
    return np.array([x[1] * x[2], x[2] * t**2 - x[0] ** 2, -0.4 * x[0] * x[2]])


def jacobian(t, x):
    return np.array(
        [
            [0.0, x[2], x[1], 0.0],
            [-2 * x[0], 0.0, t**2, 2 * x[2] * t],
            [-0.4 * x[2], 0.0, -0.4 * x[0], 0.0],
        ]
    )


def gradient(name, t, x):
    if name == "affine":
        return np.array([0.5, -2.0, 0.25, -3.0])
    if name == "turning":
        return np.array([t**2, -1.0, 0.0, 2 * x[0] * t])
    return np.array([x[1], x[0], 0.6 * x[2], -0.5])


def turning(name, t, x, f):
    """Derivatives of the speed along given rates, by the states and by time."""
    if name == "affine":
        return np.zeros(4)
    if name == "turning":
        return np.array([2 * t, 0.0, 0.0, 2 * t * f[0] + 2 * x[0]])
    return np.array([f[1], f[0], 0.6 * f[2], 0.0])


NAMES = ["affine", "bent", "hidden", "turning"]


@pytest.mark.parametrize("name", NAMES)
def test_values_speeds_and_accelerations_with_their_rounding(name):
    trajectory = start(system(), X, T, mode="m", solver=DOP853(rtol=1e-5, atol=1e-4))
    trajectory.run.scale[:] = SCALE
    out, transition = np.zeros(7), NAMES.index(name)
    judged(trajectory.model, trajectory.method, trajectory.run, transition, T, X, trajectory.work, out)
    f, J, g = field(T, X), jacobian(T, X), gradient(name, T, X)
    share = 16 * EPSILON
    speed = g[3] + g[:3] @ f
    assert out[0] == pytest.approx(speed, rel=1e-14)
    band = share * (abs(g[3]) * T + np.abs(g[:3]) @ SCALE)
    # These are far below the absolute tolerance of pytest.approx.
    # Bounds also have the rounding of each operation.
    assert band <= out[1] <= 1.3 * band or out[1] == pytest.approx(band, rel=1e-12, abs=0.0)
    assert out[2] == pytest.approx(band, rel=1e-12, abs=0.0)
    assert out[3] == pytest.approx(np.abs(g[:3]) @ (1e-4 + 1e-5 * SCALE), rel=1e-12)
    # The field may be off by its own rounding and by that of its arguments.
    spread = np.abs(f) + np.abs(J[:, 3]) * T + np.abs(J[:, :3]) @ SCALE
    # State and time turn the gradient of a guard that is not affine.
    bends = turning(name, T, X, f)
    turned = np.abs(bends) @ [*SCALE, T]
    assert out[4] == pytest.approx(
        share * (abs(g[3]) + np.abs(g[:3]) @ spread + turned), rel=0.1 if turned else 1e-12, abs=0.0
    )
    acceleration = bends[:3] @ f + bends[3] + g[:3] @ (J[:, 3] + J[:, :3] @ f)
    assert out[5] == pytest.approx(acceleration, rel=1e-12 if name != "hidden" else 1e-6)
    bend = np.abs(J[:, 3]) + np.abs(J[:, :3]) @ spread
    assert out[6] == pytest.approx(share * (np.abs(g[:3]) @ bend), rel=1e-12, abs=0.0)


def test_sizes_are_at_least_what_the_flow_changes_while_rates_change():
    """In the time that a rate takes to change by its own size, or that the fastest feedback takes."""
    trajectory = start(system(), X, T, mode="m", solver=DOP853())
    trajectory.run.scale[:] = 0.1
    widened(trajectory.model, trajectory.run, T, trajectory.work)
    f, J = field(T, X), jacobian(T, X)
    change = J[:, 3] + J[:, :3] @ f
    feedback = np.abs(J[:, :3] * J[:, :3].T).max()
    moments = np.minimum(np.abs(f / change), feedback**-0.5)
    np.testing.assert_allclose(trajectory.run.scale, np.maximum(0.1, np.abs(f) * moments), rtol=1e-12)
    # A run that is known to be short does not take that long, but as long as its clock has come.
    assert moments.max() > T
    for horizon, longest in ((0.9 * T, T), (0.5 * (T + moments.max()), 0.5 * (T + moments.max()))):
        trajectory.run.scale[:], trajectory.run.horizon = 0.0, horizon
        widened(trajectory.model, trajectory.run, T, trajectory.work)
        expected = np.abs(f) * np.minimum(moments, longest)
        np.testing.assert_allclose(trajectory.run.scale, expected, rtol=1e-12)
    large = np.full(3, 100.0)
    trajectory.run.scale[:] = large
    widened(trajectory.model, trajectory.run, T, trajectory.work)
    np.testing.assert_array_equal(trajectory.run.scale, large)


@cache
def pushed():
    """Large forces that cancel at ``t = 2 pi``, among small ones, in a mode and in the guard of another."""
    return HybridSystem(
        state=("x", "v"),
        parameters={"f": 1e6},
        modes=[
            Mode("first", lambda t, x, p: (np.sin(t) + x.v, np.cos(3.0 * t) - x.x)),
            Mode("second", lambda t, x, p: (x.v, 1e6 * np.cos(t) - p.f - x.x)),
            Mode("third", lambda t, x, p: (x.v, np.exp(-(((t - 3.0) / 0.01) ** 2)) - x.x)),
        ],
        transitions=[
            Transition("first", "second", Guard(lambda t, x, p: 1e6 * np.cos(t) - p.f - x.x, +1)),
            Transition("second", "first", Guard(lambda t, x, p: x.v, +1)),
            Transition("second", "third", Guard(lambda t, x, p: x.v - 5.0, +1)),
            Transition("third", "first", Guard(lambda t, x, p: x.v, -1)),
        ],
    )


@njit
def bands_of_residues(model, run, t, x, work, out):
    for transition in range(2):
        model.field(transition, t, x, model.parameters, work.field)
        _speed(model, transition, t, x, work.field, work.gradient)
        out[transition, 0] = _smooth(model, run, transition, t, x, work)
        out[transition, 1] = _speed_rounding(model, run, transition, transition, t, x, work)


def test_terms_that_cancel_leave_their_own_rounding():
    """At ``x = 0`` and ``t = 2 pi`` neither the state nor any derivative tells how large the terms were."""
    t, x, out = 2 * np.pi, np.zeros(2), np.zeros((2, 2))
    trajectory = start(pushed(), x, t, mode="first", solver=DOP853())
    trajectory.run.scale[:] = 0.0
    bands_of_residues(trajectory.model, trajectory.run, t, x, trajectory.work, out)
    # The guard of the first and the speed of the guard of the second are differences of large numbers.
    assert 1e-11 < out[0, 0] < 1e-8
    assert 1e-11 < out[1, 1] < 1e-8
    assert out[1, 0] == 0.0
    # Beside a large state that rounding is nothing: no other terms are added.
    trajectory.run.scale[:] = 1e9
    bands_of_residues(trajectory.model, trajectory.run, t, x, trajectory.work, out)
    assert out[0, 0] == pytest.approx(16 * EPSILON * 1e9, rel=1e-2, abs=0.0)
    assert out[1, 0] == pytest.approx(16 * EPSILON * 1e9, rel=1e-2, abs=0.0)


def jacobian_place(value, *, steep=1, direction=1):
    """Where the Jacobian is evaluated for the guard ``2 (x0 - 1)``, whose rounding is 0.5, at ``x0 = 1``."""
    places = []
    kernels = plain(
        guards,
        guard_value=lambda *arguments: value,
        gradient_band=lambda *arguments: 0.5,
    )
    model = SimpleNamespace(
        dimension=2,
        parameters=None,
        direction=[9, direction],
        steep=[0, 0, steep],
        field_jacobian=lambda mode, t, x, parameters, out: places.append(x.copy()),
    )
    work = SimpleNamespace(
        scalar=None, jacobian=None, gradient=np.array([2.0, 0.0, 7.0]), rounding=np.zeros((4, 2))
    )
    kernels.slopes_at_guard(model, None, 1, 2, 0.0, np.array([1.0, 5.0]), work)
    [[moved, other]] = places
    assert other == 5.0
    return moved - 1.0


@pytest.mark.parametrize("direction", [-1, 1])
def test_a_root_of_a_guard_has_its_slope_beyond_the_guard(direction):
    """There it is zero. The guard is moved by its value and by its rounding, to the far side."""
    for value in (0.0, 0.75, -0.75):
        assert jacobian_place(value, direction=direction) == direction * (abs(value) + 0.5) / 2.0
    # Away from the guard, and in a mode without such roots, the slope is that of the state.
    assert jacobian_place(8.01, direction=direction) == jacobian_place(-8.01, direction=direction) == 0.0
    assert jacobian_place(7.99, direction=direction) != 0.0
    assert jacobian_place(0.0, direction=direction, steep=0) == jacobian_place(0.0, direction=0) == 0.0


def test_a_guard_that_rounding_has_left_behind_moves_back():
    def left(value, speed, side):
        kernels = plain(guards, guard_value=lambda *arguments: value, rounding_band=lambda *arguments: 0.5)
        return bool(
            kernels.was_left_behind(None, None, 0, 0.0, None, speed, side, SimpleNamespace(scalar=None))
        )

    for side in (-1, 1):
        assert left(-7.9 * side, 1e-9 * side, side)
        assert not left(-8.1 * side, 1e-9 * side, side)
        assert not left(-7.9 * side, -1e-9 * side, side)
        assert not left(-7.9 * side, 0.0, side)


def test_a_state_beside_a_guard():
    """Displaced along the gradient; a guard of time alone moves no state."""
    displace, out = plain(guards).displace, np.zeros(2)
    model = SimpleNamespace(dimension=2)
    displace(model, np.array([1.0, 2.0]), 5.0, np.array([3.0, -4.0, 9.0]), out)
    np.testing.assert_allclose(out, [1.6, 1.2], rtol=1e-15)
    displace(model, np.array([1.0, 2.0]), 5.0, np.array([0.0, 0.0, 9.0]), out)
    assert out.tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    ("value", "direction", "before", "after"),
    [
        (2.0, 1, 0, 1),
        (-2.0, 1, 1, -1),
        (2.0, 0, -1, 1),
        # Within rounding it has not crossed yet, if it has a side at all.
        (0.5, 1, 1, -1),
        (-0.5, 1, -1, -1),
        (0.5, -1, -1, 1),
        (0.0, -1, 1, 1),
        (0.5, 1, 0, 0),
        (0.5, 0, 1, 1),
        (np.nan, 1, 1, 1),
        (np.nan, 1, -1, -1),
        (1.0, 1, 1, -1),
    ],
)
def test_sides_at_a_state(value, direction, before, after):
    """The second mode has the transitions 2 and 0, and 1 is none of them; rounding is 1."""
    asked = []

    def gradient(transition, t, x, parameters, out):
        asked.append(transition)

    tested = plain(guards, guard_value=lambda *given: value, rounding_band=lambda *given: 1.0).sides_at
    model = SimpleNamespace(
        first_outgoing=np.array([0, 1, 3]),
        outgoing=np.array([1, 2, 0]),
        direction=np.array([direction, 5, direction]),
        guard_gradient=gradient,
        parameters=None,
    )
    run = SimpleNamespace(mode=1, y=None, side=np.array([before, 7, before]))
    tested(model, run, 0.0, SimpleNamespace(scalar=None, gradient=None))
    assert run.side.tolist() == [after, 7, after]
    assert asked == [2, 0]
