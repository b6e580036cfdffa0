"""Pulses far narrower than a step: no solver steps over a pulse, whatever its place and shape."""

from functools import cache

import attrs
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    StatusCode,
    Taylor,
    Transition,
    Tsit5,
    compile_system,
    simulate,
    stroboscopic_section,
)
from hybrid.compiler.bounds.forcing import forcings
from hybrid.kernels.types.codes import ARGUMENTS
from hybrid.symbolic.expressions import Absolute, Maximum
from hybrid.symbolic.tracing import model_symbols

SOLVERS = (Taylor(), DOP853(), RadauIIA(rtol=1e-8, atol=1e-10), Tsit5(rtol=1e-8, atol=1e-10))
# Pulses as functions of time, with a height ``A``, a place ``a`` and a width ``w``.
SHAPES = {
    "gauss": lambda t, p: p.A * np.exp(-(((t - p.a) / p.w) ** 2)),
    "sech": lambda t, p: p.A / np.cosh((t - p.a) / p.w),
    "lorentz": lambda t, p: p.A / (1 + ((t - p.a) / p.w) ** 2),
    "window": lambda t, p: np.where(np.abs(t - p.a) < p.w, p.A, 0.0),
    "tanh": lambda t, p: (
        p.A / 2 * (np.tanh((t - p.a + p.w) / (p.w / 8)) - np.tanh((t - p.a - p.w) / (p.w / 8)))
    ),
    "kinked": lambda t, p: p.A * np.maximum(1 - np.abs(t - p.a) / p.w, 0),
}
DAMPING = 0.1
END = 1000.0


class P:
    """Parameters of a pulse for use outside a model."""

    def __init__(self, **values):
        vars(self).update(values)


@cache
def oscillator(shape):
    pulse = SHAPES[shape]
    return HybridSystem(
        state=("x", "v"),
        parameters={"A": 1.0, "a": 500.0, "w": 0.01},
        modes=[Mode("swing", lambda t, x, p: (x.v, -x.x - DAMPING * x.v + pulse(t, p)))],
    )


@cache
def lag(shape):
    pulse = SHAPES[shape]
    return HybridSystem(
        state=("x",),
        parameters={"A": 1.0, "a": 500.0, "w": 0.01},
        modes=[Mode("lag", lambda t, x, p: (-x.x + pulse(t, p),))],
    )


def integral(function, start, stop, place, width):
    """Gauss quadrature on pieces that double outwards from the pulse; kinks and jumps are at their ends."""
    reach = width * 2.0 ** np.arange(-6, 60)
    edges = np.concatenate([place - reach, [place, start, stop], place + reach])
    edges = np.unique(np.clip(np.concatenate([edges, np.arange(start, stop, 0.5)]), start, stop))
    nodes, weights = np.polynomial.legendre.leggauss(20)
    half, middle = np.diff(edges) / 2, (edges[1:] + edges[:-1]) / 2
    with np.errstate(over="ignore"):
        values = function(middle[:, None] + half[:, None] * nodes)
    return np.sum(values * weights * half[:, None])


def exact_oscillator(shape, end, parameters):
    """The oscillator from rest: its impulse response convolved with the pulse."""
    p, rate = P(**parameters), DAMPING / 2
    frequency = np.sqrt(1 - rate**2)

    def position(s):
        return np.exp(-rate * (end - s)) * np.sin(frequency * (end - s)) / frequency

    def velocity(s):
        return np.exp(-rate * (end - s)) * np.cos(frequency * (end - s)) - rate * position(s)

    return np.array(
        [
            integral(lambda s, r=r: r(s) * SHAPES[shape](s, p), 0.0, end, p.a, p.w)
            for r in (position, velocity)
        ]
    )


def exact_lag(shape, end, parameters):
    p = P(**parameters)
    return integral(lambda s: np.exp(s - end) * SHAPES[shape](s, p), 0.0, end, p.a, p.w)


widths = st.floats(-4.0, 1.0).map(lambda exponent: 10.0**exponent)
places = st.floats(1.0, 999.0)
heights = st.floats(-2.0, 0.0).map(lambda exponent: 10.0**exponent)


