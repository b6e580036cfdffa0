"""Linear equations between expressions: solutions, determinants, and derivatives by the equations."""

import numpy as np
import pytest

from hybrid.expression.derivatives import directional, jacobian_of
from hybrid.expression.evaluation import Program
from hybrid.expression.graph import in_order
from hybrid.expression.linear import determinant, equations_of_solution, solved
from hybrid.expression.nodes import ONE, ZERO, Symbol
from hybrid.expression.operations import Cos, Sin

SYMBOLS = [Symbol(f"x[{i}]") for i in range(4)]
AT = dict(zip(SYMBOLS, (0.3, -0.7, 1.1, 0.4), strict=True))


def equations(size, seed=1):
    """A matrix that depends on all symbols, diagonally dominant, and a column."""
    draw = np.random.default_rng(seed)
    rows = [
        [
            (size + 1.0 if i == j else 0.0) + draw.uniform(0.1, 1) * Cos(SYMBOLS[i % 4] - SYMBOLS[j % 3])
            for j in range(size)
        ]
        for i in range(size)
    ]
    column = [draw.uniform(0.5, 2) * Sin(SYMBOLS[i % 4]) + SYMBOLS[(i + 1) % 4] for i in range(size)]
    return rows, column


def numbers(expressions, at=AT):
    return np.array(Program([*expressions]).run(at), dtype=float)


def matrix_of(rows, at=AT):
    return numbers([each for row in rows for each in row], at).reshape(len(rows), -1)


@pytest.mark.parametrize("size", [1, 2, 3, 5])
def test_the_solution_solves_the_equations(size):
    rows, column = equations(size)
    [found] = solved(rows, [column], matrix_of(rows))
    expected = np.linalg.solve(matrix_of(rows), numbers(column))
    np.testing.assert_allclose(numbers(found), expected, rtol=1e-12)


def test_a_pivot_is_not_zero_where_another_row_has_one():
    x, y = SYMBOLS[:2]
    rows = [[ZERO, x], [y, ONE]]
    [found] = solved(rows, [[ONE, x]], matrix_of(rows))
    np.testing.assert_allclose(matrix_of(rows) @ numbers(found), numbers([ONE, x]), rtol=1e-13)


def test_rows_of_constraints_follow_a_definite_matrix():
    rows, column = equations(3)
    bordered = [[*rows[0], ONE], [*rows[1], ZERO], [*rows[2], SYMBOLS[2]], [ONE, ZERO, SYMBOLS[2], ZERO]]
    [found] = solved(bordered, [[*column, SYMBOLS[3]]], matrix_of(bordered), definite=3)
    right = numbers([*column, SYMBOLS[3]])
    np.testing.assert_allclose(matrix_of(bordered) @ numbers(found), right, rtol=1e-12)


@pytest.mark.parametrize("size", [1, 2, 4])
def test_the_determinant_is_positive_where_it_was_asked(size):
    rows, _ = equations(size)
    [found] = numbers([determinant(rows[::-1], matrix_of(rows[::-1]))])
    assert found == pytest.approx(abs(np.linalg.det(matrix_of(rows))), rel=1e-12)


@pytest.mark.parametrize("size", [1, 2, 4])
@pytest.mark.parametrize("of", ["solution", "what is made of it"])
def test_derivatives_are_those_of_the_solution(size, of):
    rows, column = equations(size)
    [found] = solved(rows, [column], matrix_of(rows))
    if of != "solution":
        found = [Sin(found[0]) * found[-1] + SYMBOLS[1]]

    def quotient(symbol):
        step = 1e-5
        above, below = (numbers(found, {**AT, symbol: AT[symbol] + s}) for s in (step, -step))
        return (above - below) / (2 * step)

    jacobian = matrix_of(jacobian_of(found, SYMBOLS))
    np.testing.assert_allclose(jacobian, np.array([quotient(each) for each in SYMBOLS]).T, atol=1e-9)
    direction = dict(zip(SYMBOLS, map(Symbol, ("v[0]", "v[1]", "v[2]", "v[3]")), strict=True))
    values = {**AT, **dict(zip(direction.values(), (0.2, 0.5, -1.0, 0.3), strict=True))}
    along = directional(found, direction)
    np.testing.assert_allclose(numbers(along, values), jacobian @ [0.2, 0.5, -1.0, 0.3], rtol=1e-10)
    # The second derivative is one of equations again.
    twice = numbers(directional(along, direction), values)
    shifted = [
        numbers(along, {**values, **{x: AT[x] + s * values[v] for x, v in direction.items()}})
        for s in (1e-5, -1e-5)
    ]
    np.testing.assert_allclose(twice, (shifted[0] - shifted[1]) / 2e-5, atol=1e-8)


def test_derivatives_of_a_solution_are_not_larger_than_solutions_for_each_variable():
    rows, column = equations(6)
    [found] = solved(rows, [column], matrix_of(rows))
    own, slopes = len(in_order(found)), len(in_order(e for row in jacobian_of(found, SYMBOLS) for e in row))
    # The chain rule through the elimination takes more.
    assert slopes < (2 + len(SYMBOLS) / 2) * own


def test_an_unknown_that_the_equations_are_made_of_is_not_known_by_them():
    x, y = SYMBOLS[:2]
    inside = Sin(x) + y
    [found] = solved([[y]], [[y * inside]], np.array([[1.0]]))
    assert found == [inside]
    assert equations_of_solution(inside) is None
    [[slope]] = jacobian_of(found, [x])
    assert slope is Cos(x)
