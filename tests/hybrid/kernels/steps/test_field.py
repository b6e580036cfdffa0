"""Whether the field is what a step took it for: no change of it in time is passed over, smooth ones are free.

Each solver follows a lag that is in motion, so that its steps are those of its error control. A change of the
field, of any width, lies at any place on one of them. Where the field is smooth, the same function written so
that it needs no bounds shows what the bounds cost.
"""

from functools import cache
from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import erf, iv

from hybrid import DOP853, HybridSystem, Mode, RadauIIA, Taylor, Tsit5, simulate

SOLVERS = (Taylor(), DOP853(), RadauIIA(rtol=1e-8, atol=1e-10), Tsit5(rtol=1e-8, atol=1e-10))
# Each change of the field at ``a``, of the width ``w``, and what a lag of one unit of time makes of it at the
# time ``a + T``. All of them are over by then, or go on for ever.
CHANGES = {
    "jump": (lambda t, p: np.where(t > p.a, 1.0, 0.0), lambda T, w: -np.expm1(-T)),
    "kink": (lambda t, p: np.maximum(t - p.a, 0.0), lambda T, w: T + np.expm1(-T)),
    "ramp": (
        lambda t, p: np.clip((t - p.a) / p.w, 0.0, 1.0),
        lambda T, w: 1.0 - np.exp(-T) * np.expm1(w) / w,
    ),
    "window": (
        lambda t, p: np.where(np.abs(t - p.a) < p.w, 1.0, 0.0),
        lambda T, w: 2.0 * np.exp(-T) * np.sinh(w),
    ),
    "triangle": (
        lambda t, p: np.maximum(1.0 - np.abs(t - p.a) / p.w, 0.0),
        lambda T, w: 4.0 * np.exp(-T) * np.sinh(w / 2) ** 2 / w,
    ),
    "gauss": (
        lambda t, p: np.exp(-(((t - p.a) / p.w) ** 2)),
        lambda T, w: np.exp(w**2 / 4 - T) * w * np.sqrt(np.pi) / 2 * (erf(T / w - w / 2) + 1.0),
    ),
}


@cache
def moving(change):
    """A lag that a cosine moves, and the change of its field."""
    shape, _ = CHANGES[change]
    return HybridSystem(
        state=("x",),
        parameters={"a": 10.0, "w": 0.1},
        modes=[Mode("lag", lambda t, x, p: (np.cos(t) - x.x + shape(t, p),))],
    )


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("solver", SOLVERS, ids=str)
def test_no_change_of_the_field_is_passed_over(change, solver):
    """Error estimates vanish by chance where a kink or jump lies at certain places of a step."""
    rng = np.random.default_rng(1)
    for place, exponent in rng.uniform((5.0, -6.0), (25.0, -0.3), (1000, 2)):
        width, end = 10.0**exponent, place + 1.0
        parameters = {"a": place, "w": width}
        arc = simulate(moving(change), (0.5,), (0.0, end), parameters=parameters, solver=solver)
        assert arc.status.ok
        wanted = (np.cos(end) + np.sin(end)) / 2 + CHANGES[change][1](1.0, width)
        assert arc.x[-1, 0] == pytest.approx(wanted, rel=0, abs=1e3 * solver.rtol), (place, width)


def harmonics(weights):
    """A sum of cosines of the multiples of an angle, which needs no bounds."""
    return lambda u: sum(weight * np.cos(k * u) for k, weight in enumerate(weights))


NINTH = [0.0 if k % 2 == 0 else comb(9, (9 - k) // 2) / 2**8 for k in range(10)]
BESSEL = [iv(0, 1.0), *(2.0 * iv(k, 1.0) for k in range(1, 18))]
# The same function twice: bounded on each step, and as a sum that needs no bounds.
SMOOTH = {
    "power": (lambda u: np.cos(u) ** 9, harmonics(NINTH)),
    "exponential": (lambda u: np.exp(np.cos(u)), harmonics(BESSEL)),
}


@cache
def driven(name):
    """A damped oscillator with a hardening spring, in both ways of writing its forcing."""
    return [
        HybridSystem(
            state=("q", "v"),
            parameters={"w": 1.0},
            modes=[Mode("m", lambda t, x, p, f=f: (x.v, f(p.w * t) - x.q - 0.3 * x.q**3 - 0.5 * x.v))],
        )
        for f in SMOOTH[name]
    ]


@pytest.mark.parametrize("name", SMOOTH)
@settings(max_examples=25)
@given(
    frequency=st.floats(-3.0, 3.0).map(lambda exponent: 10.0**exponent),
    solver=st.sampled_from([*SOLVERS, Taylor(rtol=1e-5, atol=1e-6), DOP853(rtol=1e-5, atol=1e-6)]),
)
def test_a_smooth_field_is_not_slowed_down(name, frequency, solver):
    """Not by a tenth of the steps, slow or fast."""
    span, options = (0.0, min(50.0, 200.0 / frequency)), {"parameters": {"w": frequency}, "solver": solver}
    bounded, free = (simulate(system, (0.5, 0.0), span, **options) for system in driven(name))
    assert bounded.status.ok
    assert bounded.steps + bounded.rejected <= 1.1 * (free.steps + free.rejected) + 2
    np.testing.assert_allclose(bounded.x[-1], free.x[-1], atol=1e4 * solver.rtol)
