"""Stable and unstable periodic orbits compared with closed forms, and the status if there is none."""

import math

import numpy as np
import pytest

import hybrid
import models
from hybrid import Every, HybridSystem, Mode, StatusCode, Transition, periodic_orbit, simulate
from models import bouncing_ball, buck_converter, impact_oscillator, vibroimpact
from models.one_impact import one_impact_orbits
from tests.cases import systems
from tests.reference.load import complex_pairs, reference

OSCILLATOR = impact_oscillator()


def in_order(multipliers):
    return sorted(map(complex, multipliers), key=lambda m: (round(m.real, 7), m.imag))


class TestForced:
    def test_founding_system(self):
        exact = reference("founding_system")["D=0.05"]
        orbit = periodic_orbit(vibroimpact(), np.array(exact["x0"]) * 1.001, mode="free")
        assert orbit.status.ok
        np.testing.assert_allclose(orbit.x0, exact["x0"], atol=1e-8)
        np.testing.assert_allclose(
            in_order(orbit.multipliers), complex_pairs(exact["multipliers"]), atol=1e-6
        )
        assert orbit.signature == ("free", "contact", "free")
        assert orbit.residual < 1e-10

    @pytest.mark.parametrize("t0", [0.0, 0.3, 2.0, -1.0, 50.0])
    def test_from_any_phase(self, t0):
        exact = complex_pairs(reference("impact_oscillator")["orbits"][0]["multipliers"])
        guess = simulate(OSCILLATOR, (0.0, 0.0), (t0 - 60.0, t0)).x[-1]
        orbit = periodic_orbit(OSCILLATOR, guess, t0=t0)
        assert orbit.status.ok
        np.testing.assert_allclose(in_order(orbit.multipliers), exact, atol=1e-8)
        assert orbit.period == pytest.approx(2 * math.pi, rel=1e-14)
        assert orbit.t0 == t0

    def test_unstable_orbit(self):
        """The one-impact orbit beyond its flip is found although no run stays near it."""
        parameters = {"k": 1.0, "c": 0.1, "A": 1.0, "w": 2.8, "d": 0.0, "r": 0.8}
        (closed,) = one_impact_orbits(**parameters, n=1)
        assert abs(closed.multipliers).max() > 1.05
        impact = closed.theta / 2.8
        t0 = impact + 0.5
        start = simulate(OSCILLATOR, (0.0, -0.8 * closed.V), (impact, t0), parameters=parameters).x[-1]
        orbit = periodic_orbit(OSCILLATOR, start + np.array([1e-3, -1e-3]), t0=t0, parameters=parameters)
        assert orbit.status.ok
        np.testing.assert_allclose(orbit.x0, start, atol=1e-8)
        np.testing.assert_allclose(in_order(orbit.multipliers), in_order(closed.multipliers), atol=1e-8)

    def test_several_periods_square_the_multipliers(self):
        once = periodic_orbit(OSCILLATOR, (0.9, 1.0))
        twice = periodic_orbit(OSCILLATOR, once.x0, periods=2)
        np.testing.assert_allclose(in_order(twice.multipliers), in_order(once.multipliers**2), atol=1e-9)
        assert twice.signature == ("flight",) * 3

    def test_arc_closes(self):
        orbit = periodic_orbit(OSCILLATOR, (0.9, 1.0), t0=0.4)
        arc = orbit.arc()
        assert (arc.t[0], arc.t[-1]) == pytest.approx((0.4, 0.4 + orbit.period), rel=1e-14)
        np.testing.assert_allclose(arc.x[-1], arc.x[0], atol=1e-8)


