"""Whether a series has the field as its derivative, rule by rule."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.steps import forcing
from hybrid.kernels.steps.forcing import MARGIN, ROUNDING
from hybrid.kernels.types.layout import Path
from tests.hybrid.kernels.plain import plain

ATOL, RTOL = 0.5, 0.25
# Two states and a tangent vector, at the start of the step and along it.
START, ALONG = np.array([3.0, -4.0, 6.0, -8.0]), np.array([1.0, -9.0, 2.0, 8.0])
# The vector has no absolute size: its root mean square stands in.
FLOORS = np.array([ATOL, ATOL, *[RTOL * np.sqrt(50.0)] * 2])
FIELD = np.array([2.0, -3.0, 5.0, -7.0])
ALLOWED = MARGIN * (FLOORS + (RTOL + ROUNDING) * np.array([3.0, 9.0, 6.0, 8.0]))


def path_on(clock, length):
    return Path(None, 5, clock, 7.0, 1.0, length, False)


def follows(gaps, *, tangents=1, noise=(0.0,) * 4, noisy=False, clock=-1, ends=False):
    """Whether a series follows its field on a step of 2, if both differ by a gap in each component.

    Rounding of the state changes the field by the noise. At the nodes 0.25 and 0.5 the weights are 1 and 2.
    On a clock time runs at a tenth of the pace; the mode may end at the first node.
    """
    times, length, nodes = [], 2 * (1 + tangents), (0.0, 0.25, 0.5)
    pace = 1.0 if clock < 0 else 0.1

    def along_series(model, mode, tangents, order, s, work):
        work.trial[:length], work.new[:length] = ALONG[:length], (pace * FIELD + gaps)[:length]

    def rates(model, mode, t, x, tangents, jacobian, out):
        times.append(t)
        same = np.array_equal(x[:length], ALONG[:length])
        out[:length] = (FIELD + (0.0 if same else np.array(noise)))[:length]

    def value_and_slope(series, column, order, s):
        assert (column, order) == (clock, 5)
        return 0.1 * s, 0.1

    model = SimpleNamespace(dimension=2)
    method = SimpleNamespace(atol=ATOL, rtol=RTOL)
    method.series_nodes, method.series_weights = np.array(nodes), np.array([9.0, 1.0, 2.0])
    run = SimpleNamespace(mode=1, phase=7.0, y=START)
    work = SimpleNamespace(series=None, stages=np.zeros((2, 4)), jacobian=None)
    work.error, work.trial, work.new = np.full(4, 88.0), np.zeros(4), np.zeros(4)
    tested = plain(
        forcing,
        _along_series=along_series,
        rates_by_jacobian=rates,
        _value_and_slope=value_and_slope,
        _is_beyond_guard=lambda *given: ends,
    )
    found = bool(tested._follows_field(model, method, run, tangents, path_on(clock, 2.0), noisy, work))
    # The first node is the start, where both are the same.
    expected = [7.0 + pace * 2.0 * node for node in nodes[1:] if not ends]
    assert times == pytest.approx(expected if not noisy else np.repeat(expected, 2), rel=1e-14)
    return found


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("component", range(4))
def test_each_component_may_miss_some_tolerances_over_the_step(component, way):
    """The gap is weighed by 2 (1 + 2)."""
    for share, expected in ((0.9999, True), (1.0001, False)):
        gaps = np.zeros(4)
        gaps[component] = way * share * ALLOWED[component] / 6.0
        assert follows(gaps) == expected
        # A run without tangent vectors has no others.
        assert follows(gaps, tangents=0) == (expected or component > 1)


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("component", range(4))
def test_noise_of_the_state_explains_a_gap(component, way):
    gaps, noise = np.zeros(4), np.zeros(4)
    noise[component] = -way * 100.0
    for share, expected in ((0.99, True), (1.01, False)):
        gaps[component] = way * (100.0 + share * ALLOWED[component] / 6.0)
        assert follows(gaps, noise=noise, noisy=True) == expected
        assert not follows(gaps, noise=noise)
    # Less than the noise is no gap at all.
    gaps[component] = way * 99.0
    assert follows(gaps, noise=noise, noisy=True)


def test_the_rounding_of_the_state_moves_its_components_both_ways():
    """By eight units in the last place; of two neighbours some move together and some apart."""
    moved = []

    def rates(model, mode, t, x, tangents, jacobian, out):
        moved.append(x / ALONG - 1.0)
        out[:] = 0.0

    tested = plain(
        forcing,
        _along_series=lambda model, mode, tangents, order, s, work: np.copyto(work.trial, ALONG),
        rates_by_jacobian=rates,
    )
    method = SimpleNamespace(atol=ATOL, rtol=RTOL, series_nodes=np.zeros(2), series_weights=np.zeros(2))
    work = SimpleNamespace(series=None, stages=np.zeros((2, 4)), jacobian=None)
    work.error, work.trial, work.new = np.zeros(4), np.zeros(4), np.zeros(4)
    run = SimpleNamespace(mode=1, phase=7.0, y=START)
    assert tested._follows_field(SimpleNamespace(dimension=2), method, run, 1, path_on(-1, 2.0), True, work)
    exact, rounded = moved
    assert exact.tolist() == [0.0] * 4
    assert np.abs(rounded) == pytest.approx(ROUNDING, rel=0.1)
    assert set(np.sign(rounded[1:] * rounded[:-1])) == {-1.0, 1.0}


@pytest.mark.parametrize(("gap", "expected"), [(0.3, True), (0.35, False)])
def test_a_vector_of_one_component_has_no_absolute_size(gap, expected):
    """It is 1 at the start and at the end: twice a quarter of both is 1, for three times the gap."""

    def along_series(model, mode, tangents, order, s, work):
        work.trial[:], work.new[:] = 1.0, (0.0, gap)

    def rates(model, mode, t, x, tangents, jacobian, out):
        out[:] = 0.0

    tested = plain(forcing, _along_series=along_series, rates_by_jacobian=rates)
    method = SimpleNamespace(atol=9.0, rtol=RTOL)
    method.series_nodes, method.series_weights = np.array([0.0, 1.0]), np.array([9.0, 3.0])
    work = SimpleNamespace(series=None, stages=np.zeros((2, 2)), jacobian=None)
    work.error, work.trial, work.new = np.zeros(2), np.zeros(2), np.zeros(2)
    run = SimpleNamespace(mode=1, phase=7.0, y=np.ones(2))
    found = tested._follows_field(SimpleNamespace(dimension=1), method, run, 1, path_on(-1, 1.0), False, work)
    assert bool(found) == expected


def test_a_gap_that_is_no_number_is_one():
    assert not follows([np.nan, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("clock", [0, 3])
@pytest.mark.parametrize("component", range(4))
def test_a_series_on_a_clock_follows_the_field_at_its_pace(component, clock):
    """Up to a guard beyond which the mode has ended."""
    for share, expected in ((0.99, True), (1.01, False)):
        gaps = np.zeros(4)
        gaps[component] = share * ALLOWED[component] / 6.0
        assert follows(gaps, clock=clock) == expected
        assert follows(gaps, clock=clock, ends=True)
