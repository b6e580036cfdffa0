"""Pictures of branches: what lines, colours and markers mean, and what lies below."""

import matplotlib as mpl
import numpy as np
import pytest
import xarray

mpl.use("Agg")


import hybrid
import models
from hybrid import ArgumentError, HybridSystem, Mode, continue_orbit, periodic_orbit, sweep
from hybrid.measures import amplitude, maximum, minimum
from hybrid.plot import COLOURS, plot, plot_branch

OUTPUTS = {"amplitude": amplitude("x"), "low": minimum("x")}


@pytest.fixture(scope="module")
def branches():
    """One impact per period at two coefficients of restitution, with a fold and a grazing each."""
    found = []
    for r in (0.8, 0.5):
        orbit = periodic_orbit(models.impact_oscillator(), (0.9, 1.0), parameters={"r": r})
        events = {"deep": lambda arc: minimum("x")(arc) + 2.0, "wide": lambda arc: amplitude("x")(arc) - 1.4}
        found.append(continue_orbit(orbit, "w", (0.9, 2.0), outputs=OUTPUTS, events=events))
    return found


def texts(ax):
    return [each.get_text() for each in ax.get_legend().get_texts()]


def drawn(ax, style):
    """Points of the lines of a style, without what only a legend shows."""
    lines = [each for each in ax.lines if each.get_linestyle() == style and len(each.get_xdata())]
    return np.concatenate([each.get_xydata() for each in lines])


def test_an_output_over_the_parameter(branches):
    branch = branches[0]
    ax = plot(branch, y="amplitude")
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("w", "amplitude")
    stable, unstable = drawn(ax, "-"), drawn(ax, "--")
    for points, inside in ((stable, branch.stable), (unstable, ~branch.stable)):
        shown = {tuple(each) for each in points}
        expected = zip(branch.parameter[inside], branch["amplitude"][inside], strict=True)
        assert set(expected) <= shown
    # The lines go through the bifurcations, at which the two kinds of lines meet.
    for each in branch.of("fold"):
        place = (each.value, each.outputs["amplitude"])
        assert any(np.allclose(place, point, rtol=0, atol=0) for point in stable)
        assert any(np.allclose(place, point, rtol=0, atol=0) for point in unstable)


def test_the_legend_says_what_lines_and_markers_mean(branches):
    ax = plot(branches[0], y="amplitude")
    assert texts(ax)[:2] == ["stable", "unstable"]
    assert set(texts(ax)[2:]) == {"fold", "grazing", "deep", "wide"}
    handles = dict(zip(texts(ax), ax.get_legend().legend_handles, strict=True))
    assert (handles["stable"].get_linestyle(), handles["unstable"].get_linestyle()) == ("-", "--")
    markers = [handles[kind].get_marker() for kind in ("fold", "grazing", "deep", "wide")]
    assert len(set(markers)) == 4


@pytest.mark.parametrize("together", [True, False])
def test_each_branch_in_one_picture_has_its_colour(branches, together):
    if together:
        ax = plot(branches, y="amplitude", label=["r = 0.8", "r = 0.5"])
    else:
        ax = plot(branches[0], y="amplitude", label="r = 0.8")
        assert plot(branches[1], y="amplitude", label="r = 0.5", ax=ax) is ax
    assert texts(ax)[:4] == ["r = 0.8", "r = 0.5", "stable", "unstable"]
    # Nothing is named twice.
    assert len(texts(ax)) == len(set(texts(ax)))
    colours = {each.get_color() for each in ax.lines if each.get_linestyle() == "-" and len(each.get_xdata())}
    assert colours == set(COLOURS[:2])
    markers = {}
    for each in ax.lines:
        if each.get_linestyle() == "None":
            markers.setdefault(each.get_marker(), []).append(each)
    # The two branches have four kinds between them, each with one marker.
    assert len(markers) == 4


def test_a_sweep_stays_visible_below_the_branch(branches):
    ws = np.linspace(1.0, 1.3, 4)

    def task(point):
        orbit = periodic_orbit(models.impact_oscillator(), (0.9, 1.0), parameters=point)
        return {"amplitude": amplitude("x")(orbit.arc())}

    ax = plot(branches[0], y="amplitude", over=sweep(task, {"w": ws}))
    (dots,) = ax.collections
    offsets = np.asarray(dots.get_offsets())
    np.testing.assert_allclose(offsets[:, 0], ws)
    assert dots.get_zorder() < min(each.get_zorder() for each in ax.lines)
    # They are wider than the line that covers them.
    assert np.sqrt(dots.get_sizes().min()) > max(each.get_linewidth() for each in ax.lines)
    assert texts(ax)[0] == "sweep"


