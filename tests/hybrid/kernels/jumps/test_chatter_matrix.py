"""Tangent vectors through a chatter, rule by rule: matrix, drift, changes of impacts and of the duration."""

import numpy as np
import pytest

from hybrid.kernels.jumps import chatter
from hybrid.kernels.jumps.chatter import BEFORE, IMPULSE
from hybrid.kernels.types.codes import ENDLESS
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.jumps.balls import METHOD, PULL, Ball, Model, memory, new_run
from tests.hybrid.kernels.plain import plain

kernels = plain(chatter)


@pytest.mark.parametrize("bend", [0.0, 0.75])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_the_gradient_of_a_speed(bend, scale):
    """The speed is ``v + 2 b s (1/2 + q + 2 v)``."""
    out, (q, v, s) = np.zeros(3), (0.5, -1.0, 0.25)
    run = new_run(scale=np.full(3, scale))
    kernels.speed_gradient(Model(bend=bend), run, 1, 1, 0.0, np.array([q, v, s]), out, memory())
    expected = [2.0 * bend * s, 1.0 + 4.0 * bend * s, 2.0 * bend * (0.5 + q + 2.0 * v)]
    np.testing.assert_allclose(out, expected, rtol=1e-9)


def test_the_gradient_of_a_speed_takes_steps_in_the_size_of_each_component():
    """That of a component that has none is 1."""
    places = []

    class Bent(Model):
        def guard_gradient(self, transition, t, x, parameters, out):
            places.append(x.copy())
            super().guard_gradient(transition, t, x, parameters, out)

    x, run = np.array([-0.5, 8.0, 0.0]), new_run(scale=np.array([0.25, 16.0, 0.0]))
    kernels.speed_gradient(Bent(bend=0.75), run, 1, 1, 0.0, x, np.zeros(3), memory())
    steps = (np.array(places[1:]) - x).reshape(3, 2, 3)
    for j, size in enumerate((0.5, 16.0, 1.0)):
        step = 6e-6 * size
        expected = np.zeros((2, 3))
        expected[:, j] = step, -step
        np.testing.assert_allclose(steps[j], expected, rtol=1e-8, atol=0.0)


@pytest.mark.parametrize(("apart", "exact"), [(1.5e-13, True), (-1.5e-13, True), (2.5e-13, False)])
def test_entries_that_are_rounding_of_their_terms_are_zero(apart, exact):
    """Both of their terms are 1, up to what they are apart."""
    for impulse, carried, slope, height, entry in (
        # The identity less the motion that the speed brings, or less the speed, and the coupling of both.
        ((0.0, 1.0, 0.0), 1.0 + apart, (0.0, 0.0, 0.0), 1.0, (0, 0)),
        ((0.0, 0.0, 1.0), 0.0, (0.0, 0.0, 1.0 + apart), 1.0, (2, 2)),
        ((0.0, 1.0, 0.0), 1.0, (1.0, 0.0, 0.0), 1.0 + apart, (1, 0)),
    ):

        def speed_gradient(*given, carried=carried, slope=slope):
            work, out = given[-1], given[-2]
            out[:], work.jacobian[:] = slope, 0.0
            work.jacobian[0, 1] = carried

        class Tall(Model):
            # The gradient of the guard in the height.
            height = 1.0

            def guard_gradient(self, transition, t, x, parameters, out):
                out[:] = self.height, 0.0, 0.0, 0.0

        model, run, work = Tall(), new_run(), memory()
        model.height = height
        run.trail[IMPULSE, :3] = impulse
        plain(chatter, speed_gradient=speed_gradient).chatter_matrix(model, run, 1, work)
        found = work.saltation[entry]
        assert found == 0.0 if exact else abs(found) == pytest.approx(abs(apart), rel=1e-2, abs=0.0)


