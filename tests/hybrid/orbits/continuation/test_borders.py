"""Corners and borders, on a branch and as curves in two parameters, against closed forms."""

import numpy as np
import pytest

import models
from hybrid import (
    After,
    Every,
    Guard,
    HybridSystem,
    Mode,
    Reset,
    Transition,
    continue_bifurcation,
    continue_orbit,
    periodic_orbit,
    simulate,
    split,
)


def ticked(parameters, *laws, state=("x",), rates=None):
    """A map: at each tick one of some laws, each with its condition (None: always)."""
    return HybridSystem(
        state=state,
        parameters=parameters,
        period=1.0,
        modes=[Mode("wait", rates or (lambda t, x, p: tuple(0.0 for _ in state)))],
        transitions=[
            Transition("wait", "wait", Every(1.0, when=when), Reset(law), name=f"law {i}")
            for i, (when, law) in enumerate(laws)
        ],
    )


def settled(system, x0, until, mode=None, **parameters):
    """The orbit that a run comes to."""
    arc = simulate(system, x0, (0.0, until), mode=mode, parameters=parameters)
    return periodic_orbit(system, arc.x[-1], mode=str(arc.mode[-1]), parameters=parameters)


def follow(bifurcation, kind, **over):
    """The curve of a bifurcation, which goes on to the ends of the ranges."""
    assert bifurcation.kind == kind
    curve = continue_bifurcation(bifurcation, over)
    assert curve.status.ok
    assert curve.kind == kind
    assert "range" in curve.status.message
    assert "change" not in curve.status.message
    for i in (0, len(curve) // 2, -1):
        orbit = curve.orbit(i)
        assert {name: orbit.parameters[name] for name in over} == dict(
            zip(over, curve.values[i], strict=True)
        )
    return curve


class TestARelay:
    """``x -> a x + u - sgn x``: its orbit of two periods is on both sides for ``|u| < (1 - a) / (1 + a)``."""

    @pytest.fixture(scope="class")
    @classmethod
    def branch(cls):
        relay = ticked({"a": 0.8, "u": 0.02}, (None, lambda t, x, p: (p.a * x.x + p.u - step(x.x),)))
        return continue_orbit(periodic_orbit(split(relay), (0.65,), periods=2), "u", (-0.9, 0.9))

    def test_the_branch_ends_at_its_two_corners(self, branch):
        """An orbit that is passed from its other half on is the same orbit, and no way on."""
        assert sorted(each.value for each in branch.bifurcations) == pytest.approx([-1 / 9, 1 / 9], abs=1e-10)
        assert branch.status.message == "The branch ends at a corner."

    def test_both_curves(self, branch):
        for corner in branch.bifurcations:
            curve = follow(corner, "corner", u=(-0.9, 0.9), a=(0.05, 0.99))
            a = curve["a"]
            np.testing.assert_allclose(curve["u"], np.sign(corner.value) * (1 - a) / (1 + a), atol=1e-9)
            # The curve leaves the range of u at 0.9, where a is 1/19.
            assert [a.min(), a.max()] == pytest.approx([1 / 19, 0.99], abs=1e-9)


def step(u):
    return np.where(u < 0, -1.0, 1.0)


CONDITIONS = {
    "a comparison": (lambda t, x, p: x.x < p.c, lambda t, x, p: x.x >= p.c),
    "negated": (lambda t, x, p: ~(x.x >= p.c), lambda t, x, p: ~(x.x < p.c)),
    "a number": (lambda t, x, p: p.c - x.x, lambda t, x, p: x.x - p.c),
    "the smaller of two": (lambda t, x, p: np.minimum(p.c - x.x, 5.0), lambda t, x, p: x.x >= p.c),
    "a sign": (lambda t, x, p: np.sign(x.x - p.c) < 0.5, lambda t, x, p: np.sign(x.x - p.c) > 0.5),
    "a choice": (lambda t, x, p: np.where(x.x < p.c, 1.0, -1.0), lambda t, x, p: x.x >= p.c),
    "a whole number": (lambda t, x, p: np.floor(x.x - p.c) < 0, lambda t, x, p: np.floor(x.x - p.c) >= 0),
    "a distance": (
        lambda t, x, p: np.abs(x.x + 9.0) < 9.0 + p.c,
        lambda t, x, p: np.abs(x.x + 9.0) >= 9.0 + p.c,
    ),
    "of two": (
        lambda t, x, p: (x.x < p.c) | (x.x > 7.0),
        lambda t, x, p: (x.x >= p.c) & (x.x <= 7.0),
    ),
}


@pytest.mark.parametrize("written", CONDITIONS)
def test_a_border_collision_however_its_condition_is_written(written):
    """``x -> a x + u`` below ``c``, another slope above: the point is at ``c`` where ``u = (1 - a) c``."""
    below, above = CONDITIONS[written]
    system = ticked(
        {"a": 0.5, "u": -0.2, "c": 0.3},
        (below, lambda t, x, p: (p.a * x.x + p.u,)),
        (above, lambda t, x, p: (p.a * p.c + p.u - 0.8 * (x.x - p.c),)),
    )
    branch = continue_orbit(periodic_orbit(system, (-0.4,)), "u", (-0.5, 0.5))
    assert branch.status.ok
    (corner,) = branch.bifurcations
    assert corner.value == pytest.approx(0.15, abs=1e-10)
    curve = follow(corner, "corner", u=(-0.9, 0.9), a=(-0.9, 0.9))
    np.testing.assert_allclose(curve["u"], 0.3 * (1 - curve["a"]), atol=1e-9)
    assert [curve["a"].min(), curve["a"].max()] == pytest.approx([-0.9, 0.9], abs=1e-9)


def test_the_saturation_of_a_reset():
    """``x -> min(a x + u, 1 - x / 2)``: both are 2/3 at the point 2/3, where ``u = (1 - a) 2 / 3``."""
    saturated = ticked(
        {"a": 0.5, "u": 0.2}, (None, lambda t, x, p: (np.minimum(p.a * x.x + p.u, 1.0 - x.x / 2),))
    )
    (corner,) = continue_orbit(periodic_orbit(split(saturated), (0.4,)), "u", (-0.9, 2.9)).bifurcations
    curve = follow(corner, "corner", u=(-0.9, 2.9), a=(-0.9, 0.9))
    np.testing.assert_allclose(curve["u"], (1 - curve["a"]) * 2 / 3, atol=1e-9)


def test_the_saturation_of_a_field():
    """``x' = -x + min(x / 2 + A cos w t, 3/2)`` is linear up to the amplitude at which the two meet."""
    saturated = HybridSystem(
        state=("x",),
        parameters={"A": 1.0, "w": 1.0},
        period=lambda p: 2 * np.pi / p.w,
        modes=[Mode("on", lambda t, x, p: (-x.x + np.minimum(x.x / 2 + p.A * np.cos(p.w * t), 1.5),))],
    )
    (grazing,) = continue_orbit(periodic_orbit(split(saturated), (0.3,)), "A", (0.3, 2.0)).bifurcations
    curve = follow(grazing, "grazing", A=(0.3, 3.0), w=(0.3, 3.0))
    gain = np.abs(1 + 0.5 / (0.5 + 1j * curve["w"]))
    np.testing.assert_allclose(curve["A"] * gain, 1.5, atol=1e-9)


class TestAConditionAwayFromJumps:
    """``x -> a x + u`` at each tick; between, ``y`` falls to 1, where an ``x`` above ``c`` is halved."""

    @pytest.fixture(scope="class")
    @classmethod
    def system(cls):
        return HybridSystem(
            state=("x", "y"),
            parameters={"a": 0.5, "u": -0.2, "c": 0.4},
            period=1.0,
            modes=[Mode("wait", lambda t, x, p: (0.0, -x.y))],
            transitions=[
                Transition("wait", "wait", Every(1.0), Reset(lambda t, x, p: (p.a * x.x + p.u, x.y + 1.0))),
                Transition(
                    "wait",
                    "wait",
                    Guard(lambda t, x, p: x.y - 1.0, -1, when=lambda t, x, p: x.x > p.c),
                    Reset(lambda t, x, p: {"x": x.x / 2}),
                    name="halve",
                ),
            ],
        )

    def test_from_the_side_where_it_does_not_fire(self, system):
        branch = continue_orbit(periodic_orbit(system, (-0.4, 1.58)), "u", (-0.9, 0.9))
        (corner,) = branch.bifurcations
        assert "the condition of 'halve' changes where its guard is reached" in corner.message
        curve = follow(corner, "corner", u=(-0.9, 0.9), a=(-0.9, 0.9))
        np.testing.assert_allclose(curve["u"], 0.4 * (1 - curve["a"]), atol=1e-9)

    def test_from_the_side_where_it_fires(self, system):
        orbit = periodic_orbit(system, (1.0, 1.58), parameters={"u": 0.6})
        (corner,) = continue_orbit(orbit, "u", (0.1, 0.9)).bifurcations
        curve = follow(corner, "corner", u=(-0.9, 0.9), a=(-0.9, 0.9))
        np.testing.assert_allclose(curve["u"], 0.4 * (1 - curve["a"] / 2), atol=1e-9)


def test_a_condition_on_an_orbit_of_its_own_period():
    """An oscillator is kicked by ``k`` where it comes to 0 slower than 1: it comes with ``k q / (1 - q)``."""
    system = HybridSystem(
        state=("x", "v"),
        parameters={"k": 0.5, "z": 0.1},
        modes=[Mode("swing", lambda t, x, p: (x.v, -x.x - 2 * p.z * x.v))],
        transitions=[
            Transition(
                "swing",
                "swing",
                Guard(lambda t, x, p: x.x, +1, when=lambda t, x, p: x.v < 1.0),
                Reset(lambda t, x, p: {"v": x.v + p.k}),
                name="kick",
            )
        ],
    )
    (corner,) = continue_orbit(periodic_orbit(system, (0.3, 0.9), period=6.3), "k", (0.2, 3.0)).bifurcations
    curve = follow(corner, "corner", k=(0.2, 3.0), z=(0.03, 0.3))
    q = np.exp(-2 * np.pi * curve["z"] / np.sqrt(1 - curve["z"] ** 2))
    np.testing.assert_allclose(curve["k"] * q / (1 - q), 1.0, atol=1e-9)


@pytest.mark.parametrize(("x", "s"), [(-0.3, 1.0), (-0.6, 2.0)])
def test_a_condition_that_is_asked_after_a_reset_of_its_tick(x, s):
    """``x' = s``, then ``-k x``: that is below -1/2, where a second law acts, for ``s > (1 + k) / (2 k)``."""
    system = ticked(
        {"k": 0.5, "s": s},
        (lambda t, x, p: x.x > 0, lambda t, x, p: (-p.k * x.x,)),
        (lambda t, x, p: x.x < -0.5, lambda t, x, p: (0.8 * x.x - 0.1,)),
        rates=lambda t, x, p: (p.s,),
    )
    branch = continue_orbit(periodic_orbit(system, (x,)), "s", (0.5, 3.0))
    (corner,) = branch.bifurcations
    assert len({orbit.transitions for orbit in branch.orbits}) == 2
    curve = follow(corner, "corner", s=(0.5, 3.0), k=(0.3, 0.9))
    np.testing.assert_allclose(curve["s"], (1 + curve["k"]) / (2 * curve["k"]), atol=1e-9)


def test_a_duty_that_saturates_at_both_ends():
    """``x' = E - x`` for the duty ``clip((ref - x) / 2, 0, 1)`` sampled at each tick, then ``x' = -x``.

    The duty is 0 at ``x = 0`` and 1 at ``x = E``: at ``ref = 0`` and at ``ref = E + 2``.
    """

    def sample(t, x, p):
        return {"tau": 0.0, "d": np.clip((p.ref - x.x) / 2, 0.0, 1.0)}

    system = split(
        HybridSystem(
            state=("x", "tau"),
            held=("d",),
            parameters={"E": 2.0, "ref": 1.2},
            period=1.0,
            modes=[
                Mode("on", lambda t, x, p: (p.E - x.x, 1.0)),
                Mode("off", lambda t, x, p: (-x.x, 1.0)),
            ],
            transitions=[
                Transition("on", "off", Guard(lambda t, x, p: x.tau - x.d, +1), name="open"),
                Transition("on", "on", Every(1.0), Reset(sample), name="stay"),
                Transition("off", "on", Every(1.0), Reset(sample), name="close"),
            ],
            start="on",
        )
    )
    branch = continue_orbit(settled(system, (0.5, 0.0, 0.3), 60.0, "on"), "ref", (-0.5, 5.0))
    low, high = sorted(branch.bifurcations, key=lambda each: each.value)
    np.testing.assert_allclose(follow(low, "border", ref=(-0.9, 6.0), E=(0.5, 3.5))["ref"], 0.0, atol=1e-9)
    curve = follow(high, "border", ref=(-0.9, 6.0), E=(0.5, 3.5))
    np.testing.assert_allclose(curve["ref"], curve["E"] + 2.0, atol=1e-9)
    # Below the border a multiplier is exp(-1) - E / 2.
    (flip,) = curve.points
    assert flip.kind == "border-flip"
    assert flip.values["E"] == pytest.approx(2 * (1 + np.exp(-1)), abs=1e-8)


def test_a_duty_between_two_clocks():
    """On at each tick, off at the share ``d - q``: no time is left of one of them at ``d = q``."""
    system = HybridSystem(
        state=("x",),
        parameters={"d": 0.5, "q": 0.3},
        period=1.0,
        modes=[Mode("on", lambda t, x, p: (1.0 - x.x,)), Mode("off", lambda t, x, p: (-x.x,))],
        transitions=[
            Transition("on", "off", Every(1.0, offset=lambda p: p.d - p.q)),
            Transition("off", "on", Every(1.0)),
        ],
        start="on",
    )
    branch = continue_orbit(periodic_orbit(system, (0.3,)), "d", (0.1, 1.6))
    for border, duty in zip(branch.bifurcations, (0.0, 1.0), strict=True):
        curve = follow(border, "border", d=(0.1, 1.6), q=(0.1, 0.9))
        np.testing.assert_allclose(curve["d"] - curve["q"], duty, atol=1e-9)


def coil(off, *more, modes=()):
    """A coil ``i' = E - V - 2 i`` while a switch is on, for the share ``d`` of a unit of time."""
    return HybridSystem(
        state=("i",),
        parameters={"E": 10.0, "V": 1.0, "d": 0.7},
        period=1.0,
        modes=[Mode("on", lambda t, x, p: (p.E - p.V - 2 * x.i,)), Mode("off", off), *modes],
        transitions=[
            Transition("on", "off", Every(1.0, offset="d"), name="open"),
            Transition("off", "on", Every(1.0), name="close"),
            *more,
        ],
        start="on",
    )


def falling(t, x, p):
    return (-p.V - 2 * x.i,)


with_a_diode = coil(
    falling,
    Transition("off", "idle", Guard(lambda t, x, p: x.i, -1), Reset(lambda t, x, p: (0.0,)), name="empty"),
    Transition("idle", "on", Every(1.0), name="close empty"),
    modes=[Mode("idle", lambda t, x, p: (0.0,))],
)
with_a_choice = split(coil(lambda t, x, p: (np.where(x.i > 0, falling(t, x, p)[0], 0.0),)))


class TestDiscontinuousConduction:
    @pytest.mark.parametrize("system", [with_a_diode, with_a_choice], ids=["modes", "split"])
    @pytest.mark.parametrize("V", [1.0, 6.0])
    def test_a_coil(self, system, V):
        """Its current is zero at the tick where ``V (1 - exp(-2)) = E (exp(-2 (1 - d)) - exp(-2))``."""
        branch = continue_orbit(settled(system, (1.0,), 20.0, V=V), "V", (0.5, 8.0))
        assert branch.status.ok
        (border,) = branch.bifurcations
        curve = follow(border, "border", V=(0.1, 9.9), d=(0.05, 0.98))
        V, d = curve["V"], curve["d"]
        exact = 10.0 * (np.exp(-2 * (1 - d)) - np.exp(-2)) / (1 - np.exp(-2))
        np.testing.assert_allclose(V, exact, rtol=1e-9)

    def test_a_buck_converter(self):
        """At a given duty its current is zero at the tick near ``R = 2 L / ((1 - D) T)``, but for ripple."""
        converter = HybridSystem(
            state=("v", "i"),
            parameters={"E": 20.0, "L": 20e-3, "C": 47e-6, "R": 22.0, "T": 400e-6, "D": 0.5},
            period=lambda p: p.T,
            modes=[
                Mode("on", lambda t, x, p: ((x.i - x.v / p.R) / p.C, (p.E - x.v) / p.L)),
                Mode("off", lambda t, x, p: ((x.i - x.v / p.R) / p.C, -x.v / p.L)),
                Mode("idle", lambda t, x, p: (-x.v / (p.R * p.C), 0.0)),
            ],
            transitions=[
                Transition("on", "off", After(lambda p: p.D * p.T), name="open"),
                Transition("off", "idle", Guard(lambda t, x, p: x.i, -1), Reset(lambda t, x, p: {"i": 0.0})),
                Transition("off", "on", Every("T")),
                Transition("idle", "on", Every("T")),
            ],
            start="on",
        )
        branch = continue_orbit(settled(converter, (10.0, 0.5), 0.08), "R", (10.0, 400.0))
        (border,) = branch.bifurcations
        curve = follow(border, "border", R=(10.0, 900.0), D=(0.05, 0.95))
        R, D = curve["R"], curve["D"]
        np.testing.assert_allclose(R * (1 - D) * 400e-6 / (2 * 20e-3), 1.0, atol=5e-3)
        ends = np.array([curve.orbit(i).arc().x[:, 1].min() for i in range(0, len(curve), 8)])
        np.testing.assert_allclose(ends, 0.0, atol=1e-9)


class TestModels:
    def test_the_buck_converter_stops_switching(self):
        """Where the control voltage is at the start of the ramp with the switch closed."""
        converter = models.buck_converter()
        orbit = settled(converter, (12.0, 0.5, 0.0), 0.08, "on", E=14.0)
        (border,) = continue_orbit(orbit, "E", (11.0, 15.0)).bifurcations
        curve = follow(border, "border", E=(11.0, 15.0), V_L=(1.0, 7.0))
        np.testing.assert_allclose(curve["E"], 11.3 + curve["V_L"] / 8.4, rtol=1e-9)

    def test_the_boost_converter_stops_charging(self):
        """Where the current ``E / R`` without switching is the peak."""
        boost = models.boost_converter()
        orbit = settled(boost, (0.5, 15.0, 0.0), 0.02, I_ref=0.8)
        (border,) = continue_orbit(orbit, "I_ref", (0.1, 1.0)).bifurcations
        curve = follow(border, "border", I_ref=(0.1, 1.0), E=(2.0, 20.0))
        np.testing.assert_allclose(curve["I_ref"], curve["E"] / 20.0, rtol=1e-9)
