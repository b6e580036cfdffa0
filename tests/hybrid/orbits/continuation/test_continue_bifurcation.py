"""Curves of bifurcations in two parameters against closed forms."""

import numpy as np
import pytest

import hybrid.plot
import models
from hybrid import (
    ArgumentError,
    Guard,
    HybridSystem,
    Mode,
    Reset,
    Transition,
    continue_bifurcation,
    continue_orbit,
    periodic_orbit,
    simulate,
)


def once_per_unit(state, parameters, law):
    """A map as what a jump does once per unit of time."""
    return HybridSystem(
        state=("s", *state),
        parameters=parameters,
        modes=[Mode("on", lambda t, x, p: (1.0, *(0.0 for _ in state)))],
        transitions=[
            Transition(
                "on",
                "on",
                Guard(lambda t, x, p: x.s - 1.0, +1),
                Reset(lambda t, x, p: (0.0, *law(x, p))),
                name="tick",
            )
        ],
    )


def test_folds_of_a_cubic_map_meet_in_a_cusp():
    """``u -> a + b u - u^3``: folds at ``27 a^2 = 4 (b - 1)^3``, the cusp at (0, 1)."""
    system = once_per_unit(("u",), {"a": 0.0, "b": 1.5}, lambda x, p: (p.a + p.b * x.u - x.u**3,))
    orbit = periodic_orbit(system, (0.3, np.sqrt(0.5)), period=1.0)
    branch = continue_orbit(orbit, "a", (-1.0, 1.0))
    folds = [each for each in branch.bifurcations if each.kind == "fold"]
    assert sorted(each.value for each in folds) == pytest.approx(
        [-np.sqrt(4 * 0.125 / 27), np.sqrt(4 * 0.125 / 27)], abs=1e-10
    )
    curve = continue_bifurcation(folds[0], {"a": (-1.0, 1.0), "b": (0.0, 2.0)})
    assert curve.status.ok
    a, b = curve["a"], curve["b"]
    np.testing.assert_allclose(27 * a**2, 4 * (b - 1) ** 3, atol=1e-8)
    (cusp,) = (each for each in curve.points if each.kind == "cusp")
    assert list(cusp.values.values()) == pytest.approx([0.0, 1.0], abs=1e-6)
    assert a.min() < -0.3
    assert a.max() > 0.3


def test_flips_of_the_quadratic_map():
    """``u -> c - a u^2``: the period doubles where ``4 a c = 3``."""
    system = once_per_unit(("u",), {"a": 0.5, "c": 1.0}, lambda x, p: (p.c - p.a * x.u**2,))
    orbit = periodic_orbit(system, (0.4, np.sqrt(3.0) - 1.0), period=1.0)
    (flip,) = continue_orbit(orbit, "a", (0.4, 1.0)).bifurcations
    curve = continue_bifurcation(flip, {"a": (0.5, 1.5), "c": (0.4, 2.0)})
    np.testing.assert_allclose(4 * curve["a"] * curve["c"], 3.0, rtol=1e-9)
    assert curve["a"][[0, -1]] == pytest.approx([0.5, 1.5], abs=1e-9)
    np.testing.assert_allclose(np.abs(curve.multipliers + 1.0).min(axis=1), 0.0, atol=1e-8)


def turned(x, p):
    r2 = x.u**2 + x.v**2
    c, s = np.cos(2 * np.pi * p.turn), np.sin(2 * np.pi * p.turn)
    u, v = (p.m - r2) * x.u + 0.1 * x.u**2, (p.m - r2) * x.v
    return c * u - s * v, s * u + c * v


def test_a_torus_passes_its_resonances():
    """A rotation by ``turn`` with the factor ``m``: a torus at 1, resonant at a quarter and a third."""
    system = once_per_unit(("u", "v"), {"m": 0.9, "turn": 0.2}, turned)
    orbit = periodic_orbit(system, (0.4, 0.0, 0.0), period=1.0)
    (torus,) = continue_orbit(orbit, "m", (0.8, 1.2)).bifurcations
    assert torus.kind == "torus"
    curve = continue_bifurcation(torus, {"m": (0.8, 1.2), "turn": (0.1, 0.4)})
    assert curve.status.ok
    np.testing.assert_allclose(curve["m"], 1.0, atol=1e-9)
    found = {each.kind: each.values["turn"] for each in curve.points}
    assert found == pytest.approx({"1:4 resonance": 0.25, "1:3 resonance": 1 / 3}, abs=1e-9)


