"""Statements of fields and of their derivatives along vectors; roots of guards at and beyond the guard."""

import math

import numpy as np
import pytest
import sympy

from hybrid.compiler import written as module
from hybrid.compiler.propagators.equations import Boundary
from hybrid.compiler.written import Written, beyond_guards, variational
from hybrid.symbolic.derivatives import jacobian_of
from hybrid.symbolic.expressions import ZERO, CubeRoot, Less, Maximum, Select
from hybrid.symbolic.printer import assignments
from hybrid.symbolic.tracing import model_symbols

SYMBOLS = model_symbols(2, 2)
(Q, V), (K, R), T = SYMBOLS.x, SYMBOLS.p, SYMBOLS.t
HALF = sympy.Rational(1, 2)


def field_of(*expressions, given=False):
    """A field as the compiler writes it."""
    jacobian = jacobian_of(list(expressions), SYMBOLS.variables)
    n = len(expressions)
    cells = [f"out[{i}, {j}]" for i in range(n) for j in range(n + 1)]
    derivative = assignments(cells, [entry for row in jacobian for entry in row])
    value = assignments([f"out[{i}]" for i in range(n)], list(expressions))
    return Written(value, derivative, list(expressions), jacobian, given)


FIELD = (V * K, sympy.sin(Q) * T)
SPARSE = (sympy.Integer(0), Q * V)


class TestVectors:
    @pytest.mark.parametrize("vectors", [0, 1, 3])
    @pytest.mark.parametrize("how", ["derived", "given", "not traced"])
    @pytest.mark.parametrize("field", [FIELD, SPARSE])
    def test_the_jacobian_times_each_vector_and_the_divergence(self, field, how, vectors):
        written = field_of(*field, given=how == "given")
        if how == "not traced":
            written = Written(written.value, written.derivative)
        x = np.concatenate([[0.5, -2.0], np.arange(1.0, 1.0 + 2 * vectors)])
        out = np.full(len(x) + 1, 7.0)
        scope = {"t": 3.0, "x": x, "p": [4.0, 5.0], "out": out, **vars(math)}
        exec("\n".join(variational(written, 2)), scope)
        if field is FIELD:
            rates, matrix = [-8.0, 3.0 * math.sin(0.5)], np.array([[0.0, 4.0], [3.0 * math.cos(0.5), 0.0]])
        else:
            rates, matrix = [0.0, -1.0], np.array([[0.0, 0.0], [-2.0, 0.5]])
        expected = [rates, *(matrix @ each for each in x[2:].reshape(-1, 2))]
        np.testing.assert_allclose(out[:-1], np.ravel(expected), rtol=1e-14)
        assert out[-1] == np.trace(matrix)

    def test_entries_that_are_zero_cost_nothing(self):
        lines = variational(field_of(*SPARSE), 2)
        assert "    out[v + 0] = 0.0" in lines
        assert not [line for line in lines if "a0_" in line]
        assert variational(field_of(V, sympy.Integer(0)), 2)[-1] == "out[len(x)] = 0.0"


class TestRoots:
    known = (Q - 1, V)

    @pytest.mark.parametrize(
        ("power", "instead"),
        [
            ((Q - 1) ** HALF, Maximum(Q - 1, ZERO) ** HALF),
            ((Q - 1) ** K, Maximum(Q - 1, ZERO) ** K),
            ((3 * Q - 3) ** HALF, Maximum(3 * Q - 3, ZERO) ** HALF),
            (V**-HALF, Maximum(V, ZERO) ** -HALF),
            # The factor of a guard may have either sign, or is negative.
            ((R * V) ** HALF, Select(Less(ZERO, R), Maximum(R * V, ZERO), R * V) ** HALF),
            ((1 - Q) ** HALF, None),
            ((Q - 1) ** 2, None),
            (K**HALF, None),
            ((Q - 2) ** HALF, None),
        ],
    )
    def test_fractional_powers_of_what_is_positive_in_the_mode(self, power, instead):
        found = module._roots_inside([2 * power + Q], self.known, SYMBOLS)
        assert found == ({} if instead is None else {power: instead})

    @pytest.mark.parametrize(
        ("power", "base"),
        [
            ((Q - 1) ** -HALF, Q - 1),
            (1 / V, V),
            (CubeRoot(V) ** -2, V),
            (Maximum(Q - 1, ZERO) ** -HALF, Q - 1),
            ((Q - 1) ** HALF, None),
            ((Q - 2) ** -HALF, None),
            (1 / K, None),
        ],
    )
    def test_powers_that_are_infinite_at_a_guard_are_zero_there(self, power, base):
        found = module._slopes_inside([3 * power], self.known, SYMBOLS)
        assert found == ({} if base is None else {power: Select(Less(ZERO, base), power, ZERO)})


def values(written, q, v=0.25):
    """The field and its Jacobian at a point."""
    out, cells = np.zeros(2), np.zeros((2, 3))
    for statements, target in ((written.value, out), (written.derivative, cells)):
        scope = {"t": 0.0, "x": [q, v], "p": [2.0, 3.0], "out": target, "np": np, **vars(math)}
        exec("\n".join(statements), scope)
    return out.tolist(), cells.tolist()


class TestBeyondGuards:
    inside = (Boundary(Q, 1, is_affine=True),)

    def test_inside_the_mode_nothing_changes_and_beyond_it_the_root_is_zero(self):
        field = field_of(V, K * Q**HALF)
        made = beyond_guards(field, self.inside, SYMBOLS)
        assert values(made, 4.0) == values(field, 4.0) == ([0.25, 4.0], [[0.0, 1.0, 0.0], [0.5, 0.0, 0.0]])
        for q in (0.0, -1e-12):
            assert values(made, q) == ([0.25, 0.0], [[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]])

    def test_a_slope_alone_may_be_infinite(self):
        """``max(q, 0)**(1/2)`` has a value everywhere, and a slope that is infinite at zero."""
        made = beyond_guards(field_of(V, Maximum(Q, ZERO) ** HALF), self.inside, SYMBOLS)
        assert values(made, 0.0)[1][1] == [0.0, 0.0, 0.0]
        assert values(made, 4.0)[1][1] == [0.25, 0.0, 0.0]

    def test_a_given_derivative_stays(self):
        field = field_of(V, Q**HALF, given=True)
        made = beyond_guards(field, self.inside, SYMBOLS)
        assert made.derivative == field.derivative
        assert made.given
        assert made.value != field.value

    def test_what_has_no_root_of_a_guard_stays(self):
        untraced = Written(["out[0] = 1.0"], ["out[0, 0] = 0.0"])
        assert beyond_guards(untraced, self.inside, SYMBOLS) is untraced
        for field, boundaries in (
            (field_of(V, Q**2), self.inside),
            (field_of(V, V**HALF), self.inside),
            (field_of(V, Q**HALF), (Boundary(Q, 0, is_affine=True),)),
            (field_of(V, Q**HALF), ()),
        ):
            assert beyond_guards(field, boundaries, SYMBOLS) is field
