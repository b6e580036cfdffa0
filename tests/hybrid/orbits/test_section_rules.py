"""Points of a section rule by rule, with runs whose jumps are known beforehand."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.types import codes
from hybrid.kernels.types.codes import UNLIMITED
from hybrid.orbits import sections
from hybrid.status import StatusCode

STEPS = 10


class Ringing:
    """A run that jumps at each whole time, after ten steps, by the transitions in turn."""

    def __init__(self, turn, *, period=0.0, max_steps=10**9, last=UNLIMITED, calls=UNLIMITED):
        self.turn, self.max_steps, self.last = turn, max_steps, last
        self.model = SimpleNamespace(dimension=1, period=period)
        self.run = SimpleNamespace(jumps=0, steps=0)
        self.calls = 0
        self.stop = SimpleNamespace(is_set=lambda: self.calls >= calls)

    def advance_to(self, cycle, phase, record, *, max_steps, max_jumps):
        """As the driver: the code says which limit was met first."""
        self.calls += 1
        assert self.calls < 50
        run, period = self.run, self.model.period
        assert (cycle, phase) == (UNLIMITED if period else 0, np.inf)
        while True:
            if run.jumps == self.last:
                return codes.TERMINAL
            if run.jumps >= max_jumps:
                return codes.MAX_JUMPS
            if record.jumps == len(record.jump_cycle):
                return codes.RECORD_FULL
            if run.steps + STEPS > max_steps:
                run.steps = max_steps
                return codes.MAX_STEPS
            run.steps += STEPS
            k, time = record.jumps, run.jumps + 1
            record.jump_cycle[k], record.jump_phase[k] = divmod(time, period) if period else (0, time)
            record.jump_transition[k] = self.turn[run.jumps % len(self.turn)]
            record.jump_states[k] = [[-time], [np.nan]]
            run.jumps, record.jumps = time, k + 1


def points_of(run, points, *, room=500, between=10**6, monkeypatch, bar=None):
    """Times, transitions and jumps in between, where transitions 0 and 1 count."""
    monkeypatch.setattr(sections, "POINTS_AT_ONCE", room)
    monkeypatch.setattr(sections, "STEPS_BETWEEN_POINTS", between)
    t, x, index, count, code = sections.crossings(run, np.array([True, True, False]), points, bar)
    assert x.tolist() == [[-time] for time in t]
    return t.tolist(), index.tolist(), count.tolist(), code


@pytest.mark.parametrize("room", [1, 2, 3, 500])
@pytest.mark.parametrize("period", [0.0, 2.0])
def test_the_crossings_of_the_section_among_other_jumps(room, period, monkeypatch):
    """However the jumps are divided among calls."""
    run = Ringing((2, 0, 2, 2, 1), period=period)
    found = points_of(run, 4, room=room, monkeypatch=monkeypatch)
    assert found == ([2, 5, 7, 10], [0, 1, 0, 1], [1, 3, 4, 6], codes.DONE)
    assert run.run.jumps == 10


@pytest.mark.parametrize("points", [1, 2, 3, 4])
def test_the_run_does_not_go_on_beyond_the_last_point(points, monkeypatch):
    run = Ringing((0,))
    assert points_of(run, points, monkeypatch=monkeypatch)[0] == [*range(1, points + 1)]
    assert (run.run.jumps, run.calls) == (points, 1)


def test_a_run_that_ends_keeps_its_points(monkeypatch):
    found = points_of(Ringing((2, 0), last=5), 9, monkeypatch=monkeypatch)
    assert found == ([2, 4], [0, 0], [1, 2], codes.TERMINAL)
    found = points_of(Ringing((2, 0), last=0), 9, monkeypatch=monkeypatch)
    assert found == ([], [], [], codes.TERMINAL)


@pytest.mark.parametrize("between", [20, 30, 50])
def test_a_section_that_is_not_met_for_many_steps_is_given_up(between, monkeypatch):
    """Points are two jumps apart; a point in a call allows as many steps after its end."""
    turn = (2, 0, 2, 0, 2, 0, *[2] * 90)
    t, _, _, code = points_of(Ringing(turn), 9, between=between, room=2, monkeypatch=monkeypatch)
    assert code == codes.MAX_STEPS
    assert t == [2, 4, 6]
    # The limit of the whole run holds too.
    t, _, _, code = points_of(Ringing((2, 0), max_steps=45), 9, between=between, monkeypatch=monkeypatch)
    assert (t, code) == ([2, 4], codes.MAX_STEPS)


def test_points_in_a_call_that_ended_for_its_steps_make_the_run_go_on(monkeypatch):
    run = Ringing((2, 0))
    found = points_of(run, 3, between=25, monkeypatch=monkeypatch)
    assert found == ([2, 4, 6], [0, 0, 0], [1, 2, 3], codes.DONE)
    assert run.calls > 2


@pytest.mark.parametrize(("calls", "found"), [(1, [2]), (2, [2, 4]), (3, [2, 4]), (4, [2, 4, 6])])
def test_a_run_that_is_asked_to_stop(calls, found, monkeypatch):
    """Once it has all points it does not stop any more."""
    t, _, _, code = points_of(Ringing((2, 0), calls=calls), 3, room=2, monkeypatch=monkeypatch)
    assert t == found
    assert code == (codes.DONE if len(found) == 3 else StatusCode.INTERRUPTED)


def test_a_bar_counts_the_points(monkeypatch):
    told = []
    points_of(Ringing((0, 1, 2)), 3, monkeypatch=monkeypatch, bar=SimpleNamespace(update=told.append))
    assert told == [2, 1]


@pytest.mark.parametrize(("transient", "jumps"), [(0, [3, 1, 0, 4]), (1, [1, 0, 4]), (3, [4]), (4, [])])
def test_points_after_the_transient(transient, jumps, monkeypatch):
    """Jumps are those since the point before, which may be one of the transient."""
    system = SimpleNamespace(
        transitions=["of a", "of b", "other"], state_names=("q",), mode_names=("a", "b"), units={"q": "m"}
    )
    times = np.array([1.0, 2.0, 5.0, 7.0])

    def crossings(run, counted, points, bar):
        assert (run, counted.tolist(), points, bar) == (trajectory, [True, True, False], 9 + transient, "bar")
        return times, -times[:, None], np.array([0, 1, 1, 0]), np.array([3, 4, 4, 8]), 7

    trajectory = SimpleNamespace(system=system)
    monkeypatch.setattr(sections, "crossings", crossings)
    monkeypatch.setattr(sections, "status_of", lambda run, code: (run, code))
    found = sections._collect(trajectory, 2, transient, 9, "bar")
    assert found.status == (trajectory, 7)
    assert found.jumps.tolist() == jumps
    assert found.t.tolist() == times[transient:].tolist()
    assert found.x[:, 0].tolist() == (-times[transient:]).tolist()
    assert found.mode.tolist() == ["a", "b", "b", "a"][transient:]
    assert (found.state_names, found.mode_names, found.units) == (("q",), ("a", "b"), {"q": "m"})
    assert len(found) == len(jumps)
