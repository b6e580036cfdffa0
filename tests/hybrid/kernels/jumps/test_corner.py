"""Guards reached at one instant: both fire, and where their order matters the status says so."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, Reset, StatusCode, Transition, simulate
from hybrid.kernels.events.onset import BY_SPEED, BY_STEP, JUMPING
from hybrid.kernels.jumps import corner as module
from hybrid.kernels.types.codes import NO_TRANSITION, STALE
from tests.hybrid.kernels.plain import plain


@cache
def corner(order=1, e=1.0):
    """A puck in a quadrant with reflecting walls."""
    walls = [
        Transition(
            "slide",
            "slide",
            Guard(lambda t, x, p: x.x, direction=-1),
            Reset(lambda t, x, p: (x.x, x.y, -p.e * x.u, x.v)),
            name="left",
        ),
        Transition(
            "slide",
            "slide",
            Guard(lambda t, x, p: x.y, direction=-1),
            Reset(lambda t, x, p: (x.x, x.y, x.u, -p.e * x.v)),
            name="bottom",
        ),
    ]
    return HybridSystem(
        state=("x", "y", "u", "v"),
        parameters={"e": e},
        modes=[Mode("slide", lambda t, x, p: (x.u, x.v, 0.0, 0.0))],
        transitions=walls[::order],
    )


@cache
def three_balls(masses=(1.0, 1.0, 1.0), e=1.0):
    """Three balls on a line; neighbours collide with the coefficient of restitution ``e``."""

    def collide(a, b):
        def reset(t, x, p):
            v = [x.v1, x.v2, x.v3]
            impulse = (1 + p.e) * (v[a] - v[b]) * masses[a] * masses[b] / (masses[a] + masses[b])
            v[a], v[b] = v[a] - impulse / masses[a], v[b] + impulse / masses[b]
            return (x.x1, x.x2, x.x3, *v)

        return Reset(reset)

    return HybridSystem(
        state=("x1", "x2", "x3", "v1", "v2", "v3"),
        parameters={"e": e},
        modes=[Mode("free", lambda t, x, p: (x.v1, x.v2, x.v3, 0.0, 0.0, 0.0))],
        transitions=[
            Transition(
                "free", "free", Guard(lambda t, x, p: x.x2 - x.x1, direction=-1), collide(0, 1), name="12"
            ),
            Transition(
                "free", "free", Guard(lambda t, x, p: x.x3 - x.x2, direction=-1), collide(1, 2), name="23"
            ),
        ],
    )


class TestCorner:
    @pytest.mark.parametrize("order", [1, -1])
    @pytest.mark.parametrize("e", [1.0, 0.5])
    @pytest.mark.parametrize("start", [1.0, 0.1, 1 / 3])
    def test_both_walls_fire_at_one_instant(self, order, e, start):
        arc = simulate(corner(order), (start, start, -1.0, -1.0), (0.0, 2.0), parameters={"e": e})
        assert arc.status.ok
        assert sorted(jump.transition for jump in arc.jumps) == ["bottom", "left"]
        assert arc.jumps[0].t == arc.jumps[1].t
        expected = [e * (2 - start), e * (2 - start), e, e]
        np.testing.assert_allclose(arc.x[-1], expected, rtol=0, atol=1e-14)

    @pytest.mark.parametrize("order", [1, -1])
    def test_the_one_listed_first_fires_first(self, order):
        arc = simulate(corner(order), (1.0, 1.0, -1.0, -1.0), (0.0, 2.0))
        assert [jump.transition for jump in arc.jumps] == ["left", "bottom"][::order]

    @pytest.mark.parametrize("apart", [1e-3, 1e-8, 1e-12, -1e-12, -1e-8, -1e-3])
    def test_close_to_the_corner_each_wall_fires_once_in_order(self, apart):
        arc = simulate(corner(), (1.0, 1.0 + apart, -1.0, -1.0), (0.0, 2.0))
        expected = ["left", "bottom"] if apart > 0 else ["bottom", "left"]
        assert [jump.transition for jump in arc.jumps] == expected
        np.testing.assert_allclose(arc.x[-1], [1.0, 1.0 - apart, 1.0, 1.0], rtol=0, atol=1e-14)

    def test_the_tangent_does_not_depend_on_the_order(self):
        ends = [
            simulate(corner(order), (1.0, 1.0, -1.0, -1.0), (0.0, 2.0), tangent=True).fundamental
            for order in (1, -1)
        ]
        np.testing.assert_allclose(ends[0], ends[1], atol=1e-14)
        np.testing.assert_allclose(
            ends[0], np.block([[-np.eye(2), -2 * np.eye(2)], [0 * np.eye(2), -np.eye(2)]])
        )


class TestThreeBalls:
    def test_unequal_masses_make_the_order_matter(self):
        arc = simulate(three_balls((1.0, 2.0, 3.0), 0.5), (-1.0, 0.0, 1.0, 1.0, 0.0, -1.0), (0.0, 2.0))
        assert arc.status.code == StatusCode.AMBIGUOUS_ORDER
        assert not arc.status.ok
        assert arc.t[-1] == 2.0
        assert arc.jumps[0].transition == "12"

    def test_equal_elastic_balls_do_not(self):
        arc = simulate(three_balls(), (-1.0, 0.0, 1.0, 1.0, 0.0, -1.0), (0.0, 2.0))
        assert arc.status.ok
        np.testing.assert_allclose(arc.x[-1, 3:], [-1.0, 0.0, 1.0], atol=1e-14)

    def test_a_blow_goes_through_balls_that_touch(self):
        arc = simulate(three_balls(), (-1.0, 0.0, 0.0, 1.0, 0.0, 0.0), (0.0, 2.0))
        assert [jump.transition for jump in arc.jumps] == ["12", "23"]
        np.testing.assert_allclose(arc.x[-1, 3:], [0.0, 0.0, 1.0], atol=1e-14)

    @pytest.mark.parametrize("masses", [(1.0, 1.0, 1.0), (1.0, 2.0, 3.0)])
    def test_momentum_is_kept(self, masses):
        arc = simulate(three_balls(masses, 0.5), (-1.0, 0.0, 1.0, 1.0, 0.0, -1.0), (0.0, 2.0))
        m = np.array(masses)
        assert arc.x[-1, 3:] @ m == pytest.approx(m[0] - m[2], abs=1e-14)


def turns_back(before, *, side=1, order=0, speed=0.0, acceleration=0.0, leads=False):
    """Rounding of the speed is 0.5, and that of the acceleration 0.25."""
    asked = []

    def leads_to_guard(model, run, transition, mode, t, x, side, work):
        asked.append(side)
        return leads

    kernels = plain(
        module,
        guard_speed=lambda *arguments: speed,
        speed_rounding=lambda *arguments: 0.5,
        guard_acceleration=lambda *arguments: acceleration,
        acceleration_rounding=lambda *arguments: 0.25,
        leads_to_guard=leads_to_guard,
    )
    model = SimpleNamespace(field=lambda *arguments: None, parameters=None)
    run = SimpleNamespace(on_guard=[0, order], side=[0, side], mode=0, phase=0.0, y=None)
    work = SimpleNamespace(field=None, gradient=None)
    answer = bool(kernels.turns_back(model, run, 1, before, work))
    assert set(asked) <= {before}
    return answer


@pytest.mark.parametrize("before", [-1, 1])
def test_a_guard_that_only_touches(before):
    # A speed beyond rounding tells, unless the field leads to the guard from both sides.
    assert turns_back(before, speed=0.6 * before, acceleration=-9.0 * before)
    assert not turns_back(before, speed=0.6 * before, leads=True)
    assert not turns_back(before, speed=-0.6 * before, acceleration=9.0 * before)
    # Within rounding the acceleration tells, if that is no rounding itself.
    for speed in (0.4, -0.4):
        assert turns_back(before, speed=speed, acceleration=0.3 * before)
        assert not turns_back(before, speed=speed, acceleration=0.2 * before)
        assert not turns_back(before, speed=speed, acceleration=-0.3 * before)
    # A guard that is known to move on by its speed has not turned.
    assert not turns_back(before, speed=0.6 * before, order=BY_SPEED, side=-before)
    assert turns_back(before, speed=0.6 * before, order=BY_SPEED, side=before)
    assert turns_back(before, speed=0.6 * before, order=BY_STEP, side=-before)


@pytest.mark.parametrize(
    ("on_guard", "has_program", "in_series", "order"),
    [(0, True, 0, JUMPING), (0, True, 1, BY_SPEED), (0, False, 0, BY_SPEED), (BY_STEP, True, 0, BY_STEP)],
)
def test_a_guard_that_has_crossed_zero_and_is_not_small_has_jumped(on_guard, has_program, in_series, order):
    def take_sides(model, run, *given):
        run.on_guard[0] = on_guard

    tested = plain(
        module,
        task_of=lambda task: task,
        take_sides=take_sides,
        turns_back=lambda *given: False,
        allowed=lambda *given: True,
    ).first_in_order
    model = SimpleNamespace(
        first_outgoing=[0, 1],
        outgoing=[0],
        direction=[-1],
        affine_guard=[0],
        guard_in_series=[in_series],
        programs=SimpleNamespace(first=[0, int(has_program)]),
        marker=[0],
    )
    run = SimpleNamespace(
        mode=0,
        phase=0.0,
        y=None,
        side=[1],
        due=[0],
        on_guard=[9],
        rehearsal=np.zeros((4, 1)),
        order_mattered=0,
    )
    task = (None, model, None, run, None, SimpleNamespace(scalar=None))
    assert tested(task, 0) == 0
    assert (run.on_guard[0], run.side[0], run.due[0], run.order_mattered) == (order, -1, 1, 0)


@pytest.mark.parametrize(
    ("direction", "before", "affine", "turned", "permitted", "side"),
    [
        (-1, 1, 1, False, True, -1),
        (1, -1, 1, False, True, 1),
        (0, 1, 1, False, True, -1),
        (0, -1, 1, False, True, 1),
        (1, -1, 1, True, True, 0),
        (1, -1, 0, True, True, 1),
        # One that may not fire is behind all the same.
        (1, -1, 1, True, False, 0),
        (1, -1, 1, False, False, 0),
    ],
)
def test_the_side_after_a_crossing(direction, before, affine, turned, permitted, side):
    """A touch is recorded and does not fire; the next step shows the side after it, and after a refusal."""
    asked, touches = [], []

    def turns_back(model, run, fired, near, work):
        asked.append(near)
        return turned

    tested = plain(
        module,
        task_of=lambda task: task,
        take_sides=lambda *given: None,
        turns_back=turns_back,
        allowed=lambda *given: permitted,
        guard_value=lambda *given: 0.0,
        keep_grazing=lambda *given: touches.append(given[3]),
    ).first_in_order
    model = SimpleNamespace(
        first_outgoing=[0, 1], outgoing=[0], direction=[direction], affine_guard=[affine], marker=[0]
    )
    run = SimpleNamespace(
        mode=0, phase=0.0, y=None, side=[before], due=[0], on_guard=[1], rehearsal=np.zeros((4, 1)),
        order_mattered=0, stage=0, last_step=1.0,
    )  # fmt: skip
    touched = turned and affine == 1 and permitted
    task = (None, model, None, run, None, SimpleNamespace(scalar=None))
    assert tested(task, 0) == (NO_TRANSITION if touched or not permitted else 0)
    assert asked == ([before] if affine else [])
    assert touches == ([0] if touched else [])
    assert (run.side, run.due) == ([side], [0 if touched or not permitted else 1])
    assert (run.stage, run.last_step) == ((STALE, 0.0) if touched or not permitted else (0, 1.0))


@pytest.mark.parametrize(("matters", "count"), [((), 0), ((1,), 1), ((2,), 1), ((1, 2), 1)])
def test_an_instant_whose_order_matters_is_counted_once(matters, count):
    """However many of the guards reached with the first one it matters for; a marker is none of them."""
    asked = []

    def order_matters(model, run, first, other, work):
        asked.append((first, other))
        return other in matters

    tested = plain(
        module,
        task_of=lambda task: task,
        take_sides=lambda *given: None,
        turns_back=lambda *given: False,
        allowed=lambda *given: True,
        order_matters=order_matters,
    ).first_in_order
    model = SimpleNamespace(
        first_outgoing=[0, 4], outgoing=[0, 1, 2, 3], direction=[1] * 4, affine_guard=[1] * 4
    )
    model.marker = [0, 0, 0, 1]
    run = SimpleNamespace(mode=0, phase=0.0, y=None, side=[-1] * 4, due=[1] * 4, on_guard=[1] * 4)
    run.rehearsal, run.order_mattered = np.zeros((4, 4)), 5
    task = (None, model, None, run, None, SimpleNamespace(scalar=None))
    assert tested(task, 0) == 0
    assert run.order_mattered == 5 + count
    assert asked == ([(0, 1)] if 1 in matters else [(0, 1), (0, 2)])