def test_the_matrix_of_a_whole_chatter():
    """``Xi = I - p (D_x v - (D_x v D_x f p) D_x g) - (D_x f p) D_x g``; it leaves states at rest alone."""
    for bend in (0.0, 0.5):
        run, work, model = new_run((0.25, -1.0, 0.5)), memory(), Model(bend=bend)
        slope, jacobian = np.zeros(3), np.zeros((3, 4))
        kernels.speed_gradient(model, run, 1, 1, 3.0, run.y, slope, memory())
        model.field_jacobian(1, 3.0, run.y, None, jacobian)
        gradient = np.array([1.0, 0.0, 2.0 * bend * 0.5])
        p = run.trail[IMPULSE, :3]
        carried = jacobian[:, :3] @ p
        expected = np.eye(3) - np.outer(p, slope - (slope @ carried) * gradient) - np.outer(carried, gradient)
        kernels.chatter_matrix(model, run, 1, work)
        np.testing.assert_allclose(work.saltation, expected, rtol=0, atol=2e-15)
        assert np.all((work.saltation != 0.0) == (np.abs(expected) > 1e-13))


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, 2.0, -1.0), (1e6, 1e5, 0.0), (0.0, 0.0, 0.0)])
def test_the_derivative_of_the_mean_field(direction):
    """``D f d - (D a d) p`` with ``a = -4 + q s / 2``, whose central difference is exact."""
    x, direction, p = np.array([0.5, -1.0, 0.25]), np.array(direction), np.array([0.0, 1.0, 0.25])
    model, run, mean, out = Model(), new_run(), np.zeros(3), np.zeros(3)
    kernels.mean_field(model, run, 1, 3.0, x, mean, memory())
    jacobian = np.zeros((3, 4))
    model.field_jacobian(1, 3.0, x, None, jacobian)
    work = memory()
    work.trial[:], work.new[:], work.reset_jacobian[:] = x, mean, jacobian
    kernels.along_mean(model, run, 1, 3.0, direction, 2.0, out, work)
    change = 0.5 * (direction[0] * x[2] + direction[2] * x[0])
    expected = jacobian[:, :3] @ direction - change * p
    np.testing.assert_allclose(out, expected, rtol=1e-8, atol=1e-8 * np.abs(direction).max())


def test_the_drift_with_the_mean_field():
    """Columns grow by ``A h + (A h)^2 / 2`` with the derivative of the mean field half way."""
    run, work, model, p = new_run((0.5, -1.0, 0.25)), memory(), Model(), np.array([0.0, 1.0, 0.25])
    work.settled[:] = 0.0, -0.5, 0.75
    q, s, h = 0.25, 0.5, 0.125
    jacobian = np.array([[0.0, 1.0, 0.0], [s / 2.0, 0.0, q / 2.0], [1.0, 2.0, 0.0]])
    a = jacobian - np.outer(p, [s / 2.0, 0.0, q / 2.0])
    start = np.array([[1.0, 2.0, 0.0], [0.0, -1.0, 0.0], [3.0, 1.0, 1.0]])
    work.saltation[:] = start
    times, field = set(), model.field
    model.field = lambda mode, t, *given: times.add(t) or field(mode, t, *given)
    kernels.drift_with_mean(model, run, 1, h, work)
    assert times == {3.0 + h / 2.0}
    expected = start + h * a @ start + h**2 / 2.0 * a @ a @ start
    np.testing.assert_allclose(work.saltation, expected, rtol=0, atol=1e-9)


def test_an_impact():
    """The guard's speed is the height's: from -2 to 1."""
    after = np.zeros(3)
    found = kernels.impact(Model(tilt=0.25), new_run(), 1, 3.0, np.array([0.0, -2.0, 1.0]), after, memory())
    assert found == (0.5, 3.0)
    assert after.tolist() == [0.0, 1.0, 1.75]


@pytest.mark.parametrize(
    ("up", "down", "noise", "change"),
    [
        (3.0, 1.0, 0.0, 2.0),
        (1.0, 3.0, 0.0, -2.0),
        (1.0, 3.0, 2.1, 0.0),
        (1.0, 3.0, 1.9, -2.0),
        (1.0, 1.0 + 100 * EPSILON, 0.0, 0.0),
        (1.0, 1.0 - 200 * EPSILON, 0.0, 200 * EPSILON),
        (1.0 + 120 * EPSILON, 1.0, 0.0, 0.0),
        (-1.0, -1.0 - 100 * EPSILON, 0.0, 0.0),
    ],
)
def test_changes_that_are_rounding(up, down, noise, change):
    assert kernels.changed(up, down, noise) == change


