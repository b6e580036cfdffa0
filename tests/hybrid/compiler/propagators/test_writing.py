"""Columns, initial values and loops of a series, statement by statement."""

import math

import numpy as np
import pytest
import sympy

from hybrid.compiler.propagators import writing
from hybrid.compiler.propagators.writing import CLOCK, DIVERGENCE, FLOOR, OTHERS, Body
from hybrid.compiler.taylor.loops import below_highest, indented, padded
from hybrid.compiler.taylor.series import ONE_THEN_ZERO
from hybrid.kernels.types.codes import FROM_LAST_STEP, FROM_ZERO, WIDE
from hybrid.symbolic.tracing import model_symbols

SYMBOLS = model_symbols(2, 1)
(Q, V), (K,), T = SYMBOLS.x, SYMBOLS.p, SYMBOLS.t


def test_harmonics_of_linear_functions_of_time():
    """Sines come with cosines; functions of the state, of parameters or of squares of time are none."""
    field = [
        Q * sympy.sin(3 * T) + sympy.exp(-T) * sympy.sinh(K * T),
        sympy.cos(3 * T) + sympy.cos(T**2) + sympy.sin(K) + sympy.exp(T * Q) + sympy.sin(Q),
    ]
    found = writing.harmonics_of(field, SYMBOLS)
    linear = {sympy.sin(3 * T), sympy.cos(3 * T), sympy.exp(-T), sympy.sinh(K * T), sympy.cosh(K * T)}
    assert found.keys() == linear
    assert [str(each) for each in found.values()] == ["h0", "h1", "h2", "h3", "h4"]
    assert writing.harmonics_of([Q, V], SYMBOLS) == {}


def test_names():
    assert writing.names_of_state(SYMBOLS) == (["0", "1"], ["x[0]", "x[1]"])
    assert {x: str(seed) for x, seed in writing.seeds_of(SYMBOLS).items()} == {Q: "v0", V: "v1"}


@pytest.mark.parametrize(("vectors", "groups"), [(0, 0), (1, 1), (3, 1), (4, 1), (5, 2), (8, 2), (9, 3)])
@pytest.mark.parametrize("n", [1, 2, 5])
def test_tangent_vectors_come_in_groups_of_four(n, vectors, groups):
    scope = {"x": np.zeros(n * (1 + vectors))}
    exec(writing.groups(n), scope)
    assert scope["groups"] == groups


def test_loops():
    assert writing._each_order(["a = o"]) == [
        "for o in range(1, order + 1):",
        "    shrink = 1.0/o",
        "    a = o",
    ]
    assert indented(["a", "b"]) == ["    a", "    b"]
    assert below_highest(["a"]) == ["if o < order:", "    a"]
    assert below_highest([]) == []
    assert [padded(width, 4) for width in (0, 1, 4, 5, 8, 9)] == [0, 4, 4, 8, 8, 12]


def test_columns_behind_the_guards():
    other = sympy.Symbol("h")
    body = Body(SYMBOLS, [Q - K, V], [other], ONE_THEN_ZERO)
    assert [body.column(place) for place in (CLOCK, DIVERGENCE)] == ["4", "5"]
    # All of these are one vector of whole registers, and further columns come behind it.
    first = padded(2 + 2 + OTHERS, WIDE)
    assert body.rows == {other: str(first)}
    assert [body.allot(), body.allot()] == [str(first + 1), str(first + 2)]


class TestRoots:
    """The initial value of the root of the guard ``q - k``, which is in the second place."""

    def start(self, q, *, last=0.0, origin=0.0, order=2, goes_on=True, k=1.0):
        body = Body(SYMBOLS, [V, Q - K], (), ONE_THEN_ZERO)
        body.start_root("root", Q - K, order, 1, goes_on=goes_on)
        assert body.at_start[Q - K] == "*".join(["root"] * order)
        out = np.zeros((6, 12))
        out[4, 3], out[5, 3] = last, origin
        scope = {"x": [q, 7.0], "p": [k], "t": 0.0, "out": out, "order": 3, "sqrt": math.sqrt}
        exec("\n".join(body.preamble), scope)
        return scope["root"]

    @pytest.mark.parametrize(("order", "root"), [(2, 0.5), (3, 0.25 ** (1 / 3)), (4, 0.25**0.25)])
    def test_of_the_states(self, order, root):
        assert self.start(1.25, order=order) == pytest.approx(root, rel=1e-15)
        assert self.start(1.25, order=order, goes_on=False) == pytest.approx(root, rel=1e-15)

    @pytest.mark.parametrize("goes_on", [False, True])
    def test_a_stored_root_that_is_the_same_to_rounding_is_taken(self, goes_on):
        for last in (0.5 + 1e-14, -0.5 - 1e-14):
            assert self.start(1.25, last=last, goes_on=goes_on) == abs(last)
        assert self.start(1.25, last=0.5 + 1e-11, goes_on=goes_on) == 0.5
        assert self.start(1.25, last=0.5 - 1e-11, goes_on=goes_on) == 0.5

    def test_a_root_that_goes_on_is_taken_from_the_last_step(self):
        for origin, goes_on, root in (
            (FROM_LAST_STEP, True, 0.75),
            (FROM_LAST_STEP, False, 0.5),
            (FROM_LAST_STEP + 7, True, 0.5),
        ):
            assert self.start(1.25, last=0.75, origin=origin, goes_on=goes_on) == root

    def test_a_small_one_starts_below_the_rounding_of_the_guard(self):
        """It starts at zero only where the guard is zero and moves on."""
        for q, k in ((1.0, 1.0), (1.0 - 1e-15, 1.0)):
            assert self.start(q, k=k) == pytest.approx(math.sqrt(FLOOR * q), rel=1e-12)
            assert self.start(q, k=k, order=3) == pytest.approx((FLOOR * q) ** (1 / 3), rel=1e-12)
        assert self.start(0.0, k=0.0) == pytest.approx(1e-150, rel=1e-12)
        # A stored root near zero is no root of a guard that is smaller than its rounding.
        assert self.start(1.0, last=1e-9) == pytest.approx(math.sqrt(FLOOR), rel=1e-12)
        for q in (1.25, 1.0):
            assert self.start(q, origin=FROM_ZERO, last=0.3) == 0.0
