import inspect

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")

import matplotlib.pyplot as plt

import hybrid
import lyapunov
import lyapunov.plot
import models
from hybrid import ArgumentError, Guard, HybridSystem, Mode, Transition, simulate
from hybrid.plot import plot, plot_arc, plot_graph, plot_phase


@pytest.fixture(scope="module")
def contacts():
    start = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
    return simulate(models.vibroimpact(), start, (0.0, 2.0))


def curves(axes):
    """Data of the drawn lines, without the legend entries of modes."""
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
    assert (height.get_ylabel(), velocity.get_ylabel()) == ("q (m)", "v (m/s)")
    assert velocity.get_xlabel() == "t (s)"
    assert height.get_legend() is None


def test_modes_have_colours_of_their_own_and_a_legend(contacts):
    (row,) = plot_arc(contacts, ["x1"])
    assert len({line.get_color() for line in row.lines}) == 3
    assert [text.get_text() for text in row.get_legend().get_texts()] == ["free", "contact"]


def test_each_component_adds_the_same_height_to_a_figure(contacts):
    heights = [
        plot_arc(contacts, names)[0].get_figure().get_size_inches()[1]
        for names in (["x1"], ["x1", "v1"], ["x1", "v1", "x2"])
    ]
    assert np.diff(heights).tolist() == pytest.approx([1.5, 1.5])


def test_axes_may_be_given_one_a_component(bounces):
    _, given = plt.subplots(2, 1)
    assert list(plot_arc(bounces, ax=given)) == list(given)
    with pytest.raises(ArgumentError, match="ax must hold 1 axes, one per row of the picture; got 2"):
        plot_arc(bounces, ["v"], ax=given)


def test_an_arc_of_samples_is_drawn_through_them():
    arc = simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 0.4), samples=np.linspace(0.0, 0.4, 5))
    points = curves(plot_phase(arc, "q", "v"))[0]
    np.testing.assert_array_equal(points[np.isfinite(points).all(axis=1)], arc.x)


def test_phase_portrait_names_its_axes(bounces):
    axes = plot_phase(bounces, 1, "q")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("v (m/s)", "q (m)")
    with pytest.raises(ArgumentError, match="State component or output 'height' does not exist"):
        plot_phase(bounces, "height", "v")
    with pytest.raises(ArgumentError, match="State component 2 does not exist; the state has 2"):
        plot_phase(bounces, 2, "v")


def test_a_phase_portrait_shows_flights_jumps_and_the_start(contacts, bounces):
    for arc, i, j in ((contacts, 2, 0), (bounces, 0, 1)):
        axes = plot_phase(arc, i, j)
        *flights, jumps, start = curves(axes)
        modes = sorted(set(arc.mode), key=arc.system.mode_index)
        assert len(flights) == len(modes)
        for name, points in zip(modes, flights, strict=True):
            inside = np.isin(arc.x[arc.mode == name][:, i], points[:, 0])
            assert inside.all()
            assert np.isnan(points[:, 0]).sum() == len(set(arc.j[arc.mode == name]))
        np.testing.assert_array_equal(jumps[::3], arc.jumps.x_minus[:, [i, j]])
        np.testing.assert_array_equal(jumps[1::3], arc.jumps.x_plus[:, [i, j]])
        assert np.isnan(jumps[2::3]).all()
        np.testing.assert_array_equal(start, arc.x[:1, [i, j]])


def test_visits_of_modes_other_than_the_first_are_shaded(contacts):
    (row,) = plot_arc(contacts, ["x1"])
    [shades] = row.collections
    spans = [(path.vertices[:, 0].min(), path.vertices[:, 0].max()) for path in shades.get_paths()]
    switches = [(jump.t, jump.target) for jump in contacts.jumps]
    visits = [
        (t, switches[k + 1][0] if k + 1 < len(switches) else contacts.t[-1])
        for k, (t, target) in enumerate(switches)
        if target == "contact"
    ]
    np.testing.assert_allclose(spans, visits, rtol=1e-12)
    (row,) = plot_arc(simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0)), ["q"])
    assert not row.collections


