"""Basins whose boundaries are known, and labels that depend on the starts alone."""

import json
import signal
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import hybrid
import models
from hybrid import StatusCode
from tests.hybrid.sweep.attractors.test_attractors import double_well

TWO = {"parameters": {"w": 2.6}}


@pytest.fixture(scope="module")
def impacting():
    """Two attractors of the impact oscillator: one without impacts, one with an impact in two periods."""
    over = {"x": np.linspace(-3.0, 1.2, 43), "v": np.linspace(-3.0, 3.0, 41)}
    return hybrid.basins(models.impact_oscillator(), over, **TWO)


def test_a_boundary_at_an_unstable_equilibrium():
    values = np.linspace(-2.0, 2.0, 40)
    found = hybrid.basins(double_well(), {"x": values})
    assert found.label.dims == ("x",)
    np.testing.assert_array_equal(found.label, np.where(values < 0, 1, 2))
    assert (found.status == StatusCode.SUCCESS).all()
    np.testing.assert_allclose(found.fraction, 0.5)
    # Near the boundary a run takes longer.
    assert found.steps.sel(x=values[20]) > found.steps.sel(x=values[30])


def test_the_boundary_passes_through_a_saddle_orbit(impacting):
    """Newton's method finds the saddle; on the two sides of its stable manifold the labels differ."""
    system = models.impact_oscillator()
    assert set(np.unique(impacting.label)) == {-1, 1, 2}

    def label_of(x, v):
        given = {"x": float(x), "v": float(v)}
        shares = hybrid.basin_fractions(system, given, starts=1, **TWO)
        return shares.kind.size, float(shares["round"].max())

    # Bisection between two neighbours of the grid with different labels.
    column = impacting.label.sel(x=-1.5, method="nearest")
    place = int(np.flatnonzero(np.diff(column.values))[0])
    low, high = column.v.values[place : place + 2]
    first = label_of(column.x, low)
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if label_of(column.x, middle) == first else (low, middle)
    near = hybrid.stroboscopic_section(system, (float(column.x), low), periods=30, **TWO)
    orbits = [hybrid.periodic_orbit(system, x, periods=2, **TWO) for x in near.x[4:16:2]]
    saddle = next(each for each in orbits if each.status.ok and each.log_moduli[0] > 1e-3)
    assert saddle.log_moduli[1] < 0
    _, directions = np.linalg.eig(saddle.fundamental)
    unstable = directions[:, np.argmax(np.abs(np.linalg.eigvals(saddle.fundamental)))]
    sides = [label_of(*(saddle.x0 + sign * 1e-5 * unstable)) for sign in (-1, 1)]
    assert sides[0] != sides[1]


def test_starts_that_violate_every_mode(impacting):
    outside = impacting.x > 1.0
    assert (impacting.label.where(outside, -1) == -1).all()
    assert (impacting.label.where(~outside, 1) > 0).all()
    assert json.loads(impacting.attrs["violated_modes"]) == ["flight"]
    assert impacting.label.attrs["meaning of -1"] == "violates flight"


def test_labels_depend_neither_on_the_order_of_the_starts_nor_on_threads(impacting):
    system = models.impact_oscillator()
    random = np.random.default_rng(3)
    mixed = {"v": random.permutation(impacting.v.values), "x": impacting.x.values[::-1]}
    for options in ({"executor": 1}, {"executor": 3}):
        again = hybrid.basins(system, mixed, **TWO, **options)
        again = again.sortby("x").sortby("v").transpose("x", "v", ...)
        np.testing.assert_array_equal(again.label, impacting.label)
        np.testing.assert_array_equal(again.steps, impacting.steps)


def test_the_attractors_come_with_their_basins(impacting):
    assert impacting["round"].values.tolist() == [1, 2]
    assert impacting.jumps.values.tolist() == [0.0, 1.0]
    alone = hybrid.attractors(models.impact_oscillator(), {"x": (-3.0, 1.0), "v": (-3.0, 3.0)}, **TWO)
    for label, each in alone.items():
        points = impacting.points.sel(attractor=label).values[: each.round]
        np.testing.assert_allclose(points, each.points, atol=1e-4)
    # A start on an attractor belongs to it.
    x, v = alone[2].points[0]
    assert hybrid.basins(models.impact_oscillator(), {"x": [x], "v": [v]}, **TWO)["round"].values == [2]