def allowed_error(shape, solver, height, width):
    """A share of the response plus some absolute tolerances; edges are found by the error control only."""
    has_edges = shape in ("window", "kinked") or isinstance(solver, Tsit5)
    share = 1e-3 if has_edges else 1e-6
    return share * height * min(width, 1.0) + 100 * solver.atol


@pytest.mark.parametrize("shape", SHAPES)
@settings(max_examples=25)
@given(place=places, width=widths, height=heights, solver=st.sampled_from(SOLVERS))
def test_an_oscillator_at_rest_answers_a_pulse(shape, place, width, height, solver):
    parameters = {"A": height, "a": place, "w": width}
    end = min(END, place + 20.0)
    arc = simulate(oscillator(shape), (0.0, 0.0), (0.0, end), parameters=parameters, solver=solver)
    assert arc.status.code == StatusCode.SUCCESS
    assert "not resolved" not in arc.status.message
    expected = exact_oscillator(shape, end, parameters)
    np.testing.assert_allclose(arc.x[-1], expected, rtol=0, atol=allowed_error(shape, solver, height, width))
    assert arc.steps < 10_000


@pytest.mark.parametrize("shape", SHAPES)
@settings(max_examples=15)
@given(place=places, width=widths, height=heights, solver=st.sampled_from(SOLVERS))
def test_a_lag_at_rest_answers_a_pulse(shape, place, width, height, solver):
    parameters = {"A": height, "a": place, "w": width}
    end = min(END, place + 3.0)
    arc = simulate(lag(shape), (0.0,), (0.0, end), parameters=parameters, solver=solver)
    expected = exact_lag(shape, end, parameters)
    np.testing.assert_allclose(
        arc.x[-1, 0], expected, rtol=0, atol=allowed_error(shape, solver, height, width)
    )


@pytest.mark.parametrize("solver", SOLVERS)
@given(place=places, width=st.floats(-4.0, -0.3).map(lambda exponent: 10.0**exponent))
def test_a_window_has_a_closed_form(solver, place, width):
    arc = simulate(
        lag("window"), (0.0,), (0.0, place + 1.0), parameters={"a": place, "w": width}, solver=solver
    )
    expected = 2 * np.sinh(width) * np.exp(-1.0)
    np.testing.assert_allclose(
        arc.x[-1, 0], expected, rtol=0, atol=allowed_error("window", solver, 1.0, width)
    )


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("shape", [shape for shape in SHAPES if shape != "lorentz"])
def test_the_steps_are_those_that_the_pulse_needs(shape, solver):
    """A pulse a thousand times narrower and a hundred times farther away needs hardly more steps."""
    most = {Taylor: 300, DOP853: 300, RadauIIA: 1200, Tsit5: 400}[type(solver)]
    for place, width in ((50.0, 1e-4), (50.0, 1e-2), (5000.0, 1e-4), (5000.0, 1e-2)):
        arc = simulate(
            oscillator(shape),
            (0.0, 0.0),
            (0.0, place + 1),
            parameters={"a": place, "w": width},
            solver=solver,
        )
        assert arc.steps < most


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("height", [0.0, 1e-30])
def test_a_pulse_of_no_size_needs_no_small_steps(solver, height):
    for shape in ("gauss", "window", "tanh"):
        arc = simulate(
            oscillator(shape), (0.0, 0.0), (0.0, END), parameters={"A": height, "w": 1e-3}, solver=solver
        )
        assert arc.steps < 20


@pytest.mark.parametrize("solver", SOLVERS)
def test_tangent_vectors_see_a_pulse_that_multiplies_the_state(solver):
    """``x' = (-1 + g(t)) x``, also at ``x = 0``, where the state does not change."""
    system = HybridSystem(
        state=("x",),
        parameters={"A": 200.0, "a": 30.0, "w": 0.01},
        modes=[Mode("growth", lambda t, x, p: (x.x * (-0.1 + SHAPES["gauss"](t, p)),))],
    )
    for width in (0.01, 1e-3):
        for x0 in (0.0, 1.0):
            arc = simulate(
                system, (x0,), (0.0, 60.0), parameters={"w": width}, solver=solver, tangent=np.eye(1)
            )
            expected = np.exp(-6.0 + 200.0 * width * np.sqrt(np.pi))
            rtol = 1e-8 if solver.rtol < 1e-9 else 1e-5
            np.testing.assert_allclose(arc.fundamental[0, 0], expected, rtol=rtol)
            np.testing.assert_allclose(arc.x[-1, 0], x0 * expected, rtol=rtol)