class TestAutonomous:
    def test_rimless_wheel_from_the_state_after_a_step(self):
        exact = reference("rimless_wheel")
        guess = (exact["theta"], exact["omega"] + 0.02)
        orbit = periodic_orbit(models.rimless_wheel(), guess, period=1.0)
        assert orbit.status.ok
        assert orbit.period == pytest.approx(exact["period"], rel=1e-9)
        np.testing.assert_allclose(in_order(orbit.multipliers), sorted(exact["multipliers"]), atol=1e-7)
        # The point lies away from the step; the state after it is on the arc.
        jump = orbit.arc().jumps[0]
        np.testing.assert_allclose(jump.x_plus, [exact["theta"], exact["omega"]], atol=1e-7)

    def test_stick_slip(self):
        exact = reference("stick_slip")
        orbit = periodic_orbit(systems.stick_slip(), (0.5, 0.2), mode="stick", period=11.0)
        assert orbit.status.ok
        assert orbit.period == pytest.approx(exact["period"], rel=1e-9)
        np.testing.assert_allclose(in_order(orbit.multipliers), [0.0, 1.0], atol=1e-8)
        assert set(orbit.signature) == {"stick", "slip"}

    @pytest.mark.parametrize("converter", reference("buck_converter"), ids=lambda c: f"{c['E']:g} V")
    def test_buck_converter(self, converter):
        """Unstable at 25 V. The start is at a tick of the clock, which forgets the phase of the ramp."""
        parameters = {"E": converter["E"]}
        orbit = periodic_orbit(buck_converter(), (*converter["x0"], 0.0), mode="off", parameters=parameters)
        assert orbit.status.ok
        expected = in_order([*complex_pairs(converter["multipliers"]), 0.0])
        np.testing.assert_allclose(in_order(orbit.multipliers), expected, atol=1e-12)

    def test_a_smooth_limit_cycle(self):
        """``r' = r (1 - r^2)``: multipliers 1 and ``exp(-4 pi)``."""

        def field(t, x, p):
            r2 = x.x**2 + x.y**2
            return x.x * (1 - r2) - x.y, x.y * (1 - r2) + x.x

        system = HybridSystem(state=("x", "y"), modes=[Mode("turn", field)])
        orbit = periodic_orbit(system, (1.2, 0.1), period=6.0)
        assert orbit.status.ok
        assert orbit.period == pytest.approx(2 * math.pi, rel=1e-9)
        np.testing.assert_allclose(in_order(orbit.multipliers), [math.exp(-4 * math.pi), 1.0], atol=1e-9)
        assert np.hypot(*orbit.x0) == pytest.approx(1.0, rel=1e-9)
        assert orbit.signature == ("turn",)


def van_der_pol():
    """The limit cycle of mu = 1 with any centre and size."""

    def field(t, x, p):
        q = (x.x - p.offset) / p.size
        return x.y, (1 - q**2) * x.y - (x.x - p.offset)

    return HybridSystem(
        state=("x", "y"), parameters={"offset": 0.0, "size": 1.0}, modes=[Mode("turn", field)]
    )


