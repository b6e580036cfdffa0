"""Branches of orbits against closed forms: points, folds, flips, tori, grazings."""

import numpy as np
import pytest
from scipy.optimize import brentq

import hybrid
import hybrid.plot
import lyapunov
import models
from hybrid import (
    ArgumentError,
    Branch,
    Guard,
    HybridSystem,
    Mode,
    Reset,
    Transition,
    continue_orbit,
    periodic_orbit,
    simulate,
    switch_branch,
)
from models.one_impact import one_impact_orbits


def kinds(branch):
    return [each.kind for each in branch.bifurcations]


@pytest.fixture(scope="module")
def impacts():
    """One impact per period, over the frequency of the forcing, and what goes on at either end."""
    orbit = periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    return continue_orbit(orbit, "w", (0.68, 2.0))


def one_impact(branch):
    """The orbits with one impact per period."""
    return [orbit for orbit in branch.orbits if orbit.transitions == ("impact",)]


def of_kind(branch, kind):
    return [each for each in branch.bifurcations if each.kind == kind]


class TestOneImpact:
    """Shaw and Holmes: the speed of the impact solves a quadratic equation."""

    def exact(self, w):
        return [orbit.V for orbit in one_impact_orbits(1.0, 0.1, 1.0, w, 1.0, 0.8)]

    def test_each_orbit_is_one_of_the_two(self, impacts):
        assert impacts.status.ok
        assert len(one_impact(impacts)) > 50
        for orbit in one_impact(impacts)[::5]:
            (V,) = orbit.arc().jumps.x_minus[:, 1]
            assert min(abs(V - each) for each in self.exact(orbit.parameters["w"])) < 1e-8

    def test_the_fold_is_where_both_are_one(self, impacts):
        fold = max(of_kind(impacts, "fold"), key=lambda each: each.value)
        low, high = 1.7, 1.8
        while high - low > 1e-13:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if len(self.exact(middle)) == 2 else (low, middle)
        assert fold.value == pytest.approx(low, abs=1e-10)
        assert np.abs(fold.orbit.multipliers - 1.0).min() < 1e-5
        assert "turns back" in str(fold)

    def test_the_impact_loses_its_speed_where_the_free_motion_is_as_wide_as_the_gap(self, impacts):
        """``(k - w^2)^2 + (c w)^2 = (A / d)^2``."""
        last = max(of_kind(impacts, "grazing"), key=lambda each: each.value)
        assert "loses its speed" in last.message
        assert last.value == pytest.approx(np.sqrt(1.99), abs=1e-10)
        assert sorted(last.stable) == [False, True]

    def test_beyond_it_the_motion_is_free(self, impacts):
        """Its amplitude is ``A / sqrt((k - w^2)^2 + (c w)^2)``, up to the end of the range."""
        free = [orbit for orbit in impacts.orbits if not orbit.transitions]
        values = [orbit.parameters["w"] for orbit in free]
        assert min(values) == pytest.approx(np.sqrt(1.99), abs=0.05)
        assert max(values) == pytest.approx(2.0, abs=1e-12)
        for orbit in free:
            w = orbit.parameters["w"]
            amplitude = np.hypot(orbit.x0[0], orbit.x0[1] / w)
            assert amplitude == pytest.approx(1 / np.hypot(1 - w**2, 0.1 * w), rel=1e-10)

    def test_a_second_impact_is_touched(self, impacts):
        """Below, the closed form has no orbit without a second touch."""
        first = min(of_kind(impacts, "grazing"), key=lambda each: each.value)
        assert "the guard of 'impact', which does not fire" in first.message
        low, high = 0.7, 0.71
        while high - low > 1e-11:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self.exact(middle) else (middle, high)
        assert first.value == pytest.approx(low, abs=1e-9)
        (other,) = {orbit.transitions for orbit in impacts.orbits if len(orbit.transitions) > 1}
        assert other == ("impact", "impact")

    def test_the_branch_from_another_orbit_is_the_same(self, impacts):
        i = len(impacts) // 2
        again = continue_orbit(impacts.orbit(i), "w", (0.68, 2.0))
        assert kinds(again) in (kinds(impacts), kinds(impacts)[::-1])
        values = [[each.value for each in branch.bifurcations] for branch in (impacts, again)]
        assert np.sort(values[0]) == pytest.approx(np.sort(values[1]), abs=1e-10)

    def test_stability_changes_at_bifurcations_alone(self, impacts):
        changes = np.flatnonzero(impacts.stable[1:] != impacts.stable[:-1])
        assert len(changes) == sum(each.stable[0] != each.stable[1] for each in impacts.bifurcations)

    def test_as_a_dataset(self, impacts):
        dataset = impacts.to_xarray()
        assert dataset.x0.dims == ("point", "state")
        np.testing.assert_array_equal(dataset.w, impacts.parameter)
        assert repr(impacts).startswith("<Branch w = 0.68")


