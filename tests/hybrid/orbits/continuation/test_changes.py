"""Where the sequence of transitions changes, against closed forms; and the orbit beyond."""

import numpy as np
import pytest
from scipy.optimize import brentq

import models
from hybrid import (
    Guard,
    HybridSystem,
    Mode,
    Reset,
    Transition,
    continue_orbit,
    filippov,
    periodic_orbit,
    simulate,
    switch_branch,
)


def settled(system, x0, periods, mode=None, **parameters):
    """The orbit that a forced system settles to."""
    period = system.forcing_period(parameters)
    arc = simulate(system, x0, (0.0, periods * period), mode=mode, parameters=parameters)
    return periodic_orbit(system, arc.x[-1], mode=str(arc.mode[-1]), parameters=parameters)


def change(orbit, name, span):
    """The only bifurcation of a branch, which goes on beyond it to both ends of the span."""
    branch = continue_orbit(orbit, name, span)
    assert branch.status.ok
    (found,) = branch.bifurcations
    assert np.sort(branch.parameter[[0, -1]]) == pytest.approx(span, abs=1e-10)
    ends = [branch.orbit(i).transitions for i in (0, -1)]
    assert ends[0] != ends[1]
    for i in range(0, len(branch), 5):
        orbit = branch.orbit(i)
        arc = orbit.arc()
        assert sorted(arc.jumps.transition) == sorted(orbit.transitions)
        np.testing.assert_allclose(arc.x[-1], arc.x[0], atol=1e-9)
    return found, ends


def pushed(below):
    """A state that is pushed down above zero, beside another one."""
    return filippov(
        state=("z", "y"),
        parameters={"A": 1.0},
        below=lambda t, x, p: (below(t, x, p), np.sin(t) - x.y),
        above=lambda t, x, p: (-3.0, np.sin(t) - x.y),
        switching=lambda t, x, p: x.z,
        period=2 * np.pi,
    )


def test_grazing_sliding():
    """``z' = -(z + 1) + A cos t`` swings by ``A / sqrt 2`` about -1."""
    system = pushed(lambda t, x, p: -(x.z + 1.0) + p.A * np.cos(t))
    orbit = settled(system, (-1.0, 0.0), 10, mode="below")
    found, ends = change(orbit, "A", (0.5, 2.0))
    assert found.kind == "grazing-sliding"
    assert found.value == pytest.approx(np.sqrt(2.0), abs=1e-10)
    assert ends == [(), ("below->sliding", "sliding->below")]
    assert "goes on" in found.message


def test_adding_sliding():
    """At rest on the surface while the field below, ``1 + A cos t``, pushes up."""
    system = pushed(lambda t, x, p: 1.0 + p.A * np.cos(t))
    orbit = settled(system, (0.0, 0.0), 10, mode="sliding", A=0.5)
    found, ends = change(orbit, "A", (0.2, 1.5))
    assert found.kind == "adding-sliding"
    assert found.value == pytest.approx(1.0, abs=1e-10)
    assert set(ends[1]) == {"sliding->below", "below->sliding"}


def test_switching_sliding():
    """It comes back to the surface at ``t``, when the field above, ``cos t - p``, begins to push down."""
    system = filippov(
        state=("z",),
        parameters={"p": 0.9, "c": 0.3},
        below=lambda t, x, p: (p.c + np.sin(t),),
        above=lambda t, x, p: (np.cos(t) - p.p,),
        switching=lambda t, x, p: x.z,
        period=2 * np.pi,
    )
    left = np.pi + np.arcsin(0.3)
    back = brentq(lambda t: 0.3 * (t - left) - np.cos(t) + np.cos(left), 2 * np.pi - 0.2, 3 * np.pi)
    orbit = settled(system, (-0.5,), 3, mode="below")
    found, ends = change(orbit, "p", (np.cos(back) - 0.1, 0.95))
    assert found.kind == "switching-sliding"
    assert found.value == pytest.approx(np.cos(back), abs=1e-10)
    assert len(ends[0]) == 3
    assert len(ends[1]) == 2


def test_crossing_sliding():
    """Den Hartog: the mass stops where its acceleration after the turn, ``X w^2 - f``, vanishes."""
    orbit = settled(models.dry_friction_oscillator(), (1.0, 0.0), 200, mode="above")
    found, _ = change(orbit, "w", (0.5, 0.9))
    assert found.kind == "crossing-sliding"

    def excess(w):
        forced, friction = 1 / (1 - w**2), 0.5 * np.tan(np.pi / (2 * w)) / w
        return np.sqrt(forced**2 - friction**2) * w**2 - 0.5

    assert found.value == pytest.approx(brentq(excess, 0.57, 0.6, xtol=1e-14), abs=1e-10)


