"""Attractors told apart by features of their arcs: what points find too, and what only features find."""

import numpy as np
import pytest

import hybrid
import models
from hybrid import HybridSystem, Mode, StatusCode
from hybrid.measures import maximum, mean, minimum, rms
from hybrid.sweep.attractors.groups import Linkage, Precision
from tests.hybrid.sweep.attractors.test_attractors import double_well
from tests.hybrid.sweep.attractors.test_fractions import Pressed
from tests.lyapunov.clocked import clocked

PLANE = {"x": (-4.0, 1.0), "v": (-4.0, 4.0)}
SETTLED = {"periods": 200}


def pendulum():
    """A damped pendulum under a constant torque, whose angle counts its turns: it rests, or goes round."""
    return HybridSystem(
        state=("angle", "speed"),
        parameters={"torque": 0.5, "c": 0.2},
        modes=[Mode("swing", lambda t, x, p: (x.speed, p.torque - p.c * x.speed - np.sin(x.angle)))],
    )


def grouped(values, scatter=0.0, apart=None):
    values = np.array(values, dtype=float)
    values = values[:, None] if values.ndim == 1 else values
    known = Precision(1e-5, 1e-6)
    return Linkage(values, np.full(values.shape, scatter), known, apart).grouped().tolist()


@pytest.mark.parametrize("w_A", [(2.6, 1.0), (2.6, 3.4), (1.0, 1.0)])
def test_shares_are_those_that_points_find(w_A):
    """Two attractors, three of which two have rounds of four points, and a single one."""
    given = {"parameters": dict(zip("wA", w_A, strict=True)), "starts": 30, **SETTLED}
    system = models.impact_oscillator()
    by_points = hybrid.basin_fractions(system, PLANE, **given)
    asked = {"low": minimum("x"), "mean": mean("x"), "speed": rms("v")}
    by_features = hybrid.basin_fractions(system, PLANE, **given, features=asked)
    assert sorted(by_features.fraction.values) == pytest.approx(sorted(by_points.fraction.values))
    assert by_features.feature.values.tolist() == ["low", "mean", "speed"]


def test_a_motion_whose_states_never_return():
    """The power of the torque is that of the damping: torque * mean speed = c * rms**2."""
    over = {"angle": (-3.0, 3.0), "speed": (-4.0, 6.0)}
    asked = {"mean": mean("speed"), "rms": rms("speed")}
    found = hybrid.attractors(
        pendulum(), over, starts=40, periods=200, recurrences=40, interval=1.0, features=asked
    )
    assert found.status.ok
    rest, turning = found.values()
    assert abs(rest["mean"]) < 1e-6
    assert 0.5 * turning["mean"] == pytest.approx(0.2 * turning["rms"] ** 2, rel=2e-2)
    # Rests that are whole turns apart have other states.
    assert len(hybrid.attractors(pendulum(), over, starts=40, periods=200)) > 2


def test_two_chaotic_attractors():
    """The map x -> 2.5 x - x**3 keeps the sign of x and is chaotic on either side."""
    system = clocked(("x",), lambda t, x, p: (2.5 * x.x - x.x**3,))
    over = {"x": np.linspace(-1.5, 1.5, 30), "tau": 0.5}
    found = hybrid.basins(system, over, interval=1.0, periods=100, recurrences=50, features=mean("x"))
    np.testing.assert_array_equal(found.label, np.where(found.x < 0, 1, 2))
    assert found.features.sel(feature="mean of x").values == pytest.approx([-0.9, 0.9], abs=0.3)
    assert (found.lowest_feature < found.highest_feature).all()


def test_groups_are_joined_across_gaps_as_wide_as_their_scatter():
    assert grouped([0.0, 1e-9, 1.0, 1.0 + 1e-9]) == [0, 0, 1, 1]
    assert grouped([1.0, 0.0, 1.0 + 1e-9, 1e-9]) == [1, 0, 1, 0]
    assert grouped([0.0, 0.1, 0.2, 1.0], scatter=0.06) == [0, 0, 0, 1]
    assert grouped([0.0, 0.1, 0.2, 1.0], scatter=0.04) == [0, 1, 2, 3]
    # The scatter of a group is its own: of three runs that differ, two are one chaotic attractor.
    assert grouped([[0.0], [0.5], [0.8]], scatter=[[0.0], [0.2], [0.2]]) == [0, 1, 1]
    assert grouped([2.0]) == [0]
    assert grouped([]) == []


def test_a_feature_without_meaning_hides_no_other():
    random = np.random.default_rng(1)
    values = np.column_stack([np.repeat([0.0, 1.0], 20), random.normal(size=40)])
    scatter = np.column_stack([np.zeros(40), np.ones(40)])
    assert grouped(values, scatter=scatter) == np.repeat([0, 1], 20).tolist()


def test_a_distance_by_hand():
    values = [0.0, 0.4, 0.8, 2.0]
    assert grouped(values, apart=np.array([0.5])) == [0, 0, 0, 1]
    assert grouped(values, scatter=9.0, apart=np.array([0.3])) == [0, 1, 2, 3]
    wells = {"x": (-2.0, 3.0)}
    for together, count in ((1.9, 2), (2.1, 1), ({"mean of x": 2.1}, 1)):
        found = hybrid.attractors(double_well(), wells, starts=20, features=mean("x"), together=together)
        assert len(found) == count


