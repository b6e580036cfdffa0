"""Axes, legends, components and dots that all plots share."""

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")

import matplotlib.pyplot as plt

from hybrid import ArgumentError
from hybrid.plot.axes import as_component, axes_for, dot_area, plain
from hybrid.plot.legends import legend
from hybrid.plot.styles import COLOURS, colour_of


@pytest.fixture(autouse=True)
def _no_figures_left():
    yield
    plt.close("all")


@pytest.mark.parametrize("component", [1, -2, "b", np.int64(1), np.int8(-2)])
def test_components_by_name_and_by_index(component):
    assert as_component("x", ("a", "b", "c"), component) == 1


@pytest.mark.parametrize("component", [3, -4, True, "d", 1.0, None])
def test_components_that_do_not_exist(component):
    with pytest.raises(ArgumentError, match="x: State component"):
        as_component("x", ("a", "b", "c"), component)


def test_new_axes_are_in_a_column_and_share_their_time():
    for count in (1, 3):
        axes = axes_for(None, count)
        assert axes.shape == (count,)
        figure = axes[0].get_figure()
        assert figure.axes == axes.tolist()
        assert tuple(figure.get_size_inches()) == (7.0, pytest.approx(0.8 + 1.5 * count))
        tops = [ax.get_subplotspec().rowspan.start for ax in axes]
        assert tops == [*range(count)]
        axes[0].set_xlim(3.0, 4.0)
        assert axes[-1].get_xlim() == (3.0, 4.0)
    assert tuple(axes_for(None, 1, (5.0, 2.0))[0].get_figure().get_size_inches()) == (5.0, 2.0)


def test_given_axes_are_taken():
    _, grid = plt.subplots(2, 2)
    assert axes_for(grid, 4).tolist() == grid.ravel().tolist()
    assert axes_for(grid[0, 0], 1).tolist() == [grid[0, 0]]
    with pytest.raises(ArgumentError, match="ax must hold 3 axes, one per row of the picture; got 4"):
        axes_for(grid, 3)
    with pytest.raises(ArgumentError, match="ax"):
        axes_for([grid[0, 0], 3], 2)


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


def test_dots_share_an_area_within_limits():
    assert [dot_area(count) for count in (0, 1, 200, 400, 4000, 10_000)] == [20.0, 20.0, 20.0, 10.0, 1.0, 1.0]
    assert dot_area(10_000, 3.0) == 9.0
