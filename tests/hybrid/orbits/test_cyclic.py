"""Cyclic components: orbits close up to a shift along them."""

import pickle

import attrs
import numpy as np
import pytest

from hybrid import (
    ArgumentError,
    Contact,
    Guard,
    HybridSystem,
    Laws,
    Mode,
    ModelError,
    Reset,
    Transition,
    attractors,
    continue_all,
    continue_bifurcation,
    continue_orbit,
    filippov,
    from_equations,
    mechanics,
    open_branch,
    periodic_orbit,
    switch_branch,
)
from hybrid.orbits.diagrams.leads import numbers_of
from lyapunov import floquet_exponents

G, E, W, U = 1.0, 0.5, 2 * np.pi, 0.3
# The ball hits the table at the phase whose cosine is this over the amplitude, and leaves it with 1 / 2.
SMALLEST = 0.5 * G * (1 - E) / (1 + E) / W


def conveyor(cyclic=("x",)):
    """A ball on a vibrating table that a belt carries along with the speed u."""
    return HybridSystem(
        state=("x", "q", "v"),
        parameters={"u": U, "w": W, "A": 0.035, "g": G, "e": E},
        period=lambda p: 2 * np.pi / p.w,
        modes=[Mode("flight", lambda t, x, p: (p.u, x.v, -p.g))],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q - p.A * np.sin(p.w * t), -1),
                Reset(lambda t, x, p: {"v": -p.e * x.v + (1 + p.e) * p.A * p.w * np.cos(p.w * t)}),
                name="hit",
            )
        ],
        cyclic=cyclic,
    )


def bouncing(phase, A):
    """The state of the orbit with one hit per period, at a time after the hit."""
    late = phase - np.arccos(SMALLEST / A) / W
    return A * np.sin(np.arccos(SMALLEST / A)) + 0.5 * late - 0.5 * late**2, 0.5 - late


def vertical_multipliers(A):
    """Determinant ``e^2`` and trace of the map from one hit to the next, linearised by hand."""
    curvature = (1 + E) * A * W**2 * np.sin(np.arccos(SMALLEST / A))
    trace = (1 + E) ** 2 - 2 * E - (1 + E) * curvature / G - (1 + E) ** 2 + 1 + E**2 + 2 * E
    return np.roots([1.0, -trace, E**2])


# The place where the belt is has no influence.
@pytest.mark.parametrize("x", [0.0, -1e4])
@pytest.mark.parametrize("t0", [0.4, 0.0])
def test_a_ball_on_a_belt(x, t0):
    A = 0.035
    q, v = bouncing(t0 if t0 > 0.2 else 1.0, A)
    orbit = periodic_orbit(conveyor(), (x, q + 1e-3, v - 1e-3), t0=t0)
    assert orbit.status.ok, orbit.status
    assert "family" not in orbit.status.message
    assert orbit.shift == {"x": pytest.approx(U, abs=1e-11 * max(1.0, abs(x)))}
    assert orbit.x0 == pytest.approx([x, q, v], abs=1e-10)
    assert orbit.residual < 1e-10
    expected = np.sort_complex([1.0, *vertical_multipliers(A)])
    np.testing.assert_allclose(np.sort_complex(orbit.multipliers), expected, rtol=1e-8)
    assert np.sum(np.abs(floquet_exponents(orbit)) < 1e-9) == 1
    arc = orbit.arc()
    assert arc["x"][-1] - arc["x"][0] == pytest.approx(U, abs=1e-11 * max(1.0, abs(x)))
    assert float(orbit.to_xarray()["shift"].sel(state="x")) == orbit.shift["x"]
    assert f"shift of x {U:g}" in repr(orbit)
    assert numbers_of(orbit)["shift"] == orbit.shift


def start():
    return periodic_orbit(conveyor(), (2.0, *bouncing(0.4, 0.035)), t0=0.4)


