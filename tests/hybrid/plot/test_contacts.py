"""Bands of contacts over time: what holds, when it begins and ends, and where impacts are."""

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")


import models
from hybrid import ArgumentError, simulate
from hybrid.plot import plot, plot_arc, plot_contacts
from hybrid.plot.contacts import IMPACT_COLOUR, STATES
from hybrid.plot.styles import colour_of
from tests.hybrid.transform.contacts.scenes import G, beam, block


@pytest.fixture(scope="module")
def sliding():
    """A block slides with speed 2 and comes to rest after ``2 / (mu g)``."""
    return simulate(block(), (0.0, 0.0, 2.0, 0.0), (0.0, 1.5))


def bands(ax):
    """By colour: begin, end and middle height of each band."""
    found = {}
    for each in ax.collections:
        for path in each.get_paths() if each.get_facecolor().size else []:
            (left, low), (right, high) = path.get_extents().get_points()
            colour = mpl.colors.to_hex(each.get_facecolor()[0])
            found.setdefault(colour, []).append((left, right, 0.5 * (low + high)))
    return found


def test_slip_and_stick_are_bands_that_meet_where_the_block_stops(sliding):
    found, stop = bands(plot_contacts(sliding)), 2.0 / (0.3 * G)
    [(begin, end, height)] = found[colour_of(STATES["slips +"]).lower()]
    assert (begin, end, height) == pytest.approx((0.0, stop, 0.0), abs=1e-9)
    [(begin, end, height)] = found[colour_of(STATES["sticks"]).lower()]
    assert (begin, end, height) == pytest.approx((stop, 1.5, 0.0), abs=1e-9)


def test_an_impact_is_a_line_at_its_time():
    arc = simulate(block(), (0.0, 1.0, 0.0, 0.0), (0.0, 1.0))
    ax = plot_contacts(arc)
    marks = [
        each
        for each in ax.collections
        if len(each.get_edgecolor())
        and np.allclose(each.get_edgecolor()[0], mpl.colors.to_rgba(IMPACT_COLOUR))
    ]
    times = [segment[0][0] for each in marks for segment in each.get_segments()]
    assert times == pytest.approx([np.sqrt(2.0 / G)], abs=1e-9)


def test_an_arc_has_a_row_of_contacts_below_its_components():
    arc = simulate(beam(), (1.0, 0.1, 0.0, 0.0), (0.0, 1.0))
    axes = plot(arc)
    assert len(axes) == 5
    assert [each.get_text() for each in axes[-1].get_yticklabels()] == ["left", "right"]
    assert len(plot_arc(arc, ["y", "left.normal"])) == 2
    held = bands(axes[-1])[colour_of(STATES["held"]).lower()]
    firsts = np.flatnonzero(np.diff(arc.j, prepend=-1))
    lengths = np.diff(np.append(arc.t[firsts], arc.t[-1]))
    for k, name in enumerate(("left", "right")):
        wanted = sum(length for i, length in zip(firsts, lengths, strict=True) if name in str(arc.mode[i]))
        assert sum(end - begin for begin, end, height in held if round(height) == k) == pytest.approx(wanted)


def test_a_legend_of_long_names_is_no_wider_than_the_picture():
    arc = simulate(block(), (0.0, 1.0, 2.0, 0.0), (0.0, 2.0))
    axes = plot(arc)
    axes.figure.canvas.draw()
    legend = axes[0].get_legend().get_window_extent()
    assert legend.x1 <= axes.figure.bbox.x1


def test_a_system_without_contacts_has_no_band():
    arc = simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0))
    assert len(plot(arc)) == 2
    with pytest.raises(ArgumentError, match=r"has no contacts\. Make one with mechanics"):
        plot_contacts(arc)
