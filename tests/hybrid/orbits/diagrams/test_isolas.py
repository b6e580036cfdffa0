"""Branches that no bifurcation joins to the start, found from what a sweep has seen, against closed forms."""

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")

import matplotlib.pyplot as plt

import models
from hybrid import (
    ArgumentError,
    Every,
    HybridSystem,
    Mode,
    Reset,
    Transition,
    basin_fractions,
    continue_all,
    equilibrium,
    open_diagram,
    periodic_orbit,
)
from hybrid.measures import amplitude, maximum
from hybrid.orbits.diagrams import walker
from hybrid.orbits.diagrams.same import is_known
from hybrid.plot import plot
from models.one_impact import one_impact_orbits

OVER = {"x": (-2.0, 0.9), "v": (-2.0, 2.0)}


@pytest.fixture(scope="module")
def impacts():
    """Between 2.2177 and 2.7726 the oscillator may hit its stop once in two periods, or not at all."""
    system = models.impact_oscillator()
    seen = basin_fractions(system, OVER, along={"w": np.linspace(1.5, 3.1, 9)}, starts=10, periods=300)
    start = periodic_orbit(system, (0.1, 0.0), parameters={"w": 1.5})
    outputs = {"width": amplitude("x"), "hits": lambda arc: len(arc.jumps)}
    return continue_all(start, "w", (1.4, 3.0), sweep=seen, outputs=outputs)


def test_an_isola_of_impacts_in_closed_form(impacts):
    assert len(impacts) == 2
    isola = impacts[1]
    assert isola.closed
    assert not impacts[0].closed
    assert impacts.origins[1] is None
    assert ", 1 closed," in repr(impacts)
    assert len(isola.of("fold")) == 2
    for i in range(0, len(isola), 7):
        orbit = isola.orbit(i)
        (jump,) = orbit.arc().jumps
        closed = [each.V for each in one_impact_orbits(**orbit.parameters, n=2)]
        assert min(abs(each - jump.x_minus[1]) for each in closed) < 1e-8
    low, high = sorted(each.value for each in isola.of("fold"))
    others = {"k": 1.0, "c": 0.1, "A": 1.0, "d": 1.0, "r": 0.8, "n": 2}
    counts = [
        len(one_impact_orbits(w=w, **others)) for w in (low - 1e-6, low + 1e-6, high - 1e-6, high + 1e-6)
    ]
    assert counts == [0, 2, 2, 0]


def test_each_attractor_is_on_its_branch(impacts):
    sweep = impacts.sweep
    assert sweep.w.max() <= 3.0
    there = sweep["kind"].values != ""
    np.testing.assert_array_equal(sweep["branch"].values >= 0, there)
    np.testing.assert_array_equal(sweep["branch"].values == 1, sweep["round"].values == 2)
    # Once around an orbit there is one impact in two periods, or none, or one in each.
    hits = sweep["reached"].sel(measured="hits").values[..., 0]
    assert set(hits[there].tolist()) == {0.0, 1.0}
    assert impacts.notes == ()
    assert impacts.status.ok


def test_what_the_sweep_has_reached_is_drawn_below_the_branches(impacts):
    try:
        for y, count in (("width", 1), ("x", 2)):
            ax = plot(impacts, y=y)
            (dots,) = ax.collections
            at = dots.get_offsets()
            periods = impacts.sweep["round"].values
            assert len(at) == sum(1 if count == 1 else each for each in periods[periods > 0])
            assert "sweep" in ax.get_legend_handles_labels()[1]
    finally:
        plt.close("all")


def test_a_diagram_with_a_sweep_is_opened_again(impacts):
    again = open_diagram(impacts.system, impacts.to_xarray())
    assert repr(again) == repr(impacts)
    assert again.to_xarray().drop_attrs().equals(impacts.to_xarray().drop_attrs())
    assert again.outputs == {"width": amplitude("x"), "hits": None}
    assert again[1].closed
    assert [str(each) for each in again.bifurcations] == [str(each) for each in impacts.bifurcations]
    changed = impacts.to_xarray()
    changed["period"] = changed["period"] + 1.0
    with pytest.raises(ArgumentError, match="saved is not what was saved: 'period' is damaged or changed"):
        open_diagram(impacts.system, changed)
    with pytest.raises(ArgumentError, match="saved must be the dataset of a diagram"):
        open_diagram(impacts.system, impacts[0].to_xarray())
    with pytest.raises(
        ArgumentError, match=r"a diagram of a system with the states x, v; got a system with q, v"
    ):
        open_diagram(models.bouncing_ball(), impacts.to_xarray())


