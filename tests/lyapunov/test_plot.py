"""Charts of exponents show their data."""

import attrs
import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray

import hybrid
import lyapunov
import models
from hybrid import DOP853, ArgumentError, Guard
from lyapunov.maps import KINDS
from lyapunov.plot import (
    kinds,
    plot_bifurcation,
    plot_chart,
    plot_convergence,
    plot_exponents,
    plot_kinds,
    plot_map,
    plot_phase_portrait,
    plot_spectrum,
)

SHORT = {"intervals": 20, "transient": 5, "solver": DOP853(rtol=1e-6, atol=1e-8)}


@pytest.fixture(autouse=True)
def _no_figures_left():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def line():
    """A chart over the stop, not sorted; with the stop at -1 the start is beyond it."""
    over = {"d": [1.0, 0.5, 0.8, -1.0]}
    return lyapunov.chart(models.impact_oscillator(), over, (0.0, 0.0), k=2, section=3, **SHORT)


@pytest.fixture(scope="module")
def grid():
    over = {"r": [0.7, 0.8, 0.9], "d": [1.0, -1.0]}
    return lyapunov.chart(models.impact_oscillator(), over, (0.0, 0.0), **SHORT)


def test_exponents_are_drawn_in_the_order_of_the_parameter(line):
    ax = plot_exponents(line, ax=plt.figure().subplots())
    zero, first, second, failed = ax.lines
    assert set(zero.get_ydata()) == {0.0}
    np.testing.assert_array_equal(first.get_xdata(), [-1.0, 0.5, 0.8, 1.0])
    np.testing.assert_array_equal(first.get_ydata(), line.exponents.values[[3, 1, 2, 0], 0])
    np.testing.assert_array_equal(second.get_ydata(), line.exponents.values[[3, 1, 2, 0], 1])
    np.testing.assert_array_equal(failed.get_xdata(), [-1.0])
    assert len(ax.collections) == 2
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("d", "Lyapunov exponents")


def test_the_bifurcation_diagram_has_every_point(line):
    ax = plot_bifurcation(line, "v", ax=plt.figure().subplots())
    (points,) = ax.collections
    across, up = points.get_offsets().T
    np.testing.assert_array_equal(across, np.repeat([1.0, 0.5, 0.8, -1.0], 3))
    np.testing.assert_array_equal(up, line.section.values[:, :, 1].ravel())
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("d", "v")


def test_a_map_is_white_at_zero_and_grey_where_nothing_is_known(grid):
    ax = plot_map(grid, ax=plt.figure().subplots())
    # The values of d fall, so there is no image.
    (mesh,) = ax.collections
    assert mesh.norm(0.0) == 0.5
    shown = mesh.get_array()
    np.testing.assert_array_equal(shown[:, 0], grid.exponents[:, 0, 0])
    assert shown.mask[:, 1].all()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("d", "r")


def made(exponents, errors, forced="yes"):
    """A chart with these exponents over two axes."""
    shape = np.shape(exponents)[:2]
    axes = ("b", "a")
    values = {
        "exponents": ((*axes, "exponent"), np.array(exponents, dtype=float), {"units": "1/s"}),
        "standard_error": ((*axes, "exponent"), np.broadcast_to(errors, np.shape(exponents))),
        "status": (axes, np.zeros(shape, dtype=int)),
    }
    coords = {"b": ("b", np.arange(shape[0]), {"units": "m"}), "a": np.arange(shape[1]) / 2}
    return xarray.Dataset(values, coords, {"forced": forced})


ROWS = [
    [(-1.0, -2.0), (0.1, -2.0), (-0.1, 0.1)],
    [(1.0, -2.0), (1.0, 0.0), (np.nan, np.nan)],
]


@pytest.mark.parametrize(
    ("forced", "found"),
    [
        ("yes", [["periodic", "torus", "torus"], ["chaotic", "chaotic", "not known"]]),
        ("no", [["at rest", "periodic", "torus"], ["chaotic", "chaotic", "not known"]]),
    ],
)
def test_signs_tell_the_kinds_of_motion(forced, found):
    chart = made(ROWS, 0.2, forced)
    assert [[KINDS[i] for i in row] for row in kinds(chart).values] == found
    ax = plot_kinds(chart)
    assert {text.get_text() for text in ax.get_legend().get_texts()} == {*found[0], *found[1]}