TRAINS = {
    "window": lambda t, p: np.where(np.abs(np.mod(t, p.T) - p.c) < p.w, p.A, 0.0),
    "gauss": lambda t, p: p.A * np.exp(-(((np.mod(t, p.T) - p.c) / p.w) ** 2)),
    "sine": lambda t, p: p.A * np.exp(-((p.T / np.pi * np.sin(np.pi * (t - p.c) / p.T) / p.w) ** 2)),
}


@cache
def driven_lag(train):
    pulse = TRAINS[train]
    return HybridSystem(
        state=("x",),
        parameters={"A": 1.0, "c": 0.7, "w": 1e-3, "T": 5.0},
        modes=[Mode("lag", lambda t, x, p: (-x.x + pulse(t, p),))],
        period=lambda p: p.T,
    )


@pytest.mark.parametrize("train", TRAINS)
@settings(max_examples=15)
@given(
    place=st.floats(0.3, 4.7),
    width=st.floats(-4.0, -1.5).map(lambda exponent: 10.0**exponent),
    solver=st.sampled_from(SOLVERS),
)
def test_a_train_of_pulses_of_the_declared_period(train, place, width, solver):
    parameters = {"c": place, "w": width, "T": 5.0, "A": 1.0}
    section = stroboscopic_section(driven_lag(train), (0.0,), periods=6, parameters=parameters, solver=solver)
    p = P(**parameters)
    response = integral(lambda s: np.exp(s - 5.0) * TRAINS[train](s, p), 0.0, 5.0, place, width)
    turns = 1 + np.arange(len(section.x))
    expected = response * (1 - np.exp(-5.0 * turns)) / (1 - np.exp(-5.0))
    np.testing.assert_allclose(
        section.x[:, 0], expected, rtol=0, atol=allowed_error("window", solver, 1.0, width)
    )


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_difference_of_two_switches_is_a_pulse(solver):
    """Each switch alone is consistent with the values at the ends of a step."""
    system = HybridSystem(
        state=("x",),
        parameters={"a": 500.0, "w": 1e-3},
        modes=[
            Mode("lag", lambda t, x, p: (-x.x + np.heaviside(t - p.a, 1) - np.heaviside(t - p.a - p.w, 1),)),
        ],
    )
    for width in (1e-3, 1.0):
        arc = simulate(system, (0.0,), (0.0, 502.0), parameters={"w": width}, solver=solver)
        expected = np.exp(-2.0) * np.expm1(width)
        np.testing.assert_allclose(
            arc.x[-1, 0], expected, rtol=0, atol=allowed_error("window", solver, 1.0, width)
        )


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_high_power_of_a_cosine_is_a_pulse(solver):
    system = HybridSystem(
        state=("x",),
        modes=[Mode("lag", lambda t, x, p: (-x.x + np.cos(t / 100) ** 400,))],
    )
    place = 100 * np.pi
    arc = simulate(system, (0.0,), (place / 2, place + 1.0), solver=solver)
    expected = integral(
        lambda s: np.exp(s - place - 1) * np.cos(s / 100) ** 400, place / 2, place + 1, place, 1.0
    )
    np.testing.assert_allclose(arc.x[-1, 0], expected, rtol=0, atol=1e4 * solver.atol)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_pulse_in_one_mode_of_two(solver):
    """A pulse kicks a ball on a spring across a guard; the crossing must be at the exact time."""
    system = HybridSystem(
        state=("x", "v"),
        parameters={"a": 400.0, "w": 0.01},
        modes=[
            Mode("held", lambda t, x, p: (x.v, -x.x - x.v + 300 * np.exp(-(((t - p.a) / p.w) ** 2)))),
            Mode("free", lambda t, x, p: (1.0 + 0 * x.v, -1.0)),
        ],
        transitions=[Transition("held", "free", Guard(lambda t, x, p: x.x - 0.5, +1), name="leave")],
    )
    times = []
    for width in (0.01, 1e-3):
        arc = simulate(system, (0.0, 0.0), (0.0, 410.0), mode="held", parameters={"w": width}, solver=solver)
        times += list(arc.jumps.t)
    assert len(times) == 1
    reference = simulate(system, (0.0, 0.0), (0.0, 410.0), mode="held", solver=DOP853(max_step=1e-3))
    np.testing.assert_allclose(times, reference.jumps.t, rtol=0, atol=1e-5)