def test_the_border_of_the_converter():
    """Below ``E = V_ref + V_L / a`` the switch stays closed."""
    converter = models.buck_converter()
    arc = simulate(converter, (12.0, 0.5, 0.0), (0.0, 0.08), mode="on", parameters={"E": 14.0})
    orbit = periodic_orbit(converter, arc.x[-1], mode=str(arc.mode[-1]), parameters={"E": 14.0})
    found, ends = change(orbit, "E", (11.0, 15.0))
    assert found.kind == "border"
    assert found.value == pytest.approx(11.3 + 3.8 / 8.4, abs=1e-10)
    assert ends[0] == ("saturate",)


def test_a_corner():
    """``u`` rises towards 2 and is halved once per unit of time; its cap is reached just then."""
    system = HybridSystem(
        state=("s", "u"),
        parameters={"cap": 1.9},
        modes=[Mode("on", lambda t, x, p: (1.0, 2.0 - x.u))],
        transitions=[
            Transition(
                "on",
                "on",
                Guard(lambda t, x, p: x.s - 1.0, +1),
                Reset(lambda t, x, p: (0.0, 0.5 * x.u)),
                name="tick",
            ),
            Transition(
                "on",
                "on",
                Guard(lambda t, x, p: x.u - p.cap, +1),
                Reset(lambda t, x, p: (x.s, x.u - 0.1)),
                name="cap",
            ),
        ],
    )
    orbit = periodic_orbit(system, (0.5, 1.2), period=1.0)
    branch = continue_orbit(orbit, "cap", (1.4, 2.0))
    again, first = branch.bifurcations
    assert again.kind == first.kind == "corner"
    assert first.value == pytest.approx((2 - 2 / np.e) / (1 - 0.5 / np.e), abs=1e-10)

    def twice(cap):
        """How the times up to the cap, and from below it up to it again, differ from one unit."""
        return (2 - cap) ** 2 / ((2 - 0.5 * cap) * (2.1 - cap)) - 1 / np.e

    assert again.value == pytest.approx(brentq(twice, 1.4, 1.5), abs=1e-10)


def test_an_isola_closes():
    """``u -> u + 0.3 (1 - a^2 - u^2)``: its orbits are a circle."""
    system = HybridSystem(
        state=("s", "u"),
        parameters={"a": 0.0},
        modes=[Mode("on", lambda t, x, p: (1.0, 0.0))],
        transitions=[
            Transition(
                "on",
                "on",
                Guard(lambda t, x, p: x.s - 1.0, +1),
                Reset(lambda t, x, p: (0.0, x.u + 0.3 * (1.0 - p.a**2 - x.u**2))),
            )
        ],
    )
    branch = continue_orbit(periodic_orbit(system, (0.4, 0.9), period=1.0), "a", (-2.0, 2.0))
    assert "closed" in branch.status.message
    assert sorted(each.value for each in branch.bifurcations) == pytest.approx([-1.0, 1.0], abs=1e-10)
    np.testing.assert_allclose(branch.parameter**2 + branch.x0[:, 1] ** 2, 1.0, rtol=1e-10)


class TestBeyond:
    def test_switch_branch_goes_to_the_new_transitions(self):
        orbit = periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
        branch = continue_orbit(orbit, "w", (0.9, 2.0))
        grazing = max(branch.bifurcations, key=lambda each: (each.kind == "grazing", each.value))
        free = switch_branch(grazing)
        assert free.transitions == ()
        assert free.parameters["w"] > np.sqrt(1.99)

    def test_the_same_branch_from_beyond(self):
        """From the orbit without impacts down to the grazing, and up again with impacts."""
        orbit = periodic_orbit(models.impact_oscillator(), (0.3, 0.0), parameters={"w": 1.9})
        assert orbit.transitions == ()
        branch = continue_orbit(orbit, "w", (1.2, 2.0))
        found = [(each.kind, each.value) for each in branch.bifurcations]
        assert ("grazing", pytest.approx(np.sqrt(1.99), abs=1e-10)) in found
        assert ("fold", pytest.approx(1.750142624, abs=1e-8)) in found