def quadratic_map(start):
    """``u -> 1 - a u^2`` once per unit of time: one orbit for a > -1/4, whose period doubles at 3/4."""
    return HybridSystem(
        state=("s", "u"),
        parameters={"a": start},
        modes=[Mode("on", lambda t, x, p: (1.0, 0.0))],
        transitions=[
            Transition(
                "on",
                "on",
                Guard(lambda t, x, p: x.s - 1.0, +1),
                Reset(lambda t, x, p: (0.0, 1.0 - p.a * x.u**2)),
                name="tick",
            )
        ],
    )


@pytest.mark.parametrize(
    ("a", "u", "period", "span", "expected"),
    [
        (0.5, np.sqrt(3.0) - 1.0, 1.0, (-1.0, 1.0), {("fold", -0.25), ("flip", 0.75)}),
        (1.0, 0.0, 2.0, (0.8, 1.5), {("flip", 1.25)}),
    ],
)
def test_the_quadratic_map(a, u, period, span, expected):
    orbit = periodic_orbit(quadratic_map(a), (0.4, u), period=period)
    branch = continue_orbit(orbit, "a", span)
    assert branch.status.ok
    found = {(each.kind, round(each.value, 9)) for each in branch.bifurcations}
    assert found == expected
    np.testing.assert_allclose(branch.period, period, rtol=1e-12)


def test_what_folds_and_flips_begin():
    """``u = 2 - 2 e`` at ``a = (e^2 - 1) / 4``; beyond the flip ``u`` swings by ``sqrt(4 a - 3) / 2 a``."""
    orbit = periodic_orbit(quadratic_map(0.5), (0.4, np.sqrt(3.0) - 1.0), period=1.0)
    fold, flip = sorted(continue_orbit(orbit, "a", (-1.0, 1.0)).bifurcations, key=lambda each: each.value)
    assert fold.coefficient == pytest.approx(0.25, rel=1e-4)
    assert "on the side of larger a" in fold.message
    # u = 2 / 3 there.
    assert flip.coefficient == pytest.approx(0.25, rel=1e-2)
    assert "stable, on the side of larger a" in flip.message


def test_the_converter_doubles_its_period():
    converter = models.buck_converter()
    arc = simulate(converter, (12.0, 0.5, 0.0), (0.0, 0.08), mode="on", parameters={"E": 20.0})
    orbit = periodic_orbit(converter, arc.x[-1], mode=str(arc.mode[-1]), parameters={"E": 20.0})
    branch = continue_orbit(orbit, "E", (15.0, 30.0))
    (flip,) = branch.bifurcations
    assert flip.kind == "flip"
    assert flip.value == pytest.approx(24.51657, abs=5e-6)
    assert np.abs(flip.orbit.multipliers + 1.0).min() < 1e-9
    assert branch.stable[0] != branch.stable[-1]


def test_the_tori_of_the_founding_system():
    """At omega = 7.1 the phase 0 lies inside the contact; nothing happens to the orbit there."""
    system = models.vibroimpact()
    arc = simulate(system, (0.0, 0.02, 0.0, 0.0), (0.0, 600 * 2 * np.pi / 7.40))
    branch = continue_orbit(periodic_orbit(system, arc.x[-1], mode=str(arc.mode[-1])), "omega", (6.5, 8.5))
    assert branch.status.ok
    assert kinds(branch) == ["torus", "torus"]
    values = [each.value for each in branch.bifurcations]
    assert values == pytest.approx([7.4543975, 7.9929157], abs=2e-7)
    inside = (branch.parameter > values[0]) & (branch.parameter < values[1])
    np.testing.assert_array_equal(branch.stable, ~inside)
    assert set(branch.mode) == {"free", "contact"}


def test_a_pitchfork_is_a_branch_point():
    """``x' = b x - x^3``: at ``b = 0`` two orbits leave ``x = 0``, whose multiplier is ``exp(b)``."""
    fork = HybridSystem(
        state=("x", "y"),
        parameters={"b": -0.5},
        modes=[Mode("m", lambda t, x, p: (p.b * x.x - x.x**3, np.cos(2 * np.pi * t) - x.y))],
        period=1.0,
    )
    branch = continue_orbit(periodic_orbit(fork, (0.0, 0.0)), "b", (-1.0, 1.0))
    (point,) = branch.bifurcations
    assert point.kind == "branch point"
    assert point.value == pytest.approx(0.0, abs=1e-10)
    np.testing.assert_array_equal(branch.stable, branch.parameter < 0.0)


