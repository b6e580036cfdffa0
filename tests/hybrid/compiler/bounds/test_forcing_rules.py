"""Which parts of a vector field are bounded on each step, rule by rule."""

import pytest
import sympy
from sympy.codegen.cfunctions import exp2, expm1

from hybrid.compiler.bounds.forcing import (
    FACTORS_OF_HARMONIC,
    MOST_FACTORS,
    NO_COMPONENT,
    _saturates,
    arguments_of,
    forcings,
    is_harmless,
    times_of,
)
from hybrid.kernels.types.codes import ARGUMENTS, IN_TIME, TERMS
from hybrid.symbolic.expressions import (
    Absolute,
    And,
    Ceiling,
    Floor,
    Less,
    LessEqual,
    Maximum,
    Minimum,
    Remainder,
    Select,
    Sign,
    Step,
    Together,
    Truncate,
    TruncatedRemainder,
)
from hybrid.symbolic.tracing import model_symbols

SYMBOLS = model_symbols(4, 1)
A, B, C, D = SYMBOLS.x
T = SYMBOLS.t
[K] = SYMBOLS.p
# Two pulses in time, and one on a clock.
G, H, ON_CLOCK = sympy.exp(-(T**2)), 1 / (1 + T**2), sympy.exp(-(D**2))


def test_components_that_tell_the_time():
    """They pass at a constant rate, or stay; the others depend on a variable."""
    for field, passing, staying, state in (
        ((1, 0, C, 1), (A, D), (A, B, D), (C,)),
        ((K, -K, T, A), (A, B), (A, B), (C, D)),
        ((0, 0, 0, 0), (), (A, B, C, D), ()),
        ((B, sympy.sin(T), D, A), (), (), (A, B, C, D)),
    ):
        times = times_of([sympy.sympify(each) for each in field], SYMBOLS)
        assert (times.passing, times.all, times.state) == ((T, *passing), (T, *staying), state)


def found(term, component=2):
    """The parts of a field with this term; ``B`` stays as it is, ``D`` tells the time."""
    field = [C * A, sympy.S.Zero, C + A, sympy.S.One]
    field[component] += term
    return [
        (each.expression, each.component)
        for each in forcings(field, [], SYMBOLS)
        if each.kind == IN_TIME and each.expression is not None
    ]


@pytest.mark.parametrize(
    ("term", "expected"),
    [
        (G, [(G, 2)]),
        (K * G, [(K * G, 2)]),
        (G * H, [(G * H, 2)]),
        (G * B, [(G * B, 2)]),
        (ON_CLOCK, [(ON_CLOCK, 2)]),
        (G * ON_CLOCK, [(G * ON_CLOCK, 2)]),
        # A sum without its harmless terms.
        (G + H + sympy.cos(T) + B, [(G + H, 2)]),
        # Factors of the state are left out, and the rest is no term of the rate.
        (A * G, [(G, NO_COMPONENT)]),
        (A * C * G * H, [(G * H, NO_COMPONENT)]),
        (A * G + H, [(H, 2), (G, NO_COMPONENT)]),
        (A * (G + sympy.cos(T)), [(G + sympy.cos(T), NO_COMPONENT)]),
        (A * (C + G), [(G, NO_COMPONENT)]),
        (sympy.sin(A + G), [(G, NO_COMPONENT)]),
        (sympy.sin(A * G), [(G, NO_COMPONENT)]),
        (C * (A + G) ** 2, [(G, NO_COMPONENT)]),
        (G * sympy.sin(T * A), [(G, NO_COMPONENT)]),
        (Maximum(Maximum(A, G), H), [(G, NO_COMPONENT), (H, NO_COMPONENT)]),
        (A * sympy.cos(T) ** 5, [(sympy.cos(T) ** 5, NO_COMPONENT)]),
        # Harmless, or of the state alone.
        (A * sympy.sin(T), []),
        (A * sympy.cos(T) ** 4, []),
        (sympy.sin(T * A), []),
        (A / (1 + C**2), []),
        (B / (1 + B**2), []),
    ],
)
def test_parts_in_time(term, expected):
    assert found(term) == expected


def test_each_part_counts_once():
    assert found(G, 0) == [(G, 0)]
    twice = forcings([G, G * A + G * C, G * A, sympy.S.One], [], SYMBOLS)
    assert [(each.expression, each.component) for each in twice if each.kind == IN_TIME] == [
        (G, 0),
        (G, NO_COMPONENT),
    ]
    assert forcings(None, [], SYMBOLS) == ()


