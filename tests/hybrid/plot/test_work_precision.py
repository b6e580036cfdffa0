"""Error over time: lines of methods, the reference's own error, and labels that do not overlap."""

from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")


from hybrid import WorkPrecision
from hybrid.plot import plot_work_precision
from hybrid.plot.styles import COLOURS
from hybrid.plot.work_precision import LABEL_HEIGHT, MARKERS


def made(lines, floor=np.nan):
    """Made-up measurements ``{method: (seconds, errors)}``."""
    counts = [len(seconds) for seconds, _ in lines.values()]
    seconds, errors = (np.concatenate(each) for each in zip(*lines.values(), strict=True))
    unknown = np.full(len(seconds), np.nan)
    return WorkPrecision(
        method=np.repeat([*lines], counts),
        tolerance=unknown,
        error={"state": errors},
        seconds=seconds,
        compile_seconds=unknown,
        steps=unknown,
        events=unknown,
        status=np.full(len(seconds), "SUCCESS"),
        reference_error={"state": floor},
    )


def labels(ax):
    return {text.get_text(): text for text in ax.texts}


def test_runs_that_failed_and_errors_of_zero_are_not_drawn():
    lines = {
        "a": ([1.0, 2.0, 3.0], [1e-3, np.nan, 1e-9]),
        "none": ([1.0], [np.nan]),
        "b": ([1.0, 2.0], [1e-2, 0.0]),
    }
    ax = plot_work_precision(made(lines))
    one, two = ax.lines
    np.testing.assert_array_equal(one.get_xydata(), [[1.0, 1e-3], [3.0, 1e-9]])
    np.testing.assert_array_equal(two.get_xydata(), [[1.0, 1e-2]])
    assert (one.get_color(), two.get_color()) == (COLOURS[0], COLOURS[2])
    assert set(labels(ax)) == {"a", "b"}
    assert labels(ax)["a"].xy == (3.0, 1e-9)
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("seconds", "error of the state")


def test_colours_come_first_and_then_markers():
    count = len(COLOURS) + 1
    ax = plot_work_precision(made({f"m{k}": ([1.0, 2.0], [10.0**-k, 0.1**k / 2]) for k in range(count)}))
    assert [line.get_color() for line in ax.lines] == [*COLOURS, COLOURS[0]]
    assert [line.get_marker() for line in ax.lines] == [*MARKERS[0] * len(COLOURS), MARKERS[1]]


@pytest.mark.parametrize("floor", [1e-14, 1e-6, 1e-1])
def test_the_reference_s_own_error_is_shown(floor):
    ax = plot_work_precision(made({"a": ([1.0, 10.0], [1e-2, 1e-8])}, floor))
    [band] = ax.patches
    low, high = band.get_y(), band.get_y() + band.get_height()
    assert high == pytest.approx(floor)
    bottom, top = ax.get_ylim()
    # The band reaches below the axes, and a part of it is seen.
    assert low < bottom <= floor / 3
    assert bottom <= 1e-8 < 1e-2 <= top
    for unknown in (np.nan, 0.0, np.inf):
        assert not plot_work_precision(made({"a": ([1.0], [1e-2])}, unknown)).patches
    empty = plot_work_precision(made({"a": ([1.0], [np.nan])}, floor))
    assert not empty.patches
    assert not empty.lines


@pytest.mark.parametrize("spread", [0.0, 0.02, 0.2, 2.0])
def test_labels_are_right_of_their_points_and_apart(spread):
    """Eight methods end near each other; each label keeps the order of the errors."""
    count = 8
    ends = 1e-6 * 10.0 ** (spread * np.arange(count))
    lines = {f"method {k}": ([1.0, 10.0], [1e-2, ends[k]]) for k in reversed(range(count))}
    ax = plot_work_precision(made(lines))
    figure = ax.get_figure()
    figure.draw_without_rendering()
    point = figure.dpi / 72
    heights = []
    for k in range(count):
        text = labels(ax)[f"method {k}"]
        _, y = ax.transData.transform(text.xy) / point
        assert text.xyann[0] > 0.0
        assert text.xyann[1] >= -1e-6
        heights.append(y + text.xyann[1])
    gaps = np.diff(sorted(heights))
    assert gaps.min() > 0.99 * LABEL_HEIGHT
    if spread == 2.0:
        assert max(abs(labels(ax)[f"method {k}"].xyann[1]) for k in range(count)) < 1e-6
    if spread > 0.0:
        assert heights == sorted(heights)
    # Room for the names on the right, by a share of the decades shown.
    assert ax.get_xlim()[1] > 20.0


def test_labels_far_apart_in_time_stay_at_their_points():
    ax = plot_work_precision(made({"a": ([1.0, 1e-3], [1.0, 1e-6]), "b": ([1.0, 1e3], [1.0, 1e-6])}))
    assert [text.xyann for text in ax.texts] == [pytest.approx((6.0, 0.0), abs=1e-9)] * 2


def test_only_measurements_are_drawn():
    with pytest.raises(Exception, match="result must be a WorkPrecision"):
        plot_work_precision(SimpleNamespace())