def test_errors():
    orbit = periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    for given, text in [
        (("ww", (0.5, 1.5)), "parameter: Parameter 'ww' does not exist"),
        (("w", (1.5, 2.0)), "span must be (low, high) around w = 1.0"),
        (("w", 3.0), "span must be (low, high)"),
    ]:
        with pytest.raises(ArgumentError) as caught:
            continue_orbit(orbit, *given)
        assert text in str(caught.value)
    with pytest.raises(ArgumentError, match="orbit must be"):
        continue_orbit(3, "w", (0.5, 1.5))
    branch = continue_orbit(orbit, "w", (0.95, 1.05))
    assert isinstance(branch, Branch)
    with pytest.raises(ArgumentError, match="i must be a whole number"):
        branch.orbit(10_000)


def test_brackets_of_the_range_belong_to_the_branch():
    orbit = periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    branch = continue_orbit(orbit, "w", (0.95, 1.05))
    assert branch.parameter[[0, -1]] == pytest.approx([0.95, 1.05], abs=1e-12)
    assert brentq(lambda w: w - 1.0, branch.parameter[0], branch.parameter[-1]) == 1.0


class TestSensitivity:
    """Derivatives of orbits against those of neighbouring orbits."""

    def test_a_forced_orbit(self):
        system = models.impact_oscillator()
        orbit = periodic_orbit(system, (0.9, 1.0))
        found = orbit.sensitivity(("w", "r", "d"))
        assert found.period == pytest.approx([-2 * np.pi, 0.0, 0.0], rel=1e-12)
        for j, (name, value) in enumerate((("w", 1.0), ("r", 0.8), ("d", 1.0))):
            ends = [periodic_orbit(system, orbit.x0, parameters={name: value + h}) for h in (1e-5, -1e-5)]
            np.testing.assert_allclose(found.x0[:, j], (ends[0].x0 - ends[1].x0) / 2e-5, rtol=1e-6)
            multipliers = (ends[0].multipliers - ends[1].multipliers) / 2e-5
            np.testing.assert_allclose(found.multipliers[:, j], multipliers, rtol=1e-4)

    def test_an_autonomous_orbit(self):
        """The speed of the belt changes the period of stick and slip."""
        system = models.stick_slip()
        arc = simulate(system, (1.0, 0.2), (0.0, 61.0), mode="sliding")
        orbit = periodic_orbit(system, arc.x[-1], mode=str(arc.mode[-1]), period=12.0)
        ends = [
            periodic_orbit(system, orbit.x0, mode=orbit.mode, period=12.0, parameters={"belt": 0.2 + h})
            for h in (1e-5, -1e-5)
        ]
        found = orbit.sensitivity(("belt",)).period
        assert found == pytest.approx([(ends[0].period - ends[1].period) / 2e-5], rel=1e-7)

    def test_errors(self):
        orbit = periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
        with pytest.raises(ArgumentError, match="Parameter 'ww' does not exist"):
            orbit.sensitivity(("ww",))


def test_the_walker_doubles_its_step():
    """Published: 0.0151."""
    walker, angle, rate = models.simplest_walker(), 0.200310900544, -0.199832473005
    start = (angle, 2 * angle, rate, rate * (1 - np.cos(2 * angle)))
    orbit = periodic_orbit(walker, start, mode="behind", period=3.88)
    branch = continue_orbit(orbit, "gamma", (0.005, 0.018))
    (flip,) = branch.bifurcations
    assert flip.kind == "flip"
    assert flip.value == pytest.approx(0.01508844, abs=5e-9)


def test_a_picture(impacts):
    from matplotlib.figure import Figure

    ax = Figure().subplots()
    hybrid.plot.plot(impacts, ax=ax)
    assert ax.get_xlabel() == "w"
    labels = {text.get_text() for text in ax.get_legend().get_texts()}
    assert labels == {"stable", "unstable", "fold", "grazing"}