class TestOwnScale:
    """An orbit closes on the scale of its own motion, for any offset and units."""

    @pytest.mark.parametrize(
        ("offset", "size"), [(0.0, 1.0), (1e6, 1.0), (-30.0, 1e-3), (0.0, 1e-9), (0.0, 1e9)]
    )
    def test_far_from_the_origin_and_tiny(self, offset, size):
        parameters = {"offset": offset, "size": size}
        orbit = periodic_orbit(van_der_pol(), (offset + 2 * size, 0.0), parameters=parameters, period=6.6)
        assert orbit.status.ok
        assert orbit.period == pytest.approx(6.66328685933, rel=1e-7)
        # An orbit of a millionth of the offset has fewer digits within the tolerance of the states.
        atol = 1e-6 if offset else 1e-9
        np.testing.assert_allclose(np.log(orbit.multipliers) / orbit.period, [0.0, -1.05937699], atol=atol)

    def test_one_component_a_billion_times_smaller_than_the_other(self):
        """Closure is checked on the scale of each component, not of the largest."""
        system = HybridSystem(
            state=("q", "v"),
            parameters={"unit": 1e-9},
            modes=[Mode("on", lambda t, x, p: (p.unit * x.v, -x.q / p.unit - x.v + np.cos(t)))],
            period=2 * np.pi,
        )
        orbit = periodic_orbit(system, (3e-9, 5.0))
        assert orbit.status.ok
        np.testing.assert_allclose(orbit.x0, [0.0, 1.0], atol=1e-9)
        assert abs(orbit.x0[0]) < 1e-18

    def test_an_equilibrium_repeats_after_each_forcing_period(self):
        system = HybridSystem(
            state=("q",),
            parameters={"rest": 5.0},
            modes=[Mode("on", lambda t, x, p: (p.rest - x.q,))],
            period=1.0,
        )
        for rest in (5.0, 0.0):
            orbit = periodic_orbit(system, (0.3,), parameters={"rest": rest})
            assert orbit.status.ok
            assert orbit.x0[0] == pytest.approx(rest, rel=1e-14, abs=1e-14)
            assert orbit.multipliers[0] == pytest.approx(math.exp(-1), rel=1e-10)

    def test_states_that_only_jumps_change(self):
        """Once per period ``q`` becomes ``1 - q / 2``; between jumps it is constant. Fixed point 2/3."""
        system = HybridSystem(
            state=("q",),
            modes=[Mode("rest", lambda t, x, p: (0.0,))],
            transitions=[
                hybrid.Transition(
                    "rest",
                    "rest",
                    hybrid.Guard(lambda t, x, p: np.sin(2 * np.pi * (t - 0.3)), +1),
                    hybrid.Reset(lambda t, x, p: (1 - x.q / 2,)),
                )
            ],
            period=1.0,
        )
        once = periodic_orbit(system, (0.1,))
        assert once.status.ok
        assert once.x0[0] == pytest.approx(2 / 3, rel=1e-12)
        assert once.multipliers[0] == pytest.approx(-0.5, rel=1e-12)

    def test_one_of_a_family_of_orbits(self):
        """Newton's step is arbitrary along the family of a pendulum; the result is still an orbit."""
        pendulum = HybridSystem(state=("q", "v"), modes=[Mode("swing", lambda t, x, p: (x.v, -np.sin(x.q)))])
        orbit = periodic_orbit(pendulum, (1.0, 0.0), period=6.7)
        assert orbit.status.ok
        arc = orbit.arc()
        np.testing.assert_allclose(arc.x[-1], arc.x[0], atol=1e-9)

    @pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
    def test_one_of_a_family_near_the_guess_although_the_period_is_not(self, unit):
        """With the period wrong by 5 %, Newton's method itself would prefer smaller and smaller orbits."""
        spring = HybridSystem(
            state=("q", "v"),
            parameters={"unit": 1.0},
            modes=[Mode("swing", lambda t, x, p: (x.v, -x.q - (x.q / p.unit) ** 2 * x.q))],
        )
        orbit = periodic_orbit(spring, (unit, 0.0), parameters={"unit": unit}, period=5.0)
        assert orbit.status.ok
        energy = orbit.x0[1] ** 2 / 2 + orbit.x0[0] ** 2 / 2 + orbit.x0[0] ** 4 / unit**2 / 4
        assert energy == pytest.approx(0.75 * unit**2, rel=0.05)
        assert orbit.residual < 1e-10 * unit


