"""Whether tangent vectors lose digits at a guard, for slopes that are known powers of the distance."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.jumps import jump, steep
from hybrid.kernels.types.codes import EXACT, RUNGE_KUTTA
from tests.hybrid.kernels.plain import plain

BAND = 1e-16
GRADIENT = np.array([0.0, -2.0, 0.0])


class World:
    """Two states, whose rates change with each other; the slope is a function of the guard."""

    def __init__(self, slope, *, speed=0.5, rtol=1e-6, stuck=1, propagator=RUNGE_KUTTA):
        def field_jacobian(mode, t, x, parameters, out):
            assert mode == 1
            out[0, 1] = slope(self.places[-1])
            out[1, 0] = 0.25 * out[0, 1]

        self.places = []
        self.kernels = plain(
            steep,
            guard_speed=self.guard_speed,
            gradient_band=lambda model, run, t, gradient: BAND,
            displace=self.displace,
        )
        self.speed = speed
        self.model = SimpleNamespace(
            dimension=2,
            parameters=None,
            steep=np.array([0, stuck]),
            propagator=np.array([0, propagator]),
            field=lambda *arguments: None,
            field_jacobian=field_jacobian,
            first_slope=np.array([[0, 0, 0], [0, 1, 2]]),
            slope_column=np.array([1, 0]),
            direction=np.array([1, -1, 1, -1, 1]),
            surface=np.array([0, 1, 2, 1, 0]),
            first_outgoing=np.array([0, 1, 4]),
            outgoing=np.array([0, 4, 2, 3]),
        )
        self.method = SimpleNamespace(rtol=rtol)
        self.run = SimpleNamespace(phase=0.0, mode=1, y=np.array([0.0, 1.0, 3.0, 4.0]))
        self.work = SimpleNamespace(
            **{name: np.zeros(n) for name, n in (("new", 4), ("trial", 4), ("field", 2), ("state", 2))},
            jacobian=np.zeros((2, 3)),
            gradient=np.zeros(3),
        )

    def guard_speed(self, model, transition, t, x, field, gradient):
        self.asked = transition
        gradient[:] = GRADIENT
        return self.speed

    def displace(self, model, x, distance, gradient, out):
        np.testing.assert_array_equal(gradient, GRADIENT)
        self.places.append(distance)
        out[:] = 1.0

    def lost(self, side=1.0):
        answer = self.kernels.is_lost(self.model, self.method, self.run, 1, 3, side, 1, self.work)
        return bool(answer)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_slopes_are_compared_at_rounding_and_farther(side):
    world = World(lambda z: 1e3 * abs(z) ** -0.5)
    assert world.lost(side)
    assert world.places == [side * BAND, side * 16.0 * BAND]
    # The vector is (3, 4); its first component changes at 4 times the slope, the other at 3/4 of it.
    np.testing.assert_allclose(world.work.new[2:], [4e11, 0.75e11], rtol=1e-12)
    np.testing.assert_allclose(world.work.trial[2:], [1e11, 0.1875e11], rtol=1e-12)


@pytest.mark.parametrize(
    ("slope", "speed", "rtol", "lost"),
    [
        # Over the rounding ``d`` ``4 K sqrt(d)`` is lost, beside the vector's size, ``3 + 5 / sqrt(2)``.
        (lambda z: 164.0 * abs(z) ** -0.5, 1.0, 1e-6, True),
        (lambda z: 163.0 * abs(z) ** -0.5, 1.0, 1e-6, False),
        # It takes longer at half of the speed, in either direction; a looser tolerance allows it.
        (lambda z: 163.0 * abs(z) ** -0.5, 0.5, 1e-6, True),
        (lambda z: 163.0 * abs(z) ** -0.5, -0.5, 1e-6, True),
        (lambda z: 164.0 * abs(z) ** -0.5, -1.0, 1e-6, True),
        (lambda z: 163.0 * abs(z) ** -0.5, 0.5, 1e-5, False),
        # Large, but no larger at the guard than beside it.
        (lambda z: 1e20, 1.0, 1e-6, False),
        (lambda z: -1e20 * abs(z) ** -0.5, 1.0, 1e-6, True),
        (lambda z: 1e20 * abs(z) ** 0.5, 1.0, 1e-6, False),
    ],
)
def test_what_is_lost(slope, speed, rtol, lost):
    assert World(slope, speed=speed, rtol=rtol).lost() is lost


def test_modes_without_steep_powers_or_with_series_lose_nothing():
    def steepest(z):
        return 1e9 * abs(z) ** -0.5

    assert World(steepest).lost()
    assert not World(steepest, stuck=0).lost()
    assert not World(steepest, propagator=EXACT).lost()


def test_the_way_to_a_guard_is_on_its_near_side():
    for transition, side in ((2, -1.0), (3, 1.0)):
        world = World(lambda z: 1e9 * abs(z) ** -0.5)
        assert world.kernels.is_steep(world.model, world.method, world.run, transition, 1, world.work)
        assert world.asked == transition
        assert world.places[0] == side * BAND


def test_the_way_from_a_guard_is_that_of_the_transition_on_it():
    """Transition 1 has fired; of those that leave mode 1, only 3 watches the same guard, and it falls."""
    world = World(lambda z: 1e9 * abs(z) ** -0.5)
    assert world.kernels.is_steep_behind(world.model, world.method, world.run, 1, 1, world.work)
    assert world.asked == 3
    assert world.places == [BAND, 16.0 * BAND]
    world.model.surface[1] = 7
    assert not world.kernels.is_steep_behind(world.model, world.method, world.run, 1, 1, world.work)
    world = World(lambda z: 1e20)
    assert not world.kernels.is_steep_behind(world.model, world.method, world.run, 1, 1, world.work)


class Draining:
    """A level that is emptied at the rate ``wide * abs(level)**power``; its guard is twice the level."""

    LEVEL = 1e-12

    def __init__(self, power, *, direction=-1, steep_mode=1, propagator=RUNGE_KUTTA, at=0.0, since=1.0):
        def field(mode, t, x, parameters, out):
            assert mode == 1
            out[0] = -3.0 * abs(x[0]) ** power

        def guard_speed(model, transition, t, x, field, gradient):
            assert transition == 2
            gradient[0] = 2.0
            return 2.0 * field[0]

        def speed_displaced(model, transition, mode, t, x, distance, work):
            assert work.gradient[0] == 2.0
            field(mode, t, x + distance / 2.0, None, work.field_after)
            return guard_speed(model, transition, t, x, work.field_after, work.gradient)

        kernels = plain(
            steep,
            guard_speed=guard_speed,
            speed_displaced=speed_displaced,
            error_band=lambda method, run, gradient, n: gradient[0] * self.LEVEL,
        )
        model = SimpleNamespace(
            dimension=1,
            parameters=None,
            steep=np.array([0, steep_mode]),
            propagator=np.array([RUNGE_KUTTA, propagator]),
            field=field,
            direction=np.array([1, 1, direction]),
        )
        self.run = SimpleNamespace(
            phase=0.0, mode=1, y=np.array([at]), since_entry=since, unknown_time=0.0, ran_dry=0
        )
        work = SimpleNamespace(**{name: np.zeros(1) for name in ("field", "field_after", "gradient")})
        self.ask = lambda: kernels.keep_unknown_time(model, SimpleNamespace(rtol=1e-10), self.run, 2, work)
        self.ask()


@pytest.mark.parametrize("power", [0.4, 0.5, 0.9])
@pytest.mark.parametrize("direction", [-1, 0])
def test_a_level_takes_its_time_to_run_dry(power, direction):
    """From the level ``z`` on it takes ``z**(1 - power) / (3 (1 - power))``."""
    run = Draining(power, direction=direction).run
    assert run.unknown_time == pytest.approx(1e-12 ** (1.0 - power) / 3.0 / (1.0 - power), rel=1e-9)
    assert run.ran_dry == 2


def test_a_level_that_does_not_run_dry_would_take_for_ever():
    assert Draining(1.5).run.unknown_time == np.inf


@pytest.mark.parametrize(
    "other",
    [{"steep_mode": 0}, {"propagator": EXACT}, {"since": 1e4}, {"at": 1e-9}, {"power": 0.0}],
    ids=str,
)
def test_other_arrivals_are_known(other):
    """No slope that is infinite, a series, a time that is known well enough, or a guard with a speed."""
    assert Draining(**({"power": 0.5} | other)).run.unknown_time == 0.0


def test_the_largest_uncertainty_is_kept():
    tank = Draining(0.5)
    tank.run.unknown_time, tank.run.ran_dry = 1.0, 1
    tank.ask()
    assert (tank.run.unknown_time, tank.run.ran_dry) == (1.0, 1)


@pytest.mark.parametrize("tangents", [0, 1])
@pytest.mark.parametrize("locked", [0, 1])
@pytest.mark.parametrize(("before", "behind"), [(False, False), (True, False), (False, True), (True, True)])
def test_a_jump_of_tangent_vectors_counts_once_if_it_is_steep_on_either_side(
    tangents, locked, before, behind
):
    """But not if it is locked to another one."""

    def nothing(*given):
        return 0.0

    run = SimpleNamespace(
        mode=1, locked=locked, last_kind=0, phase=0.0, y="y", due=[9, 9], steep_jumps=5, ill_conditioned=0
    )
    model = SimpleNamespace(dimension=2, target=[0, 1], marker=[1, 1])
    task = SimpleNamespace(tangents=tangents, orthonormal=0)
    record, work = SimpleNamespace(jump_phase=np.zeros(4)), SimpleNamespace(new=None, saltation=None)
    names = ("recall_map", "cross", "follow", "cross_with_map", "cross_without_map", "remember_jump")
    more = ("map_of_instant", "assume_sizes", "judge", "restore_tangents", "carry_tangents", "leave")
    tested = plain(
        jump,
        task_of=lambda task: (None, model, None, run, record, work),
        is_steep=lambda *given: before,
        is_steep_behind=lambda *given: behind,
        keep_unknown_time=nothing,
        **dict.fromkeys((*names, *more), nothing),
    )
    tested.jump(task, 1)
    counts = tangents > 0 and not locked and (before or behind)
    assert run.steep_jumps == (6 if counts else 5)
    assert (run.due, run.locked) == ([9, 0], 0)