def test_the_founding_system_touches_its_contact():
    """Without contact it is linear: the amplitude of ``x1 - x2`` about ``-D`` is D at the grazing."""
    system = models.vibroimpact()
    p = system.parameters
    chi, w = p["m2"] / p["m1"], p["omega"]
    c, k = 2 * p["xi2"] * p["omega2"], p["omega2"] ** 2
    stiffness = np.array([[p["omega1"] ** 2 + chi * k, -chi * k], [-k, k]])
    damping = np.array([[2 * p["xi1"] * p["omega1"] + chi * c, -chi * c], [-c, c]])
    response = np.linalg.solve(stiffness - w**2 * np.eye(2) + 1j * w * damping, [1 / p["m1"], 0.0])
    exact = p["D"] / abs(response[0] - response[1])
    orbit = settled(system, (0.0, 0.05, 0.0, 0.0), 300, P=100.0)
    branch = continue_orbit(orbit, "P", (90.0, 250.0))
    assert branch.status.ok
    grazing = next(each for each in branch.bifurcations if each.kind == "grazing")
    assert grazing.value == pytest.approx(exact, rel=1e-10)
    assert {orbit.transitions for orbit in branch.orbits} == {(), ("impact", "release")}


class TestDiscontinuityMap:
    """``x -> x + C sqrt(H)`` at a grazing, against the flow."""

    @pytest.fixture(scope="class")
    @classmethod
    def grazing(cls):
        orbit = periodic_orbit(models.impact_oscillator(), (0.3, 0.0), parameters={"w": 1.9})
        branch = continue_orbit(orbit, "w", (1.2, 2.0))
        return next(each for each in branch.bifurcations if each.kind == "grazing")

    def test_in_closed_form(self, grazing):
        """The speed ``sqrt(2 a H)`` is turned and multiplied by ``r``; ``a`` is ``w^2 d``."""
        C = grazing.coefficient
        assert pytest.approx([0.0, -1.8 * np.sqrt(2 * 1.99)], abs=1e-6) == C

    def test_against_the_flow(self, grazing):
        """Half a period later, the orbit that jumps is ``Phi C sqrt(H)`` away from the one that does not."""
        orbit, system = grazing.orbit, models.impact_oscillator()
        w, half = grazing.value, np.pi / grazing.value
        arc = orbit.arc()
        t = arc.t[0] + orbit.period * np.linspace(0, 1, 4001)
        top = t[np.argmax(arc(np.clip(t, arc.t[0], arc.t[-1]))[:, 0])]
        beyond = []
        for H in (1e-5, 1e-6):
            start = simulate(
                system, (1.0 + H, 0.0), (top, top + half), parameters={"w": w, "d": 9.0}, tangent=True
            )
            back = simulate_back(system, (1.0 + H, 0.0), top, half / 2, w)
            real = simulate(system, back, (top - half / 2, top + half), parameters={"w": w})
            assert len(real.jumps) == 1
            expected = start.fundamental @ grazing.coefficient * np.sqrt(H)
            beyond.append(np.abs(real.x[-1] - start.x[-1] - expected).max() / np.abs(expected).max())
        assert beyond[0] < 0.02
        assert beyond[1] < 0.4 * beyond[0]


def simulate_back(system, x, t, length, w):
    """The state of the free oscillator a while before."""
    forward = simulate(system, (0.0, 0.0), (t - length, t), parameters={"w": w, "d": 9.0}, tangent=True)
    return np.linalg.solve(forward.fundamental, np.asarray(x) - forward.x[-1])


def test_a_branch_point_on_a_curved_branch():
    """``u = g(b)`` and ``(u - g)^2 = b``: arms leave at ``b = 0``, the branch goes straight on."""

    def g(b):
        return 0.3 * np.sin(2 * b) + 0.5 * b**2 + 0.4

    def law(t, x, p):
        d = x.u - g(p.b)
        return 0.0, x.u + 0.5 * d * (p.b - d**2), 0.3 * x.w + x.u

    system = HybridSystem(
        state=("s", "u", "w"),
        parameters={"b": -0.5},
        modes=[Mode("on", lambda t, x, p: (1.0, 0.0, 0.0))],
        transitions=[Transition("on", "on", Guard(lambda t, x, p: x.s - 1.0, +1), Reset(law))],
    )
    orbit = periodic_orbit(system, (0.4, g(-0.5), g(-0.5) / 0.7), period=1.0)
    branch = continue_orbit(orbit, "b", (-0.9, 0.9))
    (point,) = branch.bifurcations
    assert point.kind == "branch point"
    assert point.value == pytest.approx(0.0, abs=1e-10)
    np.testing.assert_allclose(branch.x0[:, 1], g(branch.parameter), atol=1e-9)
    np.testing.assert_array_equal(branch.stable, branch.parameter < 0.0)
    arm = switch_branch(point)
    assert (arm.x0[1] - g(arm.parameters["b"])) ** 2 == pytest.approx(arm.parameters["b"], abs=1e-9)


