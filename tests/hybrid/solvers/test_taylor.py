"""The default solver: exact where documented, and fully accurate through contacts."""

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hybrid
import models
from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, Taylor, Transition, simulate
from tests.reference.load import reference

FOUNDING = reference("founding_system")
# A point that is pushed against a Hertz contact, with no forcing: every stay has a clock of its own.
CONTACT = HybridSystem(
    state=("z", "v"),
    parameters={"K": 1.0, "F": 1.0},
    modes=[
        Mode("free", lambda t, x, p: (x.v, p.F)),
        Mode("contact", lambda t, x, p: (x.v, p.F - p.K * np.maximum(x.z, 0.0) ** 1.5)),
    ],
    transitions=[
        Transition("free", "contact", Guard(lambda t, x, p: x.z, +1)),
        Transition("contact", "free", Guard(lambda t, x, p: x.z, -1)),
    ],
)


def ulps(found, exact):
    return abs(mp.mpf(float(found)) - exact) / mp.mpf(float(np.spacing(float(exact))))


def test_order_follows_the_tolerance():
    assert [Taylor(rtol=rtol).series_order for rtol in (1e-3, 1e-6, 1e-10, 1e-15)] == [13, 20, 28, 28]


def test_bounces_within_units_in_the_last_place():
    """Bounce times in closed form, for exactly the doubles that the solver receives."""
    ball = models.bouncing_ball()
    for e, h in ((0.8, 1.0), (0.5, 3.7), (0.95, 0.123)):
        arc = simulate(ball, (h, 0.0), (0.0, 100.0), parameters={"e": e})
        with mp.workdps(40):
            fall = mp.sqrt(2 * mp.mpf(h) / mp.mpf(9.81))
            for k, jump in enumerate(arc.jumps[:10]):
                exact = fall * (1 + 2 * sum(mp.mpf(e) ** i for i in range(1, k + 1)))
                # Half a unit is lost at each bounce, in the time and in the speed.
                assert ulps(jump.t, exact) <= (4 if k < 5 else 6)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-12])
def test_an_exact_mode_does_not_depend_on_the_tolerance(tolerance):
    """A driven oscillator from rest matches its closed form to rounding."""
    system = HybridSystem(
        state=("x", "v"),
        parameters={"c": 0.1, "k": 4.0, "A": 1.3, "w": 1.7},
        modes=[Mode("free", lambda t, x, p: (x.v, -p.k * x.x - p.c * x.v + p.A * np.cos(p.w * t)))],
    )
    arc = simulate(
        system, (0.0, 0.0), (0.0, 7.5), solver=Taylor(rtol=tolerance, atol=tolerance), tangent=True
    )
    t, c, k, A, w = 7.5, 0.1, 4.0, 1.3, 1.7
    gain = A / ((k - w**2) + 1j * c * w)
    wd = np.sqrt(k - c**2 / 4)

    def free(x, v):
        return np.exp(-c * t / 2) * (x * np.cos(wd * t) + (v + c / 2 * x) / wd * np.sin(wd * t))

    x = (gain * np.exp(1j * w * t)).real + free(-gain.real, -(1j * w * gain).real)
    assert arc.x[-1, 0] == pytest.approx(x, rel=1e-13)
    np.testing.assert_allclose(arc.fundamental[0], [free(1.0, 0.0), free(0.0, 1.0)], rtol=1e-13)