def test_a_pulse_during_a_contact():
    """A mode on its own clock also resolves pulses in time."""
    system = HybridSystem(
        state=("x", "v"),
        parameters={"a": 60.0, "w": 1e-3, "K": 1e4},
        modes=[
            Mode(
                "contact",
                lambda t, x, p: (
                    x.v,
                    1.0
                    - 0.5 * x.v
                    - p.K * np.maximum(x.x, 0) ** 1.5
                    - 0.01 / p.w * np.exp(-(((t - p.a) / p.w) ** 2)),
                ),
            ),
            Mode("free", lambda t, x, p: (x.v, 1.0 - 0.5 * x.v)),
        ],
        transitions=[
            Transition("contact", "free", Guard(lambda t, x, p: x.x, -1)),
            Transition("free", "contact", Guard(lambda t, x, p: x.x, +1)),
        ],
    )
    start, span = ((1e-4) ** (2 / 3), 0.0), (0.0, 61.0)
    for width in (1e-3, 1e-4):
        arcs = [
            simulate(system, start, span, mode="contact", parameters={"w": width}, solver=solver)
            for solver in (Taylor(), DOP853(max_step=width))
        ]
        assert all(arc.status.ok for arc in arcs)
        assert len(arcs[0].jumps) == len(arcs[1].jumps)
        np.testing.assert_allclose(arcs[0].x[-1], arcs[1].x[-1], rtol=0, atol=1e-6)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("width", [1e-7, 1e-8, 2e-9, 3e-10, 1e-12])
def test_a_pulse_as_narrow_as_the_rounding_of_time_is_seen_or_reported(solver, width):
    place = 1e6
    parameters = {"A": 1e5, "a": place, "w": width}
    arc = simulate(lag("gauss"), (0.0,), (0.0, place + 5.0), parameters=parameters, solver=solver)
    expected = 1e5 * width * np.sqrt(np.pi) * np.exp(-5.0)
    is_seen = abs(arc.x[-1, 0] - expected) < 0.1 * expected
    assert is_seen or not arc.status.ok or "the forcing is not resolved" in arc.status.message
    assert arc.steps < 300


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_run_does_not_crawl_where_bounds_say_nothing(solver):
    """``0 / 0`` at one instant, and a forcing whose bounds are far wider than its range."""
    for forcing in (
        lambda t: np.sin(t - 300.0) / (t - 300.0),
        lambda t: (np.tanh(t) ** 2 + 1 / np.cosh(t) ** 2) ** 40 - 1,
    ):
        system = HybridSystem(
            state=("x",),
            modes=[Mode("lag", lambda t, x, p, forcing=forcing: (-x.x + forcing(t),))],
        )
        arc = simulate(system, (0.0,), (280.1, 310.0), solver=solver)
        assert arc.status.ok
        assert arc.steps < 3000


def test_what_the_compiled_system_says():
    bounded = "its forcing is bounded on each step"
    assert bounded in repr(compile_system(oscillator("gauss")))
    # Programs of guards come before those of forcings; an affine guard has none.
    for value in (lambda t, x, p: x.x - 2.0, lambda t, x, p: np.tanh(x.x) - 2.0):
        marks = [Transition("swing", "swing", Guard(value, +1), name=name) for name in ("one", "other")]
        system = attrs.evolve(oscillator("gauss"), transitions=marks)
        assert bounded in repr(compile_system(system))
    plain = HybridSystem(
        state=("x",),
        modes=[Mode("lag", lambda t, x, p: (-x.x + np.cos(t) + t**2 + np.exp(-t) * np.sin(3 * t),))],
    )
    assert "forcing" not in repr(compile_system(plain)).replace("polynomial, harmonic", "")

    def branching(t, x, p):
        return (-x.x + (1.0 if abs(t - 5.0) < 1e-3 else 0.0),)

    untraced = HybridSystem(
        state=("x",),
        modes=[Mode("lag", branching, jacobian=lambda t, x, p: ((-1.0,),))],
    )
    assert "narrower than a step may be stepped over" in repr(compile_system(untraced))


