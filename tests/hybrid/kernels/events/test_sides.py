"""Sides of guards, rule by rule: what a mode inherits, what a landing crosses, what lies beside a jump."""

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.events import sides
from hybrid.kernels.events.onset import BY_ACCELERATION, BY_SPEED, BY_STEP
from hybrid.kernels.types.codes import NO_TRANSITION
from tests.hybrid.kernels.plain import plain

kernels = plain(sides)


def integers(*values):
    return np.array(values, dtype=np.int64)


def crossed(direction, *, paired=0, known=True, own=False, was_on=False, before, now, order=0):
    model = SimpleNamespace(direction=integers(direction), paired=integers(paired))
    return bool(kernels.crossed_by_landing(model, 0, known, own, was_on, before, now, order))


class TestLanding:
    @pytest.mark.parametrize("direction", [-1, 1])
    def test_a_guard_with_a_direction(self, direction):
        for before, now in product((-1, 0, 1), repeat=2):
            before, now = direction * before, direction * now
            through = before == -direction and now == direction
            assert crossed(direction, before=before, now=now) == through
            # Its own reset fires it again only if the state was put on the guard, off which it moves.
            assert not crossed(direction, before=before, now=now, own=True)
            for own in (False, True):
                leaves = now == direction
                assert crossed(direction, before=before, now=now, own=own, order=BY_SPEED) == leaves
            # If it was on the guard already, the guard is known to have been there.
            again = crossed(direction, before=before, now=now, was_on=True, order=BY_SPEED)
            assert again == through
            # A guard that the mode before did not have: beyond is crossed, unless another one watches it too.
            assert crossed(direction, before=before, now=now, known=False) == (now == direction)
            assert not crossed(direction, before=before, now=now, known=False, paired=1)

    def test_a_guard_that_fires_both_ways(self):
        for before, now, own in product((-1, 0, 1), (-1, 0, 1), (False, True)):
            expected = not own and before * now == -1
            assert crossed(0, before=before, now=now, own=own) == expected
            assert crossed(0, before=before, now=now, own=own, order=BY_SPEED) == expected


def test_at_the_end_of_an_instant_nothing_is_due_in_its_mode():
    model = SimpleNamespace(first_outgoing=integers(0, 2, 4), outgoing=integers(3, 0, 2, 1))
    due = integers(1, 1, 1, 1)
    kernels.end_instant(model, 0, due)
    assert due.tolist() == [0, 1, 1, 0]
    due = integers(1, 1, 1, 1)
    kernels.end_instant(model, 1, due)
    assert due.tolist() == [1, 0, 0, 1]


@pytest.mark.parametrize(
    ("values", "refused", "expected"),
    [
        # Beyond by more than the band of 0.5, in the direction of each, and allowed; the first counts.
        ((0.6, -0.6), (), 4),
        ((0.4, -0.6), (), 2),
        ((0.6, -0.6), (4,), 2),
        ((-0.6, 0.6), (), NO_TRANSITION),
        ((0.4, -0.4), (), NO_TRANSITION),
        ((0.6, -0.6), (4, 2), NO_TRANSITION),
    ],
)
def test_transitions_that_fire_only_at_a_start(values, refused, expected):
    given = dict(zip((4, 2), values, strict=True))
    stubbed = plain(
        sides,
        guard_value=lambda model, transition, t, x, scalar: given[transition],
        rounding_band=lambda *arguments: 0.5,
        allowed=lambda model, transition, t, x, scalar: transition not in refused,
    )
    model = SimpleNamespace(
        first_at_start=integers(0, 1, 3), at_start=integers(9, 4, 2), direction=integers(0, 0, -1, 0, 1)
    )
    model.parameters, model.guard_gradient = None, lambda *given: None
    x, work = np.zeros(1), SimpleNamespace(scalar=np.zeros(1), gradient=None)
    assert stubbed.beyond_at_start(model, None, 1, 0.0, x, work) == expected


