"""Limits of jumps at one instant: light balls that heavy ones press to the floor, or to each other."""

import math
from functools import cache
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    Reset,
    StatusCode,
    Taylor,
    Transition,
    simulate,
)
from hybrid.kernels.jumps import collapse as module
from tests.hybrid.kernels.plain import plain

SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853(), "RadauIIA": RadauIIA()}
METHODS = pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)


def collide(i, count):
    """The collision of the balls ``i`` and ``i + 1``, with the restitution ``e`` of parameter ``i + 1``."""

    def reset(t, x, p):
        m, M, e = p[i], p[i + 1], p[count + i + 1]
        v, w = x[count + i], x[count + i + 1]
        common, apart = (m * v + M * w) / (m + M), e * (v - w)
        after = list(x)
        after[i + 1] = x[i]
        after[count + i] = common - M / (m + M) * apart
        after[count + i + 1] = common + m / (m + M) * apart
        return tuple(after)

    return reset


def land(count):
    def reset(t, x, p):
        return (0.0, *x[1:count], -p[count] * x[count], *x[count + 1 :])

    return reset


@cache
def column(count, at_rest=False):
    """Balls above each other on a floor: heights, then speeds; ``p`` has masses, then restitutions."""

    def between(i):
        return lambda t, x, p: x[i + 1] - x[i]

    names = [f"{letter}{i}" for letter in "me" for i in range(count)]
    return HybridSystem(
        state=2 * count,
        parameters=dict.fromkeys(names, 1.0),
        modes=[
            Mode("fly", lambda t, x, p: (*x[count:], *[-1.0] * count)),
            *([Mode("rest", lambda t, x, p: (0.0,) * (2 * count))] if at_rest else []),
        ],
        transitions=[
            Transition(
                "fly",
                "fly",
                Guard(lambda t, x, p: x[0], -1),
                Reset(land(count)),
                name="floor",
                accumulates_to="rest" if at_rest else None,
            ),
            *(
                Transition("fly", "fly", Guard(between(i), -1), Reset(collide(i, count)), name=f"hit {i}")
                for i in range(count - 1)
            ),
        ],
    )


def run(m, e, q, v, t1, solver=None, at_rest=False):
    count = len(m)
    parameters = {f"m{i}": m[i] for i in range(count)} | {f"e{i}": e[i] for i in range(count)}
    mode = "fly" if at_rest else None
    return simulate(
        column(count, at_rest), (*q, *v), (0.0, t1), parameters=parameters, solver=solver, mode=mode
    )


def time_of_collapse(m, e, q, v):
    """When jumps follow each other without time between them, flight by flight in closed form."""
    q, v, count = list(q), list(v), len(m)
    p, t, spans = (*m, *e), 0.0, [1.0] * 30
    while max(spans[-30:]) > 1e-17:
        spans_to = [v[0] + math.sqrt(v[0] * v[0] + 2.0 * q[0])]
        for (low, high), (v_low, v_high) in zip(pairwise(q), pairwise(v), strict=True):
            spans_to.append((high - low) / (v_low - v_high) if v_low > v_high else math.inf)
        span = min(spans_to)
        next_one = spans_to.index(span)
        t += span
        spans.append(span)
        q = [a + span * (b - 0.5 * span) for a, b in zip(q, v, strict=True)]
        v = [b - span for b in v]
        reset = land(count) if next_one == 0 else collide(next_one - 1, count)
        after = reset(t, (*q, *v), p)
        q, v = list(after[:count]), list(after[count:])
    return t


def pressed(count):
    """A light ball below a heavy one."""
    rng = np.random.default_rng(7)
    for _ in range(count):
        ratio, e = 10.0 ** rng.uniform(1.5, 6.0), rng.uniform(0.2, 0.9, 2)
        e[rng.integers(2)] = rng.choice([0.0, 1.0, 0.7], p=[0.1, 0.4, 0.5])
        q = rng.uniform(0.1, 1.0, 2).cumsum()
        yield (
            float(ratio),
            tuple(map(float, e)),
            tuple(map(float, q)),
            tuple(map(float, rng.uniform(-1, 1, 2))),
        )


@METHODS
def test_pressed_to_the_floor(solver):
    """All speed is lost in no time, however many rounds the heavy ball takes to lose it."""
    for ratio, e, q, v in pressed(20):
        arc = run((1.0, ratio), e, q, v, 20.0, solver)
        assert arc.status.code == StatusCode.ACCUMULATION, (ratio, e, q, v)
        assert arc.jumps[-1].kind == "limit"
        assert arc.t[-1] == pytest.approx(time_of_collapse((1.0, ratio), e, q, v), rel=1e-9)
        np.testing.assert_allclose(arc.x[-1], 0.0, atol=1e-12)


def test_the_run_goes_on_in_the_mode_of_the_limit():
    arc = run((1e-5, 1.0), (0.5, 0.8), (0.1, 0.2), (0.0, -1.0), 5.0, at_rest=True)
    assert arc.status.ok
    assert arc.mode[-1] == "rest"
    np.testing.assert_allclose(arc.x[-1], 0.0, atol=1e-12)


