"""Pictures of basins and shares: what they show, in the words of the model."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.collections import PathCollection

import hybrid
import hybrid.plot
import models
from hybrid.measures import mean
from tests.hybrid.sweep.attractors.test_attractors import double_well


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def legend(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_basins_in_a_plane():
    over = {"x": np.linspace(-3.0, 1.2, 22), "v": np.linspace(-3.0, 3.0, 20)}
    found = hybrid.basins(models.impact_oscillator(), over, parameters={"w": 2.6})
    ax = hybrid.plot(found)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x", "v")
    names = legend(ax)
    assert names[0] == "violates flight"
    assert names[1].startswith("1: periodic, 1 point and 0 jumps per round (")
    assert names[2].startswith("2: periodic, 2 points and 1 jump per round (")
    # One dot per point of an attractor.
    dots = [each.get_offsets() for each in ax.collections if isinstance(each, PathCollection)]
    drawn = sorted(v for each in dots for v in each[:, 1].tolist())
    np.testing.assert_allclose(drawn, sorted(found.points.values[..., 1][[0, 1, 1], [0, 0, 1]]))


def test_basins_along_a_line():
    found = hybrid.basins(double_well(units={"x": "m"}), {"x": np.linspace(-2.0, 2.0, 10)})
    ax = hybrid.plot.plot_basins(found)
    assert ax.get_xlabel() == "x (m)"
    assert legend(ax) == ["1: equilibrium (50.0% of the starts)", "2: equilibrium (50.0% of the starts)"]


def test_what_has_no_plane_is_told():
    with pytest.raises(hybrid.ArgumentError, match="basins must be over one or two axes to be drawn"):
        hybrid.plot.plot_basins(hybrid.basins(double_well(), {"x": 1.5}))


def test_shares_as_bars_and_as_bands():
    bars = hybrid.plot(hybrid.basin_fractions(double_well(), {"x": (-1.0, 3.0)}, starts=40))
    heights = [bar.get_height() for bar in bars.patches]
    assert sum(heights) == pytest.approx(1.0)
    over = hybrid.basin_fractions(double_well(), {"x": (-2.0, 2.0)}, along={"h": [-0.5, 0.0, 0.5]}, starts=20)
    bands = hybrid.plot(over)
    assert bands.get_xlabel() == "h"
    assert bands.get_ylim() == (0.0, 1.0)
    assert legend(bands) == ["1: equilibrium", "2: equilibrium"]
    one = hybrid.plot(over.isel(h=[1]))
    assert sum(bar.get_height() for bar in one.patches) == pytest.approx(1.0)


def test_attractors_by_features_are_told_by_them():
    given = {"features": {"level": mean("x")}}
    ax = hybrid.plot(hybrid.basins(double_well(), {"x": np.linspace(-2.0, 2.0, 10)}, **given))
    assert legend(ax) == ["1: level -1 (50.0% of the starts)", "2: level 1 (50.0% of the starts)"]
    bars = hybrid.plot(hybrid.basin_fractions(double_well(), {"x": (-1.0, 3.0)}, starts=10, **given))
    assert legend(bars) == ["1: level -1", "2: level 1"]
    over = hybrid.basin_fractions(
        double_well(), {"x": (-2.0, 2.0)}, along={"h": [-0.2, 0.2]}, starts=10, **given
    )
    assert legend(hybrid.plot(over)) == ["1: level -1.088 to -0.8789", "2: level 0.8789 to 1.088"]
