"""Derivatives by the chain rule, compared with SymPy and with finite differences."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy

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
from hybrid.expression.derivatives import directional, jacobian_of, partial_derivatives
from hybrid.expression.nodes import Symbol, multiply, number
from hybrid.expression.operations import (
    Absolute,
    Atan2,
    Cos,
    Cosh,
    Exp,
    Log,
    Maximum,
    Select,
    Sign,
    Sin,
    Tanh,
    sqrt,
)
from hybrid.system.functions import field_function, reset_function

a, b, c = map(Symbol, ("a", "b", "c"))
EXPRESSIONS = [
    number(3),
    c,
    a * b * (a - b) ** 3,
    Sin(a * b) * Exp(-a) / (1 + b**2),
    (a - 2) ** c,
    c**a,
    Atan2(a, 2 + b),
    Tanh(a * Cos(b)) + Log(3 + a * b),
    sqrt(a**2) * b,
    Maximum(a * b, b**2) * a,
    Select(Sign(a), a * b, b) * b,
    Absolute(a - b) * c,
]


@pytest.mark.parametrize("expression", EXPRESSIONS, ids=str)
def test_partial_derivatives_equal_sympys(expression):
    [row] = partial_derivatives([expression], (a, b))
    point = {a: 2.7, b: 1.3, c: 0.6}
    for found, variable in zip(row, (a, b), strict=True):
        difference = (found - expression.diff(variable)).xreplace(point)
        assert abs(float(difference.evalf())) < 1e-13


def test_what_does_not_depend_on_a_variable_has_the_derivative_zero():
    assert partial_derivatives([b * c, a - a], (a,)) == [[0], [0]]


@pytest.mark.parametrize("expression", EXPRESSIONS[:-3], ids=str)
def test_along_a_vector_it_is_the_sum_of_the_partial_ones(expression):
    u, v = map(Symbol, ("u", "v"))
    [along] = directional([expression], {a: u, b: v})
    [[by_a, by_b]] = partial_derivatives([expression], (a, b))
    point = {a: 2.7, b: 1.3, c: 0.6, u: 0.3, v: -1.1}
    assert abs(float((along - u * by_a - v * by_b).xreplace(point).evalf())) < 1e-13


def test_large_blocks_share_what_they_use_twice(monkeypatch):
    from hybrid.expression import printer

    shared = Exp(a * b) + c
    expressions = [shared**2 / (1 + shared), Sin(shared) * a, 1 / shared + b / shared, shared * c**1.5]
    values = {"a": 0.4, "b": -1.2, "c": 0.9}
    found = []
    for large in (printer.LARGE, 0):
        monkeypatch.setattr(printer, "LARGE", large)
        names = [f"out{i}" for i in range(len(expressions))]
        lines = printer.assignments(names, expressions)
        assert sum(line.count("exp(") for line in lines) == 1
        namespace = dict(values)
        exec("from math import *\n" + "\n".join(lines), namespace)
        found.append([namespace[name] for name in names])
    exact = [float(expression.xreplace({a: 0.4, b: -1.2, c: 0.9})) for expression in expressions]
    np.testing.assert_allclose(found, [exact, exact], rtol=1e-15)


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
    field = compiled.derivative(field_function(system.modes[0], system.state), 0, 0.3, x, np.zeros(0))
    expected = -np.eye(n, n + 1)
    for i in range(0, n, 5):
        expected[i] = 0.0
        expected[i, i] += x[0]
        expected[i, 0] += x[i]
        expected[i, n] = -1.0
    np.testing.assert_allclose(field, expected, atol=1e-15)
    reset = compiled.derivative(reset_function(system.transitions[0], system.state), 0, 0.3, x, np.zeros(0))
    np.testing.assert_array_equal(reset, np.diag([0.5] + [1.0] * (n - 1) + [0.0])[:n])


def test_a_power_of_zero_has_slope_zero_in_its_exponent():
    flow = HybridSystem(
        state=("q", "v"),
        parameters={"k": 0.0},
        modes=[Mode("a", lambda t, x, p: (np.abs(x.q) ** x.v, p.k**x.v + 2.0**t))],
    )
    compiled, function = compile_system(flow), field_function(flow.modes[0], 2)
    found = compiled.derivative(function, 0, 3.0, np.array([0.0, 1.5]), flow.parameter_values())
    np.testing.assert_allclose(found, [[0.0, 0.0, 0.0], [0.0, 0.0, 8.0 * np.log(2.0)]], rtol=1e-14)


DECAYS = {
    # A function that is zero where its exponentials overflow, and its derivative, in high precision.
    "logistic": (
        lambda u: 1 / (1 + Exp(-u)),
        lambda u: 1 / (mpmath.exp(u / 2) + mpmath.exp(-u / 2)) ** 2,
    ),
    "power": (
        lambda u: (3 + 2 * Exp(u)) ** number(Fraction(-3, 2)),
        lambda u: -3 * mpmath.exp(u) * (3 + 2 * mpmath.exp(u)) ** mpmath.mpf(-2.5),
    ),
    "sech": (lambda u: Cosh(u) ** -2, lambda u: -2 * mpmath.tanh(u) * mpmath.sech(u) ** 2),
    "two": (
        lambda u: 1 / (Exp(u) + 4 * Exp(-2 * u)),
        lambda u: (8 * mpmath.exp(-2 * u) - mpmath.exp(u)) / (mpmath.exp(u) + 4 * mpmath.exp(-2 * u)) ** 2,
    ),
}


@pytest.mark.parametrize("name", DECAYS)
@pytest.mark.parametrize("u", [-2e4, -700.0, -360.0, -30.0, -1.0, 0.0, 0.7, 25.0, 360.0, 700.0, 2e4])
def test_a_function_that_decays_has_a_derivative_where_its_exponentials_overflow(name, u):
    """Where the chain rule divides infinity by infinity it is zero. Elsewhere it keeps its digits."""
    function, exact = DECAYS[name]
    [[slope]] = jacobian_of([function(a)], [a])
    [along] = directional([function(a)], {a: b})
    with np.errstate(over="ignore"):
        values = [
            f(np.float64(u), 1.0) for f in (sympy.lambdify((a, b), each, "numpy") for each in (slope, along))
        ]
    assert values == pytest.approx([float(exact(mpmath.mpf(u)))] * 2, rel=1e-12, abs=1e-300)


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
    [[slope]] = jacobian_of([multiply(3, c, a - b, evaluate=False)], [c])
    bit = np.finfo(float).eps
    assert sympy.lambdify((a, b), slope)(1.0 + bit, 1.0) == 3.0 * bit


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
