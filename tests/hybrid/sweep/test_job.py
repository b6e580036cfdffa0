"""What is left to be computed, in which order and when it is passed on."""

import numpy as np
import pytest

from hybrid.sweep import job
from hybrid.sweep.job import Job, Rhythm, computed
from hybrid.sweep.points import as_points

POINTS = as_points({"a": [0.0, 1.0], "b": [0.0, 1.0, 2.0, 3.0]})
LINES = np.arange(8).reshape(2, 4)


class Chain:
    """Each result has the states carried to it; the task fails where ``b`` is in ``broken``."""

    along = "b"

    def __init__(self, broken=()):
        self.broken = broken

    def carry(self, point, state):
        if point["b"] in self.broken:
            raise ValueError("broken")
        return 10.0 * (state or 0.0) + point["b"] + 1.0

    def __call__(self, point, state):
        return {"seen": -1.0 if state is None else state}


@pytest.mark.parametrize(
    ("rows", "lines", "units"),
    [
        ([], None, []),
        ([1, 5], None, [[1], [5]]),
        ([], LINES, []),
        ([0], LINES, [[0]]),
        ([2], LINES, [[0, 1, 2]]),
        ([3, 4, 6], LINES, [[0, 1, 2, 3], [4, 5, 6]]),
        ([7], LINES, [[4, 5, 6, 7]]),
    ],
)
def test_lines_are_computed_up_to_the_last_missing_point(rows, lines, units):
    assert Job(None, POINTS, np.array(rows, dtype=int), lines).units() == units


def results(task, rows, wanted, stop_after=np.inf):
    calls = iter(range(100))
    values = [POINTS.values[row].tolist() for row in rows]
    parts = computed(task, ("a", "b"), [(rows, values)], wanted, lambda: next(calls) >= stop_after)
    return {
        int(row): float(value)
        for part in parts
        for row, value in zip(part.rows, part.columns[0], strict=True)
    }


class TestComputed:
    def test_states_are_carried_through_points_that_are_not_wanted(self):
        assert results(Chain(), [0, 1, 2, 3], {0, 1, 2, 3}) == {0: -1.0, 1: 1.0, 2: 12.0, 3: 123.0}
        assert results(Chain(), [4, 5, 6], {6}) == {6: 12.0}

    def test_a_line_begins_anew_behind_a_point_that_fails(self):
        assert results(Chain(broken=(1.0,)), [0, 1, 2, 3], {2, 3}) == {2: -1.0, 3: 3.0}

    def test_plain_tasks_have_no_state(self):
        assert results(lambda p: {"sum": p["a"] + p["b"]}, [5, 6], None) == {5: 2.0, 6: 3.0}

    def test_a_point_that_was_interrupted_is_not_kept(self):
        assert results(Chain(), [0, 1, 2, 3], {0, 1, 2, 3}, stop_after=2) == {0: -1.0, 1: 1.0}


class TestRhythm:
    @pytest.fixture
    def clock(self, monkeypatch):
        now = [100.0]
        monkeypatch.setattr(job, "perf_counter", lambda: now[0])
        return now

    def due(self, clock, rhythm, end, step=1 / 128):
        found = []
        while clock[0] < end:
            clock[0] += step
            if rhythm.is_due():
                found.append(clock[0])
        return np.diff([100.0, *found])

    def test_in_memory_ten_times_per_second(self, clock):
        assert np.all(np.abs(self.due(clock, Rhythm(stored=False), 105.0) - 0.1) <= 1 / 128)

    def test_on_disk_each_second_at_first_and_each_half_minute_in_the_end(self, clock):
        gaps = self.due(clock, Rhythm(stored=True), 140.0)
        np.testing.assert_allclose(gaps, 1.0)
        gaps = self.due(clock, Rhythm(stored=True), 2500.0, step=0.25)
        late = gaps[len(gaps) // 2 :]
        assert 1.0 <= gaps.min() <= 1.25
        assert 29.0 < late.max() <= 30.25
        assert np.all(np.diff(gaps[1:]) >= -0.25)
