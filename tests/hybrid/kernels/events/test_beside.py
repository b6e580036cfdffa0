"""Signs of a guard beside a place where its derivatives tell nothing."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.events import beside
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain

kernels = plain(beside)


def moving(guard, **others):
    """One state, which moves at a speed of 2."""

    def write(transition, t, x, parameters, scalar):
        scalar[0] = guard(t, x[0])

    return SimpleNamespace(dimension=1, parameters=None, guard=write, period=0.0, **others), SimpleNamespace(
        field=np.array([2.0]), state=np.zeros(1), scalar=np.zeros(1)
    )


def test_the_sign_of_a_guard_a_moment_away():
    for moment, sign in ((0.5, 1), (-0.5, -1), (0.0, 0)):
        model, work = moving(lambda t, x: x - 1.0 + 4.0 * (t - 3.0))
        assert kernels.sign_at(model, 0, 3.0, np.array([1.0]), moment, work) == sign
        assert work.state[0] == 1.0 + 2.0 * moment
        model, work = moving(lambda t, x: 8.0 * (t - 3.0) - (x - 1.0))
        assert kernels.sign_at(model, 0, 3.0, np.array([1.0]), moment, work) == sign


@pytest.mark.parametrize(
    ("edge", "expected"),
    [
        (0.0, (-1, 1, 16)),
        (20.0, (-1, 1, 16)),
        (-300.0, (-1, 1, 256)),
        (4000.0, (-1, 1, 4096)),
        (5000.0, (0, 0, 0)),
    ],
)
def test_signs_on_both_sides_of_a_jump(edge, expected):
    """Three moments look for the jump up to 16^3 times the rounding of the state, which is 1 here."""
    model, work = moving(lambda t, x: -1.0 if x - 1.0 < edge * EPSILON else 1.0)
    run = SimpleNamespace(scale=np.array([1.0]))
    before, after, moment = kernels.signs_beside(model, run, 0, 0.0, np.array([1.0]), 3, work)
    assert (before, after) == expected[:2]
    assert moment == pytest.approx(expected[2] * EPSILON / 2.0)
    model, work = moving(lambda t, x: 1.0 if x - 1.0 < edge * EPSILON else -1.0)
    before, after, _ = kernels.signs_beside(model, run, 0, 0.0, np.array([1.0]), 3, work)
    assert (-before, -after) == expected[:2]


def test_a_flow_that_turns_within_a_moment():
    """A ball that leaves the ground at a speed of 2e-3 under a pull of 1 is back after 4e-3."""

    def field(mode, t, x, parameters, out):
        out[0], out[1] = x[1], -1.0

    def guard(transition, t, x, parameters, scalar):
        scalar[0] = x[0] ** 3

    model = SimpleNamespace(dimension=2, parameters=None, guard=guard, field=field)
    work = SimpleNamespace(
        field=np.array([2e-3, -1.0]), settled=np.zeros(2), field_after=np.zeros(2), scalar=np.zeros(1)
    )
    for moment, back in ((3.9e-3, False), (4.1e-3, True)):
        assert kernels.turns_within(model, 0, 0, 0.0, np.array([0.0, 2e-3]), moment, 1, work) == back


def test_a_flow_that_turns_at_a_later_time():
    """Speed and guard depend on the time: ``x' = 3 - s`` from 1 at 7, compared with ``1 + s``, ``s`` after 7.

    By Heun's rule, which is exact here, the difference is ``2 s - s^2 / 2``: zero after 4.
    """

    def field(mode, t, x, parameters, out):
        assert x[0] == 1.0 + 3.0 * (t - 7.0)
        out[0] = 3.0 - (t - 7.0)

    def guard(transition, t, x, parameters, scalar):
        scalar[0] = x[0] - 1.0 - (t - 7.0)

    model = SimpleNamespace(dimension=1, parameters=None, guard=guard, field=field)
    work = SimpleNamespace(
        field=np.array([3.0]), settled=np.zeros(1), field_after=np.zeros(1), scalar=np.zeros(1)
    )
    for moment, back in ((0.5, False), (3.5, False), (4.5, True)):
        assert kernels.turns_within(model, 0, 0, 7.0, np.array([1.0]), moment, 1, work) == back
        assert work.settled[0] == 1.0 + 3.0 * moment - 0.5 * moment**2
        assert work.scalar[0] == 2.0 * moment - 0.5 * moment**2
    assert kernels.turns_within(model, 0, 0, 7.0, np.array([1.0]), 0.5, -1, work)
    # Exactly zero is not back.
    assert not kernels.turns_within(model, 0, 0, 7.0, np.array([1.0]), 4.0, 1, work)


def test_a_guard_that_is_zero_beside_the_jump_has_no_signs_there():
    model, work = moving(lambda t, x: min(x - 1.0, 0.0))
    run = SimpleNamespace(scale=np.array([1.0]))
    assert kernels.signs_beside(model, run, 0, 0.0, np.array([1.0]), 3, work) == (0, 0, 0.0)
    model, work = moving(lambda t, x: max(x - 1.0, 0.0))
    assert kernels.signs_beside(model, run, 0, 0.0, np.array([1.0]), 3, work) == (0, 0, 0.0)


@pytest.mark.parametrize("place", [0, 1])
def test_which_guards_the_signs_beside_them_tell(place):
    """Neither affine guards, nor guards with series, nor markers; each guard has its own entry."""
    kinds = ("affine_guard", "guard_in_series", "marker")
    for ones in ((), *((kind,) for kind in kinds), kinds[:2], kinds[1:], kinds):
        model = SimpleNamespace(**{kind: np.array([2, 2]) for kind in kinds})
        for kind in kinds:
            vars(model)[kind][place] = int(kind in ones)
        assert kernels.leaves_by_signs(model, place) == (not ones)