@pytest.mark.parametrize("gap", [0.05, 0.0])
def test_contacts_lose_no_order(gap):
    """The error of state and tangents is proportional to the tolerance down to rounding."""
    case = FOUNDING[f"D={gap:g}"]
    system = models.vibroimpact()
    span = case["periods"] * 2 * np.pi / 7.4
    steps = []
    for tolerance in (1e-6, 1e-8, 1e-10, 1e-12):
        arc = simulate(
            system,
            case["x0"],
            (0.0, span),
            parameters={"D": gap},
            solver=Taylor(rtol=tolerance, atol=1e-2 * tolerance),
            tangent=True,
        )
        size = np.max(np.abs(arc.x), axis=0)
        assert np.max(np.abs(arc.x[-1] - case["x0"]) / size) < max(100 * tolerance, 2e-12)
        found = np.sort_complex(np.linalg.eigvals(arc.fundamental))
        exact = np.sort_complex([complex(*pair) for pair in case["multipliers"]])
        assert np.max(np.abs(found - exact)) < max(3e4 * tolerance, 2e-10)
        steps.append(arc.steps)
    # A pair of order 8 that falls to order 3.5 would need five hundred times as many.
    assert steps[-1] < 1.5 * steps[0]


@pytest.mark.parametrize("speed", [1e-3, 1.0])
@pytest.mark.parametrize("wall", [0.0, 1.0, 1e3, 1e6])
def test_a_contact_far_from_the_origin_gives_the_speed_back(wall, speed):
    """The penetration is a difference of large numbers; its rounding in the force would cost 1e-7."""

    def penetration(t, x, p):
        return x.q - p.D

    system = HybridSystem(
        state=("q", "v"),
        parameters={"K": 1e6, "D": wall},
        modes=[
            Mode("free", lambda t, x, p: (x.v, 0.0)),
            Mode("contact", lambda t, x, p: (x.v, -p.K * np.maximum(x.q - p.D, 0.0) ** 1.5)),
        ],
        transitions=[
            Transition("free", "contact", Guard(penetration, direction=+1)),
            Transition("contact", "free", Guard(penetration, direction=-1)),
        ],
    )
    start = (wall - 0.5 * speed, speed)
    solver = Taylor(rtol=1e-13, atol=1e-15)
    arc = simulate(system, start, (0.0, 4.0), mode="free", solver=solver, tangent=True)
    assert [jump.target for jump in arc.jumps] == ["contact", "free"]
    assert arc.x[-1, 1] == pytest.approx(-speed, rel=1e-14)
    # Areas are preserved.
    assert np.linalg.det(arc.fundamental) == pytest.approx(1.0, rel=1e-12)


def test_dense_output_inside_a_contact():
    """The clock of a contact is not time, but the dense output is a function of time."""
    system, case = models.vibroimpact(), FOUNDING["D=0.05"]
    arc = simulate(system, case["x0"], (0.0, 1.0))
    other = simulate(system, case["x0"], (0.0, 1.0), solver=DOP853(rtol=1e-13, atol=1e-15))
    entry, exit_ = (jump.t for jump in arc.jumps[:2])
    times = np.linspace(entry, exit_, 41)
    np.testing.assert_allclose(arc(times), other(times), rtol=1e-8, atol=1e-11)


def test_a_run_may_end_and_resume_inside_a_contact():
    system, case = models.vibroimpact(), FOUNDING["D=0.05"]
    whole = simulate(system, case["x0"], (0.0, 0.8))
    entry, exit_ = (jump.t for jump in whole.jumps[:2])
    for share in (1e-6, 0.1, 0.5, 0.9, 1 - 1e-6):
        t = entry + share * (exit_ - entry)
        first = simulate(system, case["x0"], (0.0, t))
        assert first.mode[-1] == "contact"
        second = simulate(system, first.x[-1], (t, 0.8), mode="contact")
        np.testing.assert_allclose(second.x[-1], whole.x[-1], rtol=1e-9)


def test_a_contact_entered_at_rest():
    """A constant push from zero depth and speed doubles the static depth of a Hertz contact."""
    arc = simulate(CONTACT, (0.0, 0.0), (0.0, 6.0), mode="contact")
    assert arc.status.ok
    z, v = arc(np.linspace(0.0, 6.0, 50)).T
    np.testing.assert_allclose(v**2 / 2 + 0.4 * np.maximum(z, 0.0) ** 2.5 - z, 0.0, atol=1e-9)
    assert z.max() == pytest.approx(2.5 ** (2 / 3), rel=1e-2)


