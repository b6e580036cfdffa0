"""ode23s compared with a plain version of its formulas, with exact solutions, and with GNU Octave."""

import math
import shutil
import subprocess
from types import SimpleNamespace

import numpy as np
import pytest

import models
from hybrid import simulate
from lyapunov.study import ode23s
from lyapunov.study.ode23s import Ode23s, StepTooSmall
from lyapunov.study.runs import STARTS
from tests.lyapunov.study.compiled import compiled

LINEAR = np.array([[-0.5, 3.0, 0.0], [-3.0, -0.5, 1.0], [0.0, 0.0, -40.0]])
SPAN = (0.0, 2.0)


def linear(t, y, p, out):
    out[0] = -0.5 * y[0] + 3.0 * y[1] + math.sin(2.0 * t)
    out[1] = -3.0 * y[0] - 0.5 * y[1] + y[2]
    out[2] = -40.0 * (y[2] - math.cos(t))


def linear_jacobian(t, y):
    return LINEAR


def slow(t, y, p, out):
    """``linear`` with a thousand units of time in place of one."""
    out[0] = (-0.5 * y[0] + 3.0 * y[1] + math.sin(2e-3 * t)) / 1000.0
    out[1] = (-3.0 * y[0] - 0.5 * y[1] + y[2]) / 1000.0
    out[2] = -0.04 * (y[2] - math.cos(1e-3 * t))


def slow_jacobian(t, y):
    return LINEAR / 1000.0


def van_der_pol(t, y, p, out):
    out[0] = y[1]
    out[1] = 20.0 * (1.0 - y[0] ** 2) * y[1] - y[0]


def van_der_pol_jacobian(t, y):
    return np.array([[0.0, 1.0], [-40.0 * y[0] * y[1] - 1.0, 20.0 * (1.0 - y[0] ** 2)]])


def riccati(t, y, p, out):
    """The solution from (1, 1) is ``1 / (1 + t), exp(sin(t))``."""
    out[0] = -(y[0] ** 2)
    out[1] = math.cos(t) * y[1]


def plain_ode23s(function, jacobian, y, span, rtol, atol):
    """The published method in NumPy, with the exact Jacobian; times and states of all accepted steps."""

    def f(t, y):
        out = np.empty_like(y)
        function(t, y, (), out)
        return out

    def rate(t, y, h):
        ahead = min(np.sqrt(np.finfo(float).eps) * max(abs(t), abs(t + h)), h)
        return (f(t + ahead, y) - f(t, y)) / ahead

    d, e32, identity = 1 / (2 + np.sqrt(2)), 6 + np.sqrt(2), np.eye(len(y))
    t, end = span
    y, longest, threshold = np.array(y, dtype=float), 0.1 * (end - t), atol / rtol
    weight = np.maximum(np.abs(y), threshold)
    h = min(longest, 0.8 * rtol ** (1 / 3) / np.max(np.abs(f(t, y)) / weight))
    bend = rate(t, y, h) + jacobian(t, y) @ f(t, y)
    h = min(longest, 0.8 * rtol ** (1 / 3) / np.sqrt(0.5 * np.max(np.abs(bend) / weight)))
    times, states = [], []
    while t < end:
        h = min(h, longest)
        if 1.1 * h >= end - t:
            h = end - t
        T, J, f0, first = rate(t, y, h), jacobian(t, y), f(t, y), True
        while True:
            W = identity - h * d * J
            k1 = np.linalg.solve(W, f0 + h * d * T)
            f1 = f(t + h / 2, y + h / 2 * k1)
            k2 = np.linalg.solve(W, f1 - k1) + k1
            new = y + h * k2
            f2 = f(t + h, new)
            k3 = np.linalg.solve(W, f2 - e32 * (k2 - f1) - 2 * (k1 - f0) + h * d * T)
            scale = np.maximum(np.maximum(np.abs(y), np.abs(new)), threshold)
            error = np.max(np.abs(h / 6 * (k1 - 2 * k2 + k3)) / scale)
            if error <= rtol:
                break
            h, first = h * max(0.1, 0.8 * (rtol / error) ** (1 / 3)), False
        t, y = (end if abs(end - t - h) < 1e-14 else t + h), new
        times.append(t)
        states.append(y)
        if first:
            h = h * min(5.0, 0.8 * (rtol / error) ** (1 / 3))
    return np.array(times), np.array(states)