@pytest.mark.parametrize(
    ("options", "components"),
    [({}, (0, 1)), ({"x": 1}, (1, 0)), ({"x": "v", "y": "v"}, (1, 1)), ({"y": 0}, (0, 0))],
)
def test_an_orbit_is_drawn_over_the_components_asked_for(options, components):
    orbit = hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    axes = hybrid.plot.plot_orbit(orbit, **options)
    *_, start = curves(axes)
    np.testing.assert_allclose(start, [orbit.x0[[*components]]], rtol=1e-14)
    names = orbit.system.state_names
    assert (axes.get_xlabel(), axes.get_ylabel()) == tuple(names[i] for i in components)
    assert axes.get_title(loc="left") == (f"period 6.28319, largest multiplier {orbit.multipliers[0]:.4g}")


def test_an_orbit_of_one_component_is_drawn_over_itself():
    line = hybrid.HybridSystem(
        state=("u",), modes=[hybrid.Mode("decay", lambda t, x, p: (-x.u + np.cos(t),))], period=2 * np.pi
    )
    orbit = hybrid.periodic_orbit(line, (0.5,))
    axes = plot(orbit)
    np.testing.assert_allclose(curves(axes)[-1], [[orbit.x0[0]] * 2], rtol=1e-14)
    assert "largest multiplier 0.001867" in axes.get_title(loc="left")


def test_the_legend_of_an_orbit_is_not_over_its_title():
    walk = models.simplest_walker()
    orbit = hybrid.periodic_orbit(walk, (0.2003, 0.4006, -0.1998, -0.0158), mode="behind", period=3.88)
    ax = plot(orbit, figsize=(4.0, 3.0))
    ax.figure.draw_without_rendering()
    boxes = [ax.get_legend().get_window_extent(), ax._left_title.get_window_extent()]
    assert not boxes[0].overlaps(boxes[1])


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


@pytest.mark.parametrize("count", range(1, 8))
def test_loops_stay_beside_their_modes(count):
    """Labels are within 50 to 100 points of the middle of the mode, on whichever side the loop is."""
    names = [f"mode {i}" for i in range(count)]
    system = HybridSystem(
        state=("q",),
        modes=[Mode(name, lambda t, x, p: (1.0,)) for name in names],
        transitions=[
            Transition(name, target, Guard(lambda t, x, p: x.q, +1), name=f"{kind} {name}")
            for place, name in enumerate(names)
            for kind, target in (("loop", name), ("on", names[(place + 1) % count]))
        ],
    )
    loops = [text for text in plot_graph(system).texts if text.get_text().startswith("loop")]
    assert len(loops) == count
    for loop in loops:
        assert 50.0 < np.hypot(*loop.xyann) < 100.0


def test_graph_of_many_modes_has_one_arrow_for_two_modes():
    """Six modes of a split system: no names that repeat the modes, no transitions of a start."""
    system = hybrid.from_equations(
        lambda t, x, p: (x.v, np.cos(t) - 0.3 * np.sign(x.v) - 4.0 * np.maximum(x.q - 1, 0)), state=("q", "v")
    )
    axes = plot_graph(system)
    axes.get_figure().canvas.draw()
    arrows = {(each.source, each.target) for each in system.transitions if not each.guard.at_start}
    shown = [text.get_text() for text in axes.texts if text.get_text().strip()]
    assert {*system.mode_names, "two-fold ↓"} <= set(shown)
    assert len([text for text in shown if text in "↑↓"]) + shown.count("two-fold ↓") == len(arrows)


def test_graph_shows_the_end_of_a_run():
    system = HybridSystem(
        state=("q",),
        modes=[Mode("fall", lambda t, x, p: (-1.0,))],
        transitions=[Transition("fall", None, Guard(lambda t, x, p: x.q, -1), name="ground")],
    )
    axes = plot_graph(system)
    axes.get_figure().canvas.draw()
    assert {"fall", "ground ↓"} <= texts(axes)


