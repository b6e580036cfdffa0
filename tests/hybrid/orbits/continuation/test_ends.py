"""A branch is one curve: each step is the next point of it, and each end has a name."""

import collections

import numpy as np
import pytest
from scipy.optimize import brentq

import models
from hybrid import (
    Every,
    Guard,
    HybridSystem,
    Mode,
    Reset,
    Transition,
    continue_orbit,
    filippov,
    from_equations,
    periodic_orbit,
    simulate,
    switch_branch,
)
from tests.hybrid.orbits.traffic import traffic_light


def clocked(state, image, parameters, **options):
    """A map of the state, once per unit of time."""
    return HybridSystem(
        state=state,
        parameters=parameters,
        period=1.0,
        modes=[Mode("wait", lambda t, x, p: (0.0,) * len(state))],
        transitions=[Transition("wait", "wait", Every(1.0), Reset(image))],
        **options,
    )


@pytest.mark.parametrize("span", [(-0.2, 0.2), (-0.9, 0.9), (-0.9, 0.3)])
def test_a_branch_does_not_go_over_a_jump_of_a_reset(span):
    """A leaky sigma-delta modulator: the orbit of two points exists for ``abs(u) < (1 - a) / (1 + a)``."""
    modulator = clocked(
        ("x",),
        lambda t, x, p: (p.a * x.x + p.u + np.where(x.x < 0, 1.0, -1.0),),
        {"a": 0.8, "u": 0.02},
    )
    branch = continue_orbit(periodic_orbit(modulator, (0.65,), periods=2), "u", span)
    np.testing.assert_allclose(branch.parameter[[0, -1]], [-1 / 9, 1 / 9], atol=1e-4)


def test_a_tongue_closes_after_a_turn_of_the_phase():
    """``v' = I`` up to ``1 + k sin(2 pi t)``: a spike per period for ``abs(I - 1) <= k``, at every phase."""
    neuron = HybridSystem(
        state=("v",),
        parameters={"I": 1.02, "k": 0.1},
        period=1.0,
        modes=[Mode("up", lambda t, x, p: (p.I,))],
        transitions=[
            Transition(
                "up",
                "up",
                Guard(lambda t, x, p: x.v - 1 - p.k * np.sin(2 * np.pi * t), +1),
                Reset(lambda t, x, p: (0.0,)),
            )
        ],
    )
    orbit = periodic_orbit(neuron, simulate(neuron, (0.0,), (0.0, 60.0)).x[-1])
    branch = continue_orbit(orbit, "I", (0.5, 1.6))
    assert "closed" in branch.status.message
    assert sorted(each.value for each in branch.bifurcations) == pytest.approx([0.9, 1.1], abs=1e-9)


def test_a_curve_of_angles_closes_after_a_turn():
    """The dissipative standard map has fixed points for ``W = m - K sin(f)``."""
    b, K, m = 0.3, 0.8, 2 * np.pi * 0.7
    standard = clocked(
        ("f", "y"),
        lambda t, x, p: (
            x.f + p.b * x.y + p.W + p.K * np.sin(x.f),
            p.b * x.y + p.W + p.K * np.sin(x.f),
        ),
        {"b": b, "K": K, "W": m + 0.1},
        angles={"f": 2 * np.pi},
    )
    branch = continue_orbit(periodic_orbit(standard, (3.0, 6.28)), "W", (2.0, 7.0))
    assert "closed" in branch.status.message
    assert sorted(each.value for each in branch.bifurcations) == pytest.approx([m - K, m + K], abs=1e-8)


def test_a_wide_span_gives_what_narrow_ones_give():
    """A gear pair with backlash and a bearing, through a grazing and four folds."""

    def pair(t, s, p):
        d = s.x - s.y
        gap = np.where(d > 1, d - 1, np.where(d < -1, d + 1, 0.0))
        mesh = 2 * p.z * (s.u - s.w) + (1 + p.eps * np.cos(p.Om * t)) * gap
        force = p.Fm + p.Fa * np.cos(p.Om * t)
        return s.u, force - mesh, s.w, p.m * mesh - 2 * p.zb * s.w - p.kb * s.y

    values = {"z": 0.05, "eps": 0.2, "Om": 0.9, "Fm": 0.1, "Fa": 0.05, "m": 0.3, "zb": 0.05, "kb": 1.5}
    gear = from_equations(
        pair, state=("x", "u", "y", "w"), period=lambda p: 2 * np.pi / p.Om, parameters=values
    )
    settled = simulate(gear, (1.1, 0, 0, 0), (0, 300 * 2 * np.pi / 0.9))
    orbit = periodic_orbit(gear, settled.x[-1], mode=str(settled.mode[-1]))
    spans = ((0.3, 0.9), (0.8, 1.6), (0.3, 1.6))
    left, right, whole = (continue_orbit(orbit, "Om", span) for span in spans)
    assert left.status.ok
    assert right.status.ok
    assert whole.status.ok
    for part, low, high in ((left, 0.3, 0.9), (right, 0.9, 1.6)):
        found, wanted = (
            sorted((each.kind, each.value) for each in branch.bifurcations if low < each.value < high)
            for branch in (part, whole)
        )
        assert [kind for kind, _ in found] == [kind for kind, _ in wanted]
        np.testing.assert_allclose([at for _, at in found], [at for _, at in wanted], rtol=1e-7)


