"""What all plots share: arguments, labels, styles, and texts that can be read."""

import importlib
import inspect
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")

import matplotlib.pyplot as plt

import hybrid
import hybrid.plot
import lyapunov.plot
import models
from hybrid import ArgumentError, HybridSystem, Mode, simulate
from hybrid.plot import plot_arc, plot_branch, plot_graph, plot_phase, style
from hybrid.plot.picture import Look
from hybrid.plot.styles import COLOURS, PRINTED
from hybrid.shared import fields_of
from tests.hybrid.plot.legible import illegible, shown

ROOT = Path(__file__).parents[3]
PLOTS = {
    name: getattr(module, name)
    for module in (hybrid.plot, lyapunov.plot)
    for name in module.__all__
    if name.startswith("plot_")
}


@pytest.fixture(scope="module")
def prints():
    with pytest.MonkeyPatch.context() as patched:
        patched.syspath_prepend(ROOT / "docs")
        yield importlib.import_module("print_plots")


@pytest.mark.parametrize("name", PLOTS)
def test_every_plot_has_and_describes_the_shared_arguments(name):
    function = PLOTS[name]
    parameters = inspect.signature(function).parameters
    for shared in Look.__annotations__:
        assert parameters[shared].kind is inspect.Parameter.KEYWORD_ONLY
        assert parameters[shared].default is None
    section = inspect.getdoc(function).partition("Parameters\n----------\n")[2].partition("\n\n")[0]
    described = [
        each for line in section.splitlines() if not line.startswith(" ") for each in line.split(", ")
    ]
    assert sorted(described) == sorted(parameters)
    assert fields_of(Look)["style"][1].text in " ".join(section.split())


@pytest.mark.parametrize("chosen", ["paper", None])
def test_the_texts_of_every_plot_can_be_read(chosen, prints):
    assert set(prints.PLOTS) == set(PLOTS)
    found = {}
    for name in PLOTS:
        with style(chosen):
            figure = prints.draw(name)
        found |= {name: each} if (each := illegible(figure)) else {}
        plt.close(figure)
    assert found == {}


def test_the_page_shows_the_calls_of_the_pictures(prints):
    """``python docs/make_pictures.py`` writes the page again."""
    assert prints.PAGE.read_text(encoding="utf-8") == prints.page()
    drawn = {path.stem for path in (ROOT / "docs" / prints.FOLDER).glob("*.png")}
    assert drawn == set(prints.PLOTS)


def test_texts_that_overlap_or_leave_the_figure_are_found():
    figure, ax = plt.subplots()
    assert illegible(figure) == []
    ax.text(0.5, 0.5, "one")
    ax.text(0.5, 0.51, "two")
    ax.text(3.0, 0.5, "far")
    assert illegible(figure) == ["'far' leaves the figure", "'one' lies on 'two'"]


class TestLabels:
    def test_they_stand_in_place_of_names_and_units_follow(self, bounces):
        (ax,) = plot_arc(bounces, ["q"], labels={"q": "$h$", "t": "$t$"})
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("$t$ (s)", "$h$ (m)")

    def test_a_name_on_no_axis_is_refused_and_no_figure_stays(self, bounces):
        with pytest.raises(ArgumentError, match=r"labels: 'w' is on no axis of this picture\. .*: q, v"):
            plot_phase(bounces, "q", "v", labels={"q": "$h$", "w": "$v$"})
        with pytest.raises(ArgumentError, match="'q' is on no axis of this picture"):
            plot_graph(models.bouncing_ball(), labels={"q": "$h$"})
        assert plt.get_fignums() == []

    def test_the_axes_of_the_caller_stay_where_a_name_is_refused(self, bounces):
        _, ax = plt.subplots()
        with pytest.raises(ArgumentError, match="labels"):
            plot_phase(bounces, "q", "v", labels={"w": "$v$"}, ax=ax)
        assert plt.get_fignums() == [ax.get_figure().number]

    def test_labels_of_a_style_hold_where_there_are_none_nearer(self, bounces):
        with style(labels={"q": "far", "v": "$v$", "not there": "$n$"}), style(labels={"q": "near"}):
            ax = plot_phase(bounces, "q", "v")
            nearest = plot_phase(bounces, "q", "v", labels={"q": "own"})
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("near (m)", "$v$ (m/s)")
        assert (nearest.get_xlabel(), nearest.get_ylabel()) == ("own (m)", "$v$ (m/s)")
        assert plot_phase(bounces, "q", "v").get_xlabel() == "q (m)"

    def test_labels_reach_plots_that_others_draw(self, prints):
        figure = prints.draw("plot_chart")
        assert figure.axes[-1].get_xlabel() == r"$\omega$"


