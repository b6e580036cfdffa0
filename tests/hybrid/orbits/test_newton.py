"""Newton's method for orbits on shots whose maps are known in closed form, in any units."""

import attrs
import numpy as np
import pytest

from hybrid.orbits.newton import EPSILON, ROUNDING_OF_GAP, Newton, Point, Shot, length
from hybrid.status import Status, StatusCode

# Units of two states, as powers of two so that no digit changes.
UNITS = [np.ones(2), np.array([2.0**40, 2.0**-30]), np.array([2.0**-200, 2.0**100])]


def shot(x, end, fundamental, *, unit=None, **changes):
    """A shot over a period of 3, with states measured in other units."""
    unit = np.ones(len(x)) if unit is None else unit
    x, end = np.asarray(x) * unit, np.asarray(end) * unit
    values = {
        "point": Point(x, 0.0, 3.0),
        "mode": "run",
        "end": end,
        "end_mode": "run",
        "fundamental": np.asarray(fundamental) * unit[:, None] / unit,
        "field": unit,
        "end_field": unit,
        "extent": np.abs(end - x),
        "magnitude": np.maximum(np.abs(x), np.abs(end)),
        "status": Status(StatusCode.SUCCESS, ""),
    }
    return Shot(**values | changes)


@pytest.mark.parametrize("size", [0.0, 1.0, 2.0**-900, 2.0**900, np.inf])
def test_length_of_vectors_whose_squares_leave_the_range(size):
    with np.errstate(invalid="ignore"):
        vector = np.array([3.0, 0.0, -4.0]) * (size or 0.0)
    vector[1] = 0.0
    assert length(vector) == 5.0 * size


class TestShot:
    MATRIX = np.array([[0.5, 1.0], [0.0, -2.0]])

    @pytest.mark.parametrize("unit", UNITS)
    def test_growth_and_size_in_any_units(self, unit):
        run = shot((1.0, 1.0), (4.0, 5.0), self.MATRIX, unit=unit)
        np.testing.assert_array_equal(run.gap, [3.0, 4.0] * unit)
        assert run.growth(unit) == pytest.approx(2.0, rel=1e-14)
        assert run.size(unit) == pytest.approx(5.0, rel=1e-14)

    def test_rounding_of_the_start_and_of_the_end(self):
        run = shot((1.0, 3.0), (-8.0, 2.0), self.MATRIX)
        share = ROUNDING_OF_GAP * EPSILON
        np.testing.assert_allclose(run.rounding / share, [8.0 + 0.5 * 8.0 + 3.0, 3.0 + 2.0 * 3.0], rtol=1e-14)

    @pytest.mark.parametrize(
        "changes",
        [
            {"status": Status(StatusCode.MAX_STEPS, "")},
            {"end_mode": "other"},
            {"fundamental": np.array([[np.nan, 0.0], [0.0, 1.0]])},
        ],
    )
    def test_a_run_that_is_not_whole_closes_nothing(self, changes):
        run = shot((1.0, 1.0), (1.0, 1.0), self.MATRIX)
        assert run.whole
        assert run.closes(0.0, np.zeros(2))
        broken = attrs.evolve(run, **changes)
        assert not broken.whole
        assert not broken.closes(1.0, np.ones(2))
        assert broken.size(np.ones(2)) == np.inf

    def test_each_component_closes_to_its_motion_or_to_rounding(self):
        run = shot((0.0, 0.0), (1e-6, 1e-9), self.MATRIX, extent=np.array([10.0, 0.0]))
        assert run.closes(2e-7, np.array([0.0, 2e-9]))
        assert not run.closes(0.5e-7, np.array([0.0, 2e-9]))
        assert not run.closes(2e-7, np.array([0.0, 0.5e-9]))
        assert run.closes(0.0, np.array([2e-6, 2e-9]))


