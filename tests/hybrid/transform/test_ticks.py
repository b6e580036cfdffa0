"""Sawtooths of time in plain equations: their steps are ticks of clocks, exact, and none is searched for."""

import pickle
from fractions import Fraction

import numpy as np
import pytest

import hybrid
from hybrid import Every, HybridSystem, Mode, Reset, Transition, from_equations, simulate, split
from hybrid.testing import check_system

P = {"T": 0.3, "d": 0.4}
DUTIES = {
    "remainder of t by T": lambda t, x, p: np.mod(t, p.T) < p.d * p.T,
    "with the operator": lambda t, x, p: t % p.T < p.d * p.T,
    "other way round": lambda t, x, p: p.d * p.T > np.mod(t, p.T),
    "phase": lambda t, x, p: np.mod(t, p.T) / p.T < p.d,
    "phase of a quotient": lambda t, x, p: np.mod(t / p.T, 1.0) < p.d,
    "floor": lambda t, x, p: t / p.T - np.floor(t / p.T) < p.d,
    "negative sawtooth": lambda t, x, p: -np.mod(t, p.T) > -p.d * p.T,
    "twice as steep": lambda t, x, p: 2 * np.mod(t, p.T) < 2 * p.d * p.T,
}


def pulsed(on, parameters=None, period=None):
    """A lag that follows a pulse of height 1."""
    field = lambda t, x, p: (np.where(on(t, x, p), 1.0, 0.0) - x.q,)  # noqa: E731
    return from_equations(
        field, state=("q",), parameters=P if parameters is None else parameters, period=period
    )


def mapped(periods, T, d, q=0.0):
    """The lag after so many periods, in closed form."""
    for _ in range(periods):
        q = (1 + (q - 1) * np.exp(-d * T)) * np.exp(-(1 - d) * T)
    return q


def clocks(system):
    return [each for each in system.transitions if each.clock]


@pytest.mark.parametrize("name", DUTIES)
def test_a_duty_that_is_a_parameter_has_two_modes_and_two_clocks(name):
    system = pulsed(DUTIES[name])
    assert len(system.modes) == 2
    assert [type(each.guard) for each in clocks(system)] == [Every, Every]
    assert all(each.clock or each.guard.at_start for each in system.transitions)
    for given in (P, {"T": 0.7, "d": 0.25}):
        arc = simulate(system, (0.0,), (0.0, 20 * given["T"]), parameters=given)
        assert arc.status.ok
        assert arc.x[-1, 0] == pytest.approx(mapped(20, **given), abs=1e-13)


@pytest.mark.parametrize("d", [0.0, 1.0, -0.3, 1.7])
def test_a_duty_at_its_limits_or_beyond(d):
    arc = simulate(pulsed(DUTIES["remainder of t by T"]), (0.2,), (0.0, 3.0), parameters={"d": d})
    assert arc.status.ok
    assert arc.x[-1, 0] == pytest.approx(mapped(10, 0.3, np.clip(d, 0.0, 1.0), 0.2), abs=1e-13)


@pytest.mark.parametrize("period", [None, lambda p: p.T])
def test_ticks_are_exact(period):
    system = pulsed(DUTIES["remainder of t by T"], period=period)
    arc = simulate(system, (0.0,), (0.0, 0.3 * 1000.5))
    T, d = arc.parameters["T"], arc.parameters["d"]
    T, on = Fraction(T), Fraction(d * T)
    exact = sorted([float(k * T) for k in range(1, 1001)] + [float(k * T + on) for k in range(1001)])
    found = arc.jumps.t
    np.testing.assert_allclose(found, exact[: len(found)], rtol=0 if period is None else 3e-16)


@pytest.mark.parametrize(
    "on",
    [
        lambda t, x, p: np.mod(t, 0.3) < 0.1,
        lambda t, x, p: np.mod(t, 7.1) < 1.7,
        lambda t, x, p: np.mod(-t, 0.7) < 0.1,
        lambda t, x, p: np.mod(t, -0.7) < -0.2,
        lambda t, x, p: np.mod(t - 0.05, 0.3) > 0.1,
        lambda t, x, p: np.mod(3 * t, 0.7) < 0.3,
        lambda t, x, p: np.mod(t, 0.3) < 0.15,
        lambda t, x, p: np.mod(t - p.d, p.T) < 0.1,
    ],
)
def test_the_pulse_is_on_when_its_formula_says_so(on):
    arc = simulate(pulsed(on), (0.0,), (0.013, 30.0))
    assert len(clocks(arc.system)) == 2
    edges = np.r_[0.013, arc.jumps.t, 30.0]
    middles = (edges[1:] + edges[:-1]) / 2
    rates = [
        np.where(on(t, None, arc.system.variables.parameter_view([*P.values()])), 1.0, 0.0) for t in middles
    ]
    modes = {mode.name: mode for mode in arc.system.modes}
    names = [*(jump.source for jump in arc.jumps), arc.mode[-1]]
    p = arc.system.variables.parameter_view([*P.values()])
    found = [
        modes[name].field(t, arc.system.variables.state_view([0.0]), p)[0]
        for name, t in zip(names, middles, strict=True)
    ]
    np.testing.assert_allclose(np.ravel(found), rates, atol=1e-15)


@pytest.mark.parametrize("period", [None, lambda p: p.T, lambda p: 10 * p.T])
def test_a_run_that_starts_at_a_tick(period):
    """Whatever rounding makes of the time, the pulse that begins there is on."""
    system = pulsed(DUTIES["remainder of t by T"], period=period)
    for k in range(0, 400, 7):
        for share, wanted in ((0.0, 1 - np.exp(-0.087)), (0.4, 0.0)):
            t0 = (k + share) * 0.3
            arc = simulate(system, (0.0,), (t0, t0 + 0.087))
            assert arc.x[-1, 0] == pytest.approx(wanted, abs=1e-12)