def test_jumps_of_one_instant_each_move_their_own_time():
    """Two oscillators that do not know of each other have the multipliers of one, twice."""

    def twice(field):
        return lambda t, x, p: (*field(t, x.x, x.v, p), *field(t, x.y, x.u, p))

    system = HybridSystem(
        state=("x", "v", "y", "u"),
        parameters={"w": 1.0},
        modes=[Mode("m", twice(lambda t, x, v, p: (v, np.cos(p.w * t) - 0.1 * v - x)))],
        transitions=[
            Transition(
                "m",
                "m",
                Guard(lambda t, x, p: x.x - 1.0, +1),
                Reset(lambda t, x, p: {"v": -0.8 * x.v}),
                name="one",
            ),
            Transition(
                "m",
                "m",
                Guard(lambda t, x, p: x.y - 1.0, +1),
                Reset(lambda t, x, p: {"u": -0.8 * x.u}),
                name="other",
            ),
        ],
        period=lambda p: 2 * np.pi / p.w,
    )
    alone = periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    branch = continue_orbit(periodic_orbit(system, (0.9, 1.0, 0.9, 1.0)), "w", (0.95, 1.05))
    i = int(np.argmin(np.abs(branch.parameter - 1.0)))
    found = sorted(branch.multipliers[i], key=lambda each: each.imag)
    expected = sorted(np.repeat(alone.multipliers, 2), key=lambda each: each.imag)
    np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.mark.parametrize("shift", [0.0, 0.02, -0.02])
def test_a_touch_at_phase_zero(shift):
    """Nothing depends on where the phase of the forcing begins."""
    delay = np.arctan2(0.1 * np.sqrt(1.99), 1.0 - 1.99) + shift
    system = HybridSystem(
        state=("x", "v"),
        parameters={"w": 1.9},
        modes=[Mode("m", lambda t, x, p: (x.v, np.cos(p.w * t + delay) - 0.1 * x.v - x.x))],
        transitions=[
            Transition(
                "m", "m", Guard(lambda t, x, p: x.x - 1.0, +1), Reset(lambda t, x, p: {"v": -0.8 * x.v})
            )
        ],
        period=lambda p: 2 * np.pi / p.w,
    )
    branch = continue_orbit(periodic_orbit(system, (0.3, 0.0)), "w", (1.2, 2.0))
    grazing = next(each for each in branch.bifurcations if each.kind == "grazing")
    assert grazing.value == pytest.approx(np.sqrt(1.99), abs=1e-10)


def test_a_compliant_stop_is_touched_alike_from_both_sides():
    """``hypot(k1 - w^2, c w) = A`` for a gap of 1, in the bilinear oscillator with its stop at 1."""
    system = HybridSystem(
        state=("x", "v"),
        parameters={"A": 1.0},
        modes=[
            Mode("free", lambda t, x, p: (x.v, p.A * np.cos(1.6 * t) - 0.1 * x.v - x.x)),
            Mode("held", lambda t, x, p: (x.v, p.A * np.cos(1.6 * t) - 0.1 * x.v - x.x - 9.0 * (x.x - 1.0))),
        ],
        transitions=[
            Transition("free", "held", Guard(lambda t, x, p: x.x - 1.0, +1)),
            Transition("held", "free", Guard(lambda t, x, p: x.x - 1.0, -1)),
        ],
        period=2 * np.pi / 1.6,
    )
    exact = np.hypot(1 - 1.6**2, 0.16)
    for A, mode in ((1.2, "free"), (1.7, "free")):
        orbit = settled(system, (0.0, 0.0), 200, mode=mode, A=A)
        branch = continue_orbit(orbit, "A", (1.1, 1.8))
        assert branch.status.ok
        (grazing,) = (each for each in branch.bifurcations if each.kind == "grazing")
        assert grazing.value == pytest.approx(exact, abs=1e-9)
        assert {orbit.transitions for orbit in branch.orbits} >= {()}
