"""A series on a forced step: its values, whether it is finite, where the mode ends, how long the step is."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.steps import forcing
from hybrid.kernels.types.codes import NARROW
from tests.hybrid.kernels.plain import plain

kernels = plain(forcing)


def test_a_column_and_its_derivative():
    series = np.full((5, 3), 99.0)
    series[:4, 1] = 1.0, 2.0, 3.0, -4.0
    assert kernels._value_and_slope(series, 1, 3, 0.5) == (2.25, 2.0)
    assert kernels._value_and_slope(series, 1, 3, -1.0) == (6.0, -16.0)
    assert kernels._value_and_slope(series, 1, 1, 0.5) == (2.0, 2.0)
    assert kernels._value_and_slope(series, 1, 0, 0.5) == (1.0, 0.0)


# Tangent vectors begin at this column; four of them take so many columns together in each of three modes.
FIRST, TOGETHER = 5, (99, 2 * NARROW + 3, 77)
VECTORS = NARROW + 2


def with_vectors():
    """Two states, two other columns, and six tangent vectors: component ``i`` of vector ``v`` is 10 v + i.

    Its rate is 1000 more. What no component has is not finite.
    """
    series = np.full((4, FIRST + 3 * TOGETHER[1]), np.nan)
    series[:2, :2] = (3.0, 4.0), (20.0, 40.0)
    columns = {}
    for vector in range(VECTORS):
        group, lane = divmod(vector, NARROW)
        for i in range(2):
            column = FIRST + group * TOGETHER[1] + lane + NARROW * i
            columns[vector, i] = column
            series[:2, column] = 10.0 * vector + i, 1000.0 + 10.0 * vector + i
    assert len(set(columns.values())) == 2 * VECTORS
    model = SimpleNamespace(dimension=2, tangent_start=FIRST, tangent_columns=np.array(TOGETHER))
    return model, series, columns


def test_state_and_tangent_vectors_along_a_series():
    model, series, _ = with_vectors()
    for tangents in (0, 1, VECTORS):
        work = SimpleNamespace(series=series, trial=np.full(99, 77.0), new=np.full(99, 77.0))
        kernels._along_series(model, 1, tangents, 1, 0.5, work)
        components = [10.0 * vector + i for vector in range(tangents) for i in range(2)]
        length = 2 * (1 + tangents)
        assert work.trial[:length].tolist() == [13.0, 24.0, *(500.0 + 1.5 * each for each in components)]
        assert work.new[:length].tolist() == [20.0, 40.0, *(1000.0 + each for each in components)]
        assert set(work.trial[length:]) == set(work.new[length:]) == {77.0}


def test_a_series_is_finite_if_all_its_terms_are():
    model, series, columns = with_vectors()
    work = SimpleNamespace(series=series)
    assert kernels._is_finite(model, 1, VECTORS, 1, work)
    # Terms beyond its order do not count.
    assert not kernels._is_finite(model, 1, VECTORS, 2, work)
    places = [(0, i) for i in range(2)] + [(1 + v, columns[v, i]) for v, i in columns]
    for vector, column in places:
        for order in (0, 1):
            for value in (np.nan, np.inf, -np.inf):
                before = series[order, column]
                series[order, column] = value
                assert not kernels._is_finite(model, 1, VECTORS, 1, work)
                # A vector that the run does not have is no part of it.
                assert kernels._is_finite(model, 1, vector - 1, 1, work) == (vector > 0)
                assert kernels._is_finite(model, 1, VECTORS, 0, work) == (order > 0)
                series[order, column] = before


@pytest.mark.parametrize("side", [1, -1])
def test_a_guard_that_is_passed_on_the_clock(side):
    """The second mode has the guards 2 and 0, in columns 3 and 4 of a series ``c - 4 s``."""
    series = np.full((3, 6), np.nan)
    series[1, 3:5] = -4.0
    model = SimpleNamespace(
        dimension=3,
        first_outgoing=np.array([0, 1, 3]),
        outgoing=np.array([1, 2, 0]),
        guard_in_series=np.array([1, 1, 1]),
    )
    run, work = SimpleNamespace(mode=1, side=np.array([side, 0, side])), SimpleNamespace(series=series)

    def beyond(*starts):
        series[0, 3:5] = starts
        return bool(kernels._is_beyond_guard(model, run, 1, 0.25, work))

    near, far = 1.0 + 0.5 * side, 1.0 - 0.5 * side
    assert not beyond(near, near)
    assert beyond(near, far)
    assert beyond(far, near)
    # On the guard it is not beyond.
    assert not beyond(1.0, 1.0)
    model.guard_in_series[2] = 0
    assert not beyond(far, near)
    assert beyond(near, far)
    run.mode = 0
    assert not beyond(far, far)
