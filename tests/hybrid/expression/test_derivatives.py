"""Derivatives by the chain rule, against complex steps, exact formulas and tangent maps."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given, settings

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    Reset,
    Taylor,
    Transition,
    Tsit5,
    compile_system,
    simulate,
)
from hybrid.expression.derivatives import (
    close_gates,
    defined_at_origin,
    derivative,
    directional,
    divergence,
    jacobian_of,
    partial_derivatives,
)
from hybrid.expression.evaluation import Program
from hybrid.expression.graph import nodes
from hybrid.expression.nodes import ZERO, Symbol
from hybrid.expression.operations import (
    Absolute,
    Cosh,
    Exp,
    Gate,
    Hypot,
    Less,
    Maximum,
    Select,
    Sin,
    Step,
    sqrt,
)
from hybrid.system.functions import field_function, reset_function
from tests.hybrid.expression.formulas import (
    KINKED,
    POLYNOMIAL,
    X,
    Y,
    Z,
    at,
    expression_of,
    formulas,
    places,
    smooth,
)

U, V = map(Symbol, "uv")
STEP = 1e-100


@settings(max_examples=200)
@given(smooth, places)
def test_partial_derivatives_are_those_of_a_complex_step(formula, place):
    expression = expression_of(formula)
    [row] = partial_derivatives([expression], (X, Y))
    found = at(row, place)
    with np.errstate(all="ignore"):
        for i in range(2):
            moved = [np.complex128(each + 1j * STEP * (i == k)) for k, each in enumerate(place)]
            wanted = complex(formula(*moved))
            assume(abs(wanted) < 1e6)
            assert found[i] == pytest.approx(wanted.imag / STEP, rel=1e-7, abs=1e-7)


@given(formulas(POLYNOMIAL, KINKED), places)
def test_beside_kinks_they_are_the_differences(formula, place):
    expression, step = expression_of(formula), 1e-7
    [slope] = at([derivative(expression, X)], place)
    low, middle, high = (at([expression], (place[0] + k * step, *place[1:]))[0] for k in (-1, 0, 1))
    assume(abs(middle) + abs(slope) < 1e3 and abs(high - 2 * middle + low) < 1e-9)
    assert slope == pytest.approx((high - low) / (2 * step), abs=1e-4)


@given(smooth, smooth, places)
def test_along_a_vector_it_is_the_sum_of_the_partial_ones(one, other, place):
    expressions = [expression_of(one), expression_of(other)]
    along = directional(expressions, {X: U, Y: V})
    sums = [U * by_x + V * by_y for by_x, by_y in partial_derivatives(expressions, (X, Y))]
    values = Program([*along, *sums]).run({X: place[0], Y: place[1], Z: place[2], U: 0.3, V: -1.1})
    assume(max(map(abs, values)) < 1e6)
    assert values[:2] == pytest.approx(values[2:], rel=1e-9, abs=1e-9)
    assert divergence(expressions, (X, Y)) is derivative(expressions[0], X) + derivative(expressions[1], Y)


def test_what_does_not_depend_on_a_variable_has_the_derivative_zero():
    assert partial_derivatives([Y * Z, X - X, Step(X)], (X,)) == [[ZERO], [ZERO], [ZERO]]


def test_a_derivative_of_forty_rounds_has_some_hundred_nodes():
    value = X
    for _ in range(40):
        value = Sin(value) + 0.5 * value
    assert len([*nodes(derivative(value, X))]) < 500
    [slope] = at([derivative(value, X)], (0.0, 0.0, 0.0))
    assert slope == pytest.approx(1.5**40)


def test_matrices_of_zeros():
    """A loop writes the zeros of large derivatives to the right places."""
    n = 12
    system = HybridSystem(
        state=n,
        modes=[Mode("run", lambda t, x, p: [x[i] * x[0] - t if i % 5 == 0 else -x[i] for i in range(n)])],
        transitions=[
            Transition(
                "run", "run", Guard(lambda t, x, p: x[0] - 9), Reset(lambda t, x, p: [0.5 * x[0], *x[1:]])
            )
        ],
    )
    compiled, x = compile_system(system), np.linspace(0.5, 1.5, n)
    field = compiled.derivative(field_function(system.modes[0], system.variables), 0, 0.3, x, np.zeros(0))
    expected = -np.eye(n, n + 1)
    for i in range(0, n, 5):
        expected[i] = 0.0
        expected[i, i] += x[0]
        expected[i, 0] += x[i]
        expected[i, n] = -1.0
    np.testing.assert_allclose(field, expected, atol=1e-15)
    reset = compiled.derivative(
        reset_function(system.transitions[0], system.variables), 0, 0.3, x, np.zeros(0)
    )
    np.testing.assert_array_equal(reset, np.diag([0.5] + [1.0] * (n - 1) + [0.0])[:n])


def test_a_power_of_zero_has_slope_zero_in_its_exponent():
    flow = HybridSystem(
        state=("q", "v"),
        parameters={"k": 0.0},
        modes=[Mode("a", lambda t, x, p: (np.abs(x.q) ** x.v, p.k**x.v + 2.0**t))],
    )
    compiled, function = compile_system(flow), field_function(flow.modes[0], flow.variables)
    found = compiled.derivative(function, 0, 3.0, np.array([0.0, 1.5]), flow.parameter_values())
    np.testing.assert_allclose(found, [[0.0, 0.0, 0.0], [0.0, 0.0, 8.0 * np.log(2.0)]], rtol=1e-14)


DECAYS = {
    # A function that is zero where its exponentials overflow, and its derivative, in high precision.
    "logistic": (
        1 / (1 + Exp(-X)),
        lambda u: 1 / (mpmath.exp(u / 2) + mpmath.exp(-u / 2)) ** 2,
    ),
    "power": (
        (3 + 2 * Exp(X)) ** Fraction(-3, 2),
        lambda u: -3 * mpmath.exp(u) * (3 + 2 * mpmath.exp(u)) ** mpmath.mpf(-2.5),
    ),
    "sech": (Cosh(X) ** -2, lambda u: -2 * mpmath.tanh(u) * mpmath.sech(u) ** 2),
    "two": (
        1 / (Exp(X) + 4 * Exp(-2 * X)),
        lambda u: (8 * mpmath.exp(-2 * u) - mpmath.exp(u)) / (mpmath.exp(u) + 4 * mpmath.exp(-2 * u)) ** 2,
    ),
}


@pytest.mark.parametrize("name", DECAYS)
@pytest.mark.parametrize("u", [-2e4, -700.0, -360.0, -30.0, -1.0, 0.0, 0.7, 25.0, 360.0, 700.0, 2e4])
def test_a_function_that_decays_has_a_derivative_where_its_exponentials_overflow(name, u):
    """Where the chain rule divides infinity by infinity it is zero. Elsewhere it keeps its digits."""
    expression, exact = DECAYS[name]
    [[slope]] = jacobian_of([expression], [X])
    [along] = directional([expression], {X: Y})
    wanted = float(exact(mpmath.mpf(u)))
    assert at([slope, along], (u, 1.0, 0.0)) == pytest.approx([wanted] * 2, rel=1e-12, abs=1e-300)


@pytest.mark.parametrize("solver", [Taylor(), DOP853(), Tsit5(), RadauIIA()], ids=lambda s: type(s).__name__)
def test_a_switch_so_sharp_that_its_exponential_overflows(solver):
    """The area below a logistic function of width 1e-4, and its tangent map, are exact."""
    system = HybridSystem(
        state=("q", "area"),
        modes=[Mode("run", lambda t, x, p: (1.0, 1 / (1 + np.exp(-(x.q - 0.5) / 1e-4))))],
        transitions=[],
    )
    arc = simulate(system, (0.0, 0.0), (0.0, 3.0), solver=solver, tangent=True)
    assert arc.status.ok
    assert arc.x[-1, 1] == pytest.approx(2.5, rel=1e-6)
    assert arc.fundamental == pytest.approx(np.array([[1.0, 0.0], [1.0, 1.0]]), rel=1e-6)


def test_a_multiple_of_a_difference_is_not_multiplied_out():
    """``3 (a - b)`` is exact where ``a - b`` is one bit, and ``3 a - 3 b`` is a third larger."""
    bit = np.finfo(float).eps
    assert at([derivative(3 * Z * (X - Y), Z)], (1.0 + bit, 1.0, 0.0)) == [3.0 * bit]


@pytest.mark.parametrize(
    "slope",
    [X / Hypot(X, Y), X * Y / Hypot(X, Y), X / sqrt(X**2 + Y**2), X / sqrt(X**2 + 3 * Y**4)],
)
def test_slopes_of_lengths_are_zero_at_the_origin(slope):
    made = defined_at_origin(slope)
    for place in ((0.3, -0.4, 0.0), (-2.0, 1.0, 0.0)):
        assert at([made], place) == at([slope], place)
    assert at([made], (0.0, 0.0, 0.0)) == [0.0]


@pytest.mark.parametrize(
    "other",
    [
        X / sqrt(X**2 - Y**2),
        X / sqrt(X**2 + Y),
        X / sqrt(X**2 + Y**3),
        X / (X**2 + Y**2),
        X / Hypot(X, Y) ** 2,
        X * sqrt(X**2 + Y**2),
    ],
)
def test_other_powers_stay_as_they_are(other):
    assert defined_at_origin(other) is other


def test_products_are_zero_where_a_factor_switches_them_off():
    steep, open_choice = X ** Fraction(-3, 4), Select(Less(X, Y), X, Y)
    for product, closed in (
        (Step(X) * steep, Gate(X, steep)),
        (2 * Step(Y) * X, Gate(Y, 2 * X)),
        (Step(X), Step(X)),
        (Select(Less(X, Y), ZERO, Y) * steep, Select(Less(X, Y), ZERO, Y * steep)),
        (Select(Less(X, Y), X, ZERO) * steep, Select(Less(X, Y), X * steep, ZERO)),
        (open_choice * steep, open_choice * steep),
        (1 + Step(X) * steep, 1 + Gate(X, steep)),
        (X * Y, X * Y),
    ):
        assert close_gates(product) is closed
    [[slope]] = jacobian_of([Maximum(X, ZERO) ** Fraction(1, 4)], [X])
    assert at([slope], (-1.0, 0.0, 0.0)) == [0.0]
    both = close_gates(Step(X) * Step(Y) * Absolute(X))
    assert [at([both], (a, b, 0.0))[0] for a in (-2.0, 2.0) for b in (-1.0, 1.0)] == [0.0, 0.0, 0.0, 2.0]


@pytest.mark.parametrize(
    "rate",
    [
        *(np.sin, np.cos, np.tan, np.arcsin, np.arccos, np.arctan, np.sinh, np.cosh, np.tanh, np.exp),
        *(np.arcsinh, np.arctanh, np.sqrt, np.cbrt, np.log1p, np.expm1, np.log, np.exp2, np.log2, np.log10),
    ],
)
def test_a_tangent_vector_follows_the_field(rate):
    """Along an autonomous flow in one dimension the derivative of the end is the ratio of the rates."""
    system = HybridSystem(state=("q",), modes=[Mode("on", lambda t, x, p: (rate(x.q),))])
    for solver in (Taylor(), DOP853()):
        arc = simulate(system, (0.4,), (0.0, 0.1), tangent=True, solver=solver)
        wanted = rate(arc.x[-1, 0]) / rate(0.4)
        np.testing.assert_allclose(arc.fundamental, [[wanted]], rtol=1e-6)
