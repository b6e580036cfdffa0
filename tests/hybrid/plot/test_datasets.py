"""Pictures of many runs, of sweeps, of jumps and of bounds of errors."""

import matplotlib as mpl
import numpy as np
import pytest
import xarray

mpl.use("Agg")

import matplotlib.pyplot as plt

import hybrid
import models
from hybrid import ArgumentError, Guard, HybridSystem, Mode, Reset, Transition
from hybrid.plot import plot


def swept(shape, *, failed=()):
    """What a sweep over axes ``a, b, c`` returns, with a number in metres and an array per point."""
    dims = tuple("abc"[: len(shape)])
    status = np.zeros(shape, dtype=int)
    for place in failed:
        status[place] = int(hybrid.StatusCode.FAILED)
    return xarray.Dataset(
        {
            "height": (dims, np.arange(float(np.prod(shape))).reshape(shape), {"units": "m"}),
            "many": ((*dims, "many_0"), np.zeros((*shape, 3))),
            "status": (dims, status),
            "message": (dims, np.full(shape, "", dtype=object)),
        },
        {
            name: (name, np.arange(float(size)), {"units": "s"})
            for name, size in zip(dims, shape, strict=True)
        },
    )


def test_a_sweep_over_one_axis_is_a_line():
    axes = plot(swept((5,), failed=[2]))
    assert [(ax.get_xlabel(), ax.get_ylabel()) for ax in axes] == [("a (s)", "height (m)")]
    line, bad = axes[0].lines
    np.testing.assert_array_equal(line.get_ydata(), np.arange(5.0))
    assert line.get_markersize() >= 1.0
    assert bad.get_xdata().tolist() == [2.0]
    assert "FAILED" in axes[0].get_legend().get_texts()[0].get_text()


def test_a_sweep_over_two_axes_is_a_map():
    axes = plot(swept((3, 4), failed=[(1, 2)]))
    (mesh,) = axes[0].collections
    assert mesh.get_array().mask.sum() == 1
    assert mesh.get_array()[2, 3] == 11.0
    assert (axes[0].get_xlabel(), axes[0].get_ylabel()) == ("b (s)", "a (s)")
    (cross,) = axes[0].lines
    np.testing.assert_array_equal(cross.get_xydata(), [[2.0, 1.0]])


def test_sweeps_without_a_picture_say_what_has_one():
    with pytest.raises(ArgumentError, match=r"over a, b, c\. Take a plane: swept\.isel\(a=0\)"):
        plot(swept((2, 3, 4)))
    arrays = swept((4,)).drop_vars("height")
    with pytest.raises(ArgumentError, match=r"many is an array per point.*swept\.isel\(many_0=0\)"):
        plot(arrays)
    plot(arrays.isel(many_0=0))
    table = swept((4,)).rename(a="point").drop_vars("point").assign_coords(e=("point", np.arange(4.0)))
    with pytest.raises(ArgumentError, match=r"table of points of e.*swap_dims\(point='e'\)"):
        plot(table)
    plot(table.swap_dims(point="e"))


def test_the_size_of_a_picture_and_its_axes_may_be_given():
    assert tuple(plot(swept((3,)), figsize=(3, 2)).figure.get_size_inches()) == (3.0, 2.0)
    _, ax = plt.subplots()
    assert plot(swept((3,)), ax=ax, size=5.0).tolist() == [ax]
    assert ax.lines[0].get_markersize() == 5.0
    for figsize in ((1,), (1, -2), "large", (1, np.inf)):
        with pytest.raises(ArgumentError, match="figsize must be a width and a height"):
            plot(swept((3,)), figsize=figsize)
    with pytest.raises(ArgumentError, match="size must be a positive diameter"):
        plot(swept((3,)), size=0.0)


def test_rows_are_short_to_print_and_their_figure_is_not_shown_twice():
    """A notebook shows the figures that pyplot knows, and the last value of a cell."""
    axes = plot(swept((3,)))
    assert repr(axes) == str(axes) == "<1 axes: height (m)>"
    assert not isinstance(axes, mpl.figure.Figure)
    assert plt.get_fignums() == [axes.figure.number]


def test_the_ends_of_many_runs_have_units_modes_and_failures():
    names = ["q", "v"]
    ends = xarray.Dataset(
        {
            "x0": (("start", "state"), np.zeros((4, 2))),
            "x_end": (("start", "state"), np.arange(8.0).reshape(4, 2)),
            "t_end": ("start", np.ones(4)),
            "mode_end": ("start", np.array(["a", "b", "a", "a"], dtype=object)),
            "status": ("start", [0, 0, 0, int(hybrid.StatusCode.MAX_STEPS)]),
            "message": ("start", np.full(4, "", dtype=object)),
        },
        {"state": names, "unit": ("state", ["m", "m/s"])},
    )
    ax = plot(ends, x="v")
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("v (m/s)", "q (m)")
    first, second, failed = ax.collections
    np.testing.assert_array_equal(first.get_offsets(), [[1.0, 0.0], [5.0, 4.0]])
    np.testing.assert_array_equal(second.get_offsets(), [[3.0, 2.0]])
    np.testing.assert_array_equal(failed.get_offsets(), [[7.0, 6.0]])
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["a", "b", "MAX_STEPS, see .message"]


def test_limits_of_chatter_are_arrows_with_names():
    system = HybridSystem(
        state=("q",),
        modes=[Mode("fly", lambda t, x, p: (1.0,)), Mode("rest", lambda t, x, p: (0.0,))],
        transitions=[
            Transition(
                "fly",
                "fly",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: (-x.q,)),
                accumulates_to="rest",
                name="hit",
            ),
        ],
    )
    ax = plot(system, figsize=(5, 4))
    assert tuple(ax.figure.get_size_inches()) == (5.0, 4.0)
    texts = {text.get_text(): text for text in ax.texts}
    assert {"hit ↓", "limit of hit"} <= texts.keys()
    [arrow] = [each.arrow_patch for each in ax.texts if getattr(each, "arrowprops", None) is not None]
    assert arrow.get_linestyle() != "-"
    assert "limit of chatter" in ax.texts[-1].get_text()


def test_units_stand_in_the_text_of_a_system_and_on_the_axes():
    text = repr(models.bouncing_ball())
    assert "state: q (m), v (m/s)" in text
    assert "time: t (s)" in text
    assert "g = 9.81 m/s^2" in text
    arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.2))
    rows = plot(arc)
    assert repr(rows) == "<2 axes: q (m), v (m/s)>"
    assert rows[-1].get_xlabel() == "t (s)"
    data = arc.to_xarray()
    assert (data.x.attrs["units"], data.t.attrs["units"]) == ("m, m/s", "s")
    ax = plot(arc.jumps)
    assert [label.get_text() for label in ax.get_yticklabels()] == ["bounce"]
    np.testing.assert_array_equal(ax.lines[0].get_xdata(), arc.jumps.t)


def test_bounds_of_errors_are_drawn():
    found = hybrid.global_error(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.2))
    state, jumps = plot(found)
    np.testing.assert_array_equal(state.lines[0].get_ydata(), found.x)
    np.testing.assert_array_equal(
        jumps.lines[0].get_xydata(), np.column_stack([found.arc.jumps.t, found.jumps])
    )
    assert jumps.get_ylabel() == "error of jump times (s)"