class TestNewton:
    @pytest.mark.parametrize("unit", UNITS)
    def test_one_step_finds_the_fixed_point_of_an_affine_map(self, unit):
        matrix, fixed = np.array([[0.5, 1.0], [0.25, -2.0]]), np.array([0.75, -1.5])
        x = np.array([2.0, 1.0])
        run = shot(x, matrix @ (x - fixed) + fixed, matrix, unit=unit)
        step, longer = Newton.begin(run, 0.0, free_period=False).step(run)
        np.testing.assert_allclose((run.point.x + step) / unit, fixed, rtol=1e-13)
        assert longer == 0.0

    @pytest.mark.parametrize("unit", UNITS)
    def test_with_a_free_period_the_step_solves_the_linear_equations(self, unit):
        """The end meets the start to first order, in the plane across the field at the first start."""
        matrix = np.array([[0.5, 1.0], [0.25, -2.0]])
        start, end, field = np.array([2.0, 1.0]), np.array([2.5, 0.0]), np.array([1.0, -3.0])
        first = shot((1.5, 2.0), (1.0, -4.0), matrix, unit=unit, field=field * unit)
        run = shot(start, end, matrix, unit=unit, end_field=np.array([-1.0, 0.5]) * unit)
        begun = Newton.begin(first, 0.0, free_period=True)
        step, longer = begun.step(run)
        step = step / unit
        np.testing.assert_allclose(
            start + step, end + matrix @ step + np.array([-1.0, 0.5]) * longer, rtol=1e-13
        )
        normal = field / np.array([1.5, 4.0]) ** 2
        assert normal @ (start + step - (1.5, 2.0)) == pytest.approx(0.0, abs=1e-13)
        # A scale that has grown since leaves the plane as it was.
        again, time = begun.advanced(run, shot(start, (8.0, 1.0), matrix, unit=unit)).step(run)
        np.testing.assert_allclose(again / unit, step, rtol=1e-12)
        assert time == pytest.approx(longer, rel=1e-12)

    def test_scale_and_move_after_a_step(self):
        one, two = shot((1.0, -8.0), (2.0, 1.0), np.eye(2)), shot((4.0, 1.0), (3.0, 2.0), np.eye(2))
        begun = Newton.begin(one, 3.0, free_period=False)
        np.testing.assert_array_equal(begun.scale, [3.0, 8.0])
        np.testing.assert_array_equal(begun.moved, [0.0, 0.0])
        later = begun.advanced(one, two)
        np.testing.assert_array_equal(later.scale, [4.0, 8.0])
        np.testing.assert_array_equal(later.moved, [3.0, 9.0])

    @pytest.mark.parametrize("unit", UNITS)
    def test_directions_that_are_nearly_singular_are_left_out(self, unit):
        run = shot((1.0, 1.0), (2.0, 2.0), [[1.0 - 1e-6, 0.0], [0.0, 0.5]], unit=unit)
        begun = Newton.begin(run, 0.0, free_period=False)
        np.testing.assert_allclose(begun.step(run)[0] / unit, [1e6, 2.0], rtol=1e-9)
        np.testing.assert_allclose(begun.step(run, smallest=1e-3)[0] / unit, [0.0, 2.0], atol=1e-14)

    @pytest.mark.parametrize("unit", UNITS)
    def test_parts_of_a_gap_that_no_short_step_removes(self, unit):
        """The first direction needs a step of 1e6, the second one of 1, in units of the scale."""
        run = shot((1.0, 1.0), (2.0, 2.0), [[1.0 - 1e-6, 0.0], [0.0, 0.5]], unit=unit)
        other = shot((1.0, 1.0), (1.25, -3.0), np.eye(2), unit=unit)
        begun = Newton.begin(run, 0.0, free_period=False)
        found = begun.drift(run, other, farthest=100.0) / unit[:, None]
        np.testing.assert_allclose(np.abs(found), [[0.25], [0.0]], atol=1e-14)
        assert begun.drift(run, other, farthest=1e7).shape == (2, 0)
        assert begun.drift(run, other, farthest=0.5).shape == (2, 2)