@pytest.mark.parametrize("unit", ["1", "-", "", "—"])
def test_no_unit_is_written_for_a_number(unit):
    units = {"x": unit, "t": unit}
    system = HybridSystem(state=("x",), modes=[Mode("m", lambda t, x, p: (-x[0],))], period=None, units=units)
    (ax,) = plot_arc(simulate(system, (1.0,), (0.0, 1.0)))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("t", "x")


class TestPaper:
    def test_a_figure_has_the_width_of_a_column_and_small_letters(self, bounces):
        figure = plot_arc(bounces, style="paper").figure
        assert figure.get_figwidth() == 3.4
        figure.draw_without_rendering()
        assert {text.get_fontsize() for text in shown(figure)} == {8.0}
        assert max(line.get_linewidth() for ax in figure.axes for line in ax.lines) <= 1.0
        assert plot_arc(bounces).figure.get_figwidth() == 7.0
        assert plot_arc(bounces, style="paper", figsize=(5.0, 2.0)).figure.get_figwidth() == 5.0

    def test_it_is_the_same_by_argument_and_by_context(self, bounces):
        one = plot_phase(bounces, "q", "v", style="paper")
        with style("paper"):
            other = plot_phase(bounces, "q", "v")
        widths = [[line.get_linewidth() for line in ax.lines] for ax in (one, other)]
        assert widths[0] == widths[1]
        assert one.figure.get_figwidth() == other.figure.get_figwidth() == 3.4
        assert mpl.rcParams["font.size"] == mpl.rcParamsDefault["font.size"]

    def test_a_figure_that_is_saved_later_has_fonts_that_can_be_embedded(self, bounces, tmp_path):
        figure = plot_phase(bounces, "q", "v", style="paper").figure
        figure.savefig(tmp_path / "paper.pdf")
        plot_phase(bounces, "q", "v").figure.savefig(tmp_path / "plain.pdf")
        paper, usual = ((tmp_path / f"{name}.pdf").read_bytes() for name in ("paper", "plain"))
        assert b"/Type3" in usual
        assert b"/Type3" not in paper
        assert b"/CIDFontType2" in paper
        figure.savefig(tmp_path / "paper.png")
        assert plt.imread(tmp_path / "paper.png").shape[1] == pytest.approx(3.4 * 300, abs=1)

    def test_given_axes_have_their_style_already(self, bounces):
        _, ax = plt.subplots()
        with pytest.raises(ArgumentError, match="style must be left out where ax is given; got 'paper'"):
            plot_phase(bounces, "q", "v", ax=ax, style="paper")

    def test_a_style_that_does_not_exist_is_refused(self, bounces):
        with pytest.raises(ArgumentError, match="style"):
            plot_phase(bounces, "q", "v", style="papper")
        with pytest.raises(ArgumentError, match="name"):
            style("papper")

    def test_colours_can_be_told_apart_in_grey(self):
        grey = sorted(lightness(colour) for colour in PRINTED)
        assert np.diff(grey).min() > 4.0
        first = sorted(lightness(colour) for colour in PRINTED[:3])
        assert np.diff(first).min() > 15.0
        assert np.diff(sorted(lightness(colour) for colour in COLOURS[:3])).min() < 15.0
        shades = mpl.colormaps["cividis"](np.linspace(0.0, 1.0, 9))
        assert (np.diff([lightness(shade) for shade in shades]) > 5.0).all()

    def test_branches_have_colours_of_their_own_and_one_legend(self, prints):
        with style("paper"):
            _, ax = plt.subplots()
            for branch in prints.result("branches"):
                plot_branch(branch, "x", ax=ax)
        texts = [text.get_text() for text in ax.get_legend().get_texts()]
        assert texts == ["stable", "unstable", "fold", "grazing"]
        coloured = {mpl.colors.to_hex(line.get_color()).upper() for line in ax.lines}
        assert set(PRINTED[:2]) <= coloured


def lightness(colour):
    """The lightness L* of a colour, from 0 to 100."""
    red, green, blue = (
        each / 12.92 if each <= 0.04045 else ((each + 0.055) / 1.055) ** 2.4
        for each in mpl.colors.to_rgb(colour)
    )
    luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    return 116 * np.cbrt(luminance) - 16 if luminance > 0.008856 else 903.3 * luminance