class TestHeld:
    """A mass at rest at ``q = 1`` on the guard ``q - 1``, pushed with ``a``; the reset scales its speed."""

    def held(self, a, keeps, towards, unit=1.0):
        def field(mode, t, x, parameters, out):
            out[0], out[1] = x[1], a * unit

        def reset(transition, t, x, parameters, out):
            assert t > 5.0
            out[0], out[1] = x[0], keeps * x[1]

        def guard_gradient(transition, t, x, parameters, out):
            out[0], out[1], out[2] = 1.0, 0.0, 0.0

        model = SimpleNamespace(
            dimension=2, parameters=None, field=field, reset=reset, guard_gradient=guard_gradient
        )
        work = SimpleNamespace(
            **{name: np.zeros(2) for name in ("settled", "state", "field_after")},
            gradient=np.array([1.0, 0.0, 0.0]),
        )
        work.field = np.array([0.0, a * unit])
        run = SimpleNamespace(scale=np.array([unit, unit]))
        return bool(kernels.is_held(model, run, 0, 0, 5.0, np.array([unit, 0.0]), towards, work))

    @pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
    @pytest.mark.parametrize("a", [2.0, -2.0])
    def test_a_reset_holds_if_it_takes_the_speed_away(self, a, unit):
        for keeps, holds in ((0.0, True), (-0.5, True), (0.9e-3, True), (1.1e-3, False), (1.0, False)):
            assert self.held(a, keeps, np.sign(a), unit) is holds
            # A push to the near side needs no holding.
            assert self.held(a, keeps, -np.sign(a), unit) is False

    def test_nothing_holds_where_nothing_pushes(self):
        assert self.held(0.0, 0.0, 1) is False


def side_of(
    value, *, speed=0.0, acceleration=0.0, soon=0, direction=1, before=0, was_on=False, band=1.0, jumps=0
):
    stubbed = plain(
        sides,
        guard_value=lambda *arguments: value,
        guard_speed=lambda *arguments: speed,
        rounding_band=lambda *arguments: band,
        has_program=lambda *arguments: jumps > 0,
        exceeds_slope=lambda *arguments: abs(value) > 0.4,
        speed_sign=lambda *arguments: float(np.sign(arguments[6])),
        may_jump=lambda *arguments: jumps > 1,
        acceleration_sign=lambda *arguments: float(np.sign(acceleration)),
        acceleration_soon=lambda *arguments: soon,
    )
    model = SimpleNamespace(direction=integers(direction))
    work = SimpleNamespace(scalar=None, field=None, gradient=None)
    return stubbed.side_of(model, None, (0, 0.0, None), 0, before, was_on, work)


@pytest.mark.parametrize("sign", [-1, 1])
def test_the_side_of_a_guard(sign):
    for direction in (-1, 0, 1):
        # Beyond its band the value decides, within the speed, then the acceleration.
        given = {"direction": direction, "before": -sign, "was_on": True}
        assert side_of(1.1 * sign, speed=-sign, **given) == (sign, 0)
        assert side_of(-0.9 * sign, speed=sign, acceleration=-sign, **given) == (sign, BY_SPEED)
        assert side_of(-0.9 * sign, acceleration=sign, **given) == (sign, BY_ACCELERATION)
    # If none does, the side is the near one unless it was known before.
    for direction in (-1, 1):
        assert side_of(0.9 * sign, direction=direction) == (-direction, BY_STEP)
        assert side_of(0.9 * sign, direction=direction, soon=sign) == (sign, BY_STEP)
        assert side_of(0.9, direction=direction, before=sign) == (-direction, BY_STEP)
        assert side_of(0.9, direction=direction, before=sign, was_on=True) == (sign, BY_STEP)
    assert side_of(0.9, direction=0, before=sign) == (sign, BY_STEP)
    # A guard without a value keeps its side, an infinite one has that of its sign.
    assert side_of(np.nan, speed=-sign, before=sign) == (sign, 0)
    assert side_of(np.nan, jumps=2, before=sign) == (sign, sides.JUMPING)
    for speed in (-sign, np.nan):
        assert side_of(sign * np.inf, speed=speed, before=-sign, was_on=True, jumps=2) == (sign, 0)


@pytest.mark.parametrize("sign", [-1, 1])
def test_the_side_of_a_guard_that_jumps(sign):
    jumping = sides.JUMPING
    # Much larger than its gradient tells: it jumps, and its sign is its side if no other is known.
    assert side_of(0.5 * sign, speed=-sign, jumps=1) == (sign, jumping)
    assert side_of(0.5 * sign, speed=-sign, jumps=1, before=-sign) == (sign, jumping)
    assert side_of(0.5 * sign, speed=sign, jumps=1, before=-sign, was_on=True) == (-sign, jumping)
    assert side_of(0.5 * sign, speed=-sign, jumps=1, was_on=True) == (sign, jumping)
    # As small as its gradient tells: its speed counts.
    assert side_of(0.3 * sign, speed=-sign, jumps=1) == (-sign, BY_SPEED)
    # In the middle of a jump.
    assert side_of(0.3, acceleration=sign, jumps=2, before=sign, was_on=True) == (sign, jumping)
    assert side_of(0.3, acceleration=sign, jumps=2, direction=-1) == (1, BY_STEP)
    for before, was_on in ((0, True), (-1, False)):
        assert side_of(0.3, jumps=2, direction=-1, before=before, was_on=was_on) == (1, BY_STEP)