class TestResonancesAtTheEnds:
    """``(x, y) -> (y, a y + b x - y^3 / 10)``: at ``b = -1`` the pair has the sum ``a``."""

    @pytest.fixture(scope="class")
    @classmethod
    def torus(cls):
        system = once_per_unit(
            ("x", "y"), {"a": 0.5, "b": -0.5}, lambda x, p: (x.y, p.a * x.y + p.b * x.x - 0.1 * x.y**3)
        )
        orbit = periodic_orbit(system, (0.4, 0.0, 0.0), period=1.0)
        return continue_orbit(orbit, "b", (-1.5, 0.0)).bifurcations[0]

    def test_all_four_in_their_order(self, torus):
        curve = continue_bifurcation(torus, {"a": (-2.5, 2.5), "b": (-1.5, 0.0)})
        assert curve.status.ok
        points = sorted(curve.points, key=lambda each: each.values["a"])
        assert [*curve.points] in (points, points[::-1])
        assert [each.kind for each in points] == [f"1:{n} resonance" for n in (2, 3, 4, 1)]
        assert [each.values["a"] for each in points] == pytest.approx([-2.0, -1.0, 0.0, 2.0], abs=1e-8)
        assert [each.values["b"] for each in points] == pytest.approx([-1.0] * 4, abs=1e-8)
        assert [curve["a"].min(), curve["a"].max()] == pytest.approx([-2.0, 2.0], abs=1e-8)

    def test_a_range_that_ends_before_is_no_resonance(self, torus):
        """The next step would be beyond both ends."""
        curve = continue_bifurcation(torus, {"a": (-1.99, 1.99), "b": (-1.5, 0.0)})
        assert sorted(each.kind for each in curve.points) == ["1:3 resonance", "1:4 resonance"]
        assert [curve["a"].min(), curve["a"].max()] == pytest.approx([-1.99, 1.99], abs=1e-9)


def test_one_curve_has_both_tori_of_the_founding_system():
    """Its branch at P = 500 has two; the curve of one goes through the other."""
    system = models.vibroimpact()
    arc = simulate(system, (0.0, 0.02, 0.0, 0.0), (0.0, 600 * 2 * np.pi / 7.40))
    orbit = periodic_orbit(system, arc.x[-1], mode=str(arc.mode[-1]))
    first, second = continue_orbit(orbit, "omega", (6.5, 8.5)).bifurcations
    curve = continue_bifurcation(first, {"omega": (6.5, 8.5), "P": (100.0, 900.0)})
    assert curve.status.ok
    (end,) = curve.points
    assert end.kind == "1:1 resonance"
    omega, P = curve["omega"], curve["P"]
    across = (P[:-1] - 500.0) * (P[1:] - 500.0) < 0.0
    (i,) = np.flatnonzero(across & (omega[:-1] > 7.7))
    share = (500.0 - P[i]) / (P[i + 1] - P[i])
    assert omega[i] + share * (omega[i + 1] - omega[i]) == pytest.approx(second.value, abs=1e-3)


@pytest.fixture(scope="module")
def branch():
    orbit = periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    return continue_orbit(orbit, "w", (0.9, 2.0))


@pytest.fixture(scope="module")
def curve(branch):
    grazing = max((each for each in branch.bifurcations if each.kind == "grazing"), key=lambda b: b.value)
    return continue_bifurcation(grazing, {"w": (1.2, 2.0), "A": (0.5, 2.0)})


class TestGrazings:
    def test_the_free_motion_is_as_wide_as_the_gap(self, curve):
        """``(k - w^2)^2 + (c w)^2 = (A / d)^2``."""
        assert curve.status.ok
        w, A = curve["w"], curve["A"]
        np.testing.assert_allclose(np.hypot(1 - w**2, 0.1 * w), A, rtol=1e-9)
        assert A[[0, -1]].min() == pytest.approx(0.5, abs=1e-9)
        assert A[[0, -1]].max() == pytest.approx(2.0, abs=1e-9)

    def test_as_a_dataset_and_a_picture(self, curve):
        from matplotlib.figure import Figure

        dataset = curve.to_xarray()
        np.testing.assert_array_equal(dataset.A, curve["A"])
        ax = hybrid.plot.plot(curve, ax=Figure().subplots())
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("w", "A")

    def test_errors(self, branch, curve):
        fold = branch.bifurcations[0]
        for over, text in [
            ({"w": (1.0, 2.0)}, "over must map the names of two parameters"),
            ({"w": (1.0, 2.0), "q": (0.0, 1.0)}, "over: Parameter 'q' does not exist"),
            ({"w": (1.9, 2.0), "A": (0.5, 2.0)}, "over['w'] must be (low, high) around 1.75"),
        ]:
            with pytest.raises(ArgumentError) as caught:
                continue_bifurcation(fold, over)
            assert text in str(caught.value)
        with pytest.raises(ArgumentError, match="bifurcation must be"):
            continue_bifurcation(3, {"w": (1.0, 2.0), "A": (0.5, 2.0)})
        with pytest.raises(ArgumentError, match="Parameter 'q' does not exist"):
            curve["q"]