def test_cycles_on_an_isola_in_closed_form():
    """Radii with ``(r^2 - 4)^2 + a^2 = 1 / 4``, around an equilibrium that is always stable."""

    def field(t, x, p):
        squared = x.x**2 + x.y**2
        rate = 0.25 - p.a**2 - (squared - 4.0) ** 2
        return rate * x.x - x.y, rate * x.y + x.x

    system = HybridSystem(state=("x", "y"), parameters={"a": 0.0}, modes=[Mode("flow", field)])
    seen = basin_fractions(system, {"x": (0.0, 3.0), "y": 0.0}, along={"a": [-0.7, -0.3, 0.4]}, starts=6)
    diagram = continue_all(equilibrium(system, (0.1, 0.1)), "a", (-1.0, 1.0), sweep=seen)
    assert len(diagram) == 2
    rest, isola = diagram
    np.testing.assert_allclose(rest.x, 0.0, atol=1e-12)
    assert isola.closed
    squared = np.sum(isola.x0**2, axis=1)
    np.testing.assert_allclose((squared - 4.0) ** 2 + isola.parameter**2, 0.25, atol=1e-9)
    np.testing.assert_array_equal(isola.stable[1:-1], squared[1:-1] > 4.0)
    assert sorted(each.value for each in isola.of("fold")) == pytest.approx([-0.5, 0.5], abs=1e-9)
    assert sorted(set(diagram.sweep["branch"].values.ravel().tolist())) == [-1, 0, 1]


def test_a_pendulum_turns_where_its_rest_ends():
    """Rests whole turns apart are one. Rotations begin at the fold, where their period is infinite."""
    system = HybridSystem(
        state=("phi", "w"),
        parameters={"c": 4.0, "T": 0.5},
        modes=[Mode("turns", lambda t, x, p: (x.w, p.T - p.c * x.w - np.sin(x.phi)))],
        angles={"phi": 2.0 * np.pi},
    )
    over = {"phi": (-3.0, 3.0), "w": 0.0}
    seen = basin_fractions(system, over, along={"T": [-0.5, 0.5, 2.0]}, starts=2, interval=1.0)
    outputs = {"high": maximum("phi"), "wide": amplitude("w"), "long": lambda arc: arc.t[-1] - arc.t[0]}
    diagram = continue_all(
        equilibrium(system, (0.5, 0.0)), "T", (-0.9, 2.5), sweep=seen, outputs=outputs, max_steps=300
    )
    np.testing.assert_array_equal(diagram.sweep["branch"].values[:, 2], [0, 0, 1])
    rest, rotations = diagram
    assert rest.of("fold")[0].value == pytest.approx(1.0, abs=1e-9)
    assert rotations.parameter.min() == pytest.approx(1.0, abs=1e-3)
    assert rotations.period.max() > 100.0
    high, wide, long = diagram.sweep["reached"].values[..., 2, 0]
    assert np.sin(high[:2]) == pytest.approx([-0.5, 0.5], abs=1e-9)
    np.testing.assert_array_equal(wide[:2], 0.0)
    np.testing.assert_array_equal(np.isnan(long), [True, True, False])


def logistic():
    """``u -> a u (1 - u)``, once per unit of time."""
    return HybridSystem(
        state=("u",),
        parameters={"a": 2.8},
        modes=[Mode("on", lambda t, x, p: (0.0,))],
        transitions=[
            Transition("on", "on", Every(1.0), Reset(lambda t, x, p: (p.a * x.u * (1.0 - x.u),)), name="tick")
        ],
        period=lambda p: 1.0,
    )


