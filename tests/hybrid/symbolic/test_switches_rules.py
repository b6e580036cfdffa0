"""Branches, heights and factors of switching functions, one by one."""

import math

import numpy as np
import pytest
import sympy

from hybrid.symbolic import switches
from hybrid.symbolic.expressions import (
    ONE,
    ZERO,
    Absolute,
    Ceiling,
    Floor,
    Less,
    LessEqual,
    Level,
    Maximum,
    Minimum,
    Select,
    Sign,
    Step,
)
from hybrid.symbolic.printer import assignments
from hybrid.symbolic.switches import Surfaces, Switches
from hybrid.symbolic.tracing import model_symbols

SYMBOLS = model_symbols(2, 1)
(Q, V), (K,), T = SYMBOLS.x, SYMBOLS.p, SYMBOLS.t


def value(expression, q, v=1.0):
    out = np.zeros(1)
    code = "\n".join(assignments(["out[0]"], [expression]))
    exec(code, {"t": 0.0, "x": (q, v), "p": (1.0,), "out": out, "np": np, **vars(math)})
    return out[0]


@pytest.mark.parametrize(
    ("atom", "height", "above", "below"),
    [
        (Less(Q, V), V - Q, ONE, ZERO),
        (LessEqual(Q, V), V - Q, ONE, ZERO),
        (Step(Q), Q, ONE, ZERO),
        (Sign(Q), Q, ONE, -ONE),
        (Maximum(Q, V), Q - V, Q, V),
        (Minimum(Q, V), Q - V, V, Q),
        (Absolute(Q - V), Q - V, Q - V, V - Q),
    ],
)
def test_heights_and_both_branches(atom, height, above, below):
    assert switches._height(atom) == (height, None)
    assert switches._branch(atom, 1) == above
    assert switches._branch(atom, -1) == below


@pytest.mark.parametrize("kind", [Floor, Ceiling])
def test_both_halves_of_a_step(kind):
    """The height is positive in the first half, and each branch holds a quarter beyond its half."""
    atom = kind(3 * Q)
    height, argument = switches._height(atom)
    assert argument == 3 * Q
    for whole in (-2, 0, 3):
        for fraction in (0.01, 0.2, 0.3, 0.49):
            assert value(height, (whole + fraction) / 3) > 0.0
            assert value(height, (whole + fraction + 0.5) / 3) < 0.0
        first, second = switches._branch(atom, 1), switches._branch(atom, -1)
        expected = whole + (kind is Ceiling)
        for fraction in (-0.24, 0.01, 0.3, 0.74):
            assert value(first, (whole + fraction) / 3) == expected
            assert value(second, (whole + fraction + 0.5) / 3) == expected


@pytest.mark.parametrize(
    ("height", "used", "simpler", "sign"),
    [
        (Q * V, {}, Q * V, 1),
        (Q**2 * V, {}, V, 1),
        (Q**3 * V, {}, Q**3 * V, 1),
        (sympy.exp(Q) * (V - 1), {}, V - 1, 1),
        (2 * V * Q, {}, Q * V, 1),
        (-2 * V, {}, V, -1),
        (Q * V, {Q: 1}, V, 1),
        (Q * V, {Q: -1}, V, -1),
        (Q**3 * V, {Q: -1}, V, -1),
        (-(Q**3) * V, {Q: -1}, V, 1),
        (V / Q, {Q: -1}, V, -1),
        (V / Q**2, {}, V, 1),
        (sympy.sqrt(Q) * V, {Q: 1}, V, 1),
        (sympy.sqrt(Q) * V, {Q: -1}, sympy.sqrt(Q) * V, 1),
        ((Q + 1) * V, {Q: 1}, V, 1),
        ((Q - 1) * V, {Q: 1}, (Q - 1) * V, 1),
        # If the signs of all factors are known, the height stays as it is.
        (Q * V, {Q: 1, V: 1}, Q * V, 1),
        (Q * V, {Q: -1, V: 1}, Q * V, 1),
    ],
)
def test_factors_of_known_sign_are_left_out(height, used, simpler, sign):
    surfaces = Surfaces(SYMBOLS)
    sides = {}
    for each, side in used.items():
        number, orientation = surfaces.find(each)
        sides[number] = side * orientation
    assert Switches([], surfaces)._simpler(height, sides) == (simpler, sign)


def test_which_functions_switch():
    """Those of the state or of time; a level is a floor that does not jump."""
    for atom, switching in ((Sign(Q), True), (Sign(T), True), (Sign(K), False), (Level(Q), False)):
        assert switches._switches(atom, SYMBOLS) is switching
    entries = [Sign(Q) + Absolute(V) * Sign(V), Maximum(K, ONE) * Q]
    assert switches.switching_names(entries, SYMBOLS) == ["Absolute", "Sign"]


@pytest.mark.parametrize(
    ("base", "heights", "multiple"),
    [
        (2 * Q - 2, [V, Q - 1], True),
        (K * (Q - 1), [Q - 1], False),
        (Q, [], False),
        (1 - Q, [Q - 1], True),
        (Q, [V], False),
    ],
)
def test_multiples_of_heights(base, heights, multiple):
    assert switches._is_multiple(base, heights) is multiple


def test_fractional_powers_of_heights_are_protected():
    half = sympy.Rational(1, 2)
    assert switches._guarded(3 * Q**half + V**half, [Q]) == 3 * Maximum(Q, ZERO) ** half + V**half
    for other in (Q**2, Q**V, V**half, Q * V):
        assert switches._guarded(other, [Q]) == other


def test_negatives_term_by_term():
    assert switches._negative(Q - 2 * V + 3) == 2 * V - Q - 3
    assert switches._negative(Q - V).is_Add
    assert switches._negative(Q) == -Q


def test_numbers_as_conditions_beside_switches():
    """They are taken as true once the switches in them are decided."""
    open_choice = Select(Sign(Q) * V, T, V)
    assert switches._without_truths(open_choice) == open_choice
    assert switches._without_truths(Select(V, T, V) * Q) == T * Q
    assert switches._without_truths(Q * V) == Q * V
