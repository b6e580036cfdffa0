"""Derivatives by the chain rule, compared with SymPy and with finite differences."""

import numpy as np
import pytest
import sympy

from hybrid import Guard, HybridSystem, Mode, Reset, Transition, compile_system
from hybrid.symbolic.derivatives import directional, partial_derivatives
from hybrid.symbolic.expressions import Absolute, Maximum, Select, Sign
from hybrid.system.functions import field_function, reset_function

a, b, c = sympy.symbols("a b c", real=True)
EXPRESSIONS = [
    sympy.Integer(3),
    c,
    a * b * (a - b) ** 3,
    sympy.sin(a * b) * sympy.exp(-a) / (1 + b**2),
    (a - 2) ** c,
    c**a,
    sympy.atan2(a, 2 + b),
    sympy.tanh(a * sympy.cos(b)) + sympy.log(3 + a * b),
    sympy.sqrt(a**2) * b,
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
    u, v = sympy.symbols("u v", real=True)
    [along] = directional([expression], {a: u, b: v})
    [[by_a, by_b]] = partial_derivatives([expression], (a, b))
    point = {a: 2.7, b: 1.3, c: 0.6, u: 0.3, v: -1.1}
    assert abs(float((along - u * by_a - v * by_b).xreplace(point).evalf())) < 1e-13


def test_large_blocks_share_what_they_use_twice(monkeypatch):
    from hybrid.symbolic import printer

    shared = sympy.exp(a * b) + c
    expressions = [shared**2 / (1 + shared), sympy.sin(shared) * a, 1 / shared + b / shared, shared * c**1.5]
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
    field = compiled.derivative(field_function(system.modes[0], system.dimension), 0, 0.3, x, np.zeros(0))
    expected = -np.eye(n, n + 1)
    for i in range(0, n, 5):
        expected[i] = 0.0
        expected[i, i] += x[0]
        expected[i, 0] += x[i]
        expected[i, n] = -1.0
    np.testing.assert_allclose(field, expected, atol=1e-15)
    reset = compiled.derivative(
        reset_function(system.transitions[0], system.dimension), 0, 0.3, x, np.zeros(0)
    )
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