def test_a_period_that_grows_without_bound_ends_a_branch():
    """``x -> e + x**2`` at a saddle: the period is ``-log(x)``, and infinite at ``e = 0``."""
    saddle = HybridSystem(
        state=("x", "y"),
        parameters={"e": 0.2},
        modes=[Mode("f", lambda t, x, p: (x.x, -2.0 * x.y))],
        transitions=[
            Transition("f", "f", Guard(lambda t, x, p: x.x - 1, +1), Reset(lambda t, x, p: (x.y + p.e, 1.0)))
        ],
    )
    x = (1 - np.sqrt(0.2)) / 2
    branch = continue_orbit(periodic_orbit(saddle, (x, 1.0), period=-np.log(x)), "e", (-0.5, 0.5))
    assert "an orbit whose period grows without bound" in branch.status.message
    assert abs(branch.parameter[0]) < 1e-6
    # The orbit returns to x where e = x - x**2.
    x = np.exp(-branch.period)
    np.testing.assert_allclose(branch.parameter, x - x**2, atol=1e-9)
    assert [each.kind for each in branch.bifurcations] == ["fold"]
    assert branch.bifurcations[0].value == pytest.approx(0.25, abs=1e-9)


def test_a_family_at_one_value_of_the_parameter_is_named_once():
    """At a traffic light, every queue of 15 cars or more is periodic where half of the cars arrive."""
    branch = continue_orbit(periodic_orbit(traffic_light(), (3.0,), mode="green"), "lam", (0.05, 0.6))
    assert branch.status.ok
    assert "fold" not in [each.kind for each in branch.bifurcations]
    assert "orbits that all have one value of the parameter" in branch.status.message
    assert branch.parameter.max() == pytest.approx(0.5, abs=1e-9)


def test_what_is_listed_lies_in_the_span_on_an_orbit_that_closes():
    """A driven mass carries a free mass between two walls."""

    def swap(t, x, p):
        mean, rel = (x.v + p.mu * x.u) / (1 + p.mu), -p.e * (x.u - x.v)
        return {"v": mean - p.mu * rel / (1 + p.mu), "u": mean + rel / (1 + p.mu)}

    damper = HybridSystem(
        state=("x", "y", "v", "u"),
        parameters={"z": 0.02, "A": 0.1, "w": 1.0, "mu": 0.1, "e": 0.7, "d": 1.0},
        modes=[Mode("free", lambda t, x, p: (x.v, x.u, p.A * np.cos(p.w * t) - 2 * p.z * x.v - x.x, 0.0))],
        transitions=[
            Transition(
                "free", "free", Guard(lambda t, x, p: x.y - x.x - p.d / 2, +1), Reset(swap), name="right"
            ),
            Transition(
                "free", "free", Guard(lambda t, x, p: x.y - x.x + p.d / 2, -1), Reset(swap), name="left"
            ),
        ],
        period=lambda p: 2 * np.pi / p.w,
    )
    settled = simulate(damper, (0.0, 0.0, 0.1, 0.5), (0.0, 300 * 2 * np.pi))
    orbit = periodic_orbit(damper, settled.x[-1], periods=2)
    branch = continue_orbit(orbit, "w", (0.97, 1.03))
    assert branch.status.ok
    assert len(branch.bifurcations) > 0
    for each in branch.bifurcations:
        assert 0.97 <= each.value <= 1.03
        assert each.orbit.residual < 1e-6