class TestNoOrbit:
    def test_says_how_far_it_got(self):
        orbit = periodic_orbit(OSCILLATOR, (0.0, 0.0), max_iterations=1)
        assert orbit.status.code == StatusCode.NOT_CONVERGED
        assert "Newton's method did not converge: the residual is" in orbit.status.message
        assert "after 1 iterations" in orbit.status.message
        assert "raise max_iterations" in orbit.status.remedy
        assert orbit.residual > 1e-6

    def test_a_run_that_ends_early_says_why(self):
        orbit = periodic_orbit(OSCILLATOR, (0.0, 0.0), solver=hybrid.DOP853(max_steps=5))
        assert orbit.status.code == StatusCode.MAX_STEPS
        assert not orbit.status.ok

    def test_a_ball_that_loses_energy_has_none(self):
        orbit = periodic_orbit(bouncing_ball(), (1.0, 0.0), period=1.0)
        assert orbit.status.code == StatusCode.NOT_CONVERGED

    def test_an_orbit_that_ends_in_another_mode_is_none(self):
        """The states agree after one period, but the modes differ, so the orbit has not closed."""
        guard = hybrid.Guard(lambda t, x, p: np.sin(2 * np.pi * t), +1)
        system = HybridSystem(
            state=("q",),
            modes=[Mode("a", lambda t, x, p: (1 - x.q,)), Mode("b", lambda t, x, p: (1 - x.q,))],
            transitions=[hybrid.Transition("a", "b", guard)],
            period=1.0,
        )
        first = periodic_orbit(system, (1.0,), mode="a", t0=0.25)
        assert first.status.code == StatusCode.NOT_CONVERGED
        assert "the orbit ends in mode 'b' and starts in 'a'" in first.status.message
        later = periodic_orbit(system, (0.7,), mode="b", t0=0.25)
        assert later.status.ok
        np.testing.assert_allclose(later.x0, 1.0, rtol=1e-12)

    @pytest.mark.parametrize("guess", [(0.0, 0.0), (1.0, 2.0)])
    @pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
    def test_an_orbit_at_infinity_is_none(self, guess, unit):
        """At resonance the amplitude grows forever; far out the two ends agree in 13 digits."""
        system = HybridSystem(
            state=("q", "v"),
            parameters={"unit": 1.0},
            modes=[Mode("on", lambda t, x, p: (x.v, -x.q + p.unit * np.cos(t)))],
            period=2 * np.pi,
        )
        orbit = periodic_orbit(system, np.array(guess) * unit, parameters={"unit": unit})
        assert orbit.status.code == StatusCode.NOT_CONVERGED
        assert "no orbit is near" in orbit.status.message

    @pytest.mark.parametrize("rate", [lambda q: np.exp(-q), lambda q: 1 / (1 + q**2), lambda q: 1e-9 + 0 * q])
    @pytest.mark.parametrize("forced", [True, False])
    def test_a_solution_that_drifts_ever_more_slowly_is_none(self, rate, forced):
        period = {"period": 1.0}
        system = HybridSystem(
            state=("q",), modes=[Mode("on", lambda t, x, p: (rate(x.q),))], **(period if forced else {})
        )
        orbit = periodic_orbit(system, (1.0,), **({} if forced else period))
        assert orbit.status.code == StatusCode.NOT_CONVERGED

    @pytest.mark.parametrize("pace", [1.0, 1e-6])
    @pytest.mark.parametrize(
        "rate", [lambda q: np.exp(-q), lambda q: 1 / (1 + q**4), lambda q: (1 + q**2) ** -1.5]
    )
    @pytest.mark.parametrize("push", [0.0, 1.0])
    def test_a_drift_that_rounding_hides_is_no_orbit(self, rate, pace, push):
        """Far out no step changes the state any more: alone, or beside a component that swings."""
        system = HybridSystem(
            state=("q", "v"),
            parameters={"pace": 1.0, "push": 1.0},
            modes=[Mode("on", lambda t, x, p: (p.pace * rate(x.q), p.push * np.cos(t) - x.v))],
            period=2 * np.pi,
        )
        orbit = periodic_orbit(system, (0.0, 0.5), parameters={"pace": pace, "push": push})
        assert orbit.status.code == StatusCode.NOT_CONVERGED

    @pytest.mark.parametrize("pace", [1e-16, 1e-12, 1e-3, 1.0, 30.0])
    @pytest.mark.parametrize("place", [0.0, 5.0, -1e6])
    def test_a_rest_that_attracts_at_any_pace_is_one(self, place, pace):
        system = HybridSystem(
            state=("q", "v"),
            parameters={"pace": 1.0, "place": 0.0},
            modes=[Mode("on", lambda t, x, p: (p.pace * (p.place - x.q), np.cos(t) - x.v))],
            period=2 * np.pi,
        )
        orbit = periodic_orbit(system, (place, 0.5), parameters={"pace": pace, "place": place})
        assert orbit.status.ok
        np.testing.assert_allclose(orbit.x0, (place, 0.5), rtol=1e-10)

    @pytest.mark.parametrize(
        "force",
        [
            lambda q, v: 1e-4 * v**3,
            lambda q, v: -1e-4 * v**3,
            lambda q, v: 1e-11 * v,
            lambda q, v: 1e-3 * q**2 * v,
        ],
    )
    @pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
    def test_a_spiral_is_none_however_slow(self, force, unit):
        """Newton's method creeps to the equilibrium; on its way the ends agree ever better."""
        system = HybridSystem(
            state=("q", "v"),
            modes=[Mode("on", lambda t, x, p: (x.v, -x.q - force(x.q / unit, x.v / unit) * unit))],
        )
        orbit = periodic_orbit(system, (unit, 0.0), period=6.0)
        assert orbit.status.code == StatusCode.NOT_CONVERGED

    @pytest.mark.parametrize("unit", [1e-16, 1e-20, 1e-30])
    def test_states_that_the_solver_does_not_control_are_none(self, unit):
        """They are below its absolute tolerance; with a lower one the orbit is found."""
        system = HybridSystem(
            state=("q", "v"),
            parameters={"unit": unit},
            modes=[
                Mode(
                    "on",
                    lambda t, x, p: (x.v, -x.q - x.v - (x.q / p.unit) ** 3 * p.unit + p.unit * np.cos(t)),
                )
            ],
            period=2 * np.pi,
        )
        guess = np.array([-0.3, 0.5])
        orbit = periodic_orbit(system, guess * unit)
        assert orbit.status.code == StatusCode.NOT_CONVERGED
        assert "below the atol of the solver" in orbit.status.message
        assert "lower atol" in orbit.status.remedy
        found = periodic_orbit(system, guess * unit, solver=hybrid.DOP853(rtol=1e-12, atol=1e-14 * unit))
        wanted = periodic_orbit(system, guess, parameters={"unit": 1.0})
        assert found.status.ok
        np.testing.assert_allclose(found.x0 / unit, wanted.x0, rtol=1e-9)
        np.testing.assert_allclose(found.multipliers, wanted.multipliers, rtol=1e-9)

    @pytest.mark.parametrize("rate", [40.0, 300.0])
    def test_an_orbit_whose_errors_outgrow_it_is_none(self, rate):
        """The orbit is known to rounding, and after one period its error is larger than all else."""
        system = HybridSystem(
            state=("q",),
            modes=[Mode("on", lambda t, x, p: (rate * x.q + np.cos(2 * np.pi * t),))],
            period=1.0,
        )
        orbit = periodic_orbit(system, (-1 / rate,))
        assert orbit.status.code == StatusCode.NOT_CONVERGED
        assert "errors of the start grow by a factor of" in orbit.status.message

    @pytest.mark.parametrize("size", [1e20, 1e160, 1e200, 1e308])
    @pytest.mark.parametrize("period", [None, 3.0])
    def test_a_guess_out_of_all_proportion_is_none(self, size, period):
        """The Newton steps of the oscillator, which is linear between impacts, may lead back to its orbit."""
        ball = {"system": bouncing_ball(), "period": period} if period else {"system": OSCILLATOR}
        orbit = periodic_orbit(x0=(-size, size) if period is None else (size, 0.0), **ball)
        if orbit.status.ok:
            near = periodic_orbit(OSCILLATOR, (1.0, 0.0))
            assert period is None
            np.testing.assert_allclose(orbit.x0, near.x0, rtol=1e-9)

    def test_a_drift_that_the_forcing_hides_is_none(self):
        system = HybridSystem(
            state=("q",),
            modes=[Mode("on", lambda t, x, p: (np.cos(t) + 1 / (1 + x.q**4),))],
            period=2 * np.pi,
        )
        assert periodic_orbit(system, (0.3,)).status.code == StatusCode.NOT_CONVERGED

    @pytest.mark.parametrize("guess", [(0.0, 0.0), (1e-9, 0.0), (1e-3, 0.0)])
    @pytest.mark.parametrize("offset", [0.0, 5.0])
    def test_an_equilibrium_is_no_orbit_of_an_autonomous_system(self, guess, offset):
        orbit = periodic_orbit(
            van_der_pol(), (offset + guess[0], guess[1]), parameters={"offset": offset}, period=6.6
        )
        assert orbit.status.code == StatusCode.NOT_CONVERGED

    @pytest.mark.parametrize(
        ("system", "arguments", "text"),
        [
            (
                OSCILLATOR,
                {"period": 1.0},
                "period is for autonomous systems; this one has the forcing period",
            ),
            (OSCILLATOR, {"periods": 0}, "periods must be a whole number of at least 1; got 0"),
            (OSCILLATOR, {"tolerance": 0.0}, "tolerance must be above 0 and below 1; got 0.0"),
            (OSCILLATOR, {"max_iterations": -1}, "max_iterations must be a whole number of at least 0"),
            (OSCILLATOR, {"t0": math.inf}, "t0 must be finite"),
            (OSCILLATOR, {"x0": (0.0,)}, r"x0 has shape \(1,\)"),
            (bouncing_ball(), {}, "An autonomous system needs a guess of its period: give period="),
            (bouncing_ball(), {"period": -1.0}, "period must be positive; got -1.0"),
        ],
    )
    def test_bad_arguments(self, system, arguments, text):
        with pytest.raises(hybrid.ArgumentError, match=text):
            periodic_orbit(system, **({"x0": (0.5, 0.0)} | arguments))


