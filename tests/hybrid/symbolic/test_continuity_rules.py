"""The steps of the proof that a field is continuous, one by one, and what bytecode tells."""

import math

import numpy as np
import pytest
import sympy
from sympy.core.parameters import distribute

from hybrid.symbolic import continuity
from hybrid.symbolic.expressions import (
    ONE,
    ZERO,
    And,
    Atan2,
    Ceiling,
    Equal,
    Floor,
    Less,
    LessEqual,
    Level,
    Not,
    Or,
    Remainder,
    Select,
    Sign,
    Step,
    Truncate,
    TruncatedRemainder,
    WholeQuotient,
)
from hybrid.symbolic.tracing import model_symbols

SYMBOLS = model_symbols(2, 1)
(Q, V), (K,), T = SYMBOLS.x, SYMBOLS.p, SYMBOLS.t
N = sympy.Symbol("n", integer=True)


class TestSurfaces:
    @pytest.mark.parametrize(
        ("atom", "told"),
        [
            (Sign(Q - 1), "x[0] - 1 = 0"),
            (Step(Q - 1), "x[0] - 1 = 0"),
            (Less(Q, V), "x[1] = x[0]"),
            (LessEqual(Q, 2 * V), "2*x[1] = x[0]"),
            (Floor(3 * Q), "3*x[0] is a whole number"),
            (Ceiling(Q), "x[0] is a whole number"),
            (Truncate(Q), "x[0] is a whole number"),
            (Remainder(Q, K), "x[0] is a multiple of p[0]"),
            (TruncatedRemainder(Q, V), "x[0] is a multiple of x[1]"),
            (Atan2(Q, V), "the angle of (x[1], x[0]) turns from pi to -pi"),
            (WholeQuotient(Q, sympy.Integer(3)), "x[0]/3 is a whole number"),
        ],
    )
    def test_every_kind_of_jump_is_told(self, atom, told):
        assert continuity.jumps_of([Q, 2 + V * atom], (Q, V)) == [told]
        assert continuity.jumps_of([Q, 2 + V * atom.subs({Q: T, V: K})], (Q, V)) == []

    def test_a_surface_of_two_entries_is_told_once_and_in_order(self):
        found = continuity.jumps_of([Sign(V), Sign(V) + 2 * Sign(Q)], (Q, V))
        assert sorted(found) == ["x[0] = 0", "x[1] = 0"]
        assert found[0] == "x[1] = 0"

    @pytest.mark.parametrize(
        ("entry", "jumps"),
        [
            (Sign(Q - 1) - 2 * Step(Q - 1), False),
            (Sign(Q - 1) + 2 * Step(Q - 1), True),
            (Step(Q - 1) + Step(1 - Q), False),
            (Step(Q - 1) - Step(1 - Q), True),
            (Step(3 * Q - 3) - Step(Q - 1), False),
            (Step(Q / 4 - V) + Step(4 * V - Q), False),
            (V * Less(Q, ONE) + V * Step(Q - 1), False),
            (sympy.sin(2 * sympy.pi * Floor(Q)) * V, False),
            (sympy.cos(2 * sympy.pi * Ceiling(Q) / 3) * V, True),
            (Truncate(K) + TruncatedRemainder(K, V) * Truncate(T) + V * Sign(V), True),
            (Truncate(Q) * 0 + V * Sign(V), False),
        ],
    )
    def test_atoms_with_one_surface_jump_together(self, entry, jumps):
        assert bool(continuity.jumps_of([entry], (Q, V))) == jumps

    @pytest.mark.parametrize("distributing", [False, True])
    def test_proofs_distribute_numbers_whatever_the_caller_does(self, distributing):
        with distribute(distributing):
            assert continuity.jumps_of([Step(Q - V) * (2 * (Q + V) - 2 * Q - 2 * V + Q - V)], (Q, V)) == []
            assert continuity.vanishes_on(-(Q - V) + V, 2 * (V - Q / 2))

    @pytest.mark.parametrize(
        ("atom", "may"),
        [
            (Floor(Q), True),
            (Level(Q), False),
            (Remainder(Q**2 + 1, ONE), True),
            (Atan2(V, Q), True),
            (Atan2(V, Q**2 + 1), False),
            (Atan2(V, -1 - Q**2), True),
            (Atan2(Q**2 + 1, V), False),
            (TruncatedRemainder(Q, V), True),
            (Sign(Q), True),
            (Sign(1 + Q**2), False),
            (Less(Q**2, -ONE), False),
        ],
    )
    def test_which_atoms_may_jump(self, atom, may):
        assert continuity._may_jump(atom) == may

    @pytest.mark.parametrize(
        ("atom", "surface", "sides"),
        [
            (Atan2(Q, V), Q, (-sympy.pi, sympy.pi)),
            (Less(Q, V), V - Q, (ZERO, ONE)),
            (LessEqual(Q, V), V - Q, (ZERO, ONE)),
            (Sign(Q), Q, (-ONE, ONE)),
            (Step(Q), Q, (ZERO, ONE)),
            (Truncate(Q), None, (ZERO, ZERO)),
            (TruncatedRemainder(Q, V), None, (ZERO, ZERO)),
        ],
    )
    def test_values_on_both_sides(self, atom, surface, sides):
        assert continuity._sides(atom, N) == (surface, sides)

    @pytest.mark.parametrize(
        ("atom", "there", "side"),
        [
            (Less(Q, ONE), ZERO, ONE),
            (Less(Q, ONE), sympy.Integer(2), ZERO),
            (Less(Q, ONE), ONE, None),
            (Less(Q, ONE), V, None),
            (Less(Q, ONE), sympy.Symbol("z"), None),
            (Sign(Q - 1), ZERO, -ONE),
            (Step(Q), ONE, ONE),
            (Floor(Q), ZERO, None),
            (Remainder(Q, ONE), ZERO, None),
            (Atan2(Q, V), ONE, None),
        ],
    )
    def test_sides_that_are_known_elsewhere(self, atom, there, side):
        assert continuity._known_side(atom, N, {}, Q, there) == side

    @pytest.mark.parametrize(
        ("surface", "expected"),
        [
            (Q, {Q: ZERO}),
            (2 * Q - 6 * V + 4, {Q: 3 * V - 2, V: Q / 3 + sympy.Rational(2, 3)}),
            (Q - K, {Q: K}),
            (K * Q - 1, {Q: 1 / K}),
            (T - V, {T: V, V: T}),
            (3 * sympy.sin(Q) - 6, {sympy.sin(Q): sympy.Integer(2)}),
            (Q * V - 1, {Q * V: ONE}),
            (sympy.sin(T) + V, {V: -sympy.sin(T), sympy.sin(T): -V}),
            (K**2 - 1, {K**2: ONE}),
        ],
    )
    def test_substitutions_make_a_surface_zero(self, surface, expected):
        """A slope that depends on the state may vanish, so such a variable is not solved for."""
        found = {old: sympy.expand(new) for old, new in continuity._substitutions(surface)}
        # Terms beside other ones are solved for as well.
        assert expected.items() <= found.items()
        assert all(sympy.expand(surface.subs(old, new)) == 0 for old, new in found.items())
        assert {Q, V, T} & found.keys() == {Q, V, T} & expected.keys()

    def test_no_symbol_that_stands_for_a_jump_is_divided_by(self):
        jump = sympy.Dummy(real=True)
        assert Q not in dict(continuity._substitutions(jump * Q + 1))

    @pytest.mark.parametrize(
        ("one", "other", "ratio"),
        [
            (Q - V, Q - V, 1.0),
            (2 * V - 2 * Q, Q - V, -2.0),
            (Q, 4 * Q, 0.25),
            (Q, V, 0.0),
            (K * Q, Q, 0.0),
            (Q, ZERO, 0.0),
        ],
    )
    def test_constant_ratios(self, one, other, ratio):
        assert continuity._ratio(one, other) == ratio