def flat_beyond(argument):
    """A saturated switch has no argument that changes."""
    return Maximum(Minimum(argument, sympy.Integer(20)), sympy.Integer(-20))


@pytest.mark.parametrize(
    ("term", "arguments"),
    [
        (K**A, None),
        (sympy.tanh(K * B), None),
        (sympy.tanh(K * A) * B, [flat_beyond(K * A)]),
        (sympy.tanh(A**2), [flat_beyond(A**2)]),
        (sympy.tanh(A) - sympy.erf(C), [flat_beyond(A), flat_beyond(C)]),
        (sympy.cosh(A) ** -1, [A]),
    ],
)
def test_terms_that_may_be_pulses_and_the_arguments_that_tell_where(term, arguments):
    """A single switch is a pulse, too, where the state turns round behind it. ``B`` stays as it is."""
    found = [
        each for each in forcings([C, sympy.S.Zero, term, sympy.S.One], [], SYMBOLS) if each.kind != IN_TIME
    ]
    if arguments is None:
        assert [each.expression for each in found] in ([], [None])
        return
    first, *others = found
    assert (first.kind, first.component) == (ARGUMENTS, NO_COMPONENT)
    assert set(first.expression) == set(arguments)
    assert [(each.expression, each.component, each.kind) for each in others] == [(term, 2, TERMS)]


def test_arguments_of_exponentials():
    """Those of powers are logarithms of their bases; those of parameters alone do not count."""
    own = (A, B)
    for expression, expected in (
        (sympy.exp(-(A**2)) + sympy.tanh(B), [-(A**2), flat_beyond(B)]),
        (exp2(A) * expm1(3 * B), [A, 3 * B]),
        (K ** (A * B), [A * B * sympy.log(K)]),
        (sympy.Integer(3) ** (A**2), [A**2 * sympy.log(3)]),
        (A**B, [B * sympy.log(A)]),
        (sympy.exp(K) + sympy.sinh(C), []),
        (sympy.sin(A) + sympy.atan(A), []),
    ):
        assert set(arguments_of(expression, own)) == set(expected)


def test_logarithms_of_powers_that_fall_so_fast_that_their_tails_do_not_show():
    """The tails of gravity and of a resonance show, those of a square of the latter do not."""
    own, square = (A, B), A**2 + B**2
    for expression, expected in (
        (A / square ** sympy.Rational(3, 2), []),
        (1 / (1 + A**2), []),
        (sympy.sin(A) / (1 + sympy.sin(A - B) ** 2), []),
        (A**8 + sympy.sqrt(square), []),
        (1 / (1 + A**2) ** 2, [-2 * sympy.log(Absolute(1 + A**2))]),
        (3 * B / (1 + A**4), [-sympy.log(Absolute(1 + A**4))]),
        (sympy.exp(1 / (1 + A**4)), [1 / (1 + A**4), -sympy.log(Absolute(1 + A**4))]),
        (A**-3 - A**-2, [-3 * sympy.log(Absolute(A))]),
        (1 / (C + A**3), [-sympy.log(Absolute(C + A**3))]),
        (sympy.cos(A) ** 20, [20 * sympy.log(Absolute(sympy.cos(A)))]),
        (A**K, [K * sympy.log(Absolute(A))]),
        (C**-3, []),
        (1 / Maximum(A**3, K), [-sympy.log(Absolute(Maximum(A**3, K))), 16 * Sign(A**3 - K)]),
    ):
        assert set(arguments_of(expression, own)) == set(expected)


def test_sides_of_kinks_and_jumps():
    own = (A, B)
    for expression, expected in (
        (Absolute(A - 1) * Maximum(B, A**2), [16 * Sign(A - 1), 16 * Sign(B - A**2)]),
        (Minimum(A, K) + Minimum(C, K), [16 * Sign(A - K)]),
        (sympy.Integer(2) * Step(A) + Sign(B), [16 * Step(A), 16 * Sign(B)]),
        (Select(And(Less(A, B), LessEqual(A, K)), A, C), [16 * Less(A, B), 16 * LessEqual(A, K)]),
        (Floor(A) + Ceiling(B) * Truncate(A), [16 * Floor(A), 16 * Ceiling(B), 16 * Truncate(A)]),
        (Remainder(A, K) * TruncatedRemainder(B, 2), [16 * Floor(A / K), 16 * Truncate(B / 2)]),
    ):
        assert set(arguments_of(expression, own)) == set(expected)


