"""What ``over`` may be: a grid, a table of mappings, a dataset; and the keys of its points."""

import numpy as np
import pytest
import xarray

from hybrid.errors import ArgumentError
from hybrid.sweep.points import as_points


def rows(points):
    return [dict(zip(points.names, row, strict=True)) for row in points.values.tolist()]


def test_a_grid_varies_the_last_axis_fastest():
    points = as_points({"a": [1.0, 2.0], "b": (3, 4, 5)})
    assert points.names == points.dims == ("a", "b")
    assert points.shape == (2, 3)
    assert rows(points) == [{"a": a, "b": b} for a in (1.0, 2.0) for b in (3.0, 4.0, 5.0)]
    assert points.coords["b"][0] == "b"
    np.testing.assert_array_equal(points.coords["b"][1], [3.0, 4.0, 5.0])


def test_a_table_of_mappings_has_one_axis():
    points = as_points([{"a": 1.0, "b": 3.0}, {"b": 4.0, "a": 2.0}])
    assert points.dims == ("point",)
    assert points.shape == (2,)
    assert rows(points) == [{"a": 1.0, "b": 3.0}, {"a": 2.0, "b": 4.0}]
    np.testing.assert_array_equal(points.coords["a"][1], [1.0, 2.0])


def test_a_dataset_is_a_table_with_its_own_axis_and_units():
    dataset = xarray.Dataset({"a": ("run", [1.0, 2.0], {"units": "m"}), "b": ("run", [3.0, 4.0])})
    points = as_points(dataset)
    assert points.dims == ("run",)
    assert rows(points) == [{"a": 1.0, "b": 3.0}, {"a": 2.0, "b": 4.0}]
    assert points.coords["a"][2] == {"units": "m"}
    assert points.coords["b"][2] == {}


def test_axes_of_a_grid_keep_their_units():
    axis = xarray.DataArray([1.0, 2.0], dims="a", attrs={"units": "rad/s"})
    assert as_points({"a": axis, "b": [1.0]}).coords["a"][2] == {"units": "rad/s"}


@pytest.mark.parametrize(
    ("over", "text"),
    [
        ({}, "over must"),
        ([], "over must"),
        ([{}], "over must"),
        ([{}, {"a": 1.0}], "over must"),
        ("abc", "over must"),
        (b"abc", "over must"),
        (3.0, "over must"),
        ({"a": []}, r"over\['a'\] must .*shape \(0,\)"),
        ({"a": [[1.0]]}, r"over\['a'\] must .*shape \(1, 1\)"),
        ({"a": [1.0, np.nan]}, r"over\['a'\] must"),
        ({"": [1.0]}, "each name must be a text"),
        ({1: [1.0]}, "each name must be a text"),
        ({"status": [1.0]}, "is the name of a result"),
        ([{"status": 1.0}], "is the name of a result"),
        ([{"a": 1.0}, {"b": 1.0}], r"over\[1\] must have the names of over\[0\], a; got b"),
        ([{"a": 1.0}, {}], r"over\[1\] must have the names of over\[0\], a; got none"),
        ([{"a": 1.0}, 3.0], r"over\[1\] must"),
        (xarray.Dataset({"a": (("x", "y"), [[1.0]])}), "one dimension as a table of points; got x, y"),
        (xarray.Dataset(coords={"x": [1.0]}), "this xarray.Dataset has none"),
        (xarray.Dataset({"a": ("status", [1.0])}), "is the name of a result"),
    ],
)
def test_what_is_refused(over, text):
    with pytest.raises(ArgumentError, match=text):
        as_points(over)


def test_keys_depend_on_names_and_values_only():
    one = as_points({"a": [1.0, 2.0], "b": [3.0]}).keys(None)
    assert len(set(one)) == 2
    assert as_points([{"b": 3.0, "a": 1.0}, {"b": 3.0, "a": 2.0}]).keys(None) == one
    assert as_points({"b": [3.0], "a": [1.0, 2.0]}).keys(None) == one
    assert as_points({"a": [3.0], "b": [1.0, 2.0]}).keys(None) != one


def test_keys_along_lines_depend_on_the_points_before():
    points = as_points({"a": [1.0, 2.0, 3.0]})
    forth, back = (points.keys(np.array([line])) for line in ([0, 1, 2], [2, 1, 0]))
    assert len({*forth, *back, *points.keys(None)}) == 9
    shorter = as_points({"a": [1.0, 2.0]}).keys(np.array([[0, 1]]))
    assert forth[:2] == shorter
    other = as_points({"a": [1.5, 2.0]}).keys(np.array([[0, 1]]))
    assert other[1] != shorter[1]


def test_points_and_lines_of_a_grid():
    points = as_points({"a": [1.0, 2.0], "b": [3.0, 4.0, 5.0]})
    assert len(points) == 6
    assert points.at(4) == {"a": 2.0, "b": 4.0}
    assert points.lines("a").tolist() == [[0, 3], [1, 4], [2, 5]]
    assert points.lines("b").tolist() == [[0, 1, 2], [3, 4, 5]]