def test_an_impulse_that_turns():
    """The impulse per unit of the guard's speed at the limit, less the last one, in the time 1/8."""
    run, work, p = new_run((0.0, -1.0, 0.5)), memory(), np.array([0.0, 1.0, 0.25])
    work.settled[:] = 0.0, 0.0, 1.0
    work.error[:] = 2.0, 3.0, 4.0
    work.saltation[:] = 7.0
    kernels.add_turn_of_impulse(Model(tilt=0.5, bend=0.75), run, 1, 3.125, -2.0, 0.125, work)
    gradient = np.array([1.0, 0.0, 1.5 * 0.5])
    place = work.settled + 2.0 * p
    speed = lambda x: x[1] + 1.5 * x[2] * (0.5 + x[0] + 2.0 * x[1])  # noqa: E731
    after = np.array([place[0], -0.5 * place[1], place[2] - 0.75 * place[1]])
    turn = ((after - place) / (speed(after) - speed(place)) - p) / 0.125
    expected = 7.0 + np.outer(turn - np.dot([2.0, 3.0, 4.0], turn) * p, gradient)
    np.testing.assert_allclose(work.saltation, expected, rtol=1e-13)


def turned(model, run, settled, speed=-2.0):
    """How fast the impulse turns on the way of 1/8 to the limit: the slope of the guard is (0, 0, 0) here."""
    work = memory()
    work.settled[:], work.error[:], work.saltation[:] = settled, 0.0, 0.0
    kernels.add_turn_of_impulse(model, run, 1, 3.125, speed, 0.125, work)
    return work.saltation[:, 0]


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_an_impulse_at_the_limit_is_that_of_an_impact_with_the_last_speed(way):
    """With the speed ``v`` the height is 1/4 there, and the impulse of the third component 3/8."""
    found = turned(Changing(), new_run(), (0.25, 0.0, 1.0), speed=way)
    # The restitution is not the same on both sides, but the impulse is one per unit of speed.
    np.testing.assert_allclose(found, [0.0, 0.0, (0.375 - 0.25) / 0.125], rtol=1e-13)
    run = new_run()
    run.trail[IMPULSE, :3] = 0.5, 1.0, 0.25
    # An impulse of the height: it has been 1/4 + way / 2 before it is taken out.
    found = turned(Changing(), run, (0.25, 0.0, 1.0), speed=-way)
    expected = [-0.5 / 0.125, 0.0, 0.5 * (0.25 + 0.5 * way) / 0.125]
    np.testing.assert_allclose(found, expected, rtol=1e-13)


@pytest.mark.parametrize(
    ("turn", "counts"), [(1.1e-3, False), (1.3e-3, True), (-1.1e-3, False), (-1.3e-3, True)]
)
def test_a_turn_that_is_rounding_of_the_state_does_not_count(turn, counts):
    """Sixteen units of a size of 1e12, against a change of the speed by 3."""
    run = new_run(scale=np.array([1.0, 1.0, 1e12]))
    found = turned(Model(tilt=0.25 + turn), run, (0.0, 0.0, 1.0))
    np.testing.assert_allclose(found, [0.0, 0.0, turn / 0.125 if counts else 0.0], rtol=1e-9)
    # What moves for ever has no limit to turn to.
    run.trail[ENDLESS, 2] = 1.0
    assert turned(Model(tilt=0.25 + turn), run, (0.0, 0.0, 1.0)).tolist() == [0.0] * 3


class Changing(Model):
    """The restitution is ``1/2 + s/8``, and the impulse ``(0, 1, 1/4 + q/2)``."""

    def reset(self, transition, t, x, parameters, out):
        change = -(1.5 + 0.125 * x[2]) * x[1]
        out[:] = x[0], x[1] + change, x[2] + (0.25 + 0.5 * x[0]) * change