class TestExactTurns:
    @pytest.mark.parametrize("parts", [-24, -13, -1, 1, 2, 8, 12, 24])
    def test_floats_near_parts_of_a_turn(self, parts):
        found = continuity._turns(sympy.Float(parts * math.pi / 12))
        assert found == sympy.Rational(parts, 12) * sympy.pi

    @pytest.mark.parametrize("value", [1e-9, 1.0, math.pi * (1 + 1e-14), math.pi / 24, -3.0])
    def test_other_floats_stay(self, value):
        assert continuity._turns(sympy.Float(value)) == sympy.Float(value)

    def test_only_arguments_of_harmonics_are_changed(self):
        turn = sympy.Float(2 * math.pi)
        for function in (sympy.sin, sympy.cos, sympy.tan):
            assert continuity._with_exact_turns(1 + function(turn * Q + V)) == 1 + function(
                2 * sympy.pi * Q + V
            )
        assert continuity._with_exact_turns(turn * Q) == turn * Q
        assert continuity._with_exact_turns(sympy.exp(turn * Q)) == sympy.exp(turn * Q)

    def test_a_harmonic_that_runs_backwards_joins_the_ends_of_a_sawtooth(self):
        backwards = sympy.sin(V - sympy.Float(2 * math.pi) * Remainder(Q, ONE))
        assert continuity.jumps_of([backwards], (Q, V)) == []
        assert continuity.jumps_of([sympy.sin(V - 6.25 * Remainder(Q, ONE))], (Q, V)) != []


class TestChoices:
    """Choices as polynomials in their conditions, with the values 0 and 1 put in."""

    a, b = sympy.symbols("a b", cls=sympy.Dummy)

    @pytest.mark.parametrize(("a", "b"), [(0, 0), (0, 1), (1, 0), (1, 1)])
    def test_connectives(self, a, b):
        there = {self.a: a, self.b: b}
        for made, expected in (
            (And(self.a, self.b), a and b),
            (Or(self.a, self.b), a or b),
            (Not(self.a), 1 - a),
            (Select(self.a, Q, V), Q if a else V),
            (Select(Not(self.b), Q, V) + 1, (V if b else Q) + 1),
        ):
            assert sympy.expand(continuity._without_choices(made).subs(there)) == expected

    def test_a_number_as_a_condition_is_true_beside_its_surface(self):
        assert continuity._without_choices(Select(Q, V, T)) == V
        assert continuity._without_choices(And(Q, self.a)) == self.a
        assert continuity._without_choices(Or(Q, self.a)) == 1
        assert continuity._without_choices(Not(Q)) == 0
        assert continuity._truth(Q, ZERO) == 0
        assert continuity._truth(Q, ONE) == 1

    def test_an_equality_is_false_beside_its_surface(self):
        assert continuity._without_choices(Select(Equal(Q, V), T, K)) == K
        assert continuity._without_choices(sympy.sin(Q)) == sympy.sin(Q)