def test_branches_of_orbits_that_shift():
    """The multiplier -1 begins orbits of twice the period, which go twice as far."""
    branch = continue_orbit(start(), "A", (0.03, 0.045), outputs={"top": lambda arc: arc["q"].max()})
    assert branch.status.ok
    np.testing.assert_allclose(branch["shift of x"], U, rtol=1e-10)
    [flip] = branch.bifurcations
    assert flip.kind == "flip"
    assert np.prod(vertical_multipliers(flip.value) + 1.0) == pytest.approx(0.0, abs=1e-9)
    assert flip.outputs["shift of x"] == pytest.approx(U)
    np.testing.assert_array_equal(branch.stable, branch.parameter < flip.value)
    doubled = switch_branch(flip)
    assert doubled.status.ok
    assert doubled.shift == {"x": pytest.approx(2 * U)}
    follow = continue_orbit(doubled, "A", (0.03, 0.041))
    assert any("half the period" in each.message for each in follow.of("flip"))
    saved = open_branch(conveyor(), branch.to_xarray())
    np.testing.assert_allclose(saved["shift of x"], U, rtol=1e-10)
    assert saved.orbit(1).shift == {"x": pytest.approx(U)}
    assert saved.orbit(1).residual < 1e-9
    assert pickle.loads(pickle.dumps(saved.outputs)).keys() == {"shift of x", "top"}


def test_the_shift_along_a_branch():
    branch = continue_orbit(start(), "u", (-1.0, 1.0))
    np.testing.assert_allclose(branch["shift of x"], branch.parameter, atol=1e-10)
    with pytest.raises(ArgumentError, match="'shift of x' is on every branch"):
        continue_orbit(start(), "u", (-1.0, 1.0), outputs={"shift of x": lambda arc: 0.0})