@pytest.mark.parametrize("span", [(0.04, 0.3), (0.06, 0.1)])
def test_a_branch_ends_at_a_homoclinic_orbit(span):
    """The rimless wheel has multipliers 1 and ``cos(2 alpha)^2`` down to where it stops upright."""
    branch = continue_orbit(periodic_orbit(models.rimless_wheel(), (0.0, 0.6), period=1.0), "gamma", span)
    a = np.pi / 8

    def spare(gamma):
        return np.sin(a) * np.sin(gamma) * 4 / np.tan(2 * a) ** 2 - 2 * (1 - np.cos(gamma - a))

    end = brentq(spare, 0.01, 0.3)
    assert "period grows without bound" in branch.status.message
    np.testing.assert_allclose(branch.parameter[[0, -1]], [end, span[1]], rtol=1e-7)
    np.testing.assert_allclose(np.abs(branch.multipliers), [[1.0, 0.5]] * len(branch), rtol=1e-3)
    assert branch.bifurcations == ()


def test_a_closed_branch_is_walked_once():
    """It comes back to its first orbit with another jump first: once at the first point, and once more."""
    stop, p = models.stop_oscillator(), {"F0": 0.5, "A": 2.0}
    run = simulate(stop, (0.1, 0.5), (0.0, 600 * np.pi), parameters=p)
    orbit = periodic_orbit(stop, run.x[-1], mode=str(run.mode[-1]), parameters=p)
    branch = continue_orbit(orbit, "w", (0.5, 2.5))
    assert "it is closed" in branch.status.message
    np.testing.assert_allclose(branch.x0[0], branch.x0[-1], atol=1e-8)
    # The orbit loses its symmetry at two branch points; each bifurcation between has a mirror image.
    kinds = collections.Counter(each.kind for each in branch.bifurcations)
    assert kinds == {"grazing": 4, "fold": 2, "flip": 2, "branch point": 2}


@pytest.mark.parametrize("low", [0.4, 0.5, 0.6])
def test_a_change_at_a_place_of_the_walk_itself(low):
    """The circle touches the surface ``x = c`` at ``c = 1``, where halvings of a step from 1.2 may end."""
    system = filippov(
        state=("x", "y"),
        parameters={"c": 1.2},
        below=lambda t, x, p: (
            x.x * (1 - x.x**2 - x.y**2) - x.y,
            x.y * (1 - x.x**2 - x.y**2) + x.x,
        ),
        above=lambda t, x, p: (-1.0, 0.0),
        switching=lambda t, x, p: x.x - p.c,
    )
    orbit = periodic_orbit(system, (0.0, 1.0), mode="below", period=6.28)
    branch = continue_orbit(orbit, "c", (low, 1.5))
    assert branch.status.ok
    assert branch.parameter[[0, -1]].tolist() == [low, 1.5]
    (change,) = branch.bifurcations
    assert change.kind == "grazing-sliding"
    assert change.value == pytest.approx(1.0, abs=1e-9)


def test_a_doubled_orbit_begins_at_its_flip():
    """A ball on a table: an orbit of eleven impacts doubles within 1e-4 of its size, beside others."""
    table, g, e, w = models.bouncing_table(), 9.81, 0.5, 36.0
    size = 0.5 * (np.pi * (1 - e) / (1 + e) + np.hypot(np.pi / 3, 2 * (1 + e**2) / (1 + e) ** 2))
    amplitude, phase = size * g / w**2, np.arccos(np.pi * (1 - e) / (1 + e) / size)
    v = np.pi * g / w - amplitude * w * np.cos(phase)
    orbit = periodic_orbit(
        table, (0.0, v), mode="flight", t0=phase / w, periods=1, parameters={"A": amplitude}
    )
    # A fold may come before: the branch is followed as far as its last impacts can be told apart.
    flip, grazing, *_ = continue_orbit(orbit, "A", (0.002, 0.02)).of(("flip", "grazing"))
    assert (flip.kind, grazing.kind) == ("flip", "grazing")
    doubled = switch_branch(flip)
    branch = continue_orbit(doubled, "A", (0.002, 0.02))
    first = branch.bifurcations[0]
    assert "this branch begins here" in first.message
    assert first.value == pytest.approx(flip.value, rel=1e-10)
    # It ends at the grazing of the single orbit, where only one of its halves still has the last impact.
    last = branch.bifurcations[-1]
    assert last.kind == "grazing"
    assert "no orbit is found beyond" in last.message
    assert last.value == pytest.approx(grazing.value, rel=1e-9)


