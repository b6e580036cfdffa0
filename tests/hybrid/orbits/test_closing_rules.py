"""The end of a period rule by rule, with runs whose jumps are known beforehand."""

import math
from types import SimpleNamespace

import pytest

from hybrid.kernels.types import codes
from hybrid.orbits.closing import advance_to_close, jumps_at_once, same_time
from hybrid.status import StatusCode


class Jumping:
    """A run from cycle 2 and phase 0.5 of a period of 4, which jumps at these times after its start."""

    def __init__(self, *times, last=math.inf, calls=math.inf):
        self.times, self.last, self.jumps, self.elapsed, self.calls = times, last, 0, 0.0, 0
        self.model = SimpleNamespace(period=4.0)
        self.run = SimpleNamespace(cycle=2, phase=0.5)
        self.stop = SimpleNamespace(is_set=lambda: self.calls >= calls)

    @property
    def t(self):
        return 8.5 + self.elapsed

    def no_record(self):
        return "record"

    def advance_to(self, cycle, phase, record, *, max_jumps=math.inf):
        self.calls += 1
        assert self.calls < 20
        assert record == "record"
        end = 4.0 * cycle + phase - 8.5
        while self.jumps < len(self.times) and self.times[self.jumps] <= min(end, self.last):
            if self.jumps >= max_jumps:
                self.elapsed = self.times[self.jumps]
                return codes.MAX_JUMPS
            self.elapsed = self.times[self.jumps]
            self.jumps += 1
            if self.jumps >= max_jumps:
                return codes.MAX_JUMPS
        self.elapsed = min(end, self.last)
        return codes.DONE if end <= self.last else codes.NON_FINITE


def test_a_jump_at_the_start_is_told_and_not_made():
    run = Jumping(0.0, 1.0)
    assert jumps_at_once(run)
    assert run.jumps == 0
    assert not jumps_at_once(Jumping(1e-9))
    assert not jumps_at_once(Jumping())


@pytest.mark.parametrize(("times", "jumps"), [((), 0), ((1.0,), 1), ((1.0, 4.0), 2), ((1.0, 4.5), 1)])
def test_without_a_jump_at_the_start_a_period_has_all_jumps_to_its_end(times, jumps):
    run = Jumping(*times)
    assert advance_to_close(run, 3, 0.5) == codes.DONE
    assert (run.jumps, run.t) == (jumps, 12.5)


@pytest.mark.parametrize(
    ("times", "jumps"),
    [
        # The jump at the start, others within the period, and those at its end, which belong to the next.
        ((0.0,), 1),
        ((0.0, 2.0, 3.0), 3),
        ((0.0, 0.0, 2.0), 3),
        ((0.0, 2.0, 5.0), 2),
    ],
)
def test_with_a_jump_at_the_start_the_run_goes_on_to_the_end(times, jumps):
    run = Jumping(*times)
    assert advance_to_close(run, 3, 0.5) == codes.DONE
    assert (run.jumps, run.t) == (jumps, 12.5)


def test_the_jump_at_the_start_is_the_only_one_of_two_ends():
    """The limit of the run is one jump more each time, so it stops at the jump at its end."""
    run = Jumping(0.0, 2.0, 4.0, 4.0)
    assert advance_to_close(run, 3, 0.5) == codes.DONE
    assert (run.jumps, run.t) == (3, 12.5)


def test_a_run_that_ends_early_tells_its_code():
    for times in ((), (0.0,), (0.0, 2.0)):
        assert advance_to_close(Jumping(*times, last=3.0), 3, 0.5) == codes.NON_FINITE


@pytest.mark.parametrize(("calls", "code"), [(1, StatusCode.INTERRUPTED), (3, StatusCode.INTERRUPTED)])
def test_a_run_that_is_asked_to_stop(calls, code):
    run = Jumping(0.0, 2.0, 3.0, calls=calls)
    assert advance_to_close(run, 3, 0.5) == code
    assert run.calls == calls


@pytest.mark.parametrize(("one", "other", "period"), [(3.0, 3.0, 0.0), (-5.0, -5.0, 4.0), (1e-3, 1e-3, 1e6)])
def test_times_are_the_same_within_sixteen_roundings(one, other, period):
    """Of the time or, if that is longer, of the period."""
    unit = math.ulp(max(abs(other), period))
    for sign in (-1, 1):
        assert same_time(one + sign * 16 * unit, other, period)
        assert not same_time(one + sign * 17 * unit, other, period)