def test_a_curve_is_as_fine_as_it_bends():
    """One exact step spans whole turns of a circle; every turn is drawn round."""
    system = hybrid.HybridSystem(state=("q", "v"), modes=[hybrid.Mode("free", lambda t, x, p: (x.v, -x.q))])
    arc = simulate(system, (1.0, 0.0), (0.0, 40.0))
    points = curves(plot_phase(arc, "q", "v"))[0]
    points = points[np.isfinite(points[:, 0])]
    assert np.abs(np.hypot(*points.T) - 1.0).max() < 1e-9
    middles = 0.5 * (points[:-1] + points[1:])
    assert np.hypot(*middles.T).min() > 1 - 4e-3
    assert len(points) < 5000


def test_straight_lines_take_few_points():
    system = hybrid.HybridSystem(
        state=("q",), modes=[hybrid.Mode("free", lambda t, x, p: (1.0 + 0.0 * x.q,))]
    )
    (row,) = plot_arc(simulate(system, (0.0,), (0.0, 10.0)))
    assert len(curves(row)[0]) < 50


def test_each_result_has_its_picture():
    oscillator = models.impact_oscillator()
    orbit = hybrid.periodic_orbit(oscillator, (0.9, 1.0))
    section = hybrid.stroboscopic_section(oscillator, (0.0, 0.0), periods=40)
    axes = plot(section)
    (dots,) = axes.collections
    np.testing.assert_array_equal(dots.get_offsets(), section.x)
    assert (axes.get_xlabel(), axes.get_ylabel()) == oscillator.state_names == ("x", "v")
    # With forty dots, each dot is large enough for print.
    assert dots.get_sizes()[0] >= 10
    axes = plot(section, y="x", x="v")
    np.testing.assert_array_equal(axes.collections[0].get_offsets(), section.x[:, ::-1])
    assert "period 6.28" in plot(orbit).get_title(loc="left")
    assert plot(oscillator).texts
    assert len(plot(orbit.arc())) == 2
    spectrum = lyapunov.lyapunov_spectrum(oscillator, (0.0, 0.0), intervals=50)
    axes = plot(spectrum)
    drawn = [line for line in axes.get_lines() if line.get_label().startswith("$")]
    ends = [line.get_ydata()[-1] for line in drawn]
    np.testing.assert_allclose(ends, spectrum.exponents)
    with pytest.raises(ArgumentError, match="result must be a system, an arc"):
        plot(3)
    with pytest.raises(ArgumentError, match="must have a history"):
        plot(lyapunov.lyapunov_spectrum(oscillator, (0.0, 0.0), intervals=5, history=False))


def test_a_section_of_one_component_is_drawn_over_time():
    circle = models.switched_arrival()
    line = hybrid.HybridSystem(
        state=("u",), modes=[hybrid.Mode("decay", lambda t, x, p: (-x.u + np.cos(t),))], period=2 * np.pi
    )
    section = hybrid.stroboscopic_section(line, (1.0,), periods=5)
    axes = plot(section)
    np.testing.assert_array_equal(axes.collections[0].get_offsets(), np.column_stack([section.t, section.x]))
    assert axes.get_xlabel() == "t"
    assert plot(circle) is not None


def test_axes_and_sizes_come_last_and_by_keyword():
    for module in (hybrid.plot, lyapunov.plot):
        for name, function in vars(module).items():
            if name.startswith("plot_") and "ax" in inspect.signature(function).parameters:
                options = list(inspect.signature(function).parameters.values())
                first = [option.name for option in options].index("ax")
                assert [option.name for option in options[first:]] == ["ax", "figsize", "labels", "style"]
                for option in options[first:]:
                    assert (option.kind, option.default) == (inspect.Parameter.KEYWORD_ONLY, None)