class TestSwitching:
    def test_at_a_flip_to_twice_the_period(self):
        """The orbit of period two of the quadratic map, ``a^2 u^2 - a u + 1 = a``, doubles at 5/4."""
        orbit = periodic_orbit(quadratic_map(0.5), (0.4, np.sqrt(3.0) - 1.0), period=1.0)
        flip = continue_orbit(orbit, "a", (0.3, 1.0)).bifurcations[-1]
        doubled = switch_branch(flip)
        assert doubled.period == pytest.approx(2.0, rel=1e-12)
        assert doubled.transitions == ("tick", "tick")
        a, u = doubled.parameters["a"], doubled.x0[1]
        assert a**2 * u**2 - a * u + 1.0 - a == pytest.approx(0.0, abs=1e-9)
        branch = continue_orbit(doubled, "a", (0.7, 1.4))
        assert kinds(branch) == ["flip", "flip"]
        assert [each.value for each in branch.bifurcations] == pytest.approx([0.75, 1.25], abs=1e-9)

    def test_at_a_branch_point(self):
        """The other orbits of the pitchfork have ``x^2 = b``."""
        fork = HybridSystem(
            state=("x", "y"),
            parameters={"b": -0.5},
            modes=[Mode("m", lambda t, x, p: (p.b * x.x - x.x**3, np.cos(2 * np.pi * t) - x.y))],
            period=1.0,
        )
        (point,) = continue_orbit(periodic_orbit(fork, (0.0, 0.0)), "b", (-1.0, 1.0)).bifurcations
        other = switch_branch(point)
        assert abs(other.x0[0]) == pytest.approx(0.02, abs=0.005)
        assert other.x0[0] ** 2 == pytest.approx(other.parameters["b"], abs=1e-9)

    def test_errors(self, impacts):
        fold = of_kind(impacts, "fold")[0]
        with pytest.raises(ArgumentError, match="bifurcation is a fold, where no other branch"):
            switch_branch(fold)


class TestMultipleShooting:
    def test_errors_may_grow_beyond_all_digits(self):
        """``x' = k (x - cos t)`` has one orbit, whose multiplier is ``exp(2 pi k)``."""
        system = HybridSystem(
            state=("x",),
            parameters={"k": 1.0},
            modes=[Mode("m", lambda t, x, p: (p.k * (x.x - np.cos(t)),))],
            period=2 * np.pi,
        )
        branch = continue_orbit(periodic_orbit(system, (0.5,)), "k", (0.5, 12.0))
        assert branch.status.ok
        k = branch.parameter
        np.testing.assert_allclose(branch.x0[:, 0], k**2 / (1 + k**2), rtol=1e-11)
        np.testing.assert_allclose(branch.multipliers[:, 0], np.exp(2 * np.pi * k), rtol=1e-10)
        assert branch.multipliers[-1, 0] > 1e32

    def test_an_orbit_whose_bounces_accumulate(self):
        """The number of bounces before the rest is no property of the orbit; the rest forgets all."""
        table = models.bouncing_table()
        arc = simulate(table, (0.02, 0.0), (0.0, 100 * table.forcing_period()), mode="flight")
        orbit = periodic_orbit(table, arc.x[-1], mode=str(arc.mode[-1]))
        branch = continue_orbit(orbit, "A", (0.008, 0.0115))
        assert branch.status.ok
        np.testing.assert_allclose(np.abs(branch.multipliers), 0.0, atol=1e-12)
        for i in (0, -1):
            arc = branch.orbit(i).arc()
            assert "limit" in arc.jumps.kind
            np.testing.assert_allclose(arc.x[-1], arc.x[0], atol=1e-12)


class TestScaling:
    def test_a_scaled_parameter_scales_the_branch(self, impacts):
        """The gap and the amplitude in other units: the same frequencies, states ten times as large."""
        system = models.impact_oscillator()
        parameters = {"d": 10.0, "A": 10.0}
        orbit = periodic_orbit(system, (9.0, 10.0), parameters=parameters)
        branch = continue_orbit(orbit, "w", (0.68, 2.0))
        assert kinds(branch) == kinds(impacts)
        values = [[each.value for each in one.bifurcations] for one in (branch, impacts)]
        assert values[0] == pytest.approx(values[1], abs=1e-9)

    def test_multipliers_of_neighbours_join(self, impacts):
        """But where a guard is touched, the product of the multipliers changes little from orbit to orbit."""
        orbits = one_impact(impacts)
        products = np.array([np.prod(orbit.multipliers).real for orbit in orbits])
        # Damping and restitution: ``r^2 exp(-c T)``, whatever the speed.
        exact = [0.8**2 * np.exp(-0.1 * orbit.period) for orbit in orbits]
        np.testing.assert_allclose(products, exact, rtol=1e-7)


def test_a_picture_over_a_chart(impacts):
    chart = lyapunov.chart(models.impact_oscillator(), {"w": [0.9, 1.0]}, (0.0, 0.0), intervals=5, section=3)
    ax = hybrid.plot.plot_branch(impacts, "v", over=chart)
    assert ax.get_ylabel() == "v"
    assert len(ax.collections[0].get_offsets()) == 6
    assert hybrid.plot.plot_branch(impacts, over=ax) is ax
    other = lyapunov.chart(models.impact_oscillator(), {"c": [0.1, 0.2]}, (0.0, 0.0), intervals=5, section=3)
    with pytest.raises(ArgumentError, match="over must be a chart over 'w'"):
        hybrid.plot.plot_branch(impacts, over=other)
