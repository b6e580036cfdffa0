"""Lines of arcs over time and in the plane, and orbits and sections as curves and dots."""

from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")

import matplotlib.pyplot as plt

from hybrid import Guard, HybridSystem, Mode, Reset, Transition, simulate, stroboscopic_section
from hybrid.plot import arcs, plot_arc, plot_phase, plot_section
from hybrid.plot.orbits import second as _second
from hybrid.plot.style import COLOURS

# A point on a circle that goes on at twice the speed below the axis, and counts its turns.
TURNS = HybridSystem(
    state=("c", "s", "n"),
    modes=[
        Mode("above", lambda t, x, p: (-x.s, x.c, 0.0)),
        Mode("below", lambda t, x, p: (-2 * x.s, 2 * x.c, 0.0)),
    ],
    transitions=[
        Transition("above", "below", Guard(lambda t, x, p: x.s, -1)),
        Transition(
            "below", "above", Guard(lambda t, x, p: x.s, +1), Reset(lambda t, x, p: (x.c, x.s, x.n + 1.0))
        ),
    ],
    period=1.0,
)


@pytest.fixture(autouse=True)
def _no_figures_left():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def turns():
    return simulate(TURNS, (1.0, 0.0, 0.0), (0.0, 12.0), mode="above")


def exact(t):
    """State and mode over time: half a turn takes pi above and half of that below."""
    turn, rest = np.divmod(t, 1.5 * np.pi)
    angle = np.where(rest < np.pi, rest, np.pi + 2 * (rest - np.pi))
    return np.column_stack([np.cos(angle), np.sin(angle), turn])


def drawn(line):
    """The points of a line without gaps, and the places of the gaps."""
    points = line.get_xydata()
    gaps = np.isnan(points).any(axis=1)
    return points[~gaps], np.flatnonzero(gaps)


def test_each_mode_is_a_line_with_a_gap_behind_each_visit(turns):
    for row, i in zip(plot_arc(turns, [2, "c"]), (2, 0), strict=True):
        above, below, jumps = row.lines[:3]
        assert (above.get_color(), below.get_color()) == COLOURS[:2]
        for line, side, count in ((above, 1.0, 3), (below, -1.0, 2)):
            points, gaps = drawn(line)
            assert len(gaps) == count
            assert np.all(side * exact(points[:, 0])[:, 1] > -1e-8)
            away = np.abs(points[:, 0][:, None] - turns.jumps.t).min(axis=1) > 1e-9
            np.testing.assert_allclose(points[away, 1], exact(points[away, 0])[:, i], atol=1e-8)
            assert np.all(np.diff(points[:, 0]) >= 0.0)
        both = jumps.get_xydata().reshape(-1, 3, 2)
        np.testing.assert_array_equal(both[:, :, 0], np.repeat(turns.jumps.t, 3).reshape(-1, 3))
        np.testing.assert_array_equal(both[:, 0, 1], turns.jumps.x_minus[:, i])
        np.testing.assert_array_equal(both[:, 1, 1], turns.jumps.x_plus[:, i])
        assert np.isnan(both[:, 2, 1]).all()


def test_labels_are_at_the_left_and_below_the_last_row(turns):
    axes = plot_arc(turns)
    assert [ax.get_ylabel() for ax in axes] == ["c", "s", "n"]
    assert [ax.get_xlabel() for ax in axes] == ["", "", "t"]
    assert [ax.get_legend() is not None for ax in axes] == [True, False, False]
    assert axes[0].get_xlim() == (0.0, 12.0)


def test_visits_of_the_second_mode_are_shaded(turns):
    row, *_ = plot_arc(turns)
    [shades] = row.collections
    spans = [path.vertices[[0, 2], 0] for path in shades.get_paths()]
    begin = np.pi + 1.5 * np.pi * np.arange(2)
    np.testing.assert_allclose(spans, np.column_stack([begin, begin + np.pi / 2]), atol=1e-8)
    [heights] = {(path.vertices[:, 1].min(), path.vertices[:, 1].max()) for path in shades.get_paths()}
    assert heights == (0.0, 1.0)