def test_two_standard_errors_tell_an_exponent_from_zero():
    chart = made([[(0.39, -9.0), (0.41, -9.0)], [(-0.39, -9.0), (-0.41, -9.0)]], 0.2)
    assert [[KINDS[i] for i in row] for row in kinds(chart).values] == [
        ["torus", "chaotic"],
        ["torus", "periodic"],
    ]


def test_three_exponents_of_zero_are_a_torus_too():
    rows = [[(0.1, 0.0, -0.1), (0.0, -1.0, -1.0)], [(-1.0, -1.0, -1.0), (-np.inf, -np.inf, -np.inf)]]
    found = kinds(made(rows, 0.2, "no"))
    assert [[KINDS[i] for i in row] for row in found.values] == [
        ["torus", "periodic"],
        ["at rest", "at rest"],
    ]
    assert found.attrs["flag_values"] == [0, 1, 2, 3, 4]
    assert found.attrs["flag_meanings"] == "not_known at_rest periodic torus chaotic"


def test_what_is_known_follows_from_the_first_exponent_and_the_status():
    """A state that is lost at each jump has an exponent of minus infinity; a run that failed has none."""
    rows = [[(1.0, -np.inf), (-1.0, -np.inf), (0.0, -np.inf)], [(np.nan, -1.0), (np.inf, -1.0), (1.0, -1.0)]]
    chart = made(rows, 0.2)
    chart.status[1, 2] = int(hybrid.StatusCode.MAX_STEPS)
    assert [[KINDS[i] for i in row] for row in kinds(chart).values] == [
        ["chaotic", "periodic", "torus"],
        ["not known"] * 3,
    ]


def test_exponents_are_named_and_have_bands_of_two_standard_errors(line):
    ax = plot_exponents(line, ax=plt.figure().subplots())
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names[:2] == ["$\\lambda_{1}$", "$\\lambda_{2}$"]
    for i, band in enumerate(ax.collections):
        middle, error = line.exponents.values[:3, i], 2 * line.standard_error.values[:3, i]
        [path] = band.get_paths()
        low, high = np.nanmin(path.vertices[:, 1]), np.nanmax(path.vertices[:, 1])
        assert low == pytest.approx((middle - error).min())
        assert high == pytest.approx((middle + error).max())


def test_noise_is_white_and_a_few_large_values_leave_colours_to_the_rest():
    values = np.full((10, 20, 1), -0.5)
    values[0, 0], values[0, 1] = 1e3, 0.19
    ax = plot_map(made(values, 0.1))
    (image,) = ax.images
    assert (image.norm.vmin, image.norm.vmax) == (-0.5, 0.5)
    assert image.get_array()[0, 1] == 0.0
    assert image.get_extent() == [-0.25, 9.75, -0.5, 9.5]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("a", "b (m)")
    assert ax.figure.axes[1].get_ylabel() == "$\\lambda_{1}$ (1/s)"


@pytest.mark.parametrize(("lost", "shown"), [((0.0, 0.0), 0), ((0.0, 1.0), 1), ((1.0, 1.0), 2)])
def test_a_spectrum_without_finite_exponents_is_drawn_too(lost, shown):
    """Each period a reset takes all of a state, or nothing."""
    system = hybrid.HybridSystem(
        state=("q", "v"),
        parameters={"a": 1.0, "b": 1.0},
        modes=[hybrid.Mode("on", lambda t, x, p: (-x.q, -2 * x.v))],
        transitions=[
            hybrid.Transition(
                "on",
                "on",
                hybrid.Guard(lambda t, x, p: np.sin(2 * np.pi * (t - 0.5)), +1),
                hybrid.Reset(lambda t, x, p: (p.a * x.q, p.b * x.v)),
            )
        ],
        period=1.0,
    )
    values = dict(zip("ab", lost, strict=True))
    spectrum = lyapunov.lyapunov_spectrum(system, (0.1, 0.2), parameters=values, intervals=10)
    assert np.isfinite(spectrum.exponents).sum() == shown
    ax = hybrid.plot.plot(spectrum)
    bottom, top = ax.get_ylim()
    assert -10 < bottom < top < 10