def test_runs_that_end_have_a_status():
    found = hybrid.basins(models.bouncing_ball(), {"q": [0.5, 1.0, -1.0], "v": 0.0}, interval=0.5)
    assert found.label.values.tolist() == [0, 0, -1]
    assert found.status.values[:2].tolist() == [StatusCode.ACCUMULATION] * 2
    assert json.loads(found.attrs["fixed"]) == {"v": 0.0}


def test_the_mode_in_which_runs_start():
    """With ``start=`` or ``mode=`` only that mode counts, as for `simulate`; else the guards decide."""

    def system(**options):
        return hybrid.HybridSystem(
            state=("x",),
            modes=[
                hybrid.Mode("left", lambda t, x, p: (-1.0 - x.x,)),
                hybrid.Mode("right", lambda t, x, p: (1.0 - x.x,)),
            ],
            transitions=[
                hybrid.Transition("left", "right", hybrid.Guard(lambda t, x, p: x.x, +1)),
                hybrid.Transition("right", "left", hybrid.Guard(lambda t, x, p: x.x, -1)),
            ],
            **options,
        )

    over = {"x": [-2.0, -0.5, 0.5, 2.0]}
    assert hybrid.basins(system(), over).label.values.tolist() == [1, 1, 2, 2]
    started = hybrid.basins(system(start="right"), over)
    assert started.label.values.tolist() == [-1, -1, 1, 1]
    assert json.loads(started.attrs["violated_modes"]) == ["right"]
    assert hybrid.basins(system(), over, mode="left").label.values.tolist() == [1, 1, -1, -1]


def test_modes_of_plain_equations():
    """Parts of modes that the library has made, one of them only when a run needs it."""
    wells = hybrid.from_equations(lambda t, x, p: (np.sign(x.x) - x.x,), state=("x",))
    found = hybrid.basins(wells, {"x": np.linspace(-2.0, 2.0, 6)})
    assert found.label.values.tolist() == [1, 1, 1, 2, 2, 2]
    [name, *_] = {each.part_of for each in wells.modes if each.part_of}
    named = hybrid.basins(wells, {"x": np.linspace(-2.0, 2.0, 6)}, mode=name)
    assert named.label.values.tolist() == [1, 1, 1, 2, 2, 2]


def test_modes_by_their_guards():
    """Starts in the contact and outside it: both are modes of the same basin."""
    over = {"x1": np.linspace(-0.01, 0.06, 8), "x2": 0.05, "v1": 0.0, "v2": 0.0}
    found = hybrid.basins(models.vibroimpact(), over, periods=400)
    assert (found.label == 1).all()
    assert found.kind.values.tolist() == ["periodic"]


class Interrupted(ThreadPoolExecutor):
    """One thread; Ctrl-C is pressed as soon as it works."""

    def submit(self, *given):
        future = super().submit(*given)
        signal.raise_signal(signal.SIGINT)
        return future


def test_ctrl_c_keeps_the_lines_that_are_complete():
    over = {"x": np.linspace(-3.0, 1.0, 200), "v": np.linspace(-3.0, 3.0, 500)}
    # A process that runs tests for another one may ignore it.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with Interrupted(1) as pool:
            found = hybrid.basins(models.impact_oscillator(), over, **TWO, executor=pool)
    finally:
        signal.signal(signal.SIGINT, before)
    assert found.attrs["status"] == "INTERRUPTED"
    left = found.status == StatusCode.NOT_RUN
    assert left.any()
    np.testing.assert_array_equal(found.label > 0, ~left)


def test_a_store_holds_what_is_done(tmp_path):
    values = np.linspace(-2.0, 2.0, 10)
    path = tmp_path / "wells.zarr"
    first = hybrid.basins(double_well(), {"x": values}, store=path)
    again = hybrid.basins(double_well(), {"x": values}, store=path)
    np.testing.assert_array_equal(first.label, again.label)
    with pytest.raises(hybrid.ArgumentError, match="tolerance"):
        hybrid.basins(double_well(), {"x": values}, store=path, tolerance=0.02)


def test_names_that_results_have_are_refused():
    system = hybrid.HybridSystem(state=("label",), modes=[hybrid.Mode("m", lambda t, x, p: (-x.label,))])
    with pytest.raises(hybrid.ArgumentError, match="over: 'label' is also the name of a result"):
        hybrid.basins(system, {"label": [0.0, 1.0]})


def test_processes_give_the_same(impacting):
    over = {"x": impacting.x.values[::8], "v": impacting.v.values[::8]}
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        found = hybrid.basins(models.impact_oscillator(), over, **TWO, executor=pool)
    np.testing.assert_array_equal(found.label, impacting.label[::8, ::8])
