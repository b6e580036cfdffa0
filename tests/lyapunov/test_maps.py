"""Maps over two axes: what each cell shows, and where it lies."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray
from matplotlib.colors import to_hex

from hybrid import ArgumentError, StatusCode
from lyapunov import maps


@pytest.fixture(autouse=True)
def _no_figures_left():
    yield
    plt.close("all")


def chart(exponents, errors=0.0, a=None, b=None, status=0, **attributes):
    """A chart over ``b`` and ``a`` with exponents ``(B, A, k)``."""
    values = np.array(exponents, dtype=float)
    shape = values.shape[:2]
    data = {
        "exponents": (("b", "a", "exponent"), values, {"units": "1/s"}),
        "standard_error": (("b", "a", "exponent"), np.broadcast_to(errors, values.shape)),
        "status": (("b", "a"), np.broadcast_to(status, shape)),
    }
    coords = {
        "b": ("b", np.arange(shape[0]) if b is None else np.array(b), {"units": "m"}),
        "a": np.arange(shape[1]) / 2 if a is None else np.array(a),
    }
    return xarray.Dataset(data, coords, attributes)


# One row of every kind for a forced system, and for an autonomous one.
FORCED = [[[-1.0, -2.0], [0.0, -2.0], [0.5, -2.0], [np.nan, np.nan]]]


def colours(picture):
    return [to_hex(each).upper() for each in picture.to_rgba(picture.get_array()).reshape(-1, 4)]


def test_each_kind_has_its_colour():
    ax = maps.plot_kinds(chart(FORCED * 2, forced="yes"))
    [picture] = ax.images
    wanted = ["#56B4E9", "#F0E442", "#B2182B", "#BFBFBF"]
    assert colours(picture) == wanted * 2
    legend = ax.get_legend()
    shown = {text.get_text(): to_hex(patch.get_facecolor()).upper() for text, patch in zip(
        legend.get_texts(), legend.get_patches(), strict=True
    )}  # fmt: skip
    assert shown == dict(zip(("periodic", "torus", "chaotic", "not known"), wanted, strict=True))


def test_colours_of_kinds_are_those_of_their_names():
    assert dict(zip(maps.KINDS, maps.COLOURS_OF_KINDS, strict=True)) == {
        "not known": "#BFBFBF",
        "at rest": "#FFFFFF",
        "periodic": "#56B4E9",
        "torus": "#F0E442",
        "chaotic": "#B2182B",
    }
    ax = maps.plot_kinds(chart([[[-1.0, -2.0], [0.0, -2.0], [0.0, 0.0]]] * 2, forced="no"))
    assert colours(ax.images[0])[:3] == ["#FFFFFF", "#56B4E9", "#F0E442"]


def test_a_map_is_red_above_zero_and_blue_below():
    found = maps.plot_map(chart([[[1.0], [-1.0], [0.0]], [[0.5], [-0.5], [np.nan]]]))
    [picture] = found.images
    assert picture.get_clim() == (-1.0, 1.0)
    red, blue, white = picture.to_rgba(picture.get_array())[0, :, :3]
    assert red[0] > 0.3 > red[2]
    assert blue[2] > 0.3 > blue[0]
    assert min(white) > 0.9
    assert picture.get_array().mask.tolist() == [[False] * 3, [False, False, True]]


def test_the_scale_leaves_out_the_largest_fiftieth():
    values = np.full((10, 10, 1), 1.0)
    values[0, 0], values[0, 1] = 1000.0, 0.0
    assert maps.plot_map(chart(values)).images[0].get_clim() == (-1.0, 1.0)
    assert maps.plot_map(chart(np.zeros((2, 2, 1)))).images[0].get_clim() == (-1.0, 1.0)


@pytest.mark.parametrize("exponent", [0, 1])
def test_the_exponent_that_is_asked_for(exponent):
    ax = maps.plot_map(chart([[[3.0, -2.0], [3.0, -2.0]]] * 2), exponent)
    [picture] = ax.images
    assert np.unique(picture.get_array()).tolist() == [(3.0, -2.0)[exponent]]
    assert ax.figure.axes[-1].get_ylabel() == f"$\\lambda_{{{exponent + 1}}}$ (1/s)"
    with pytest.raises(ArgumentError, match="exponent must be a whole number from 0 to 1; got 2"):
        maps.plot_map(chart(FORCED), 2)


def test_two_standard_errors_are_zero():
    made = chart([[[0.2], [0.3], [-0.2], [-0.3]]], errors=0.1)
    assert maps.settled(made)[0, :, 0].tolist() == [0.0, 0.3, 0.0, -0.3]


def test_failures_are_not_known():
    made = chart(FORCED, status=[[0, StatusCode.MAX_STEPS, 0, 0]])
    assert maps.kinds(made).values.tolist() == [[2, 0, 4, 0]]
    lost = chart([[[-np.inf, -np.inf], [np.inf, 0.0]]])
    assert maps.kinds(lost).values.tolist() == [[2, 0]]
    # A first exponent of minus infinity is known: the only one may be such.
    single = chart([[[-np.inf], [np.nan], [-1.0], [0.5]]], forced="no")
    assert [maps.KINDS[i] for i in maps.kinds(single).values[0]] == [
        "at rest",
        "not known",
        "at rest",
        "chaotic",
    ]
    assert maps.kinds(chart([[[np.nan, -np.inf], [-np.inf, np.nan]]])).values.tolist() == [[0, 2]]
    attributes = maps.kinds(made).attrs
    assert attributes["flag_values"] == [0, 1, 2, 3, 4]
    assert attributes["flag_meanings"] == "not_known at_rest periodic torus chaotic"


class TestPlace:
    """Cells are centred at the values of the axes."""

    def test_evenly_spaced_axes_are_an_image(self):
        ax = maps.plot_kinds(chart(FORCED * 3, a=[1.0, 1.5, 2.0, 2.5], b=[10.0, 20.0, 30.0]))
        assert ax.images[0].get_extent() == [0.75, 2.75, 5.0, 35.0]
        assert ax.images[0].origin == "lower"
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("a", "b (m)")

    @pytest.mark.parametrize("a", [[1.0, 2.0, 4.0, 5.0], [4.0, 3.0, 2.0, 1.0]])
    def test_others_are_a_mesh(self, a):
        ax = maps.plot_kinds(chart(FORCED * 2, a=a, b=[10.0, 20.0]))
        assert not ax.images
        [mesh] = ax.collections
        corners = mesh.get_coordinates()
        middles = (corners[0, :-1, 0] + corners[0, 1:, 0]) / 2
        assert corners[:, 0, 1].tolist() == [5.0, 15.0, 25.0]
        if a[0] > a[1]:
            np.testing.assert_allclose(middles, a)
        assert colours(mesh)[:4] == ["#56B4E9", "#F0E442", "#B2182B", "#BFBFBF"]

    @pytest.mark.parametrize(
        ("values", "even"),
        [
            ([1.0, 2.0, 3.0], True),
            ([1.0, 2.0, 3.0 + 0.9e-6], True),
            ([1.0, 2.0, 3.0 + 2e-6], False),
            ([3.0, 2.0, 1.0], False),
            ([1.0], False),
            ([1.0, 1.0], False),
        ],
    )
    def test_even(self, values, even):
        assert maps._is_even(np.array(values)) == even

    def test_other_charts_are_refused(self):
        line = chart(FORCED).isel(b=0)
        for draw in (maps.plot_map, maps.plot_kinds):
            with pytest.raises(
                ArgumentError, match=r"over two parameters for a map; this one is over a\. Use"
            ):
                draw(line)
        point = line.isel(a=0)
        with pytest.raises(ArgumentError, match="this one is over none"):
            maps.two_axes(point)
