"""Branches and derivatives of orbits that hold conserved quantities, against closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipk, mathieu_a, mathieu_b

import models
from hybrid import (
    Guard,
    HybridSystem,
    Laws,
    Mode,
    Transition,
    continue_bifurcation,
    continue_orbit,
    from_equations,
    periodic_orbit,
    switch_branch,
)


def hop_energy(t, x, p):
    return x.v**2 / 2 + p.g * x.y + np.where(x.y < 1, 1, 0) * p.k * (x.y - 1) ** 2 / 2


def untraceable_energy(t, x, p):
    spring = p.k * (x.y - 1) ** 2 / 2 if x.y < 1 else 0.0
    return x.v**2 / 2 + p.g * x.y + spring


def hopper(energy):
    """A mass that hops on a spring, one dimension."""
    touch = Guard(lambda t, x, p: x.y - 1, -1), Guard(lambda t, x, p: x.y - 1, +1)
    return HybridSystem(
        state=("y", "v"),
        parameters={"g": 9.81, "k": 400.0},
        laws=Laws(conserved={"energy": energy}),
        modes=[
            Mode("flight", lambda t, x, p: (x.v, -p.g)),
            Mode("stance", lambda t, x, p: (x.v, -p.g - p.k * (x.y - 1))),
        ],
        transitions=[Transition("flight", "stance", touch[0]), Transition("stance", "flight", touch[1])],
    )


ENERGY = 1.3 * 9.81


def hop_period(k, g=9.81, energy=ENERGY):
    """A flight with the landing speed u, then the spring: 2 u / g + 2 (pi - arctan(w u / g)) / w."""
    u, w = np.sqrt(2 * (energy - g)), np.sqrt(k)
    return 2 * u / g + 2 * (np.pi - np.arctan(w * u / g)) / w


def hop(energy=hop_energy):
    return periodic_orbit(hopper(energy), (1.3, 0.0), mode="flight", period=0.8)


class TestHopper:
    @pytest.mark.parametrize(("energy", "known"), [(hop_energy, 1e-9), (untraceable_energy, 1e-6)])
    def test_the_slopes_at_the_energy(self, energy, known):
        """Complex steps give the slopes of the period. The point moves such that the energy stays."""
        orbit = hop(energy)
        found = orbit.sensitivity(("k", "g"))
        held = np.array([hop_period(400.0 + 1e-20j).imag, hop_period(400.0, 9.81 + 1e-20j).imag]) / 1e-20
        assert found.period == pytest.approx(held, rel=known)
        assert orbit.mode == "flight"
        gradient = np.array([9.81, orbit.x0[1]])
        assert gradient @ found.x0 == pytest.approx([0.0, -orbit.x0[0]], rel=known, abs=known)
        assert found.multipliers == pytest.approx(np.zeros((2, 2)), abs=1e-9)

    def test_a_branch_over_the_stiffness(self):
        branch = continue_orbit(hop(), "k", (50.0, 1000.0))
        assert branch.status.message.endswith(f"Held as at the start: energy = {ENERGY:.9g}.")
        assert branch.bifurcations == ()
        assert branch.period == pytest.approx(hop_period(branch.parameter), rel=1e-11)
        assert np.all(branch.multipliers == 1.0)
        for i in range(0, len(branch.parameter), 7):
            again = periodic_orbit(
                hopper(hop_energy),
                branch.x0[i],
                mode=str(branch.mode[i]),
                parameters={"k": branch.parameter[i]},
                period=branch.period[i],
            )
            assert f"energy = {ENERGY:.9g}" in again.status.message

    def test_a_branch_ends_where_no_orbit_has_the_energy(self):
        """The mass stays on the ground from g = energy on; the least energy is g - g^2 / 2 k."""
        branch = continue_orbit(hop(), "g", (5.0, 14.0))
        (leaves,) = branch.bifurcations
        assert leaves.value == pytest.approx(ENERGY, rel=1e-9)
        assert "at a point, where the orbit has no size" in branch.status.message
        assert branch.parameter[-1] == pytest.approx(400.0 - np.sqrt(400.0**2 - 800.0 * ENERGY), rel=1e-3)
        flies = branch.parameter < ENERGY
        assert branch.period[flies] == pytest.approx(hop_period(400.0, branch.parameter[flies]), rel=1e-9)
        assert branch.period[~flies][1:] == pytest.approx(2 * np.pi / 20.0, rel=1e-9)


Y = 0.940267144380
SPECIFIC = 5.0**2 / 2 + 9.81


def running():
    speed = np.sqrt(2 * (SPECIFIC - 9.81 * Y))
    return periodic_orbit(models.slip_hopper(), (0.0, Y, speed, 0.0), mode="descent", period=0.252532613818)


STEEP = float(np.radians(68.0))


def next_apex(height, alpha=STEEP, k=20e3):
    """The height of the next apex at the energy of the run, and the time to it, by SciPy."""
    g, stiffness = 9.81, k / 80.0
    low = np.sin(alpha)
    fall = np.sqrt(2 * g * (height - low))

    def stance(t, s):
        push = stiffness * (1 / np.hypot(s[0], s[1]) - 1)
        return s[2], s[3], push * s[0], push * s[1] - g

    def length(t, s):
        return np.hypot(s[0], s[1]) - 1.0

    length.terminal, length.direction = True, 1
    x0 = -np.cos(alpha), low, np.sqrt(2 * (SPECIFIC - g * height)), -fall
    run = solve_ivp(stance, (0.0, 2.0), x0, method="DOP853", rtol=1e-13, atol=1e-14, events=length)
    *_, y, _, rise = run.y_events[0][0]
    return y + rise**2 / (2 * g), fall / g + run.t_events[0][0] + rise / g


def gait(**parameters):
    """Height and period of the run, and the slope of its map, by SciPy."""
    height = brentq(lambda h: next_apex(h, **parameters)[0] - h, Y - 3e-3, Y + 3e-3, xtol=1e-15, rtol=1e-14)
    return height, next_apex(height, **parameters)[1], slope_at(height, **parameters)


def slope_at(height, **parameters):
    h = min(1e-5, (height - np.sin(parameters.get("alpha", STEEP))) / 100)
    ends = [next_apex(height + step, **parameters)[0] for step in (h, -h)]
    return (ends[0] - ends[1]) / (2 * h)


class TestRunner:
    @pytest.mark.parametrize(("name", "span"), [("k", (16e3, 40e3)), ("alpha", (1.0, 1.5))])
    def test_the_third_multiplier_is_the_slope_of_the_map_of_apices(self, name, span):
        branch = continue_orbit(running(), name, span)
        kinds = [each.kind for each in branch.bifurcations]
        assert sorted(set(kinds) - {"grazing"}) == ["flip", "fold"]
        assert np.all(branch.multipliers.imag == 0.0)
        assert np.all(np.sum(branch.multipliers == 1.0, axis=1) >= 2)
        for i in np.linspace(5, len(branch.parameter) - 6, 5).astype(int):
            orbit = branch.orbit(i)
            (apex,) = (jump for jump in orbit.arc().jumps if jump.transition == "apex")
            height, value = apex.x_minus[1], {name: orbit.parameters[name]}
            assert apex.x_minus[2] ** 2 / 2 + 9.81 * height == pytest.approx(SPECIFIC, rel=1e-11)
            assert next_apex(height, **value) == pytest.approx((height, orbit.period), rel=1e-9)
            slope = slope_at(height, **value)
            assert np.abs(orbit.multipliers - slope).min() == pytest.approx(
                0.0, abs=1e-4 * max(1, abs(slope))
            )

    def test_there_is_a_fold_where_the_slope_passes_one(self):
        branch = continue_orbit(running(), "alpha", (1.0, 1.2))
        (fold,) = branch.bifurcations
        assert fold.kind == "fold"
        (apex,) = (jump for jump in fold.orbit.arc().jumps if jump.transition == "apex")
        assert slope_at(apex.x_minus[1], alpha=fold.value) == pytest.approx(1.0, abs=1e-5)

    def test_the_slopes_at_the_energy(self):
        found = running().sensitivity(("k", "alpha"))
        for j, (name, value, h) in enumerate((("k", 20e3, 2.0), ("alpha", STEEP, 1e-4))):
            ends = [gait(**{name: value + step}) for step in (h, -h)]
            _, period, multiplier = (np.subtract(*ends) / (2 * h)).tolist()
            assert found.period[j] == pytest.approx(period, rel=1e-4)
            # The multipliers of the run are 1, 1, -0.16 and 0.
            assert found.multipliers[2, j] == pytest.approx(multiplier, rel=1e-4)
            assert found.multipliers[:2, j] == pytest.approx([0.0, 0.0], abs=1e-9)


def coupled():
    """A spring y that drives another one: the motion x = 0 has Mathieu's equation beside it.

    With tau = sqrt(w) t / 2: x'' + (4 c / w - 2 q cos(2 tau)) x = 0, q = 4 a A / w, energy w A^2 / 2.
    """
    return HybridSystem(
        state=("x", "y", "u", "v"),
        parameters={"c": 0.6, "w": 1.0, "a": 0.4},
        laws=Laws(
            conserved={
                "energy": lambda t, x, p: (
                    (x.u**2 + x.v**2 + p.c * x.x**2 + p.w * x.y**2) / 2 + p.a * x.x**2 * x.y
                )
            }
        ),
        modes=[
            Mode("m", lambda t, x, p: (x.u, x.v, -p.c * x.x - 2 * p.a * x.x * x.y, -p.w * x.y - p.a * x.x**2))
        ],
    )


@pytest.fixture
def orbit():
    return periodic_orbit(coupled(), (0.0, 0.6, 0.0, 0.0), period=6.3)


class TestMathieu:
    """Pairs of multipliers stay on the unit circle, or are real and inverse to each other: no torus."""

    def test_over_the_stiffness(self, orbit):
        branch = continue_orbit(orbit, "c", (0.1, 3.0))
        q = 4 * 0.4 * 0.6
        exact = [
            ("flip", mathieu_a(1, q)),
            ("branch point", mathieu_b(2, q)),
            ("branch point", mathieu_a(2, q)),
        ]
        assert [each.kind for each in branch.bifurcations] == [kind for kind, _ in exact]
        for each, (_, value) in zip(branch.bifurcations, exact, strict=True):
            assert each.value == pytest.approx(value / 4, rel=1e-9)
        other = switch_branch(branch.bifurcations[1])
        assert (
            "energy = 0.18."
            in periodic_orbit(
                coupled(), other.x0, parameters={"c": other.parameters["c"]}, period=other.period
            ).status.message
        )

    def test_over_the_other_stiffness_the_amplitude_changes(self, orbit):
        branch = continue_orbit(orbit, "w", (0.4, 2.0))

        def off(w, value):
            return 4 * 0.6 / w - value(4 * 0.4 * np.sqrt(2 * 0.18 / w) / w)

        point = brentq(off, 0.6, 0.7, args=(lambda q: mathieu_b(2, q),), xtol=1e-14)
        flip = brentq(off, 1.6, 1.8, args=(lambda q: mathieu_a(1, q),), xtol=1e-14)
        assert [each.kind for each in branch.bifurcations] == ["branch point", "flip"]
        assert [each.value for each in branch.bifurcations] == pytest.approx([point, flip], rel=1e-9)

    def test_in_two_parameters(self, orbit):
        (flip,) = continue_orbit(orbit, "c", (0.4, 0.7)).bifurcations
        curve = continue_bifurcation(flip, {"c": (0.1, 3.0), "a": (0.1, 1.0)})
        assert 4 * curve["c"] == pytest.approx(mathieu_a(1, 2.4 * curve["a"]), rel=1e-8)
        # Both multipliers of the pair are -1 all along.
        assert curve.points == ()


def test_a_pendulum_comes_to_rest_where_its_energy_is_the_least():
    swing = Mode("swing", lambda t, x, p: (x.v, -p.k * np.sin(x.q)))
    law = Laws(conserved={"energy": lambda t, x, p: x.v**2 / 2 - p.k * np.cos(x.q)})
    pendulum = HybridSystem(state=("q", "v"), parameters={"k": 1.0}, modes=[swing], laws=law)
    branch = continue_orbit(periodic_orbit(pendulum, (1.2, 0.0), period=6.9), "k", (0.1, 3.0))
    energy = -np.cos(1.2)
    exact = 4 * ellipk((1 + energy / branch.parameter) / 2) / np.sqrt(branch.parameter)
    assert branch.period == pytest.approx(exact, rel=1e-10)
    assert "at a point, where the orbit has no size" in branch.status.message
    assert branch.parameter.min() == pytest.approx(-energy, rel=1e-2)


def test_a_formula_with_a_kink_on_a_guard():
    """A mass in the potential k abs(x): the period is 4 sqrt(2 E) / k."""
    sides = ("right", -1, "left"), ("left", 1, "right")
    well = HybridSystem(
        state=("x", "v"),
        parameters={"k": 1.0},
        laws=Laws(conserved={"energy": lambda t, x, p: x.v**2 / 2 + p.k * np.abs(x.x)}),
        modes=[Mode(name, lambda t, x, p, sign=sign: (x.v, sign * p.k)) for name, sign, _ in sides],
        transitions=[
            Transition(name, other, Guard(lambda t, x, p: x.x, sign)) for name, sign, other in sides
        ],
    )
    orbit = periodic_orbit(well, (0.5, 0.0), mode="right", period=4.1)
    branch = continue_orbit(orbit, "k", (0.3, 2.0))
    assert "Held as at the start: energy = 0.5." in branch.status.message
    assert branch.period == pytest.approx(4.0 / branch.parameter, rel=1e-11)
    assert orbit.sensitivity(("k",)).period == pytest.approx([-4.0], rel=1e-9)


def test_on_a_circle_the_energy_decides_the_angular_momentum():
    """In the potential k r^4 / 4: of circles E = 3/4 k r^4 and L^2 = k r^6."""
    force = Mode(
        "m",
        lambda t, x, p: (
            x.u,
            x.v,
            -p.k * x.x * (x.x**2 + x.y**2),
            -p.k * x.y * (x.x**2 + x.y**2),
        ),
    )
    laws = Laws(
        conserved={
            "energy": lambda t, x, p: (x.u**2 + x.v**2) / 2 + p.k * (x.x**2 + x.y**2) ** 2 / 4,
            "momentum": lambda t, x, p: x.x * x.v - x.y * x.u,
        }
    )
    system = HybridSystem(state=("x", "y", "u", "v"), parameters={"k": 1.0}, modes=[force], laws=laws)
    branch = continue_orbit(periodic_orbit(system, (1.0, 0.0, 0.0, 1.0), period=6.28), "k", (0.5, 2.0))
    assert branch.status.message.endswith("Held as at the start: energy = 0.75.")
    x, y, u, v = branch.x0.T
    assert x * v - y * u == pytest.approx(branch.parameter**-0.25, rel=1e-9)


def test_a_spin_keeps_its_length_under_a_forcing():
    """In the field (b cos t, b sin t, d) it follows (b, 0, d - 1), which turns with the field (Rabi)."""

    def turned(t, x, p):
        one, two = p.b * np.cos(t), p.b * np.sin(t)
        return two * x[2] - p.d * x[1], p.d * x[0] - one * x[2], one * x[1] - two * x[0]

    spin = HybridSystem(
        state=3,
        parameters={"b": 0.3, "d": 1.2},
        modes=[Mode("m", turned)],
        period=2 * np.pi,
        laws=Laws(conserved={"length": lambda t, x, p: x[0] ** 2 + x[1] ** 2 + x[2] ** 2}),
    )
    start = np.array([0.3, 0.0, 0.2])
    orbit = periodic_orbit(spin, 2 * start / np.linalg.norm(start))
    branch = continue_orbit(orbit, "d", (0.5, 1.6))
    assert branch.status.message.endswith("Held as at the start: length = 4.")
    assert branch.bifurcations == ()
    exact = np.array([0.3 + 0 * branch.parameter, 0 * branch.parameter, branch.parameter - 1])
    assert branch.x0 == pytest.approx((2 * exact / np.linalg.norm(exact, axis=0)).T, abs=1e-9)
    assert branch.stable.all()


def test_a_period_that_is_given_decides_the_energy_along_a_branch():
    swing = Mode("swing", lambda t, x, p: (x.v, -p.k * np.sin(x.q)))
    law = Laws(conserved={"energy": lambda t, x, p: x.v**2 / 2 - p.k * np.cos(x.q)})
    forced = HybridSystem(state=("q", "v"), parameters={"k": 1.0}, modes=[swing], laws=law, period=8.0)
    branch = continue_orbit(periodic_orbit(forced, (1.7, 0.0)), "k", (0.9, 1.1))
    assert "Held" not in branch.status.message
    amplitude = np.arccos(np.cos(branch.x0[:, 0]) - branch.x0[:, 1] ** 2 / (2 * branch.parameter))
    assert 4 * ellipk(np.sin(amplitude / 2) ** 2) / np.sqrt(branch.parameter) == pytest.approx(8.0, rel=1e-8)


def test_a_seam_within_one_field_is_no_bifurcation():
    """At a gap of zero the field is the same on both sides of it."""

    def mesh(t, x, p):
        k = np.where(np.mod(t, 2 * np.pi / p.w) < np.pi / p.w, 1.2, 0.8)
        f = np.where(x.x > p.b, x.x - p.b, np.where(x.x < -p.b, x.x + p.b, 0.0))
        return x.v, 0.1 + 0.3 * np.cos(p.w * t) - 0.1 * x.v - k * f

    def of(gap):
        gear = from_equations(
            mesh, state=("x", "v"), parameters={"b": gap, "w": 0.8}, period=lambda p: 2 * np.pi / p.w
        )
        return continue_orbit(periodic_orbit(gear, (1.2, 0.0)), "w", (0.8, 0.985))

    assert of(0.0).bifurcations == ()
    assert len(of(0.02).bifurcations) > 0
