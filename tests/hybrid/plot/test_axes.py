"""Axes, legends, components and dots that all plots share."""

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")

import matplotlib.pyplot as plt

from hybrid import ArgumentError
from hybrid.plot.axes import as_component, axes_for, dot_area, logarithmic, plain, show_spread
from hybrid.plot.legends import legend, small_legend
from hybrid.plot.styles import COLOURS, colour_of
from tests.hybrid.plot.legible import illegible


@pytest.mark.parametrize("component", [1, -2, "b", np.int64(1), np.int8(-2)])
def test_components_by_name_and_by_index(component):
    assert as_component("x", ("a", "b", "c"), component) == 1


@pytest.mark.parametrize("component", [3, -4, True, "d", 1.0, None])
def test_components_that_do_not_exist(component):
    with pytest.raises(ArgumentError, match="x: State component"):
        as_component("x", ("a", "b", "c"), component)


def test_new_axes_are_in_a_column_and_share_their_time():
    for count in (1, 3):
        axes = axes_for({}, count)
        assert axes.shape == (count,)
        figure = axes[0].get_figure()
        assert figure.axes == axes.tolist()
        assert tuple(figure.get_size_inches()) == (7.0, pytest.approx(0.8 + 1.5 * count))
        tops = [ax.get_subplotspec().rowspan.start for ax in axes]
        assert tops == [*range(count)]
        axes[0].set_xlim(3.0, 4.0)
        assert axes[-1].get_xlim() == (3.0, 4.0)
    assert tuple(axes_for({}, 1, (5.0, 2.0))[0].get_figure().get_size_inches()) == (5.0, 2.0)


def test_given_axes_are_taken():
    _, grid = plt.subplots(2, 2)
    assert axes_for({"ax": grid}, 4).tolist() == grid.ravel().tolist()
    assert axes_for({"ax": grid[0, 0]}, 1).tolist() == [grid[0, 0]]
    with pytest.raises(ArgumentError, match="ax must hold 3 axes, one per row of the picture; got 4"):
        axes_for({"ax": grid}, 3)
    with pytest.raises(ArgumentError, match="ax"):
        axes_for({"ax": [grid[0, 0], 3]}, 2)


def test_colours_repeat_after_the_last():
    assert [colour_of(k) for k in range(9)] == [*COLOURS, COLOURS[0], COLOURS[1]]


def test_a_legend_of_the_modes_that_were_visited():
    _, ax = plt.subplots()
    legend(ax, ["only"], [0])
    assert ax.get_legend() is None
    legend(ax, ["a", "b", "c"], [0, 2])
    found = ax.get_legend()
    assert [text.get_text() for text in found.get_texts()] == ["a", "c"]
    assert [line.get_color() for line in found.get_lines()] == [COLOURS[0], COLOURS[2]]
    ax.get_figure().draw_without_rendering()
    # Above the axes, in one row.
    assert found.get_window_extent().y0 >= ax.get_window_extent().y1
    assert len({text.get_window_extent().y0 for text in found.get_texts()}) == 1


def test_the_frame_is_open():
    _, ax = plt.subplots()
    plain(ax)
    assert {name: spine.get_visible() for name, spine in ax.spines.items()} == {
        "left": True,
        "bottom": True,
        "right": False,
        "top": False,
    }


def test_dots_are_smaller_the_more_there_are_and_can_always_be_seen():
    areas = [dot_area(np.arange(count), np.arange(count)) for count in (0, 1, 250)]
    assert areas == [20.0, 20.0, 20.0]
    generator = np.random.default_rng(0)
    clouds = [dot_area(*generator.uniform(size=(2, count))) for count in (400, 2000, 100_000)]
    assert clouds == [pytest.approx(15.0, rel=0.01), pytest.approx(3.0, rel=0.02), 1.5]
    assert dot_area(np.zeros(10_000), np.zeros(10_000), 3.0) == 9.0


def test_points_on_each_other_are_one_dot():
    """A thousand periods of a few attractors are few dots, and what is no number is none."""
    few, many = np.repeat([0.0, 1.0, 2.0], 1000), np.repeat([1.0, 1.0 + 1e-9, 5.0], 1000)
    assert dot_area(few, many) == dot_area(few[::1000], many[::1000]) == 20.0
    assert dot_area([np.nan, 1.0], [1.0, np.inf]) == 20.0


def test_points_that_differ_by_rounding_have_the_picture_of_one_point():
    _, ax = plt.subplots()
    across, up = 3.0 + 1e-15 * np.arange(4), np.array([0.0, 1.0, 2.0, np.nan])
    ax.plot(across, up)
    before = ax.get_ylim()
    show_spread(ax, across, up)
    assert ax.get_xlim() == pytest.approx((2.85, 3.15))
    assert ax.get_ylim() == before


@pytest.mark.parametrize("ends", [(2e-6, 3e-6), (3e-6, 4e-5), (1.0, 1e8)])
def test_a_logarithmic_scale_shows_two_powers_of_ten_at_least(ends):
    _, ax = plt.subplots()
    ax.plot([0.0, 1.0], ends)
    logarithmic(ax, "y")
    low, high = ax.get_ylim()
    assert low <= ends[0] < ends[1] <= high
    assert np.floor(np.log10(high) + 1e-9) - np.ceil(np.log10(low) - 1e-9) >= 1
    ax.get_figure().draw_without_rendering()
    assert not any(text.get_text() for text in ax.get_yticklabels(minor=True))


def test_dots_of_a_legend_are_seen_where_those_of_the_cloud_are_small():
    _, ax = plt.subplots()
    ax.scatter([1.0, 2.0], [1.0, 2.0], s=1.0, label="cloud")
    ax.scatter([1.0, 2.0], [1.0, 2.0], s=25.0, label="few")
    small_legend(ax)
    assert [handle.get_sizes().tolist() for handle in ax.get_legend().legend_handles] == [[9.0], [25.0]]


@pytest.mark.parametrize("width", [6.0, 3.0])
def test_a_legend_is_no_wider_than_its_figure(width):
    figure, ax = plt.subplots(figsize=(width, 3.0), layout="constrained")
    for name in "abcdef":
        ax.plot([0.0, 1.0], [0.0, 1.0], label=f"a name that is rather long for a legend, {name}")
    small_legend(ax)
    assert illegible(figure) == []


def test_columns_of_one_figure_share_its_width():
    figure, (left, right) = plt.subplots(1, 2, layout="constrained")
    for ax in (left, right):
        legend(ax, ["free flight of the body", "contact with the floor", "sticks"], range(3))
    assert illegible(figure) == []
