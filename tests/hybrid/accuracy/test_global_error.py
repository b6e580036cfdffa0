"""Estimated global errors compared with true errors from closed forms with forty digits."""

import functools
from types import SimpleNamespace

import mpmath as mp
import numpy as np
import pytest

import hybrid
import models
from hybrid import DOP853, StatusCode, Tsit5, global_error
from hybrid.accuracy.global_error import SAFETY, _bound, _compare, _starts_alike
from hybrid.status import SUCCESS
from tests.cases import systems
from tests.reference.impacts import ImpactOscillator

BALL, OSCILLATOR, IMPACTS = models.bouncing_ball(), models.solvable_oscillator(), models.impact_oscillator()


def bouncing_ball(rng):
    """Bounces up to a random share, 30 to 80 %, of the time at which they accumulate."""
    h, g, e = rng.uniform(0.5, 2), rng.uniform(5, 10), rng.uniform(0.5, 0.9)
    end = float(np.sqrt(2 * h / g) * (1 + e) / (1 - e) * rng.uniform(0.3, 0.8))
    with mp.workdps(40):
        fall = mp.sqrt(2 * mp.mpf(h) / g)
        times, q, v, t = [], mp.mpf(h), mp.mpf(0), mp.mpf(0)
        lands = fall
        while lands < end:
            times.append(lands)
            t, q, v = lands, mp.mpf(0), (v if v else g * fall) * mp.mpf(e)
            lands = t + 2 * v / g
        s = end - t
        exact = times, (q + v * s - g * s**2 / 2, v - g * s)
    run = {"x0": (h, 0.0), "t_span": (0.0, end), "parameters": {"g": g, "e": e}}
    return BALL, run, exact


def solvable_oscillator(rng, span=10):
    """Chaos over ten units of time, in which errors grow a few hundred times."""
    u0, b = rng.uniform(0.05, 0.95), rng.uniform(0.3, 0.65)
    with mp.workdps(40):
        rate, w, u, sign, times = mp.mpf(b), 2 * mp.pi, mp.mpf(u0), mp.mpf(1), []
        for half in range(1, 2 * span + 1):
            u = sign - (u - sign) * mp.exp(rate / 2)
            if mp.sign(u) != sign:
                times.append(mp.mpf(half) / 2)
            sign = mp.sign(u)
        # A quarter later the cosine is zero and the sine one.
        grown = (u - sign) * mp.exp(rate / 4)
        exact = times, (sign - grown * rate / w, -grown * (w + rate**2 / w))
    run = {"x0": (u0, 0.0), "t_span": (0.0, span + 0.25), "mode": "plus", "parameters": {"b": b}}
    return OSCILLATOR, run, exact


@functools.cache
def flight(x, v):
    with mp.workdps(40):
        return ImpactOscillator(1.0, 0.1, 1.0, 1.0, 1.0, 0.8).impacts((x, v), 6)


def impact_oscillator(rng):
    """Six impacts from one of four starts."""
    x0 = [(-0.8, 0.3), (0.1, -0.9), (0.6, 0.6), (-0.2, 0.5)][rng.integers(4)]
    exact = flight(*x0)
    run = {"x0": x0, "t_span": (0.0, exact["t_end"])}
    return IMPACTS, run, (exact["t"], exact["x_end"])


def shares(case, solver, count):
    """Share of components and jumps whose error is below its estimate, and the median of their ratio."""
    rng = np.random.default_rng(5)
    errors, estimates = [], []
    for _ in range(count):
        system, run, (times, x) = case(rng)
        found = global_error(system, solver=solver, **run)
        assert found.status.ok
        assert len(found.jumps) == len(times)
        # Subtract with forty digits, because a time rounded to a double is not exact.
        errors += [float(abs(mp.mpf(jump.t) - t)) for jump, t in zip(found.arc.jumps, times, strict=True)]
        errors += [float(abs(mp.mpf(value) - t)) for value, t in zip(found.arc.x[-1], x, strict=True)]
        estimates += [*found.jumps, *found.x]
    errors, estimates = np.array(errors), np.array(estimates)
    return (errors <= estimates).mean(), np.median(estimates / np.maximum(errors, 1e-17))