CASES = {
    "linear and stiff": (linear, linear_jacobian, (1.0, 0.5, 2.0), SPAN, 1e-6),
    # Near zero the increments of the difference quotients are short, and so are the digits of the first step.
    "from zero": (linear, linear_jacobian, (0.0, 0.0, 2.0), SPAN, 3e-2),
    "slow": (slow, slow_jacobian, (1.0, 0.5, 2.0), (0.0, 2000.0), 1e-5),
    "van der Pol": (van_der_pol, van_der_pol_jacobian, (2.0, -0.1), (0.0, 25.0), 1e-4),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize(("rtol", "atol"), [(1e-3, 1e-6), (1e-5, 1e-8)])
def test_step_for_step_like_a_plain_version(case, rtol, atol):
    function, jacobian, y, span, within = CASES[case]
    times, states = plain_ode23s(function, jacobian, y, span, rtol, atol)
    ours = Ode23s(rtol, atol).steps(compiled(function), y, span)
    assert len(ours.t) == len(times) > 20
    # Both differ by the rounding of the difference quotients.
    np.testing.assert_allclose(ours.t, times, rtol=within)
    np.testing.assert_allclose(ours.y, states, rtol=within, atol=within)
    assert ours.t[-1] == span[1]


def test_the_solution_has_order_two_and_its_estimate_order_three():
    field, exact = compiled(riccati), np.array([1 / 3, np.exp(np.sin(2.0))])
    rtols = 10.0 ** -np.arange(4, 10)
    runs = [Ode23s(rtol, 1e-3 * rtol).steps(field, (1.0, 1.0), SPAN) for rtol in rtols]
    steps = np.log([len(run.t) for run in runs])
    errors = np.log([np.max(np.abs(run.y[-1] - exact)) for run in runs])
    order = -np.polyfit(steps[1:], errors[1:], 1)[0]
    assert order == pytest.approx(2.0, abs=0.1)
    # A step that meets the tolerance has a length proportional to the root of the estimate's order.
    assert -np.polyfit(steps[1:], np.log(rtols[1:]), 1)[0] == pytest.approx(3.0, abs=0.1)


def test_the_jacobian_costs_one_evaluation_per_equation():
    run = Ode23s(1e-4, 1e-7).steps(compiled(riccati), (1.0, 1.0), SPAN)
    attempts = len(run.t) + run.rejected
    # At the start the field and the first step; per step the Jacobian and the time derivative.
    least = 2 + len(run.t) * (2 + 1) + 2 * attempts
    assert least <= run.evaluations <= 1.2 * least


def test_it_says_that_no_step_met_the_tolerance():
    def explodes(t, y, p, out):
        out[0] = y[0] ** 2

    with pytest.raises(StepTooSmall, match="ode23s at rtol"):
        Ode23s().steps(compiled(explodes), (1.0,), (0.0, 2.0))


@pytest.mark.parametrize("done", [0, 6, 7])
def test_growths_end_where_no_step_met_the_tolerance(done, monkeypatch):
    """Two periods of transient and five of growth."""

    def growth_rates(*arguments):
        arguments[7][:] = np.arange(7.0)[:, None]
        return done

    kernels = SimpleNamespace(growth_rates=growth_rates, founding_field=None)
    monkeypatch.setattr(ode23s, "load_kernels", lambda name: kernels)
    method, options = Ode23s(1e-6, 1e-7), {"omega": 7.4, "k": 2, "periods": 5, "transient": 2}
    if done < 7:
        with pytest.raises(StepTooSmall, match=f"rtol = 1e-06 stopped in period {done}"):
            method.growths(models.vibroimpact(), np.zeros(4), **options)
    else:
        found = method.growths(models.vibroimpact(), np.zeros(4), **options)
        np.testing.assert_array_equal(found, [[i, i] for i in range(2, 7)])


def test_the_founding_field_is_that_of_the_model():
    system, x0, end = models.vibroimpact(), STARTS[0].x0, 2 * np.pi / 7.40
    arc = simulate(system, x0, (0.0, end), tangent=True)
    assert len(arc.jumps) == 2
    x, fundamental = Ode23s(1e-9, 1e-11).carry(system, x0, np.eye(4), (0.0, end), omega=7.40)
    np.testing.assert_allclose(x, arc.x[-1], atol=2e-7)
    np.testing.assert_allclose(fundamental, arc.fundamental, atol=2e-3 * np.abs(arc.fundamental).max())


def test_growths_fall_short_at_the_paper_s_tolerance():
    """The sum is right to 1e-3, the first exponent is not."""
    growths = Ode23s(1e-6, 1e-7).growths(
        models.vibroimpact(), STARTS[0].x0, omega=7.40, k=4, periods=60, transient=20
    )
    assert growths.shape == (60, 4)
    mean = growths.mean(axis=0)
    assert mean.sum() == pytest.approx(-0.8995392, abs=1e-3)
    assert -0.085 < mean[:2].mean() < -0.06


@pytest.mark.skipif(shutil.which("octave") is None, reason="GNU Octave is not on the path")
def test_errors_are_those_of_octave():
    """Octave has the same formulas but another step control, so only the size of the error is compared."""
    script = """
        A = [-0.5 3 0; -3 -0.5 1; 0 0 -40];
        f = @(t, y) A * y + [sin(2 * t); 0; 40 * cos(t)];
        [t, y] = ode23s(f, [0 2], [1; 0.5; 2], odeset('RelTol', 1e-5, 'AbsTol', 1e-8));
        printf('%.16g ', y(end, :));
    """
    done = subprocess.run(
        ["octave", "--no-gui", "--quiet", "--eval", script],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    theirs = np.array(done.stdout.split(), dtype=float)
    field = compiled(linear)
    exact = Ode23s(1e-10, 1e-13).steps(field, (1.0, 0.5, 2.0), SPAN).y[-1]
    ours = Ode23s(1e-5, 1e-8).steps(field, (1.0, 0.5, 2.0), SPAN).y[-1]
    ratio = np.abs(theirs - exact).max() / np.abs(ours - exact).max()
    assert 1 / 30 < ratio < 30