def test_impacts_that_change():
    """Derivatives of acceleration, restitution and impulse along the columns, which are those of formulas.

    The impulse takes out a speed of 2, and what the pull adds to it in the time 1/4.
    """
    run, work = new_run((0.5, 1.0, 0.5), scale=np.full(3, 0.125)), memory()
    columns = np.array([[1.0, 0.0, 0.0], [0.5, 0.0, 3.0], [2.0, 0.0, -1.0]])
    work.saltation[:] = columns
    kernels.add_change_of_impacts(Changing(), run, 1, 2.0, 0.25, work)
    q, s = 0.5, 0.5 - 2.0 * 0.25
    bends = 0.5 * (columns[0] * s + q * columns[2])
    np.testing.assert_allclose(work.rounding[0], bends, rtol=0, atol=1e-9)
    np.testing.assert_allclose(work.rounding[1], 0.125 * columns[2], rtol=0, atol=1e-9)
    taken = 0.5 * columns[0] * (2.0 + 0.25 * (-PULL + 0.5 * q * s))
    expected = columns - np.array([0.0 * taken, 0.0 * taken, taken])
    np.testing.assert_allclose(work.saltation, expected, rtol=0, atol=1e-9)


def test_steps_along_the_columns_are_those_of_the_component_that_allows_least():
    """The state without its speed is (1/2, -1, 0), and the sizes are 1/2, 1 and 1/8."""
    places = []

    class Noted(Changing):
        def field(self, mode, t, x, parameters, out):
            places.append(x.copy())
            super().field(mode, t, x, parameters, out)

    run, work = new_run((0.5, 1.0, 0.5), scale=np.full(3, 0.125)), memory()
    columns = np.array([[1.0, 0.0, 0.0], [0.5, 0.0, 3.0], [2.0, 0.0, -1.0]])
    work.saltation[:] = columns
    kernels.add_change_of_impacts(Noted(), run, 1, 2.0, 0.25, work)
    # An impact has rates before and after it as well.
    start, found = np.array([0.5, -1.0, 0.0]), np.array(places)[::3]
    expected = [
        sign * 6e-6 * 0.125 / most * columns[:, j] for j, most in ((0, 2.0), (2, 1.0)) for sign in (1, -1)
    ]
    np.testing.assert_allclose(found - start, expected, rtol=1e-8, atol=0.0)


@pytest.mark.parametrize(("share", "counts"), [(0.9, False), (1.1, True)])
def test_changes_of_an_impulse_that_are_rounding_of_the_state_do_not_count(share, counts):
    """Sixteen units of a size of 1e6, against a change of the speed by 3; no step is longer than 6e-6."""

    class Turning(Model):
        def reset(self, transition, t, x, parameters, out):
            # The impulse grows by the noise over both steps along the height.
            tilt = 0.25 + share * noise / 2.0 * x[0] / 6e-6
            out[:] = x[0], -0.5 * x[1], x[2] - tilt * 1.5 * x[1]

    noise = 16.0 * EPSILON * 1e6 / 3.0
    run, work = new_run((0.0, 2.0, 0.0), scale=np.array([1.0, 1.0, 1e6])), memory()
    run.trail[IMPULSE, :3] = 0.0, 1.0, 0.0
    work.saltation[:] = 0.0
    work.saltation[0, 0] = 1.0
    kernels.add_change_of_impacts(Turning(), run, 1, 2.0, 0.0, work)
    # The impulse takes out a speed of 2.
    expected = -2.0 * share * noise / 12e-6 if counts else 0.0
    np.testing.assert_allclose(work.saltation[2, 0], expected, rtol=1e-3, atol=0.0)


class Resting(Ball):
    """A ball, and a mode at rest with a drift of its own."""

    drift = 1.0

    def field(self, mode, t, x, parameters, out):
        super().field(mode, t, x, parameters, out)
        if mode == 0:
            out[:] = 0.0, 0.0, self.drift

    def field_jacobian(self, mode, t, x, parameters, out):
        out[:] = 0.0
        out[0, 1] = 1.0 if mode == 1 else 0.0


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("drift", [1.0, 0.25])
def test_the_duration_of_a_chatter(drift, side):
    """``2 v / (a (1 - r))``, which a height changes through the energy of the flight.

    A state that chatters longer drifts longer with the mean field, ``1/2 - a p``, and shorter with the other.
    """
    speed, ratio, p = 0.125, 0.5, 0.25
    model = Resting(direction=-side, ratio=ratio, tilt=p)
    model.drift = drift
    run, work = new_run((0.0, side * speed, 0.5), restitution=ratio), memory()
    run.trail[BEFORE, 3] = speed
    span = 2.0 * speed / (PULL * (1.0 - ratio))
    kernels.chatter_matrix(model, run, 1, work)
    matrix = work.saltation.copy()
    np.testing.assert_allclose(matrix, [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, -p, 1.0]], atol=1e-15)
    work.settled[:] = 0.0, 0.0, 0.5 - side * speed * p + span * (0.5 + side * PULL * p)
    assert kernels.add_change_of_duration(model, METHOD, run, 0, span, work)
    instant = [side * (1.0 + ratio) / (speed * (1.0 - ratio)), side * 2.0 / (PULL * (1.0 - ratio)), 0.0]
    np.testing.assert_allclose(run.instant, instant, rtol=1e-9, atol=1e-9)
    excess = 0.5 + side * PULL * p - drift
    expected = matrix + np.outer([0.0, 0.0, excess], instant)
    np.testing.assert_allclose(work.saltation, expected, rtol=1e-9, atol=1e-9)