@given(
    end=st.floats(-3.0, 2.0).map(lambda power: 10.0**power),
    z=st.sampled_from((0.0, -1.0, -0.01)),
    v=st.floats(0.0, 2.0),
    tangent=st.booleans(),
)
def test_a_run_may_end_anywhere_in_a_contact(end, z, v, tangent):
    """The clock of the contact shows the end of a run to rounding, and the run is then complete.

    It was not: where the clock ended one rounding short, no step led through what was left.
    """
    arc = simulate(CONTACT, (z, v), (0.0, end), mode="contact" if z == 0.0 else "free", tangent=tangent)
    assert arc.status.ok
    assert arc.t[-1] == pytest.approx(end, rel=1e-14)
    z_end, v_end = arc.x[-1]
    energy = v_end**2 / 2 + 0.4 * max(z_end, 0.0) ** 2.5 - z_end
    assert energy == pytest.approx(v**2 / 2 - z, rel=1e-8, abs=1e-9)


def test_modes_without_series_run_beside_those_with():
    """A dry-friction mode with a kink runs by the pair, the flight before it exactly."""
    system = HybridSystem(
        state=("x", "v"),
        modes=[
            Mode("flight", lambda t, x, p: (x.v, -1.0)),
            Mode("mud", lambda t, x, p: (x.v, -np.sign(x.v) - x.v)),
        ],
        transitions=[
            Transition("flight", "mud", Guard(lambda t, x, p: x.x, -1), Reset(lambda t, x, p: (x.x, 2.0)))
        ],
    )
    arc = simulate(system, (0.5, 0.0), (0.0, 1.5), mode="flight", tangent=True)
    assert [str(each).split(" (")[0] for each in hybrid.compile_system(system).emitted.propagators] == [
        "exact",
        "Runge-Kutta pair",
    ]
    assert arc.jumps[0].t == pytest.approx(1.0, rel=1e-15)
    assert arc.x[-1, 1] == pytest.approx(3 * np.exp(-0.5) - 1, rel=1e-9)


def test_the_compiled_system_says_what_it_chose():
    text = repr(hybrid.compile_system(models.vibroimpact()))
    assert "mode free: exact (affine in the state)" in text
    assert "mode contact: Taylor series, desingularised" in text


def test_an_arc_says_how_it_was_computed():
    system, x0 = models.vibroimpact(), FOUNDING["D=0.05"]["x0"]
    arc = simulate(system, x0, (0.0, 0.1))
    assert arc.propagators == {"free": "exact", "contact": "Taylor series, desingularised"}
    arc = simulate(system, x0, (0.0, 0.1), solver=DOP853())
    assert set(arc.propagators.values()) == {"Runge-Kutta pair"}


def test_a_flight_without_end_is_followed_in_steps():
    """The section is crossed again only after a very long polynomial flight."""
    system = HybridSystem(state=("x",), modes=[Mode("go", lambda t, x, p: (1.0,))])
    section = hybrid.poincare_section(system, (0.0,), Guard(lambda t, x, p: x.x - 1e7, +1), points=1)
    assert section.t[0] == pytest.approx(1e7, rel=1e-14)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8, 1e-10])
def test_a_contact_is_left_once(tolerance):
    """The error of a root within the tolerance must not make the guard fire again."""
    arc = simulate(
        models.vibroimpact(),
        (0.0, 0.001, 0.0, 0.0),
        (0.0, 40 * np.pi / 7.4),
        solver=Taylor(rtol=tolerance, atol=1e-2 * tolerance),
    )
    assert np.all(np.diff(arc.jumps.t) > 1e-5)
    assert [jump.transition for jump in arc.jumps] == ["impact", "release"] * (len(arc.jumps) // 2)