@METHODS
@pytest.mark.parametrize("light", [1e-2, 1e-4, 1e-6])
def test_pressed_between_two_in_flight(light, solver):
    """The three balls go on with their momentum."""
    m, e = (1.0, light, 2.0), (0.5, 0.4, 0.7)
    q, v = (5.0, 5.2, 5.5), (1.0, 0.3, -1.5)
    arc = run(m, e, q, v, 1.0, solver)
    assert arc.status.code == StatusCode.ACCUMULATION
    t = time_of_three(m, e, q, v)
    assert arc.t[-1] == pytest.approx(t, rel=1e-9)
    common = np.dot(m, v) / sum(m) - t
    # What a million rounds make of the rounding of each.
    np.testing.assert_allclose(arc.x[-1, 3:], common, atol=1e-13 + 1e-14 / light)
    np.testing.assert_allclose(arc.x[-1, :3], arc.x[-1, 0], atol=1e-14)


def time_of_three(m, e, q, v):
    """When the gaps between three balls in flight are gone: seen from the falling frame, nothing falls."""
    gaps, speeds, t, p = [q[1] - q[0], q[2] - q[1]], list(v), 0.0, (*m, *e)
    while max(gaps) > 1e-17:
        closing = [speeds[0] - speeds[1], speeds[1] - speeds[2]]
        spans = [g / c if c > 0.0 else math.inf for g, c in zip(gaps, closing, strict=True)]
        span = min(spans)
        t += span
        gaps = [max(g - span * c, 0.0) for g, c in zip(gaps, closing, strict=True)]
        speeds = list(collide(spans.index(span), 3)(t, (0.0, 0.0, 0.0, *speeds), p)[3:])
    return t


@pytest.mark.parametrize("ratio", [10.0, 100.0, 1e3, 1e4, 3e4])
@pytest.mark.parametrize("loss", [0.0, 1e-6, 1e-3])
def test_speeds_that_turn_have_no_limit(ratio, loss):
    """A light ball on the floor that a heavy one hits elastically throws it up again, after many hits."""
    v, w, e = 0.0, -1.0, 1.0 - loss
    while v < 0.0 or v > w:
        reset = land(2) if v < 0.0 else collide(0, 2)
        v, w = reset(0.0, (0.0, 0.0, v, w), (1.0, ratio, e, e))[2:]
    arc = run((1.0, ratio), (e, e), (0.0, 0.0), (0.0, -1.0), 0.01)
    assert arc.status.ok
    np.testing.assert_allclose(arc.jumps[-1].x_plus[2:], [v, w], rtol=1e-11)


def test_a_restitution_that_depends_on_the_speed_is_not_followed():
    """Rounds that are not affine are said to be endless."""
    system = column(2)
    hit = Transition(
        "fly",
        "fly",
        Guard(lambda t, x, p: x[1] - x[0], -1),
        Reset(
            lambda t, x, p: (
                x[0],
                x[0],
                x[2] - (1.0 + 0.5 / (1.0 + (x[2] - x[3]) ** 2)) * (x[2] - x[3]) / (1.0 + 1e-5),
                x[3] + 1e-5 * (1.0 + 0.5 / (1.0 + (x[2] - x[3]) ** 2)) * (x[2] - x[3]) / (1.0 + 1e-5),
            )
        ),
    )
    bent = HybridSystem(
        state=4, parameters=system.parameters, modes=system.modes, transitions=[system.transitions[0], hit]
    )
    parameters = {"m0": 1.0, "m1": 1e5, "e0": 0.5}
    arc = simulate(bent, (0.1, 1.0, 0.0, -1.0), (0.0, 5.0), parameters=parameters)
    assert arc.status.code == StatusCode.STUCK


class TestDoubling:
    """Rounds of the map ``x -> D x + d``."""

    D, SHIFT = np.array([[0.5, 0.25], [0.0, -0.75]]), np.array([1.0, 7.0])
    LIMIT = np.linalg.solve(np.eye(2) - D, SHIFT)

    def followed(self, matrix=D, stops=10**9, before=1.0):
        asked = []

        def fires_in_turn(model, run, turn, start, rounds, work):
            assert turn == 3
            asked.append(rounds)
            work.new[:] = matrix @ start + self.SHIFT
            return len(asked) < stops

        def round_jacobian(model, run, turn, start, out, work):
            out[:] = matrix

        kernels = plain(module, fires_in_turn=fires_in_turn, round_jacobian=round_jacobian)
        names = ("trial", "new", "error", "settled", "state", "field_after")
        work = SimpleNamespace(
            **{name: np.zeros(2) for name in names}, saltation=np.zeros((2, 2)), sizes=np.zeros((2, 2))
        )
        model = SimpleNamespace(dimension=2)
        rounds = kernels.follow_doubling(model, None, 3, np.array([1e3, -9.0]), before, work)
        return rounds, asked, work.settled

    def test_the_limit_is_a_fixed_point(self):
        rounds, asked, limit = self.followed()
        np.testing.assert_allclose(limit, self.LIMIT, rtol=1e-12)
        # Until the moves of all rounds are rounding: 0.75^128 is 1e-16.
        assert rounds in (128.0, 256.0)
        assert asked[:4] == [1.0, 2.0, 4.0, 8.0]
        assert asked[-1] == rounds
        # A start that has come from many rounds has their rounding.
        assert self.followed(before=32.0)[1][:7] == [32.0, 32.0, 32.0, 32.0, 32.0, 32.0, 64.0]

    @pytest.mark.parametrize("stops", [1, 2, 5])
    def test_no_limit_if_the_order_changes(self, stops):
        assert self.followed(stops=stops)[0] == 0.0

    def test_no_limit_if_all_goes_on(self):
        rounds, asked, _ = self.followed(np.array([[1.0, 0.0], [0.25, -0.5]]))
        assert rounds == 0.0
        assert len(asked) == module.MOST_DOUBLINGS + 1

    def test_a_counter_keeps_its_value(self):
        """Nothing depends on the first component, to which each round adds the same."""
        rounds, _, limit = self.followed(np.diag([1.0, -0.5]))
        assert rounds > 0.0
        np.testing.assert_allclose(limit, [1e3, self.SHIFT[1] / 1.5], rtol=1e-12)