@pytest.mark.parametrize("high", [2.9, 3.0])
def test_the_way_on_where_some_states_come_to_rest(high):
    """Two oscillators that collide: beyond the grazing only the driven one moves."""

    def collide(t, x, p):
        change = (1 + p.e) * (x.u - x.w) / (1 + p.m)
        return {"u": x.u - p.m * change, "w": x.w + change}

    system = HybridSystem(
        state=("x", "u", "y", "w"),
        parameters={"A": 1.0, "om": 1.3, "g": 0.3, "e": 0.7, "m": 0.5, "k": 2.0, "c": 0.1},
        period=lambda p: 2 * np.pi / p.om,
        modes=[
            Mode(
                "free",
                lambda t, x, p: (
                    x.u,
                    p.A * np.cos(p.om * t) - x.x - p.c * x.u,
                    x.w,
                    (-p.k * x.y - p.c * x.w) / p.m,
                ),
            )
        ],
        transitions=[
            Transition("free", "free", Guard(lambda t, x, p: x.x - x.y - p.g, +1), Reset(collide), name="hit")
        ],
    )
    run = simulate(system, (0.0,) * 4, (0.0, 800 * np.pi / 1.3))
    branch = continue_orbit(periodic_orbit(system, run.x[-1]), "om", (1.2, high))
    assert branch.status.ok
    assert branch.parameter[[0, -1]].tolist() == [1.2, high]
    grazing = branch.bifurcations[-1]
    assert grazing.kind == "grazing"
    exact = brentq(lambda w: (1 - w**2) ** 2 + (0.1 * w) ** 2 - 1 / 0.3**2, 1.5, 3.0)
    assert grazing.value == pytest.approx(exact, rel=1e-10)
    assert branch.orbit(len(branch) - 1).transitions == ()


def neuron(parameters, field, peak, v, more):
    """It fires at a peak of its voltage, which goes back to ``v``; its adaptation grows by so much."""
    return HybridSystem(
        state=("v", "w"),
        parameters=parameters,
        modes=[Mode("on", field)],
        transitions=[
            Transition(
                "on",
                "on",
                Guard(lambda t, x, p: x.v - peak, +1),
                Reset(lambda t, x, p: {"v": v, "w": x.w + more}),
                name="spike",
            )
        ],
    )


def test_a_slow_passage_is_passed():
    """A quadratic neuron with adaptation: its period grows long before the branch ends."""
    quadratic = neuron(
        {"I": 1.0}, lambda t, x, p: (x.v**2 + p.I - x.w, (0.2 * x.v - x.w) / 10), peak=5.0, v=0.6, more=0.5
    )
    run = simulate(quadratic, (0.0, 0.0), (0.0, 400.0))
    branch = continue_orbit(periodic_orbit(quadratic, run.x[-1], period=2.0), "I", (0.005, 5.0))
    assert branch.status.ok
    assert branch.parameter[[0, -1]].tolist() == [0.005, 5.0]
    spikes = simulate(quadratic, branch.x0[0], (0.0, 600.0), parameters={"I": 0.005}).jumps.t
    assert branch.period[0] == pytest.approx(np.diff(spikes)[-1], rel=1e-8)


@pytest.mark.as_given
def test_the_period_of_the_forcing_is_exact():
    """A sampled loop whose dead time grows: its period stays the float that is declared."""
    loop = HybridSystem(
        state=("y",),
        held=("u", "next"),
        parameters={"T": 0.4, "td": 0.15},
        period=lambda p: p.T,
        modes=[Mode("run", lambda t, x, p: (x.u - x.y,))],
        transitions=[
            Transition(
                "run", "run", Every("T"), Reset(lambda t, x, p: {"next": 1.5 * (1 - x.y)}), name="sample"
            ),
            Transition(
                "run", "run", Every("T", offset="td"), Reset(lambda t, x, p: {"u": x.next}), name="act"
            ),
        ],
    )
    branch = continue_orbit(periodic_orbit(loop, (0.6, 0.6, 0.6)), "td", (0.05, 0.35))
    assert set(branch.period) == {0.4}
    for i in (0, len(branch) - 1):
        orbit = branch.orbit(i)
        arc = orbit.arc()
        np.testing.assert_allclose(arc.x[-1], arc.x[0], atol=1e-10)


def test_a_point_is_no_orbit_beyond_a_grazing():
    """A neuron with adaptation comes to rest where its spike loses its speed: there the branch ends."""
    leaky = neuron(
        {"b": 0.3, "I": 1.5},
        lambda t, x, p: (p.I - x.v - x.w, (p.b * x.v - x.w) / 5),
        peak=1.0,
        v=0.0,
        more=0.1,
    )
    run = simulate(leaky, (0.0, 0.0), (0.0, 100.0))
    branch = continue_orbit(periodic_orbit(leaky, run.x[-1], period=3.0), "b", (0.0, 1.0))
    sizes = [np.ptp(branch.orbit(i).arc().x[:, 0]) for i in range(len(branch))]
    np.testing.assert_array_less(0.5, sizes)
