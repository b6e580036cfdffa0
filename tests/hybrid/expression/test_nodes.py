"""Expressions are graphs: the cost of a query grows with the nodes, not with the branches."""

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from sympy.core.parameters import distribute

from hybrid import Guard, HybridSystem, Mode, Reset, Transition, compile_system, simulate
from hybrid.expression.nodes import (
    ask_no_more,
    contains,
    degree_of,
    forget,
    interned,
    is_larger_than,
    mentions,
    nodes,
    nodes_of,
    operations_of,
    replaced,
    symbols_of,
)

ROUNDS = 40
X, Y, Z = sympy.symbols("x y z", real=True)
LEAVES = [X, Y, Z, sympy.Integer(2), sympy.Float(0.3)]
SUMS = st.recursive(
    st.sampled_from(LEAVES),
    lambda inner: st.one_of(
        st.builds(lambda a, b: a + b, inner, inner),
        st.builds(lambda a, b: a * b, inner, inner),
        st.builds(lambda a: a**2, inner),
        st.builds(sympy.sin, inner),
    ),
    max_leaves=12,
)


@pytest.fixture(autouse=True)
def nothing_remembered():
    yield
    forget()


@given(SUMS)
def test_answers_are_those_of_a_walk_through_the_tree(expression):
    assert set(nodes(expression)) == set(sympy.preorder_traversal(expression))
    assert symbols_of(expression) == expression.free_symbols
    assert mentions(expression, (X, Y)) == expression.has(X, Y)
    assert contains(expression, sympy.sin) == expression.has(sympy.sin)
    assert nodes_of((sympy.sin, sympy.Add), expression) == expression.atoms(sympy.sin, sympy.Add)
    values = {X: Y + 1, Z: sympy.Integer(3)}
    assert replaced(expression, values) == expression.xreplace(values)


@given(SUMS)
def test_an_interned_expression_is_equal_and_one_object(expression):
    assert interned(expression) == expression
    again = expression.func(*expression.args, evaluate=False) if expression.args else expression
    assert interned(again) is interned(expression)


@given(SUMS)
def test_a_degree_is_no_less_than_that_of_the_polynomial(expression):
    degree = degree_of(expression, frozenset((X, Y)))
    assert (degree is None) == (not expression.is_polynomial(X, Y))
    if degree is not None:
        assert degree >= sympy.Poly(expression, X, Y).total_degree()


@pytest.mark.parametrize(
    ("expression", "degree"),
    [
        (Z**2, 0),
        (X, 1),
        (X + Y * Z, 1),
        (3 * X * Y**2 + Y, 3),
        ((X * Y + 1) ** 4, 8),
        (X * sympy.sin(Z), 1),
        (sympy.sin(X) + Y, None),
        (Y / X, None),
        (X ** sympy.Rational(1, 2), None),
    ],
)
def test_degrees(expression, degree):
    assert degree_of(expression, frozenset((X, Y))) == degree


def test_operations_are_counted_as_in_the_tree():
    expression = (X + Y) * (X + Y + Z) * sympy.sin(X)
    assert operations_of(expression) == 2 + 1 + 2 + 1
    assert is_larger_than(5, expression)
    assert not is_larger_than(6, expression)


def nested():
    """An expression of 2^40 branches."""
    value = X
    with distribute(False):
        for _ in range(ROUNDS):
            value = interned(sympy.sin(value, evaluate=False) + sympy.Float(0.5) * value)
    return value


def test_forty_rounds_are_two_hundred_nodes():
    expression = nested()
    assert len(set(nodes(expression))) < 5 * ROUNDS
    assert operations_of(expression) > 2**ROUNDS
    assert symbols_of(expression) == {X}
    assert not mentions(expression, (Y,))
    with distribute(False):
        moved = replaced(replaced(expression, {X: Y}), {Y: X})
    # Printing the two would take forever.
    is_the_same = moved is expression
    assert is_the_same


def rounds(value):
    for _ in range(ROUNDS):
        value = 0.6 * np.sin(value) + 0.4 * value
    return value


@pytest.mark.parametrize("where", ["field", "guard", "reset", "condition"])
def test_a_model_whose_function_uses_its_result_twice_forty_times(where):
    """The function is traced and computes the same as Python."""
    deep = {where: rounds}

    def of(name, value, plain):
        return deep[name](value) if name in deep else plain

    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("swing", lambda t, x, p: (x.v, of("field", 0.01 * x.q, 0.0) - x.q))],
        transitions=[
            Transition(
                "swing",
                "swing",
                Guard(
                    lambda t, x, p: of("guard", 0.1 * x.q, x.q),
                    -1,
                    when=lambda t, x, p: of("condition", x.q, 0.0) > -9.0,
                ),
                Reset(lambda t, x, p: (x.q, of("reset", 0.01 * x.v, 0.0) - 0.8 * x.v)),
            )
        ],
    )
    assert all(compile_system(system).emitted.traced_field)
    arc = simulate(system, (1.0, 0.3), (0.0, 4.0), tangent=True)
    assert arc.status.ok
    assert len(arc.jumps) > 0
    np.testing.assert_allclose(arc.jumps.x_minus[:, 0], 0.0, atol=1e-9)


def root_of_cubic(value):
    """``z**3 + z = value`` by Newton's method."""
    z = value
    for _ in range(12):
        z = z - (z**3 + z - value) / (3 * z * z + 1)
    return z


def test_a_model_that_solves_an_equation_in_its_field():
    """SymPy looks for signs in the tree below a quotient, five times as many branches in each round."""
    system = HybridSystem(state=("q", "v"), modes=[Mode("swing", lambda t, x, p: (x.v, -root_of_cubic(x.q)))])
    arc = simulate(system, (0.4, 0.6), (0.0, 2.0), tangent=True)
    # The energy, with the potential as an integral over z.
    z = root_of_cubic(arc.x[:, 0])
    energy = 0.5 * arc.x[:, 1] ** 2 + 0.75 * z**4 + 0.5 * z**2
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)
    assert np.isclose(np.linalg.det(arc.fundamental), 1.0, rtol=1e-9)


def test_facts_of_a_large_expression_are_not_looked_for_again():
    known, unknown = 1 + X**2, X + Y
    assert known.is_positive
    for expression in (known, unknown):
        ask_no_more(expression)
    assert known.is_positive
    assert unknown.is_positive is None
    assert unknown.is_real
    assert (X + Z).default_assumptions == sympy.Add.default_assumptions
