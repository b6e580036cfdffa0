"""Figures of the study: what is drawn, over which axes, and their limits."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import models
from hybrid import simulate
from lyapunov.study import figures
from lyapunov.study.figures import LEAST_HEIGHT, _fit_height
from lyapunov.study.paper import PAPER, ROWS
from lyapunov.study.tangents import Trap
from tests.lyapunov.study.made import STOPPED, Result, regime


@pytest.fixture(autouse=True)
def _no_figures_left(monkeypatch):
    monkeypatch.setattr(figures, "floquet_exponents", lambda orbit: np.log(np.abs(orbit.multipliers)))
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def arc():
    return simulate(models.vibroimpact(), (0.0, 0.05, 0.0, 0.0), (0.0, 1.0))


def drawn(ax):
    """Data of the lines of axes, by their labels; lines without a label under None."""
    found = {}
    for line in ax.lines:
        label = str(line.get_label())
        found.setdefault(None if label.startswith("_") else label, line.get_xydata())
    return found


class TestConvergence:
    def test_a_frequency_of_the_paper(self):
        given = regime(7.40, 500)
        figure = figures.convergence(given)
        assert (
            figure.get_suptitle() == "$\\omega$ = 7.40 rad/s, periodic: first exponent after M periods, 1/s"
        )
        axes = figure.axes
        assert [ax.get_title(loc="center") or ax.get_title(loc="left") for ax in axes] == [
            title for title, _ in figures.ESTIMATES
        ]
        assert [ax.get_xlabel() for ax in axes] == ["", "", "intervals $M$", "intervals $M$"]
        assert [ax.get_ylabel() for ax in axes] == ["exponent estimate", "", "exponent estimate", ""]
        assert [ax.get_xlim()[0] for ax in axes] == [10.0] * 4
        for ax in axes:
            assert set(drawn(ax)["Floquet exponent"][:, 1]) == {np.log(0.5)}
        lines = [drawn(ax) for ax in axes]
        np.testing.assert_array_equal(lines[0]["(7)"][-1], [500.0, 250.0])
        np.testing.assert_array_equal(lines[0]["(8)"][-1], [500.0, -0.5])
        np.testing.assert_array_equal(lines[2]["(10) I"][-1], [500.0, 500.0])
        np.testing.assert_array_equal(lines[2]["(10) II"][-1], [500.0, 1000.0])
        np.testing.assert_array_equal(lines[3]["tapered"][-1], [500.0, 5.0])
        # The paper's Benettin column has one start only, and formulas have all rows.
        np.testing.assert_array_equal(
            lines[2][None], np.column_stack([ROWS, PAPER[7.40].benettin_first_start])
        )
        np.testing.assert_array_equal(lines[0][None], np.column_stack([ROWS, PAPER[7.40].single_piece]))
        assert None not in lines[3]
        # The limits of the second panel fit nothing: its estimates are far off.
        assert axes[2].get_ylim()[1] > 1000.0
        assert axes[0].get_ylim()[1] < 300.0

    def test_a_short_run_is_shown_from_its_first_period(self):
        for intervals, left in ((100, 1.0), (101, 10.0)):
            assert figures.convergence(regime(7.5, intervals)).axes[0].get_xlim()[0] == left

    def test_the_best_known_value(self):
        given = regime(7.40, 5)
        assert figures._truth(given) == (np.log(0.5), "Floquet exponent")
        given.orbit.status = STOPPED
        assert figures._truth(given) == (1.0, "last tapered estimate")
        assert figures._truth(regime(7.46, 5, kind="quasi-periodic")) == (0.0, "zero for a torus")
        assert figures._truth(regime(7.92, 5, kind="chaotic")) == (1.0, "last tapered estimate")


def with_orbit(arc, omega, kind):
    given = regime(omega, 50, arc=arc, kind=kind)
    given.section = Result(name="section", x=np.arange(8.0).reshape(2, 4))
    return given


def test_portraits_of_both_bodies(arc):
    figure = figures.portrait(with_orbit(arc, 7.46, "chaotic"))
    assert figure.get_suptitle() == "$\\omega$ = 7.46 rad/s, chaotic: orbit and stroboscopic section"
    for ax, components in zip(figure.axes, ([0, 2], [1, 3]), strict=True):
        [points] = ax.collections
        np.testing.assert_array_equal(points.get_offsets(), np.arange(8.0).reshape(2, 4)[:, components])
    assert [ax.get_xlabel() for ax in figure.axes] == ["$x_1$, m", "$x_2$, m"]
    assert [ax.get_ylabel() for ax in figure.axes] == ["$\\dot x_1$, m/s", "$\\dot x_2$, m/s"]


def test_regimes_side_by_side(arc):
    given = [with_orbit(arc, 7.46, "chaotic"), with_orbit(arc, 7.5, "periodic")]
    axes = np.reshape(figures.comparison(given).axes, (3, 2))
    assert [ax.get_title() for ax in axes[0]] == [
        "$\\omega$ = 7.46 rad/s, chaotic",
        "$\\omega$ = 7.50 rad/s, periodic",
    ]
    for ax in axes[1]:
        np.testing.assert_array_equal(ax.collections[0].get_offsets(), [[1.0, 3.0], [5.0, 7.0]])
    for ax in axes[2]:
        np.testing.assert_allclose(drawn(ax)["first exponent"][-1], [50.0, 0.5])
        np.testing.assert_allclose(ax.get_ylim(), [0.42, 0.58])


def test_errors_outside_and_inside_the_error_control():
    truth, tolerances = np.array([0.5, -1.0, -2.0, -3.0]), np.array([1e-4, 1e-8])
    inside, outside = truth + np.array([[1e-3], [1e-6]]), truth - np.array([[0.2], [0.02]])
    [ax] = figures.tolerances(Trap(truth, tolerances, inside, outside)).axes
    lines = drawn(ax)
    for label, errors in (
        ("first exponent, outside", [0.2, 0.02]),
        ("sum of all four, outside", [0.8, 0.08]),
        ("first exponent, inside", [1e-3, 1e-6]),
    ):
        np.testing.assert_allclose(lines[label], np.column_stack([tolerances, errors]), rtol=1e-9)
    assert set(lines["the exponent itself"][:, 1]) == {0.5}
    assert ax.get_xscale() == ax.get_yscale() == "log"
    assert ax.xaxis_inverted()


@pytest.mark.parametrize("height", [1e-3, LEAST_HEIGHT, 1.0])
def test_the_late_history_the_papers_points_and_the_truth_are_inside(height):
    late = np.linspace(0.5, 0.5 + 0.5 * height, 990)
    history = np.concatenate([np.full(10, 9.0), late])
    figure, ax = plt.subplots()
    _fit_height(ax, [history], [[0.5 + height, np.nan]], 0.5 + 0.1 * height)
    low, high = ax.get_ylim()
    plt.close(figure)
    assert low < 0.5
    assert 0.5 + height < high < 9.0
    assert low + high == pytest.approx(1.0 + height)
    assert high - low == pytest.approx(max(LEAST_HEIGHT, 1.16 * height))