@pytest.mark.parametrize("method", [DOP853, Tsit5])
@pytest.mark.parametrize("rtol", [1e-5, 1e-8, 1e-10])
@pytest.mark.parametrize("case", [solvable_oscillator, impact_oscillator])
def test_estimates_hold_the_error(case, rtol, method):
    """Estimates nearly always cover the error and are not too wide."""
    covered, ratio = shares(case, method(rtol=rtol, atol=rtol / 100), 12)
    assert covered >= 0.97
    assert 1.0 < ratio < 5.0


@pytest.mark.parametrize("method", [DOP853, Tsit5])
@pytest.mark.parametrize("rtol", [1e-5, 1e-10, 1e-13])
def test_estimates_hold_the_rounding_of_polynomial_flight(rtol, method):
    """The method is exact here: the error is rounding, magnified by the bounces."""
    covered, ratio = shares(bouncing_ball, method(rtol=rtol, atol=rtol / 100), 100)
    assert covered >= 0.8
    assert ratio < 50.0


def test_the_absolute_tolerance_is_tightened_too():
    """Where ``atol`` dominates, tightening ``rtol`` alone would leave the error the same."""
    swing = hybrid.HybridSystem(state=("q", "v"), modes=[hybrid.Mode("swing", lambda t, x, p: (x.v, -x.q))])
    found = global_error(swing, (1.0, 0.0), (0.0, 20.0), solver=DOP853(rtol=1e-11, atol=1e-4))
    errors = np.abs(found.arc.x[-1] - (np.cos(20.0), -np.sin(20.0)))
    assert errors.max() > 1e-6
    assert np.all(errors <= found.x)
    assert found.x.max() < 10 * errors.max()


def test_tighter_runs_start_aside_by_the_rounding_of_a_run(monkeypatch):
    """Sixteen units in the last place of the largest values, times the root of the number of steps."""
    starts = []

    def simulate(system, x0, *arguments, **options):
        starts.append(np.array(x0, dtype=float))
        return hybrid.simulate(system, x0, *arguments, **options)

    monkeypatch.setattr("hybrid.accuracy.global_error.simulate", simulate)
    fall = {"x0": (1.0, 2.0), "t_span": (0.0, 0.4), "parameters": {"g": 10.0}}
    arc = global_error(models.bouncing_ball(), solver=DOP853(rtol=1e-9), **fall).arc
    aside = 16 * np.finfo(float).eps * np.sqrt(1 + arc.steps) * np.abs(arc.x).max(axis=0)
    tighter, tightest = starts[1] - starts[0], starts[2] - starts[0]
    np.testing.assert_allclose(np.abs(tighter), aside, rtol=0.1)
    # In two directions, so that no component's difference is zero for all.
    np.testing.assert_allclose(np.abs(tightest), aside, rtol=0.1)
    assert np.sign(tighter[0] * tightest[0]) == -np.sign(tighter[1] * tightest[1])


def test_a_chaotic_run_beyond_its_digits_says_so():
    """In 80 units of time an error grows by a factor of e^40."""
    found = global_error(models.solvable_oscillator(), (0.3, 0.0), (0.0, 80.25), mode="plus")
    assert found.status.code == StatusCode.NOT_CONVERGED
    assert "Runs at tighter tolerances agree on the first" in str(found.status)
    assert found.jumps[0] < 1e-9
    # Jumps lie on a lattice of half units, so single jumps of different orbits may coincide.
    assert np.median(found.jumps[-10:]) > 0.1
    assert found.x.max() > 0.1


def test_a_start_on_a_guard_is_not_pushed_over_it():
    """The block starts in stick; displaced upwards it would be faster than the belt."""
    system, stuck = systems.stick_slip(), (0.0, 0.2)
    found = global_error(system, stuck, (0.0, 13.0), mode="stick")
    assert found.status.ok
    assert found.arc.jumps[0].transition == "release"
    assert abs(found.arc.jumps[0].t - 5.0) <= found.jumps[0] < 1e-10


def test_a_run_that_breaks_off_keeps_its_status():
    found = global_error(models.bouncing_ball(), (1.0, 0.0), (0.0, 5.0))
    assert found.status.code == StatusCode.ACCUMULATION
    assert np.isfinite(found.jumps[0])


