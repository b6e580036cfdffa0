"""Regimes side by side: points, limits and labels of each panel."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import models
from hybrid import simulate
from lyapunov.study.regimes import Panel, plot_regimes


@pytest.fixture(scope="module")
def arc():
    return simulate(models.impact_oscillator(), (0.5, 0.0), (0.0, 10.0))


def axes_of(panels, *components, **options):
    figure = plot_regimes(panels, *components, **options)
    plt.close(figure)
    return np.reshape(figure.axes, (3, len(panels)))


def test_each_panel_has_an_orbit_a_section_and_a_history(arc):
    cloud, fixed = np.array([[0.1, 0.2], [0.3, 0.5]]), np.array([[0.5, -2.0], [0.5, -2.0 + 1e-7]])
    histories = np.linspace(1.0, 0.25, 40), np.zeros(0)
    panels = [Panel("a", arc, cloud, histories[0], 0.5), Panel("b", arc, fixed, histories[1], 2.0)]
    axes = axes_of(panels, "v", "x", labels=("speed", "place"))
    assert [ax.get_title() for ax in axes[0]] == ["a", "b"]
    assert [ax.get_title() for ax in axes[:, 0]] == ["a", "Section, once per period", "First exponent"]
    assert [[ax.get_xlabel() for ax in row] for row in axes[:2]] == [["speed"] * 2] * 2
    assert [[ax.get_ylabel() for ax in row] for row in axes[:2]] == [["place", ""]] * 2
    np.testing.assert_array_equal(axes[1, 0].collections[0].get_offsets(), cloud[:, ::-1])
    np.testing.assert_array_equal(axes[1, 1].collections[0].get_offsets(), fixed[:, ::-1])
    assert axes[2, 0].get_ylim() == (-0.25, 0.75)
    assert axes[2, 1].get_ylim() == (-2.0, 2.0)
    assert [ax.get_legend() for ax in axes[2]] == [None, None]
    # The dashed line is at zero, the first exponent of a torus.
    for ax, history in zip(axes[2], histories, strict=True):
        zero, line = ax.lines
        assert zero.get_ydata() == [0.0, 0.0]
        np.testing.assert_array_equal(line.get_ydata(), history)
    # A fixed point is in the middle, as a large dot; each axis reaches to a fifth of its value.
    np.testing.assert_allclose(axes[1, 1].get_xlim(), [-2.4, -1.6], rtol=1e-6)
    np.testing.assert_allclose(axes[1, 1].get_ylim(), [0.4, 0.6], rtol=1e-12)
    small, large = (ax.collections[0].get_sizes()[0] for ax in axes[1])
    assert small < 0.1 * large


def test_a_fixed_point_at_zero_has_limits_too(arc):
    [[_], [section], [_]] = axes_of([Panel("a", arc, np.zeros((3, 2)), np.ones(5), 1.0)], "x", 1)
    np.testing.assert_allclose([section.get_xlim(), section.get_ylim()], [[-2e-4, 2e-4]] * 2)
    assert (section.get_xlabel(), section.get_ylabel()) == ("x", "v")


def test_motion_in_one_component_is_no_fixed_point(arc):
    points = np.array([[0.5, 1.0], [0.5, 1.0 + 2e-6]])
    [[_], [section], [_]] = axes_of([Panel("a", arc, points, np.ones(5), 1.0)], "x", "v")
    low, high = section.get_ylim()
    assert high - low < 1e-4
