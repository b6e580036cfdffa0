"""Rounding and the error function in fields, guards and resets, by every way of writing them."""

import traceback

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import erf, erfc, gamma

from hybrid import (
    DOP853,
    Every,
    Guard,
    HybridSystem,
    Mode,
    ModelError,
    Reset,
    Taylor,
    Transition,
    compile_system,
    simulate,
    split,
)


def quantised(rounded):
    """A loop whose control is a multiple of 0.1, sampled at a clock."""
    return HybridSystem(
        state=("y",),
        held=("u",),
        parameters={"q": 0.1, "T": 0.2},
        modes=[Mode("run", lambda t, x, p: (x.u - x.y,))],
        transitions=[
            Transition(
                "run",
                "run",
                Every("T"),
                Reset(lambda t, x, p: {"u": rounded(np.clip(2 * (1 - x.y), 0.0, 1.5) / p.q) * p.q}),
                name="sample",
            )
        ],
    )


@pytest.mark.parametrize(
    "rounded", [np.round, np.rint, np.around, round, lambda z: np.round(10 * z, -1) / 10]
)
def test_a_quantiser_is_the_same_however_its_rounding_is_written(rounded):
    wanted = simulate(quantised(lambda z: np.floor(z + 0.5)), (0.0, 0.0), (0.0, 1.0))
    found = simulate(quantised(rounded), (0.0, 0.0), (0.0, 1.0))
    np.testing.assert_allclose(found.x[-1], wanted.x[-1], rtol=1e-13)


def test_decimals_are_kept():
    found = simulate(quantised(lambda z: round(z, 1)), (0.0, 0.0), (0.0, 1.0))
    np.testing.assert_allclose(found.jumps.x_plus[:, 1] * 100, np.round(found.jumps.x_plus[:, 1] * 100))
    assert np.any(np.abs(found.jumps.x_plus[:, 1] * 10 - np.round(found.jumps.x_plus[:, 1] * 10)) > 0.05)


@pytest.mark.parametrize("solver", [Taylor(), DOP853()])
def test_a_guard_that_rounds_is_met_half_way_between_whole_numbers(solver):
    system = HybridSystem(
        state=("q",),
        held=("n",),
        modes=[Mode("run", lambda t, x, p: (1.0,))],
        transitions=[
            Transition(
                "run",
                "run",
                Guard(lambda t, x, p: np.round(x.q) - x.n - 0.5, 1),
                Reset(lambda t, x, p: {"n": x.n + 1}),
            )
        ],
    )
    arc = simulate(system, (0.0, 0.0), (0.0, 6.0), solver=solver)
    np.testing.assert_allclose(arc.jumps.t, 0.5 + np.arange(6), rtol=1e-14)


def test_a_field_that_rounds_is_split_where_its_rounding_jumps():
    plain = HybridSystem(state=("q",), modes=[Mode("run", lambda t, x, p: (1.0 + np.round(x.q),))])
    assert "round" in str(plain)
    arc = simulate(split(plain), (0.0,), (0.0, 1.6))
    # The speed is 1 up to 0.5, 2 up to 1.5, 3 up to 2.5, 4 up to 3.5, 5 from there on.
    assert arc.x[-1, 0] == pytest.approx(3.5 + 5.0 * (1.6 - 0.5 - 0.5 - 1.0 / 3.0 - 0.25), rel=1e-12)


@pytest.mark.parametrize("function", [erf, erfc])
@pytest.mark.parametrize("solver", [Taylor(), DOP853()])
def test_the_error_function_in_a_field_and_in_a_guard(function, solver):
    """Against a solution with SciPy's own function; the event is where the guard is zero."""
    level = float(function(0.4))
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("run", lambda t, x, p: (x.v, -function(3 * x.q) - 0.1 * x.v))],
        transitions=[Transition("run", None, Guard(lambda t, x, p: function(x.q) - level), name="there")],
    )
    arc = simulate(system, (0.0, 1.0), (0.0, 5.0), solver=solver)

    def there(t, x):
        return function(x[0]) - level

    there.terminal = True
    wanted = solve_ivp(
        lambda t, x: (x[1], -function(3 * x[0]) - 0.1 * x[1]),
        (0.0, 5.0),
        (0.0, 1.0),
        events=there,
        rtol=1e-12,
        atol=1e-12,
        method="DOP853",
    )
    assert arc.jumps[0].t == pytest.approx(wanted.t[-1], rel=1e-8)
    np.testing.assert_allclose(arc.x[-1], wanted.y[:, -1], rtol=1e-7, atol=1e-8)
    assert "bounded" in str(compile_system(system))


def test_a_function_that_cannot_be_traced_is_refused_without_a_page_of_the_compiler():
    system = HybridSystem(state=("y",), modes=[Mode("run", lambda t, x, p: (-gamma(x.y + 1.5),))])
    with pytest.raises(ModelError, match="gamma is not a function of NumPy") as caught:
        simulate(system, (1.0,), (0.0, 1.0))
    shown = "".join(traceback.format_exception(caught.value))
    assert "Overload" not in shown
    assert "numba" not in shown