def test_runs_that_end_in_different_modes_have_no_error_bar():
    """Near pi/2, between the events of the loose and the tight run, only one run has jumped."""
    system = hybrid.HybridSystem(
        state=("q", "v"),
        modes=[hybrid.Mode(side, lambda t, x, p: (x.v, -x.q)) for side in ("right", "left")],
        transitions=[hybrid.Transition("right", "left", hybrid.Guard(lambda t, x, p: x.q, -1))],
    )
    loose = DOP853(rtol=1e-2, atol=1e-3)

    def error(end):
        return global_error(system, (1.0, 0.0), (0.0, end), mode="right", solver=loose)

    # The loose run crosses at another time, which also depends on where its last step ends.
    found = [error(np.pi / 2 + sign * 10.0**-power) for power in range(3, 10) for sign in (1, -1)]
    torn = [each for each in found if each.status.code == StatusCode.NOT_CONVERGED]
    assert 0 < len(torn) < len(found)
    assert all(np.all(np.isinf(each.x)) for each in torn)
    assert all(np.all(each.x < 0.1) for each in found if each not in torn)


def test_a_run_without_jumps():
    """Decay: exp(-1) of the start."""
    system = hybrid.HybridSystem(state=("x",), modes=[hybrid.Mode("only", lambda t, x, p: (-x.x,))])
    found = global_error(system, (1.0,), (0.0, 1.0), solver=DOP853(rtol=1e-6, atol=1e-8))
    assert abs(found.arc.x[-1, 0] - np.exp(-1)) <= found.x[0] < 1e-5
    assert found.jumps.shape == (0,)
    assert "in the last state, SUCCESS" in repr(found)


def test_tolerances_that_cannot_be_tightened():
    with pytest.raises(hybrid.ArgumentError, match="rtol must be at least 1e-13; got 1e-14"):
        global_error(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0), solver=DOP853(rtol=1e-14))


def test_a_bound_is_never_less_than_rounding():
    value = np.array([2.0, -3.0])
    np.testing.assert_array_equal(_bound(value, value, value), 2 * np.finfo(float).eps * np.abs(value))


def run_with(times, transitions, end, mode="m"):
    """What the comparison reads of a run."""
    jumps = SimpleNamespace(t=np.array(times), transition_index=np.array(transitions))
    jumps = type("Jumps", (SimpleNamespace,), {"__len__": lambda self: len(times)})(**vars(jumps))
    t = np.array([0.0, 5.0])
    return SimpleNamespace(t=t, jumps=jumps, x=np.array([end]), mode=[mode], status=SUCCESS)


def test_jumps_are_compared_as_far_as_all_three_runs_agree():
    run = run_with([1.0, 2.0, 3.0, 4.0], [0, 0, 0, 0], [1.0, -3.0])
    tighter = run_with([1.01, 2.0, 3.0, 4.0], [0, 0, 0, 1], [1.0, -3.25])
    tightest = run_with([1.02, 2.0, 3.0, 4.0], [0, 1, 0, 0], [1.5, -3.0])
    found = _compare(run, tighter, tightest)
    np.testing.assert_allclose(found.jumps, [0.03 * SAFETY, np.inf, np.inf, np.inf], rtol=1e-12)
    np.testing.assert_allclose(found.x, [1.0 * SAFETY, 0.25 * SAFETY], rtol=1e-12)
    assert found.status.code == StatusCode.NOT_CONVERGED
    assert "agree on the first 1 of 4 jumps" in found.status.message
    fewer = run_with([1.01], [0], [1.0, -3.0])
    assert "first 1 of 4" in _compare(run, fewer, run).status.message
    other = run_with([1.0, 2.0, 3.0, 4.0], [0, 0, 0, 0], [1.0, -3.0], mode="n")
    assert _compare(run, run, run).status is SUCCESS
    longer = run_with([1.0, 2.0, 3.0, 4.0, 5.0], [0, 0, 0, 0, 0], [1.0, -3.0], mode="n")
    assert np.isinf(_compare(run, longer, other).x).all()


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_first_jumps_are_alike_within_a_millionth_of_the_run(unit):
    def run(first, transition=0):
        return SimpleNamespace(t=[0.0, 10.0 * unit], jumps=run_with([first * unit], [transition], []).jumps)

    assert _starts_alike(run(2.0), run(2.000009))
    assert not _starts_alike(run(2.0), run(2.000011))
    assert not _starts_alike(run(2.0), run(2.0, transition=1))