# In floats 0.1 times 3 is not 0.3.
ROUNDED = sympy.Mul(sympy.Float(0.1), Q + 3, evaluate=False)
SMALL = sympy.Mul(sympy.Float(1e-6), K, Q + 1, evaluate=False)


@pytest.mark.parametrize(
    ("expression", "zero"),
    [
        (Q - Q, True),
        (Q * (V + 1) - Q * V - Q, True),
        (Q, False),
        (sympy.Float(1e-14) * Q * V + (1 + Q) * 1.0 - 1.0 - Q, False),
        (ROUNDED - sympy.Float(0.1) * Q - sympy.Float(0.3), True),
        # What rounding leaves is judged by the largest number, beside smaller ones as well.
        (ROUNDED - sympy.Float(0.1) * Q - sympy.Float(0.3) + SMALL - 1e-6 * K - 1e-6 * K * Q, True),
        (ROUNDED - sympy.Float(0.1) * Q - sympy.Float(0.3) + V, False),
        (Q * sympy.zoo, False),
        (sympy.nan, False),
        (sympy.oo, False),
    ],
)
def test_what_is_zero(expression, zero):
    assert continuity._is_zero(expression) == zero


def test_coefficients_of_a_sum():
    assert continuity._coefficients(3 * Q - V * K + 2) == [2, 3, -1]
    assert continuity._coefficients(ZERO) == []


def helper(value):
    return value


class Callable:
    def __call__(self, t, x, p):
        return (x[0],)


def calls_what_it_closes_over(value):
    return lambda t, x, p: (x[0], value)


def test_what_the_bytecode_tells():
    """Comparisons, branches and remainders decide; other functions may."""
    cases = [
        (lambda t, x, p: (x.q * 2.0 - 1.0,), False),
        (lambda t, x, p: (x.q / 3.0,), False),
        (lambda t, x, p: (x.q % 3.0,), True),
        (lambda t, x, p: (x.q // 3.0,), True),
        (lambda t, x, p: ((x.q > 3.0) * x.v,), True),
        (lambda t, x, p: ((x.q in p) * x.v,), True),
        (lambda t, x, p: ((x.q is p) * x.v,), True),
        (lambda t, x, p: (x.q or x.v,), True),
        (lambda t, x, p: (x.q if x.q is None else x.v,), True),
        (lambda t, x, p: (np.exp(x.q) + math.sin(x.q) + float(x.v),), False),
        (lambda t, x, p: (np.sign(x.q),), True),
        (lambda t, x, p: (helper(x.q),), True),
        (calls_what_it_closes_over(2.0), False),
        (calls_what_it_closes_over(helper), True),
        (calls_what_it_closes_over(np.exp), False),
        (calls_what_it_closes_over(math.sin), False),
        (Callable(), True),
    ]
    assert [continuity.may_jump(function, False) for function, _ in cases] == [jumps for _, jumps in cases]


def test_a_remainder_in_place_decides():
    def field(t, x, p):
        total = x[0]
        total %= 2.0
        return (total,)

    def other(t, x, p):
        total = x[0]
        total *= 2.0
        return (total,)

    assert continuity.may_jump(field, False)
    assert not continuity.may_jump(other, False)


def test_complex_numbers_branch_through_their_real_parts_only():
    cases = [
        (lambda t, x, p: (x[0].real,), False),
        (lambda t, x, p: (x[0] if p > 1 else x[1],), False),
        (lambda t, x, p: (x[0] if x[0].real > 1 else x[1],), True),
        (lambda t, x, p: (x[0] if abs(x[0]) > 1 else x[1],), True),
        (lambda t, x, p: (x[0] if np.hypot(x[0], x[1]) > 1 else x[1],), True),
    ]
    assert [continuity.may_jump(function, True) for function, _ in cases] == [jumps for _, jumps in cases]


@pytest.mark.parametrize(
    ("expression", "abrupt"),
    [
        (Q, False),
        (Q * V + T - 3, False),
        (sympy.sin(Q) + sympy.exp(V) * sympy.cosh(Q), False),
        (Q**2, False),
        (sympy.sqrt(Q), False),
        (1 / Q, True),
        (Q**K, True),
        (sympy.tanh(Q), True),
        (1 / T + sympy.tanh(T) * Q, False),
        (1 / K * Q, False),
        (2 + V * Sign(Q), True),
    ],
)
def test_what_may_change_like_a_jump(expression, abrupt):
    assert continuity.may_be_abrupt(expression, (Q, V)) == abrupt