def test_the_kind_needs_no_forcing():
    """Van der Pol's oscillator comes to rest, or to its limit cycle."""
    cycle = hybrid.HybridSystem(
        state=("x", "y"),
        parameters={"mu": 1.0},
        modes=[hybrid.Mode("on", lambda t, x, p: (x.y, p.mu * (1 - x.x**2) * x.y - x.x))],
    )
    options = {"k": 2, "intervals": 200, "interval": 5.0, "transient": 20}
    chart = lyapunov.chart(cycle, {"mu": [-0.5, 1.0]}, (0.5, 0.0), **options)
    assert [KINDS[i] for i in kinds(chart).values] == ["at rest", "periodic"]


def test_a_figure_of_each_kind(line, grid):
    above, below = plot_chart(line)
    assert above.get_shared_x_axes().joined(above, below)
    # The first component, unless another one is asked for.
    assert above.get_ylabel() == "x"
    # The map and its colour bar, of one figure.
    assert len(plot_chart(grid)) == 1
    assert len(plot_chart(grid).figure.axes) == 2
    bare = lyapunov.chart(models.impact_oscillator(), {"d": [1.0, 0.5]}, (0.0, 0.0), **SHORT)
    # Whether the axis of section points is empty or absent.
    for without in (bare, bare.drop_dims("sample", errors="ignore")):
        assert len(plot_chart(without)) == 1
        with pytest.raises(ArgumentError, match="chart must have section points"):
            plot_bifurcation(without)
    # One exponent needs no legend.
    assert bare.sizes["exponent"] == 1
    assert plot_exponents(bare).get_legend() is None
    with pytest.raises(ArgumentError, match="chart must have section points"):
        plot_bifurcation(bare, ax=plt.figure().subplots())


def test_lines_and_maps_want_their_kind_of_chart(line, grid):
    ax = plt.figure().subplots()
    with pytest.raises(ArgumentError, match="over one parameter; this one is over r and d"):
        plot_exponents(grid, ax=ax)
    with pytest.raises(ArgumentError, match="over one parameter; this one is over r and d"):
        plot_bifurcation(grid, ax=ax)
    with pytest.raises(ArgumentError, match=r"chart must be a dataset made with lyapunov\.chart"):
        plot_bifurcation(line.drop_vars("exponents"), ax=ax)
    with pytest.raises(ArgumentError, match="chart must be over two parameters"):
        plot_map(line, ax=ax)


class TestConvergence:
    def test_long_histories_are_thinned_and_keep_both_ends(self):
        for length in (1, 2, 10, 1499, 5000, 100_000):
            history = 1.0 / np.arange(1.0, length + 1)
            [line] = plot_convergence({"a": history}).lines
            at, shown = line.get_xdata(), line.get_ydata()
            np.testing.assert_array_equal(shown, history[at - 1])
            assert (at[0], at[-1]) == (1, length)
            # Each interval at first, and later a fixed number of points per decade.
            assert np.all(np.diff(at) > 0)
            assert np.all(np.diff(at) <= 1 + 0.02 * at[:-1])
            assert len(at) <= 1500

    def test_lines_points_and_truth_have_their_labels_and_colours(self):
        points = {"b": ([1, 3], [0.5, 0.25])}
        ax = plot_convergence(
            {"a": [1.0, 2.0], "b": [3.0, 4.0]},
            points=points,
            points_label="seen",
            truth=0.1,
            truth_label="known",
        )
        truth, a, b, marks, sample = ax.lines
        assert [line.get_label() for line in (truth, a, b, sample)] == ["known", "a", "b", "seen"]
        assert set(truth.get_ydata()) == {0.1}
        np.testing.assert_array_equal(marks.get_xydata(), [[1, 0.5], [3, 0.25]])
        assert marks.get_color() == b.get_color() != a.get_color()
        assert a.get_linewidth() > b.get_linewidth()
        assert [text.get_text() for text in ax.get_legend().get_texts()] == ["known", "a", "b", "seen"]
        assert (ax.get_xscale(), ax.get_xlabel()) == ("log", "intervals $M$")
        assert len(plot_convergence({"a": [1.0, 2.0]}).lines) == 1

    def test_a_history_without_intervals_is_an_empty_line(self):
        [line] = plot_convergence({"a": []}).lines
        assert len(line.get_xdata()) == 0

    def test_further_lines_go_through_the_colours(self):
        lines = plot_convergence({str(k): [1.0] for k in range(8)}).lines
        colours = [line.get_color() for line in lines]
        assert len(set(colours[:7])) == 7
        assert colours[7] == colours[0]