def test_windows_are_followed_and_chaos_is_listed():
    """Of the logistic map: the orbits of period three begin at ``1 + sqrt(8)``."""
    system, values = logistic(), [2.8, 3.2, 3.83, 3.835, 3.9, 3.91]
    seen = basin_fractions(system, {"u": (0.2, 0.8)}, along={"a": values}, starts=4)
    start = periodic_orbit(system, (9.0 / 14.0,))
    diagram = continue_all(start, "a", (2.5, 3.95), sweep=seen, depth=1, outputs={"top": maximum("u")})
    single, double, triple = diagram[0], diagram[1], diagram[2]
    np.testing.assert_allclose(single["u"], 1.0 - 1.0 / single.parameter, atol=1e-9)
    assert single.of("flip")[0].value == pytest.approx(3.0, abs=1e-8)
    assert double.of("flip")[-1].value == pytest.approx(1.0 + np.sqrt(6.0), abs=1e-8)
    (fold,) = triple.of("fold")
    assert fold.value == pytest.approx(1.0 + np.sqrt(8.0), abs=1e-8)
    assert [None if each is None else each.branch for each in diagram.origins[:3]] == [None, 0, None]
    told = "Seen in the sweep and on no branch: chaotic motion, a = 3.9 to 3.91 (2 values)."
    assert told in diagram.notes
    assert diagram.status.message.endswith("See .notes for what was not followed.")
    # The values of one period from points of the chaotic motion.
    reached = diagram.sweep["reached"].sel(measured="top", a=3.9).values
    assert np.isfinite(reached).sum() > 20
    few = continue_all(start, "a", (2.5, 3.95), sweep=seen, depth=0, most=2)
    assert "attractors of the sweep. Raise most=." in str(few.status)


def test_a_sweep_that_does_not_fit_is_refused(impacts):
    system, span = models.impact_oscillator(), (1.4, 3.0)
    start = periodic_orbit(system, (0.1, 0.0), parameters={"w": 1.5})

    def seen(along=None, **options):
        return basin_fractions(system, OVER, along=along or {"w": [1.6]}, starts=2, periods=20, **options)

    fixed = {"parameters": {"w": 1.6}}
    refused = {
        r"sweep must be over 'w', the parameter of the diagram; it is over c": seen({"c": [0.1]}, **fixed),
        r"sweep must be over 'w'.* over no parameter": basin_fractions(system, OVER, starts=2, **fixed),
        r"sweep has no value of 'w' within the span": seen(along={"w": [5.0]}),
        r"sweep has other parameters than the start: r = 0.5 and 0.8": seen(parameters={"r": 0.5}),
        r"points at the phase of t0 = 1, and the start at that of 0": seen(t0=1.0),
        r"sweep is one of another model": seen().assign_attrs(model_hash="0"),
        r"sweep: its points are on a surface": seen().assign_attrs(section="Guard(...)"),
        r"sweep must be a dataset of basin_fractions": 3.0,
    }
    for text, given in refused.items():
        with pytest.raises(ArgumentError, match=text):
            continue_all(start, "w", span, sweep=given)


def test_a_branch_whose_start_was_not_known_again_is_left_out(impacts, monkeypatch):
    calls = []

    def forgetful(found, branch, solver):
        calls.append(branch)
        return len(calls) > 1 and is_known(found, branch, solver)

    monkeypatch.setattr(walker, "is_known", forgetful)
    starts = [impacts[0].orbit(4), impacts[0].orbit(8)]
    diagram = continue_all(starts, "w", (1.4, 3.0), depth=0)
    assert len(diagram) == 1
    assert diagram.notes == ("A start on branch 0 was not known as one: its branch is left out.",)


def test_starts_on_a_known_branch_add_none(impacts):
    system = models.impact_oscillator()
    isola = impacts[1].orbit(3)
    first = periodic_orbit(system, (0.1, 0.0), parameters={"w": 1.5})
    second = periodic_orbit(system, impacts[0].orbit(5).x0, parameters=impacts[0].orbit(5).parameters)
    diagram = continue_all([first, isola, second, impacts[1].orbit(9)], "w", (1.4, 3.0), depth=0)
    assert [each.closed for each in diagram] == [False, True]
    other = periodic_orbit(system, (0.1, 0.0), parameters={"w": 1.5, "r": 0.7})
    with pytest.raises(ArgumentError, match=r"start\[1\] has r = 0.7, and start\[0\] has r = 0.8: all"):
        continue_all([first, other], "w", (1.4, 3.0))
    lost = periodic_orbit(system, (0.1, 0.0), parameters={"w": 1.5}, max_iterations=0)
    with pytest.raises(ArgumentError, match=r"start\[1\] has not converged: Newton's method"):
        continue_all([first, lost], "w", (1.4, 3.0))
    with pytest.raises(ArgumentError, match=r"start\[1\] is one of another system"):
        continue_all([first, equilibrium(models.relief_valve(), (2.5, 0.0, 12.5))], "w", (1.4, 3.0))