def test_a_limit_mode_that_drifts_alike_adds_nothing():
    model = Resting(direction=-1, tilt=0.25)
    run, work = new_run((0.0, 0.125, 0.5)), memory()
    run.trail[BEFORE, 3] = 0.125
    for drift, apart in ((1.5, False), (1.5 + 1e-13, False), (1.5 - 1e-9, True), (1.5 + 1e-9, True)):
        model.drift = drift
        kernels.chatter_matrix(model, run, 1, work)
        matrix = work.saltation.copy()
        work.settled[:] = 0.0, 0.0, 0.5
        assert kernels.add_change_of_duration(model, METHOD, run, 0, 0.125, work) == apart
        added = (work.saltation - matrix)[2]
        np.testing.assert_allclose(
            added, (1.5 - drift if apart else 0.0) * run.instant, rtol=1e-5, atol=1e-14
        )


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_drifts_that_differ_by_what_the_tolerances_make_of_them_are_alike(way):
    """A speed of the size 100 is known up to 1e-6, and so is the rate of the height."""
    for speed, apart in ((0.9e-6, False), (1.1e-6, True)):
        model, run, work = Resting(tilt=0.25), new_run((0.0, 0.125, 0.5)), memory()
        model.drift = 1.5
        run.scale[:], run.trail[BEFORE, 3] = (1.0, 100.0, 1.0), 0.125
        kernels.chatter_matrix(model, run, 1, work)
        work.settled[:] = 0.0, way * speed, 0.5
        assert kernels.add_change_of_duration(model, METHOD, run, 0, 0.125, work) == apart


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("drift", "apart"), [(0.25, True), (0.5, False)])
def test_parts_of_a_change_of_duration(drift, apart, side):
    """The speed has its sign, and the whole chatter counts only where the two drifts differ."""
    calls = []
    tested = plain(
        chatter,
        add_turn_of_impulse=lambda model, run, *given: calls.append(("turn", *given[:4])),
        add_change_of_impacts=lambda model, run, *given: calls.append(("impacts", *given[:3])),
        drift_with_mean=lambda model, run, *given: calls.append(("drift", *given[:2])),
    ).add_change_of_duration
    model = Resting(direction=-side)
    model.drift = drift
    run, work, times = new_run(), memory(), set()
    run.trail[BEFORE, 3] = 4.0
    run.trail[IMPULSE, :3] = 0.0, 1.0, 0.0
    work.settled[:], work.error[:], work.rounding[:], work.saltation[:] = 0.0, 0.0, 0.0, 0.0
    work.jacobian[:] = 0.0
    work.rounding[0, 1], work.rounding[1, 2] = 3.0, 5.0
    field = model.field
    model.field = lambda mode, t, *given: times.add(t) or field(mode, t, *given)
    assert tested(model, METHOD, run, 0, 0.125, work) == apart
    assert times == {3.125}
    whole = [("drift", 1, 0.125)] if apart else []
    assert calls == [("turn", 1, 3.125, side * 4.0, 0.125), ("impacts", 1, side * 4.0, 0.125), *whole]
    # The span changes with the pull and the restitution.
    expected = [side * 1.5 / 2.0, 0.125 * side * 3.0 / PULL, 0.125 * 5.0 / 0.5]
    assert run.instant.tolist() == expected
    assert work.saltation.tolist() == [[0.0] * 3, [0.0] * 3, [(0.5 - drift) * each for each in expected]]
