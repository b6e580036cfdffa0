"""Work for executors rule by rule: its chunks, what a worker gets, and points that nobody finished."""

import numpy as np
import pytest

from hybrid.status import StatusCode
from hybrid.sweep import job, remote
from hybrid.sweep.points import as_points


@pytest.mark.parametrize(("workers", "points"), [(2, 20), (200, 40)])
def test_chunks_grow_with_the_number_of_workers(workers, points):
    """A row of 0.1 s: two seconds of work, and 20 ms for each worker."""
    count = 3 * workers * points
    over = as_points({"a": np.arange(float(count))})
    chunks = remote._Chunks(job.Job(None, over, np.arange(count), None), workers)
    chunks.learn([[0]], 0.1)
    assert len(chunks.next()) == points


def test_lines_stay_whole_in_chunks():
    """A line whose last points are there is computed up to its last missing point."""
    points = as_points({"a": [1.0, 2.0, 3.0], "b": [1.0, 2.0]})
    found = job.Job(None, points, np.array([1, 2]), points.lines("a")).units()
    assert found == [[0, 2], [1]]


class TestChunks:
    """Three lines of four points along ``a``; of the second line nothing is missing."""

    points = as_points({"a": [1.0, 2.0, 3.0, 4.0], "b": [1.0, 2.0, 3.0]})
    missing = np.array([0, 3, 5, 9])

    def made(self, along, workers=1):
        lines = self.points.lines("a") if along else None
        return remote._Chunks(job.Job(None, self.points, self.missing, lines), workers)

    @pytest.mark.parametrize(
        ("along", "wanted"), [(True, [[0, 3, 6, 9], [2, 5]]), (False, [[0], [3], [5], [9]])]
    )
    def test_units_are_points_or_lines(self, along, wanted):
        chunks = self.made(along)
        assert chunks.left == len(wanted)
        assert [chunks.next() for _ in wanted] == [[each] for each in wanted]
        assert chunks.left == 0
        assert chunks.next() is None

    @pytest.mark.parametrize(("count", "workers", "size"), [(400, 1, 133), (400, 4, 33), (3, 1, 1)])
    def test_each_worker_gets_three_chunks_of_what_is_left(self, count, workers, size):
        points = as_points({"a": np.arange(float(count))})
        chunks = remote._Chunks(job.Job(None, points, np.arange(count), None), workers)
        assert len(chunks.next()) == 1
        chunks.learn([[0]], 0.0)
        assert len(chunks.next()) == size

    @pytest.mark.parametrize("along", [True, False])
    def test_what_a_worker_gets(self, along):
        chunks = self.made(along)
        chunk = chunks.next()
        names, units, values, wanted = chunks.packed(chunk)
        assert (names, units) == (("a", "b"), chunk)
        np.testing.assert_array_equal(values, self.points.values[chunk[0]])
        assert wanted == ({0, 3, 9} if along else None)

    def test_the_least_time_counts_and_may_grow_by_a_quarter(self):
        chunks = self.made(False)
        for seconds, known in ((9.0, 3.0), (1.5, 0.5), (3.0, 0.625), (0.0, 1e-6)):
            chunks.learn([[0], [3], [5]], seconds)
            assert chunks.seconds_per_unit == pytest.approx(known)

    @pytest.mark.parametrize("along", [True, False])
    def test_points_that_nobody_finished(self, along):
        """Of a line, those that were there before are not lost."""
        part = remote._lost([[0, 3, 6, 9], [2, 5]], self.made(along), MemoryError("too many."))
        assert part.rows.tolist() == ([0, 3, 9, 5] if along else [0, 3, 6, 9, 2, 5])
        assert part.codes.tolist() == [StatusCode.NOT_RUN] * len(part.rows)
        text = "No worker finished this point: MemoryError: too many. Call again to compute it."
        assert part.messages == [text] * len(part.rows)
        assert (part.schema, part.columns) == (None, [])