@pytest.mark.parametrize(
    ("fired", "here", "turn"),
    [
        ([3, 4], 60, 2),
        ([3], 48, 1),
        ([3], 47, 0),
        ([3, 4, 3, 5], 60, 4),
        ([3, 4, 6], 60, 0),
        ([3, 4, 7], 60, 0),
        (range(3, 6), 60, 3),
        ([*[3] * 15, 4], 60, 16),
        ([*[3] * 16, 4], 60, 0),
    ],
)
def test_transitions_that_fire_in_turn_at_one_instant(fired, here, turn):
    """Transition 6 leads to another mode, and 7 fires in both directions."""
    recent = np.resize(list(fired), 64)
    model = SimpleNamespace(target=np.array([0] * 6 + [1, 0]), direction=np.array([1] * 7 + [0]))
    run = SimpleNamespace(jumps=64, jumps_here=here, recent=recent, visits=np.zeros((64, 1)), mode=0)
    assert plain(module).round_at_once(model, run) == turn


@pytest.mark.parametrize(
    ("turn", "affine", "rounds", "found"),
    [
        (0, True, [], (0, 0.0)),
        (3, True, [8.0, 4.0], (3, 8.0)),
        (1, True, [8.0, 4.0], (1, 8.0)),
        (3, True, [4.0, 16.0], (3, 16.0)),
        (3, False, [4.0, 16.0], (0, 0.0)),
        (3, True, [0.0], (0, 0.0)),
        (3, True, [4.0, 0.0], (0, 0.0)),
    ],
)
def test_a_limit_is_followed_twice(turn, affine, rounds, found):
    """Once more from where it was found, with the rounding of as many rounds."""
    asked, waiting, most = [], list(rounds), 1.0

    def follow_doubling(model, run, turn, start, before, work):
        asked.append((start.tolist(), before))
        work.settled[:] = 10.0 * len(asked)
        return waiting.pop(0)

    tested = plain(
        module,
        round_at_once=lambda model, run: turn,
        follow_doubling=follow_doubling,
        is_affine=lambda *given: affine,
    ).limit_at_once
    work = SimpleNamespace(second_error=np.zeros(2), settled=np.zeros(2))
    run = SimpleNamespace(y=np.array([1.0, 2.0]))
    assert tested(SimpleNamespace(dimension=2), run, work) == found
    expected = [([1.0, 2.0], 1.0), ([10.0, 10.0], rounds[0] if rounds else most)][: len(rounds)]
    assert asked == expected


def test_the_jacobian_of_a_round():
    """Each reset at the state that the one before has made: ``x -> (x y, y + 2)``, then ``x -> (y, x^2)``."""

    def reset(transition, t, x, parameters, out):
        assert t == 7.0
        out[:] = (x[0] * x[1], x[1] + 2.0) if transition == 5 else (x[1], x[0] ** 2)

    def reset_jacobian(transition, t, x, parameters, out):
        out[:] = (
            [[x[1], x[0], 9.0], [0.0, 1.0, 9.0]]
            if transition == 5
            else [[0.0, 1.0, 9.0], [2.0 * x[0], 0.0, 9.0]]
        )

    model = SimpleNamespace(dimension=2, parameters=None, reset=reset, reset_jacobian=reset_jacobian)
    run = SimpleNamespace(
        jumps=9, recent=np.array([0] * 7 + [5, 6] + [0] * 7), visits=np.zeros((16, 1)), phase=7.0
    )
    work = SimpleNamespace(
        new=np.zeros(2), sizes=np.zeros((2, 2)), state=np.zeros(2), reset_jacobian=np.zeros((2, 3))
    )
    out, (x, y) = np.full((2, 2), 99.0), (3.0, 4.0)
    plain(module).round_jacobian(model, run, 2, np.array([x, y]), out, work)
    assert out.tolist() == [[0.0, 1.0], [2.0 * x * y * y, 2.0 * x * y * x]]