def test_derivatives_hold_the_cyclic_component():
    found = start().sensitivity(["A", "u"])
    near = [bouncing(0.4, 0.035 + h) for h in (1e-5, -1e-5)]
    np.testing.assert_allclose(found.x0[1:, 0], np.subtract(*near) / 2e-5, rtol=1e-6)
    np.testing.assert_allclose(found.x0[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(found.x0[:, 1], 0.0, atol=1e-10)


def test_attractors_of_what_moves_on():
    """From one place to the next the ball is never near a point of before, but for the shift."""
    over = {"x": (0.0, 9.0), "q": (0.09, 0.1), "v": (0.15, 0.25)}
    found = attractors(conveyor(), over, t0=0.4, starts=8)
    [orbit] = found.values()
    assert orbit.kind == "periodic"
    assert orbit.period == pytest.approx(1.0)
    np.testing.assert_allclose(orbit.points, [[0.0, *bouncing(0.4, 0.035)]], atol=1e-6)


def stepper():
    """It pushes until s = L, then recovers; each push adds 1 to z, which fades and drives it on."""
    return HybridSystem(
        state=("y", "s", "z"),
        parameters={"u": 0.2, "L": 1.0, "k": 0.7},
        modes=[
            Mode("push", lambda t, x, p: (p.u + x.z, 1.0, -p.k * x.z)),
            Mode("recover", lambda t, x, p: (0.0, -2.0, -p.k * x.z)),
        ],
        transitions=[
            Transition("push", "recover", Guard(lambda t, x, p: x.s - p.L, +1), name="let go"),
            Transition(
                "recover",
                "push",
                Guard(lambda t, x, p: x.s, -1),
                Reset(lambda t, x, p: {"z": x.z + 1.0, "y": x.y + 0.25}),
                name="step",
            ),
        ],
        cyclic=("y",),
    )


def far(L, u=0.2, k=0.7):
    """By how much it moves on per period of ``3 L / 2``."""
    return 0.25 + u * L + (1 - np.exp(-k * L)) / k / (1 - np.exp(-1.5 * k * L))


def test_an_autonomous_drive():
    orbit = periodic_orbit(stepper(), (7.0, 0.5, 1.2), mode="push", period=1.4)
    assert orbit.status.ok, orbit.status
    assert orbit.period == pytest.approx(1.5, rel=1e-10)
    assert orbit.shift["y"] == pytest.approx(far(1.0), rel=1e-10)
    assert orbit.x0[0] == 7.0
    np.testing.assert_allclose(np.sort(orbit.multipliers), [np.exp(-1.05), 1.0, 1.0], rtol=1e-8)
    branch = continue_orbit(orbit, "L", (0.5, 2.0))
    assert branch.status.ok
    assert not branch.bifurcations
    assert branch.stable.all()
    np.testing.assert_allclose(branch["shift of y"], far(branch.parameter), rtol=1e-9)
    assert np.all(np.sum(np.abs(branch.multipliers - 1.0) < 1e-9, axis=1) == 2)
    assert orbit.sensitivity(["L"]).period == pytest.approx([1.5], rel=1e-8)


def test_attractors_of_an_autonomous_drive():
    step = Guard(lambda t, x, p: x.s - 0.5 * p.L, +1)
    over = {"y": (-5.0, 5.0), "s": (0.1, 0.4), "z": (0.0, 2.0)}
    [found] = attractors(stepper(), over, mode="push", section=step, starts=5).values()
    assert (found.kind, found.round) == ("periodic", 1)
    assert found.period == pytest.approx(1.5, rel=1e-8)


def test_a_chaotic_attractor_of_what_moves_on():
    """Duffing's oscillator, whose place drives y: an exponent is 0 by the shift, and that makes no torus."""
    duffing = HybridSystem(
        state=("y", "x", "v"),
        period=2 * np.pi,
        modes=[Mode("m", lambda t, x, p: (1.0 + x.x, x.v, x.x - x.x**3 - 0.2 * x.v + 0.3 * np.cos(t)))],
        cyclic=("y",),
    )
    over = {"y": (-5.0, 5.0), "x": (-1.0, 1.0), "v": (-1.0, 1.0)}
    [found] = attractors(duffing, over, starts=3, tolerance=0.05).values()
    assert found.kind == "chaotic"
    assert np.abs(found.exponents).min() < 5e-3
    assert found.exponents.sum() == pytest.approx(-0.2, abs=1e-6)


def test_curves_and_diagrams(tmp_path):
    """Flips lie where ``1 + e^2`` plus the trace is zero, which gives the sine of the phase of the hit."""
    [flip] = continue_orbit(start(), "A", (0.03, 0.045)).bifurcations
    curve = continue_bifurcation(flip, {"A": (0.02, 0.08), "e": (0.4, 0.55)})
    A, e = curve.values.T
    sine, cosine = 2 * G * (1 + e**2) / (1 + e) ** 2 / W**2, 0.5 * G * (1 - e) / (1 + e) / W
    np.testing.assert_allclose(A, np.hypot(sine, cosine), rtol=1e-8)
    np.testing.assert_allclose(curve.outputs["shift of x"], U, rtol=1e-9)
    found = continue_all(start(), "A", (0.03, 0.041), depth=1, store=tmp_path)
    assert [round(float(each["shift of x"][0]), 9) for each in found] == [U, 2 * U]


def test_conserved_quantities_besides():
    """A harmonic oscillator of the energy 1/2 drives y by the square of its speed."""
    system = HybridSystem(
        state=("y", "q", "v"),
        parameters={"w": 1.0},
        modes=[Mode("m", lambda t, x, p: (x.v**2, x.v, -(p.w**2) * x.q))],
        laws=Laws(conserved={"energy": lambda t, x, p: 0.5 * (x.v**2 + (p.w * x.q) ** 2)}),
        cyclic=("y",),
    )
    orbit = periodic_orbit(system, (3.0, 0.0, 1.0), period=6.2)
    assert orbit.status.ok
    assert orbit.shift["y"] == pytest.approx(np.pi, rel=1e-9)
    branch = continue_orbit(orbit, "w", (0.5, 2.0))
    np.testing.assert_allclose(branch["shift of y"], np.pi / branch.parameter, rtol=1e-8)
    assert branch.stable.all()
    assert not branch.bifurcations


def test_an_orbit_that_needs_a_cyclic_component_says_so():
    orbit = periodic_orbit(conveyor(()), (0.0, *bouncing(0.4, 0.035)), t0=0.4)
    assert not orbit.status.ok
    assert "declare it with HybridSystem(cyclic=('x',))." in orbit.status.remedy


def test_steady_motion_is_no_orbit():
    """It moves on, and nothing else does: any time is a period."""
    sliding = HybridSystem(
        state=("y", "z"), modes=[Mode("m", lambda t, x, p: (1.0 + x.z, -x.z))], cyclic=("y",)
    )
    orbit = periodic_orbit(sliding, (0.0, 0.0), period=1.0)
    assert not orbit.status.ok
    assert "equilibrium" in orbit.status.message


def hopper(**options):
    """A ball in the plane on a vibrating floor; drag and a force carry it along."""
    return mechanics(
        coordinates=("x", "y"),
        velocities=("u", "v"),
        parameters={"a": 0.6, "c": 2.0, "w": W, "A": 0.035, "g": G, "e": E},
        mass=lambda t, x, p: (1.0, 1.0),
        forces=lambda t, x, p: (p.a - p.c * x.u, -p.g),
        contacts=[Contact("floor", gap=lambda t, x, p: x.y - p.A * np.sin(p.w * t), restitution="e")],
        period=lambda p: 2 * np.pi / p.w,
        **options,
    )


def test_bodies_with_contacts():
    q, v = bouncing(0.4, 0.035)
    orbit = periodic_orbit(hopper(cyclic=("x",)), {"x": 1.0, "y": q, "u": 0.1, "v": v - 1e-3}, t0=0.4)
    assert orbit.status.ok, orbit.status
    assert orbit.shift == {"x": pytest.approx(0.3, rel=1e-10)}
    assert orbit.x0 == pytest.approx([1.0, q, 0.3, v], abs=1e-9)
    expected = np.sort_complex([1.0, np.exp(-2.0), *vertical_multipliers(0.035)])
    np.testing.assert_allclose(np.sort_complex(orbit.multipliers), expected, rtol=1e-7)


def test_contacts_are_checked():
    with pytest.raises(ModelError, match=r"'y' is not cyclic\. Contact 'floor': gap is"):
        hopper(cyclic=("y",))
    with pytest.raises(ModelError, match=r"'u' is not cyclic\. mechanics: motion without contacts is"):
        hopper(cyclic=("u",))


@pytest.mark.parametrize(
    ("changed", "function"),
    [
        ({"cyclic": ("q",)}, "'q' is not cyclic. Transition 'hit': guard is"),
        ({"cyclic": ("v",)}, "'v' is not cyclic. Mode 'flight': field is"),
    ],
)
def test_what_a_function_depends_on_is_not_cyclic(changed, function):
    with pytest.raises(ModelError, match=function):
        attrs.evolve(conveyor(), **changed)


def test_a_reset_must_shift_with_it():
    hit = attrs.evolve(conveyor().transitions[0], reset=Reset(lambda t, x, p: {"x": 0.0, "v": -x.v}))
    with pytest.raises(ModelError, match=r"'x' is not cyclic\. Transition 'hit': reset is"):
        attrs.evolve(conveyor(), transitions=[hit])
    on = attrs.evolve(hit, reset=Reset(lambda t, x, p: {"x": x.x + 0.5, "v": -x.v}))
    assert attrs.evolve(conveyor(), transitions=[on]).cyclic == ("x",)


def test_names_of_cyclic_components():
    with pytest.raises(ArgumentError, match="cyclic must be names of components"):
        conveyor((1,))
    with pytest.raises(ModelError, match="cyclic: State component 'y' does not exist"):
        conveyor(("y",))
    with pytest.raises(ModelError, match="'x' is in angles= too"):
        attrs.evolve(conveyor(), angles={"x": 1.0})
    assert "cyclic: x" in repr(conveyor())
    assert not np.any(conveyor(()).is_cyclic)


def test_plain_equations_and_sliding():
    block = from_equations(
        lambda t, x, p: (x.v, -np.sign(x.v) + 2.0 * np.sin(t)), state=("q", "v"), cyclic=("q",)
    )
    assert block.cyclic == ("q",)
    with pytest.raises(ModelError, match="'v' is not cyclic"):
        from_equations(lambda t, x, p: (x.v, -np.sign(x.v)), state=("q", "v"), cyclic=("v",))
    belt = filippov(
        ("q", "v"),
        {},
        lambda t, x, p: (x.v, 1.0),
        lambda t, x, p: (x.v, -1.0),
        lambda t, x, p: x.v,
        cyclic=("q",),
    )
    assert belt.cyclic == ("q",)