class TestPhasePortrait:
    def test_the_orbit_is_in_order_with_both_sides_of_each_jump(self):
        arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 2.0))
        [line] = plot_phase_portrait(arc, "v", "q").lines
        v, q = line.get_xydata().T
        assert (v[0], q[0]) == pytest.approx((0.0, 1.0), rel=1e-14)
        assert (v[-1], q[-1]) == (arc.x[-1, 1], arc.x[-1, 0])
        up = np.flatnonzero(np.diff(v) > 1.0)
        np.testing.assert_array_equal(v[up], arc.jumps.x_minus[:, 1])
        np.testing.assert_array_equal(v[up + 1], arc.jumps.x_plus[:, 1])
        # Between jumps the ball falls, in small steps, and keeps its energy.
        falling = np.delete(np.diff(v), up)
        assert np.all(falling <= 0.0)
        assert falling.min() > -1e-3
        for piece in np.split(v**2 / 2 + 9.81 * q, up + 1):
            np.testing.assert_allclose(piece, piece[0], rtol=1e-9)

    @pytest.mark.parametrize("spread", [0.0, 0.9e-6, 1.1e-6, 1.0])
    def test_a_fixed_point_is_a_large_dot(self, spread):
        arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 0.1))
        section = np.array([[0.0, 0.0], [0.0, spread]])
        ax = plot_phase_portrait(arc, "q", "v", section=section, labels={"q": "a", "v": "b"})
        [dots] = ax.collections
        np.testing.assert_array_equal(dots.get_offsets(), section)
        assert (dots.get_sizes()[0] > 10.0) == (spread < 1e-6)
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("a (m)", "b (m/s)")

    def test_an_output_in_the_plane_and_at_a_section(self):
        ball = models.bouncing_ball()
        arc = hybrid.simulate(ball, (1.0, 0.0), (0.0, 2.0))
        section = hybrid.poincare_section(ball, (1.0, 0.0), Guard(lambda t, x, p: x.v, -1), points=3)
        ax = plot_phase_portrait(arc, "q", "energy", section=section)
        q, energy = ax.lines[0].get_xdata(), ax.lines[0].get_ydata()
        assert energy[0] == pytest.approx(9.81 * q[0], rel=1e-14)
        levels = 9.81 * 0.8 ** (2 * np.arange(len(arc.jumps) + 1))
        assert np.min(np.abs(energy[:, None] - levels), axis=1).max() < 1e-9
        # At the top all energy is that of the height.
        tops, found = ax.collections[0].get_offsets().T
        np.testing.assert_allclose(found, 9.81 * tops, rtol=1e-12)
        assert ax.get_ylabel() == f"energy ({ball.units['energy']})"
        with pytest.raises(ArgumentError, match="only the state is known, and 'energy' is an output"):
            plot_phase_portrait(arc, "q", "energy", section=section.x)


def test_a_spectrum_has_bars_of_two_standard_errors_inside_of_its_limits():
    options = {"intervals": 40, "transient": 5}
    spectrum = lyapunov.lyapunov_spectrum(models.impact_oscillator(), (0.3, 0.1), **options)
    ax = plot_spectrum(spectrum)
    values, errors = spectrum.exponents, 2 * spectrum.standard_error
    for container, value, error in zip(ax.containers, values, errors, strict=True):
        [bar] = container.lines[2]
        np.testing.assert_allclose(bar.get_segments()[0], [[40, value - error], [40, value + error]])
    labels = [f"$\\lambda_{{{i}}}$ = {value:.5g}" for i, value in enumerate(values, 1)]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["zero", *labels]
    shown = [0.0, *(values - errors), *(values + errors), *spectrum.history[4:].ravel()]
    bottom, top = min(shown), max(shown)
    margin = 0.1 * (top - bottom)
    np.testing.assert_allclose(ax.get_ylim(), [bottom - margin, top + margin])