def test_features_that_are_not_finite_lead_to_no_attractor():
    def depth(arc):
        return np.nan if arc["x"][-1] < 0 else arc["x"][-1]

    over = {"x": np.linspace(-2.0, 2.0, 8)}
    found = hybrid.basins(double_well(), over, features=[depth], **SETTLED)
    np.testing.assert_array_equal(found.label, np.where(found.x < 0, 0, 1))
    assert (found.status.values[:4] == StatusCode.NOT_CONVERGED).all()
    assert found.attrs["status"] == "NOT_CONVERGED"
    assert (
        "4 of 8 starts lead to no attractor, because of features that are not finite: depth."
        in (found.attrs["message"])
    )


def test_runs_that_end_lead_to_no_attractor():
    over = {"q": [0.5, 1.0, -1.0], "v": 0.0}
    found = hybrid.basins(models.bouncing_ball(), over, interval=0.5, features=maximum("q"))
    assert found.label.values.tolist() == [0, 0, -1]
    assert found.status.values[:2].tolist() == [StatusCode.ACCUMULATION] * 2
    assert found.sizes["attractor"] == 0


def test_attractors_followed_through_folds():
    """As by points: the lower equilibrium lives below one fold, the upper one above the other."""
    values = np.linspace(-0.6, 0.6, 7)
    given = {"along": {"h": values}, "starts": 20}
    by_points = hybrid.basin_fractions(double_well(), {"x": (-2.0, 2.0)}, **given)
    found = hybrid.basin_fractions(double_well(), {"x": (-2.0, 2.0)}, **given, features=mean("x"))
    for name in ("fraction", "first", "last"):
        np.testing.assert_allclose(found[name], by_points[name])
    x = found.features.sel(feature="mean of x", label=2)
    np.testing.assert_allclose(x**3 - x, x.h.where(np.isfinite(x)), atol=1e-6)


def test_the_order_of_the_starts_does_not_matter(tmp_path):
    values = np.linspace(-2.0, 2.0, 12)
    given = {"features": {"end": lambda arc: arc["x"][-1]}, "store": tmp_path / "wells.zarr"}
    first = hybrid.basins(double_well(), {"x": values}, **given)
    again = hybrid.basins(double_well(), {"x": values}, **given)
    mixed = hybrid.basins(double_well(), {"x": values[::-1]}, features=given["features"]).sortby("x")
    for other in (again, mixed):
        np.testing.assert_array_equal(first.label, other.label)
    np.testing.assert_array_equal(first.features_of_start, again.features_of_start)
    with pytest.raises(hybrid.ArgumentError, match="features"):
        hybrid.basins(double_well(), {"x": values}, store=given["store"], features=mean("x"))


def test_a_round_is_not_cut():
    """An orbit of four points has the same mean in each stretch, though ten points are asked for."""
    given = {"parameters": {"w": 2.6, "A": 3.4}, "features": mean("x"), "starts": 30, **SETTLED}
    for each in hybrid.attractors(models.impact_oscillator(), PLANE, **given).values():
        low, high = each.ranges["mean of x"]
        assert high - low < 1e-6


def test_what_comes_back():
    found = hybrid.attractors(double_well(), {"x": (-2.0, 3.0)}, starts=20, features={"level": mean("x")})
    assert [each.kind for each in found.values()] == ["by features"] * 2
    assert found[1]["level"] == pytest.approx(-1.0)
    assert "1: <Attractor: level -1, 0 jumps per point>" in repr(found)
    assert "<th>level</th>" in found._repr_html_()
    np.testing.assert_allclose(found.to_xarray().features, [[-1.0], [1.0]], atol=1e-6)
    np.testing.assert_allclose(found[2].points, np.ones((10, 1)), atol=1e-6)
    with pytest.raises(hybrid.ArgumentError, match="Feature 'height' does not exist"):
        found[1]["height"]
    plain = hybrid.attractors(double_well(), {"x": (-2.0, 3.0)}, starts=20)
    with pytest.raises(hybrid.ArgumentError, match="Feature 'level' does not exist"):
        plain[1]["level"]
    assert "features" not in plain.to_xarray()


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"features": {"a": lambda arc: arc["y"]}}, r"features\['a'\]: .*'y'.*at the run from \("),
        ({"features": {"a": lambda arc: 1 / 0}}, r"features\['a'\] raised ZeroDivisionError"),
        ({"features": {"a": lambda arc: [1.0, 2.0]}}, r"features\['a'\] must give one number of a run"),
        ({"features": [np.size, np.size]}, "two functions have the name 'size'. Name them in a mapping"),
        ({"together": 0.1}, "together is a distance of features; got 0.1 without features="),
        ({"features": {"a": np.size}, "together": {"b": 1.0}}, "together: Feature 'b' does not exist"),
        ({"features": {"a": np.size, "b": np.size}, "together": {"a": 1.0}}, "it lacks b"),
    ],
)
def test_what_is_wrong_is_told(given, text):
    with pytest.raises(hybrid.ArgumentError, match=text):
        hybrid.attractors(double_well(), {"x": (-2.0, 3.0)}, starts=3, periods=20, **given)


def test_ctrl_c_keeps_the_runs_that_are_complete(monkeypatch, python_hears_interrupts):
    def found():
        return hybrid.attractors(
            double_well(), {"x": (-2.0, 3.0)}, starts=100, features=mean("x"), executor=1, **SETTLED
        )

    whole = Pressed(monkeypatch, question=0)
    found()
    monkeypatch.undo()
    Pressed(monkeypatch, question=whole.asked // 2)
    part = found()
    monkeypatch.undo()
    assert part.status.code == StatusCode.INTERRUPTED
    assert [each["mean of x"] for each in part.values()] == pytest.approx([-1.0, 1.0])