@pytest.mark.parametrize("t0", [3.0, 100.0, -7.5])
def test_the_time_at_the_guess_does_not_matter_to_an_autonomous_orbit(t0):
    """A clock that jumps once per period, with a memory that decays; the orbit begins far from time zero."""
    system = HybridSystem(
        state=("phase", "q"),
        modes=[Mode("on", lambda t, x, p: (1.0, -x.q))],
        transitions=[
            hybrid.Transition(
                "on",
                "on",
                hybrid.Guard(lambda t, x, p: x.phase - 1, +1),
                hybrid.Reset(lambda t, x, p: (x.phase - 1, x.q + 1)),
            )
        ],
    )
    orbit = periodic_orbit(system, (0.97, 0.6), t0=t0, period=0.95)
    assert orbit.status.ok
    assert orbit.period == pytest.approx(1.0, rel=1e-10)
    np.testing.assert_allclose(np.sort(np.abs(orbit.multipliers)), (np.exp(-1), 1.0), rtol=1e-9)
    assert t0 <= orbit.t0 <= t0 + 2.1
    assert orbit.arc()(orbit.t0 + 0.3).shape == (2,)


def test_a_search_from_the_mode_of_another_time_asks_for_the_mode():
    """The switch is on until 0.4 of each period: an orbit that starts at 0.5 is in the mode "off" there."""
    field = {"on": lambda t, x, p: (1.0 - x.i,), "off": lambda t, x, p: (-x.i,)}
    coil = HybridSystem(
        state=("i",),
        period=1.0,
        modes=[Mode(name, each) for name, each in field.items()],
        transitions=[Transition("on", "off", Every(1.0, offset=0.4)), Transition("off", "on", Every(1.0))],
    )
    right = periodic_orbit(coil, (0.3,), mode="off", t0=0.5)
    assert right.status.ok
    assert right.multipliers[0] == pytest.approx(np.exp(-1.0))
    wrong = periodic_orbit(coil, (0.3,), mode="on", t0=0.5)
    assert wrong.status.code == StatusCode.NOT_CONVERGED
    assert "the orbit ends in mode 'off' and starts in 'on'" in wrong.status.message
    assert "name it with mode=" in wrong.status.remedy
    assert "max_iterations" not in wrong.status.remedy


def test_a_search_from_a_curved_contact_stays_on_it():
    """Steps of the search leave the circle of a corner by more than a gap that counts as closed."""
    given = {"t0": 0.28, "parameters": {"A": 0.75, "w": 10.85}}
    angle = 0.25 - 0.062
    start = (0.0, math.cos(angle), 0.062, -0.02 * math.cos(angle), 0.02 * math.sin(angle), 0.02)
    orbit = periodic_orbit(models.rocking_block(), start, **given)
    assert orbit.status.ok
    assert orbit.mode == "left sticks"
    assert orbit.residual < 1e-10