def test_a_portrait_has_points_between_the_steps(turns):
    above, below, jumps, start = plot_phase(turns, "s", "c").lines
    for line in (above, below):
        (s, c), _ = drawn(line)[0].T, None
        np.testing.assert_allclose(np.hypot(s, c), 1.0, atol=1e-8)
        np.testing.assert_array_less(-1e-9, s if line is above else -s)
        # No part bends away from its chord by more than a thousandth of the extent.
        steps = np.hypot(np.diff(s), np.diff(c))
        assert steps[steps < 0.5].max() < 2 * np.arccos(1 - 2.1e-3)
    np.testing.assert_array_equal(start.get_xydata(), [[0.0, 1.0]])
    assert len(jumps.get_xydata()) == 3 * len(turns.jumps)


class TestRefined:
    def arc(self, function, t, x, extent=1.0):
        """An arc with this dense output and these points; all of its points span the extent."""

        class Arc:
            _pieces = ()

            def __call__(self, t):
                return np.column_stack([function(t)])

        arc = Arc()
        arc.x = np.array([[0.0], [extent]])
        return arcs._refined(arc, np.array(t), np.array(x)[:, None])

    def test_a_straight_step_is_four_parts(self):
        t, x = self.arc(lambda t: 3 * t, [0.0, 1.0, 3.0], [0.0, 3.0, 9.0])
        np.testing.assert_allclose(t, [0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0])
        np.testing.assert_allclose(x[:, 0], 3 * t)

    def test_the_last_point_is_the_state_before_a_jump(self):
        """The dense output has the state after it."""
        t, x = self.arc(lambda t: np.where(t < 1.0, t, -5.0), [0.0, 1.0], [0.0, 1.0])
        assert (t[-1], x[-1, 0]) == (1.0, 1.0)
        assert x.min() == 0.0

    @pytest.mark.parametrize("extent", [1.0, 1e-3, 1e6])
    def test_parts_are_halved_until_they_are_smooth(self, extent):
        """A parabola: the middle of a part of length h is off by h^2/4, at most a thousandth."""
        t, x = self.arc(lambda t: extent * t**2, [0.0, 1.0], [0.0, extent], extent)
        np.testing.assert_allclose(x[:, 0], extent * t**2, rtol=1e-12)
        # Halving by halving: 1/4 and 1/8 and 1/16 are too long, and 1/16 is within.
        np.testing.assert_allclose(np.diff(t), 1 / 16)

    def test_a_jump_inside_ends_after_eight_halvings(self):
        t, _ = self.arc(lambda t: np.where(t < 0.3, 0.0, 1.0), [0.0, 1.0], [0.0, 1.0])
        assert np.diff(t).min() == pytest.approx(0.25 * 2.0**-8)
        assert len(t) == 5 + 8

    def test_components_that_do_not_move_do_not_count(self):
        t, _ = self.arc(lambda t: 1e-9 * t**2, [0.0, 1.0], [0.0, 0.0], 0.0)
        assert len(t) == 5

    def test_samples_and_single_points_stay(self):
        t, x = np.array([0.5]), np.array([[2.0]])
        assert arcs._refined(SimpleNamespace(_pieces=()), t, x) == (t, x)
        t, x = np.array([0.5, 1.0]), np.array([[2.0], [3.0]])
        assert arcs._refined(SimpleNamespace(_pieces=None), t, x) == (t, x)


@pytest.mark.parametrize(
    ("dimension", "first", "second"), [(1, 0, None), (2, 0, 1), (2, 1, 0), (3, 1, 2), (3, 2, 1)]
)
def test_the_component_beside_another(dimension, first, second):
    assert _second(dimension, first) == second


def test_dots_of_a_section_have_the_colours_of_their_modes():
    section = stroboscopic_section(TURNS, (1.0, 0.0, 0.0), mode="above", periods=40)
    ax = plot_section(section, "s", "c")
    for dots, mode, colour in zip(ax.collections, ("above", "below"), COLOURS, strict=False):
        np.testing.assert_array_equal(dots.get_offsets(), section.x[section.mode == mode][:, [1, 0]])
        assert mpl.colors.to_hex(dots.get_facecolor()[0]).upper() == colour
    assert len(ax.collections) == 2
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("s", "c")
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["above", "below"]