def test_a_kink_at_a_guard_of_the_mode_is_none():
    """Beyond that guard the mode ends."""
    field = [A, Maximum(A - 1, 0), A, A]
    assert [each.kind for each in forcings(field, [], SYMBOLS)] == [ARGUMENTS, TERMS]
    assert forcings(field, [A - 1], SYMBOLS) == ()
    assert forcings(field, [1 - A], SYMBOLS) == ()


M = MOST_FACTORS


@pytest.mark.parametrize(
    ("term", "saturates"),
    [
        (sympy.atan(A), True),
        (3 * C + sympy.sin(sympy.exp(A)), True),
        (K**A, True),
        (A**M, False),
        (A ** (M + 1), True),
        (A ** (M // 2) * C ** (M - M // 2), False),
        (A ** (M // 2 + 1) * C ** (M - M // 2), True),
        ((1 + sympy.sin(A)) ** M, False),
        ((1 + sympy.sin(A)) ** (M + 1), True),
        (1 / (1 + A**2), False),
        (A * (1 + A**2) ** sympy.Rational(-3, 2), True),
        ((1 + A**2) ** -2, True),
        ((1 + A**2) ** -(M + 1), True),
        (sympy.sqrt(A + 2 * C), False),
        (sympy.sqrt(K), False),
        (sympy.sqrt(A * C), True),
        (sympy.sqrt(1 + A**2), True),
        (sympy.sqrt(sympy.sin(A)), True),
        (sympy.sqrt(Maximum(A, C**2)), True),
        (sympy.sqrt(Absolute(A * C)), True),
        (sympy.asin(A - C), False),
        (sympy.acos(A * C), True),
        (sympy.acosh(A**2), True),
        (sympy.exp(K), False),
    ],
)
def test_what_may_be_flat_to_all_digits(term, saturates):
    kinds = [each.kind for each in forcings([C, A, term, A], [], SYMBOLS)]
    assert (ARGUMENTS in kinds) == saturates


def test_roots_of_the_larger_of_two_saturate_if_one_of_them_does():
    for base, saturates in (
        (Maximum(A, C), False),
        (Maximum(A, C**2), True),
        (Maximum(C * A, K), True),
        (Absolute(A), False),
        (Absolute(A**2), True),
        (Maximum(sympy.sin(A), C), True),
    ):
        assert _saturates(sympy.sqrt(base), (A, C), frozenset()) is saturates


def test_the_root_of_a_guard_does_not_saturate():
    """A guard that is positive in the mode, and its multiples: the series hold such roots."""
    guard = 1 + A**2 - C
    for term, known, saturates in (
        (sympy.sqrt(guard), [guard], False),
        (sympy.sqrt(3 * guard), [guard], False),
        (sympy.sqrt(guard), [], True),
        (sympy.sqrt(guard), [A], True),
        (guard ** (M + 1), [guard], True),
        (sympy.sqrt(guard) + sympy.sqrt(1 + C**2), [guard], True),
    ):
        kinds = [each.kind for each in forcings([C, A, term, A], known, SYMBOLS)]
        assert (ARGUMENTS in kinds) == saturates


@pytest.mark.parametrize(
    ("expression", "factors"),
    [
        (K**9, 0),
        (T, 1),
        (T**3, 3),
        (T * D, 2),
        ((T + 1) * (D - 2) * T**2, 4),
        (T**3 + D**5 * T - 7, 6),
        (T + D, 1),
        (K + T, 1),
        (sympy.cos(K * T), FACTORS_OF_HARMONIC),
        (sympy.sin(T**3), 3 * FACTORS_OF_HARMONIC),
        (sympy.sin(T) ** 3 * T, 3 * FACTORS_OF_HARMONIC + 1),
        (sympy.exp(T - K), 0),
        (sympy.exp(T) * T**2, 2),
        (K**T, 0),
        (exp2(D), 0),
        (sympy.cosh(T), 1),
        (expm1(T) ** 2, 2),
        (Together(T**2) * T, 3),
        # Not harmless, however few factors they are multiplied by.
        (sympy.exp(T**2), None),
        (K ** (T**2), None),
        (sympy.sinh(T**2), None),
        (sympy.tanh(T), None),
        (1 / T, None),
        (sympy.sqrt(T), None),
        (T**K, None),
        (T**T, None),
        (T + sympy.tanh(T), None),
        (sympy.sin(sympy.sin(T)), None),
    ],
)
def test_the_number_of_factors(expression, factors):
    times = (T, D)
    if factors is None:
        assert not is_harmless(expression, times)
        return
    left = MOST_FACTORS - factors
    assert is_harmless(expression * (2 * T + 1) ** left, times)
    assert not is_harmless(expression * (2 * T + 1) ** (left + 1), times)
