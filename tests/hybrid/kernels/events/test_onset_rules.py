"""What counts as zero at the start of a step, order by order."""

import math
from types import SimpleNamespace

import pytest

from hybrid.kernels.events import onset
from hybrid.kernels.events.onset import BY_ACCELERATION, BY_SPEED, BY_STEP, JUMPING
from tests.hybrid.kernels.plain import plain

kernels = plain(onset)
ZERO = (BY_SPEED, BY_ACCELERATION, BY_STEP)


def test_a_guard_that_jumps_is_never_zero():
    assert [kernels.is_zero(order) for order in range(5)] == [order in ZERO for order in range(5)]
    assert not kernels.is_zero(JUMPING)


@pytest.mark.parametrize("order", range(5))
def test_the_known_part_is_the_value_and_the_slope_that_is_only_rounding(order):
    expected = {0: (0.0, 0.0), BY_SPEED: (3.0, 0.0), JUMPING: (0.0, 0.0)}.get(order, (3.0, -4.0))
    assert kernels.known_part(3.0, -4.0, order) == expected
    for slope in (math.inf, -math.inf, math.nan):
        assert kernels.known_part(3.0, slope, order) == (0.0, 0.0)


@pytest.mark.parametrize("order", range(5))
def test_the_side_is_certain_but_at_a_kink(order):
    known = order in (BY_SPEED, BY_ACCELERATION)
    for slopes in ((1.0, 2.0), (-2.0, -1.0), (0.0, 2.0), (-2.0, 0.0)):
        assert bool(kernels.side_is_certain(order, *slopes)) == known
    assert bool(kernels.side_is_certain(order, -1.0, 2.0)) == (order == BY_ACCELERATION)


def test_a_transition_has_just_fired_if_no_time_has_passed_on_its_guard():
    def fired(on_guard=BY_SPEED, last=3, since=0.0):
        run = SimpleNamespace(last_fired=last, since_entry=since)
        return kernels.has_just_fired(run, 3, on_guard)

    assert all(fired(on_guard) for on_guard in range(1, 5))
    assert not fired(on_guard=0)
    assert not fired(last=2)
    assert not fired(since=1e-300)