def test_runs_up_and_down_are_drawn_too(branches):
    runs = xarray.Dataset(
        {"amplitude": (("way", "w"), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])}, {"w": [1.0, 1.1, 1.2]}
    )
    (dots,) = plot_branch(branches[0], "amplitude", over=runs).collections
    expected = {(1.0, 1.0), (1.1, 2.0), (1.2, 3.0), (1.0, 4.0), (1.1, 5.0), (1.2, 6.0)}
    assert {tuple(each) for each in np.asarray(dots.get_offsets())} == expected


def test_units_of_measures():
    def field(t, x, p):
        rate = p.mu - x.x**2 - x.y**2
        return rate * x.x - x.y, rate * x.y + x.x

    units = {"x": "m", "y": "m", "mu": "m^2"}
    system = HybridSystem(state=("x", "y"), parameters={"mu": 2.0}, modes=[Mode("turn", field)], units=units)
    orbit = periodic_orbit(system, (1.4, 0.0), period=6.0)
    branch = continue_orbit(
        orbit, "mu", (1.9, 2.1), outputs={"radius": maximum("x"), "jumps": lambda arc: 0.0}
    )
    assert plot(branch, y="radius").get_ylabel() == "radius (m)"
    assert plot(branch, y="jumps").get_ylabel() == "jumps"
    assert plot(branch, y="y").get_ylabel() == "y (m)"
    ax = plot(branch, y=1)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("mu (m^2)", "y (m)")


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"y": "height"}, r"y: Component or output 'height' does not exist\. .*amplitude, low\."),
        ({"y": 7}, r"y: State component 7 does not exist; the state has 2 components"),
        ({"y": "amplitude", "over": 3}, r"over must be a sweep or a chart with points of its section"),
        ({"y": "amplitude", "label": 3}, r"label must be a text per branch; got 3"),
        ({"y": "amplitude", "label": ["a", "b"]}, r"label must be a text per branch, of which there are 1"),
    ],
)
def test_refusals(branches, options, text):
    with pytest.raises(ArgumentError, match=text):
        plot(branches[0], **options)


def test_refused_datasets_and_lists(branches):
    other = xarray.Dataset({"amplitude": ("c", [1.0])}, {"c": [1.0]})
    with pytest.raises(ArgumentError, match=r"over must be a chart over .*, or hold 'amplitude' over 'w'"):
        plot(branches[0], y="amplitude", over=other)
    with pytest.raises(ArgumentError, match="branch must be a branch, or several"):
        plot([])
    with pytest.raises(ArgumentError, match=r"branch\[1\] must be a Branch"):
        plot([branches[0], 3])
    along = continue_orbit(branches[0].orbit(0), "r", (0.79, 0.81), outputs=OUTPUTS)
    with pytest.raises(ArgumentError, match="branch: all must be over one parameter to be drawn; got w, r"):
        plot([branches[0], along])


def test_equilibria_and_their_cycles_in_one_picture():
    """Full, dashed and pale lines of equilibria, then the cycles that begin at the Hopf point."""
    valve = models.relief_valve()
    rest = hybrid.continue_equilibrium(hybrid.equilibrium(valve, (2.5, 0.0, 12.5)), "q", (8.0, 9.0))
    ax = hybrid.plot(rest, y="y")
    texts = ax.get_legend_handles_labels()[1]
    assert {"stable", "unstable", "Hopf"} <= {*texts}
    cycle = hybrid.switch_branch(rest.of("Hopf")[0])
    cycles = hybrid.continue_orbit(cycle, "q", (8.3, 9.0), outputs={"top": maximum("y")})
    hybrid.plot(cycles, y="top", ax=ax)
    colours = {line.get_color() for line in ax.lines if line.get_gid() == "branch"}
    assert len(colours) == 2
    assert cycles["top"][-1] == pytest.approx(rest.of("Hopf")[0].equilibrium["y"][0])


def test_virtual_equilibria_are_pale():
    block = hybrid.HybridSystem(
        state=("q",),
        parameters={"F": -1.0},
        modes=[
            hybrid.Mode("free", lambda t, x, p: (p.F - x.q,)),
            hybrid.Mode("stop", lambda t, x, p: (p.F - 9 * x.q,)),
        ],
        transitions=[
            hybrid.Transition("free", "stop", hybrid.Guard(lambda t, x, p: x.q, +1)),
            hybrid.Transition("stop", "free", hybrid.Guard(lambda t, x, p: x.q, -1)),
        ],
    )
    branch = hybrid.continue_equilibrium(hybrid.equilibrium(block, (-0.5,)), "F", (-1.0, 1.0))
    ax = hybrid.plot(branch)
    pale = [line for line in ax.lines if line.get_alpha() is not None and line.get_alpha() < 1.0]
    assert len(pale) == 1
    assert min(pale[0].get_xdata()) == pytest.approx(0.0)