@pytest.mark.parametrize("error", [50.0, 1000.0])
def test_limits_hold_bars_that_reach_beyond_the_history(error):
    spectrum = lyapunov.lyapunov_spectrum(models.impact_oscillator(), (0.3, 0.1), intervals=10)
    wide = attrs.evolve(spectrum, standard_error=np.full(2, error))
    values = spectrum.exponents
    bottom, top = min(values) - 2 * error, max(values) + 2 * error
    margin = 0.1 * (top - bottom)
    np.testing.assert_allclose(plot_spectrum(wide).get_ylim(), [bottom - margin, top + margin])


def test_minus_infinity_and_failed_rows_are_marked_and_explained():
    chart = made(ROWS, 0.2).isel(b=0, drop=True)
    chart["status"][1] = int(hybrid.StatusCode.MAX_STEPS)
    chart.exponents[2, 1] = -np.inf
    ax = plot_exponents(chart, figsize=(4.0, 3.0))
    assert tuple(ax.figure.get_size_inches()) == (4.0, 3.0)
    *_, lost, failed = ax.lines
    assert (lost.get_xdata().tolist(), failed.get_xdata().tolist()) == ([1.0], [0.5])
    told = [text.get_text() for text in ax.get_legend().get_texts()]
    assert "minus infinity" in told[-2]
    assert "MAX_STEPS" in told[-1]
    assert ax.get_ylabel() == "Lyapunov exponents (1/s)"


def test_a_map_tells_minus_infinity_from_failed_rows():
    chart = made([[(-1.0, -np.inf), (0.5, -2.0)], [(-np.inf, -np.inf), (1.0, -2.0)]], 0.1)
    chart["status"][1, 1] = int(hybrid.StatusCode.MAX_STEPS)
    ax = plot_map(chart)
    values, lost = (image.get_array() for image in ax.images)
    assert values.mask.tolist() == [[False, False], [True, True]]
    assert lost.mask.tolist() == [[True, True], [False, True]]
    assert {text.get_text() for text in ax.get_legend().get_texts()} == {
        "MAX_STEPS, see chart.message",
        "minus infinity",
    }


def test_a_chart_over_three_axes_names_the_plane_to_take():
    chart = made(ROWS, 0.2).expand_dims(c=[1.0, 2.0])
    with pytest.raises(ArgumentError, match=r"over c and b and a\. Take a plane: chart\.isel\(c=0\)"):
        hybrid.plot.plot(chart)
    hybrid.plot.plot(chart.isel(c=0))


def test_estimates_from_two_orbits_and_comparisons_are_drawn():
    system = models.impact_oscillator()
    two = lyapunov.two_orbit_exponents(system, (0.3, 0.1), intervals=10)
    assert [text.get_text() for text in hybrid.plot.plot(two).get_legend().get_texts()] == [
        "zero",
        "renormalised, converges",
        "one piece, saturates",
        "undivided, saturates",
    ]
    compared = lyapunov.compare_models(
        {"stiff": system, "same": system}, (0.3, 0.1), reference="stiff", intervals=5, transient=1
    )
    told = {text.get_text() for text in hybrid.plot.plot(compared).get_legend().get_texts()}
    assert told == {"stiff, the reference", "same: the same exponents"}


def test_no_curve_of_a_spectrum_leaves_its_frame():
    """The first estimates, which are far off, are left out; each exponent has one entry in the legend."""
    spectrum = lyapunov.lyapunov_spectrum(models.impact_oscillator(), (0.0, 0.0), k=2, intervals=300)
    ax = lyapunov.plot.plot_spectrum(spectrum)
    (low, high), (left, right) = ax.get_ylim(), ax.get_xlim()
    curves = [line for line in ax.lines if len(line.get_xdata()) > 2]
    assert len(curves) == 2
    for line in curves:
        x, y = line.get_data()
        assert low <= y.min() <= y.max() <= high
        assert left <= x.min() < x.max() == 300 <= right
        assert right >= 10 * left
    assert len(ax.get_legend().get_texts()) == 3
