import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")

import matplotlib.pyplot as plt

import models
from hybrid import ArgumentError, Guard, HybridSystem, Mode, Transition, simulate
from hybrid.plot import plot_arc, plot_graph, plot_phase


@pytest.fixture(autouse=True)
def _no_figures_left():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def bounces():
    return simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 2.0))


@pytest.fixture(scope="module")
def contacts():
    start = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
    return simulate(models.vibroimpact(), start, (0.0, 2.0))


def curves(axes):
    """Data of the lines drawn, without those that name the modes in a legend."""
    return [line.get_xydata() for line in axes.lines if len(line.get_xydata())]


def texts(axes):
    return {text.get_text() for text in axes.texts}


def test_time_series_follow_the_dense_output_and_show_the_jumps(bounces):
    height, velocity = plot_arc(bounces)
    flight, jumps = curves(velocity)
    t, v = flight[np.isfinite(flight).all(axis=1)].T
    smooth = ~np.isin(t, bounces.jumps.t)
    np.testing.assert_allclose(v[smooth], bounces(t[smooth])[:, 1], rtol=1e-13, atol=1e-15)
    assert len(t) > 3 * len(bounces.t)
    np.testing.assert_array_equal(jumps[::3], np.column_stack([bounces.jumps.t, bounces.jumps.x_minus[:, 1]]))
    np.testing.assert_array_equal(jumps[1::3], np.column_stack([bounces.jumps.t, bounces.jumps.x_plus[:, 1]]))
    assert (height.get_ylabel(), velocity.get_ylabel(), velocity.get_xlabel()) == ("q", "v", "t")
    assert height.get_legend() is None


def test_modes_have_colours_of_their_own_and_a_legend(contacts):
    (row,) = plot_arc(contacts, ["x1"])
    assert len({line.get_color() for line in row.lines}) == 3
    assert [text.get_text() for text in row.get_legend().get_texts()] == ["free", "contact"]


def test_axes_may_be_given_one_a_component(bounces):
    _, given = plt.subplots(2, 1)
    assert list(plot_arc(bounces, ax=given)) == list(given)
    with pytest.raises(ArgumentError, match="ax must hold 1 axes, one per component; got 2"):
        plot_arc(bounces, ["v"], ax=given)


def test_an_arc_of_samples_is_drawn_through_them():
    arc = simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 0.4), samples=np.linspace(0.0, 0.4, 5))
    points = curves(plot_phase(arc, "q", "v"))[0]
    np.testing.assert_array_equal(points[np.isfinite(points).all(axis=1)], arc.x)


def test_phase_portrait_names_its_axes(bounces):
    axes = plot_phase(bounces, 1, "q")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("v", "q")
    with pytest.raises(ArgumentError, match="State component 'height' does not exist"):
        plot_phase(bounces, "height", "v")
    with pytest.raises(ArgumentError, match="State component 2 does not exist; the state has 2"):
        plot_phase(bounces, 2, "v")


def test_graph_shows_modes_transitions_and_directions():
    shown = texts(plot_graph(models.vibroimpact()))
    assert {"free", "contact", "impact ↑", "release ↓"} <= shown


def test_graph_shows_loops_at_many_modes():
    system = HybridSystem(
        state=("q",),
        modes=[Mode(name, lambda t, x, p: (1.0,)) for name in "abcd"],
        transitions=[
            *(
                Transition(*pair, Guard(lambda t, x, p: x.q, direction=1))
                for pair in ("ab", "bc", "cd", "da")
            ),
            *(Transition("b", "b", Guard(lambda t, x, p: x.q - 1), name=f"mark {i}") for i in range(2)),
        ],
    )
    axes = plot_graph(system)
    axes.get_figure().canvas.draw()
    assert {"a", "d", "a->b ↑", "mark 0 ↕", "mark 1 ↕"} <= texts(axes)
    assert len(axes.patches) == 2


def test_graph_shows_the_end_of_a_run():
    system = HybridSystem(
        state=("q",),
        modes=[Mode("fall", lambda t, x, p: (-1.0,))],
        transitions=[Transition("fall", None, Guard(lambda t, x, p: x.q, -1), name="ground")],
    )
    axes = plot_graph(system)
    axes.get_figure().canvas.draw()
    assert {"fall", "ground ↓"} <= texts(axes)
