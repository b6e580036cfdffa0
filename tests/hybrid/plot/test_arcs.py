"""Lines of arcs over time and in the plane, and orbits and sections as curves and dots."""

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")


import models
from hybrid import Guard, HybridSystem, Mode, Reset, Transition, simulate, stroboscopic_section
from hybrid.plot import plot_arc, plot_phase, plot_section
from hybrid.plot.orbits import beside
from hybrid.plot.styles import COLOURS

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
    assert axes[0].get_xlim() == pytest.approx((0.0, 12.0), rel=1e-14)


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
    np.testing.assert_allclose(start.get_xydata(), [[0.0, 1.0]], rtol=1e-14)
    assert len(jumps.get_xydata()) == 3 * len(turns.jumps)


def test_a_curve_ends_each_visit_with_the_state_before_the_jump():
    """The dense output has the state after it."""
    arc = simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.5))
    _, x = plot_arc(arc, ["v"])[0].lines[0].get_data()
    ends = np.flatnonzero(np.isnan(x))
    np.testing.assert_array_equal(x[ends[:-1] - 1], arc.jumps.x_minus[:, 1])
    np.testing.assert_array_equal(x[ends[:-1] + 1], arc.jumps.x_plus[:, 1])


def test_samples_are_drawn_as_they_are():
    arc = simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 0.4), samples=[0.0, 0.2, 0.4])
    t, x = plot_arc(arc, ["q"])[0].lines[0].get_data()
    np.testing.assert_array_equal(t[:-1], arc.t)
    np.testing.assert_array_equal(x[:-1], arc["q"])


@pytest.mark.parametrize(
    ("names", "first", "other"),
    [
        ("q", "q", None),
        ("qv", "q", "v"),
        ("qv", "v", "q"),
        ("qvw", "v", "w"),
        ("qvw", "w", "v"),
        ("qv", "f", "q"),
    ],
)
def test_the_component_beside_another(names, first, other):
    assert beside(tuple(names), first) == other


def test_dots_of_a_section_have_the_colours_of_their_modes():
    section = stroboscopic_section(TURNS, (1.0, 0.0, 0.0), mode="above", periods=40)
    ax = plot_section(section, "s", "c")
    for dots, mode, colour in zip(ax.collections, ("above", "below"), COLOURS, strict=False):
        np.testing.assert_array_equal(dots.get_offsets(), section.x[section.mode == mode][:, [1, 0]])
        assert mpl.colors.to_hex(dots.get_facecolor()[0]).upper() == colour
    assert len(ax.collections) == 2
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("s", "c")
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["above", "below"]