def test_sensitivities_in_period_and_duty():
    T, d, h = 0.3, 0.4, 1e-6
    arc = simulate(pulsed(DUTIES["remainder of t by T"]), (0.0,), (0.0, 10.1 * T), sensitivities=("T", "d"))

    def end(T, d):
        return 1 + (mapped(10, T, d) - 1) * np.exp(-(10.1 * 0.3 - 10 * T))

    wanted = [(end(T + h, d) - end(T - h, d)) / (2 * h), (end(T, d + h) - end(T, d - h)) / (2 * h)]
    np.testing.assert_allclose(arc.sensitivity[0], wanted, rtol=1e-7)


def test_a_ramp_restarts_at_a_tick():
    """The sawtooth itself: its mean is half its height."""
    system = from_equations(lambda t, x, p: (np.mod(t, p.T),), state=("q",), parameters={"T": 0.3})
    arc = simulate(system, (0.0,), (0.0, 30.0))
    assert arc.x[-1, 0] == pytest.approx(100 * 0.3**2 / 2, abs=1e-13)
    assert len(arc.jumps) == 200
    assert len(clocks(system)) == len(system.modes) == 2


def test_a_ramp_that_is_cut():
    """A ramp up to the duty, then nothing."""
    ramp = lambda t, x, p: (np.where(np.mod(t, p.T) < p.d * p.T, np.mod(t, p.T), 0.0),)  # noqa: E731
    arc = simulate(from_equations(ramp, state=("q",), parameters=P), (0.0,), (0.0, 30.0))
    assert arc.x[-1, 0] == pytest.approx(100 * (0.4 * 0.3) ** 2 / 2, abs=1e-12)


def test_two_pulses_of_one_sawtooth():
    """They begin together, at one instant."""
    field = lambda t, x, p: (  # noqa: E731
        np.where(np.mod(t, p.T) < p.a, 1.0, 0.0) + np.where(np.mod(t, p.T) < p.b, 2.0, 0.0),
    )
    system = from_equations(field, state=("q",), parameters={"T": 0.3, "a": 0.1, "b": 0.2})
    for a, b in ((0.1, 0.2), (0.2, 0.1), (0.1, 0.1)):
        arc = simulate(system, (0.0,), (0.0, 30.0), parameters={"a": a, "b": b})
        assert arc.x[-1, 0] == pytest.approx(100 * (a + 2 * b), abs=1e-11)


def test_a_pulse_while_a_mass_sticks():
    """A pulse beyond the friction pushes the mass; between pulses friction stops it. Exact parabolas."""
    field = lambda t, x, p: (  # noqa: E731
        x.v,
        np.where(np.mod(t, p.T) < p.d * p.T, 2.0, 0.0) - np.sign(x.v),
    )
    system = from_equations(field, state=("q", "v"), parameters={"T": 1.0, "d": 0.25})
    arc = simulate(system, (0.0, 0.0), (0.0, 10.0))
    # Each push accelerates by 1 for 1/4, and friction takes as long to stop the mass.
    assert arc.x[-1, 0] == pytest.approx(10 * 0.25**2, abs=1e-12)
    assert arc.x[-1, 1] == pytest.approx(0.0, abs=1e-12)


def test_beside_a_clock_of_the_users():
    """A sample at each tick of the pulse, in a mode that is split, misses none."""
    sample = Transition("run", "run", Every("T"), Reset(lambda t, x, p: {"n": x.n + 1}), name="sample")
    system = split(
        HybridSystem(
            state=("q",),
            counters=("n",),
            parameters=P,
            modes=[Mode("run", lambda t, x, p: (np.where(np.mod(t, p.T) < p.d * p.T, 1.0, 0.0) - x.q,))],
            transitions=[sample],
        )
    )
    arc = simulate(system, (0.0, 0.0), (0.0, 30.1))
    assert arc["n"][-1] == 100
    assert arc["q"][-1] == pytest.approx(1 + (mapped(100, 0.3, 0.4) - 1) * np.exp(-0.1), abs=1e-12)


@pytest.mark.parametrize("w", [2.0, -2.0, 0.37])
def test_a_frequency_of_either_sign(w):
    """A falling phase is on for the same share, at the other end of its turns."""
    field = lambda t, x, p: (np.where(np.mod(p.w * t, 1.0) < 0.3, 1.0, 0.0),)  # noqa: E731
    system = from_equations(field, state=("q",), parameters={"w": 1.0})
    assert len(system.modes) == 2
    arc = simulate(system, (0.0,), (0.0, 8 / abs(w)), parameters={"w": w})
    assert arc.x[-1, 0] == pytest.approx(8 * 0.3 / abs(w), abs=1e-13)
    assert arc.jumps.t[0] == pytest.approx((0.3 if w > 0 else 0.7) / abs(w), rel=1e-15)


def test_a_period_that_is_not_positive_is_refused():
    with pytest.raises(hybrid.ArgumentError, match=r"period must be positive and finite; got -0\.3"):
        simulate(pulsed(DUTIES["remainder of t by T"]), (0.0,), (0.0, 1.0), parameters={"T": -0.3})


def test_they_are_told_checked_and_pickled():
    system = pulsed(DUTIES["remainder of t by T"])
    assert "every T" in repr(system)
    again = pickle.loads(pickle.dumps(system))
    assert again.mode_names == system.mode_names == ("mod(t/T,1)<d", "mod(t/T,1)>d")
    check_system(system, examples=4, states={"q": (0.0, 1.0)}, t_span=(0.0, 2.0))