@pytest.mark.parametrize("roundings", [35, 60, 100, 170])
def test_a_pulse_hardly_wider_than_the_rounding_of_time_is_met_in_short_steps(roundings):
    """The status says that the steps do not resolve it."""
    system = HybridSystem(
        state=("q",),
        parameters={"a": 0.0, "w": 1.0},
        modes=[Mode("m", lambda t, x, p: (np.exp(-(((t - p.a) / p.w) ** 2)) / p.w,))],
    )
    parameters = {"a": 1e6 + 0.4, "w": roundings * np.spacing(1e6)}
    arc = simulate(
        system, (1.0,), (1e6, 1e6 + 1.0), parameters=parameters, solver=Taylor(rtol=1e-6, atol=1e-8)
    )
    assert arc.status.code == StatusCode.SUCCESS
    assert "the forcing is not resolved" in arc.status.message
    assert arc.x[-1, 0] == pytest.approx(1.0 + np.sqrt(np.pi), abs=5e-3)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("factor", [False, True], ids=["term", "factor"])
@pytest.mark.parametrize("w", [1e14, 1e15, 1e16, 1e18])
def test_forcing_that_rounding_of_time_hides_is_reported(w, factor, solver):
    """Pulses of a width of 0.01 / w, at times of order one."""

    def field(t, x, p):
        pulses = p.A * np.exp(-1e4 * np.sin(p.w * t) ** 2)
        return (-x.q * (1.0 + pulses) if factor else pulses - x.q,)

    system = HybridSystem(state=("q",), parameters={"A": 100.0, "w": 1.0}, modes=[Mode("m", field)])
    rough = type(solver)(rtol=1e-6, atol=1e-3, max_steps=3000)
    arc = simulate(system, (1.0,), (0.0, 1.0), parameters={"w": w}, solver=rough)
    assert not arc.status.ok or "the forcing is not resolved" in arc.status.message
    # In time that is as fine as the pulses they are resolved.
    span = 10.0 / w
    fine = type(solver)(rtol=1e-7, atol=1e-6)
    arc = simulate(system, (1.0,), (0.0, span), parameters={"w": w, "A": 100.0 / span}, solver=fine)
    assert arc.status.ok
    assert "not resolved" not in arc.status.message
    # Half a pulse at the start, and pulses at pi, 2 pi and 3 pi.
    area = 10.0 * 3.5 * np.sqrt(np.pi * 1e-4)
    assert arc.x[-1, 0] == pytest.approx(np.exp(-area) if factor else 1.0 + area, abs=1e-3)


@pytest.mark.parametrize(
    ("field", "saturates"),
    [
        (lambda x, y: sympy.tanh(x / 1e-4), True),
        (lambda x, y: y * sympy.exp(9 * x), True),
        (lambda x, y: 2**x, True),
        (lambda x, y: (x / 5) ** 40, True),
        (lambda x, y: (x * y) ** -9, True),
        (lambda x, y: x / sympy.sqrt(x**2 + sympy.Float(1e-16)), True),
        (lambda x, y: sympy.sqrt(sympy.sin(x)), True),
        (lambda x, y: sympy.sqrt(Maximum(x**2, y)), True),
        (lambda x, y: sympy.asin(sympy.sin(x)), True),
        (lambda x, y: y * sympy.acos(1 - x**2), True),
        (lambda x, y: sympy.sqrt(Maximum(x, y)), True),
        (lambda x, y: Absolute(x) ** sympy.Rational(3, 2), True),
        (lambda x, y: y / (1 + x**4), True),
        # These vary wherever they are, or their series shows where they do.
        (lambda x, y: sympy.sqrt(x - 2 * y), False),
        (lambda x, y: sympy.asin(x - 2 * y), False),
        (lambda x, y: x**3 + x * y, False),
        (lambda x, y: sympy.sin(x) * y, False),
        (lambda x, y: y / (1 + x**2), False),
    ],
)
def test_what_saturates_in_the_state_or_is_flat_at_first(field, saturates):
    symbols = model_symbols(2, 1)
    found = forcings([symbols.x[1], field(*symbols.x)], [], symbols)
    assert [each.kind for each in found[:1]] == ([ARGUMENTS] if saturates else [])
    assert forcings([symbols.x[1], field(symbols.p[0], 2 * symbols.p[0])], [], symbols) == ()
