"""Programs of expressions, run on numbers, have the values of the expressions."""

import numpy as np
import pytest

from hybrid.compiler.bounds.program import programs
from hybrid.expression import operations
from hybrid.expression.operations import Exp, Gate
from hybrid.expression.tracing import model_symbols, trace
from hybrid.kernels.arithmetic import operations as op

SYMBOLS = model_symbols(2, 1)
T, Q, V, K = 0.8, 0.45, -1.3, 1.7
OPERATIONS = {kind.bounds: kind.numpy for kind in vars(operations).values() if getattr(kind, "bounds", 0)}
OPERATIONS |= {op.SUM: np.add, op.PRODUCT: np.multiply, op.QUOTIENT: np.divide, op.SQRT: np.sqrt}
ARITY = {
    op.SELECT: 3,
    **dict.fromkeys((op.SUM, op.PRODUCT, op.QUOTIENT, op.MAXIMUM, op.MINIMUM, op.ANGLE), 2),
    **dict.fromkeys((op.LESS, op.LESS_EQUAL, op.EQUAL, op.AND, op.OR), 2),
}


def value(found, place):
    """Value of one program."""
    registers = []
    for code, a, b, c in found.rows[found.first[place] : found.first[place + 1]]:
        match code:
            case op.TIME:
                registers.append(T)
            case op.STATE:
                registers.append((Q, V)[a])
            case op.PARAMETER:
                registers.append((K,)[a])
            case op.NUMBER:
                registers.append(found.numbers[a])
            case op.WHOLE_POWER:
                registers.append(registers[a] ** b)
            case op.FIXED_POWER:
                registers.append(registers[a] ** found.numbers[b])
            case _:
                operands = [registers[each] for each in (a, b, c)[: ARITY.get(code, 1)]]
                registers.append(float(OPERATIONS[code](*operands)))
    return registers[-1]


def written(*functions):
    """Programs of guards."""
    expressions = trace(lambda t, x, p: [each(t, x.q, x.v, p.k) for each in functions], ("q", "v"), ("k",))
    return programs(expressions, [], [], SYMBOLS)


FUNCTIONS = [
    lambda t, q, v, k: q,
    lambda t, q, v, k: 3.5 + 0.0 * q,
    lambda t, q, v, k: q + v + t + k,
    lambda t, q, v, k: q - 2.0 * v * k / t,
    lambda t, q, v, k: -q / (v * t**2),
    lambda t, q, v, k: 1.0 / (v * q),
    lambda t, q, v, k: v**5 + v**-3 + q**0.5 + q**-0.5 + q**2.3 + q**-1.7,
    lambda t, q, v, k: q**2.0 + k**v + 2.3**q,
    lambda t, q, v, k: np.sqrt(q) + np.cbrt(v) + np.exp(v) + np.log(q),
    lambda t, q, v, k: np.log2(q) + np.hypot(q, v) + np.floor(v) + 10 * np.ceil(v) + np.exp2(v),
    lambda t, q, v, k: np.maximum(q, v) - 10 * np.minimum(q, v) + np.arctan2(v, q),
    lambda t, q, v, k: np.mod(v, 0.4) + 10 * np.fmod(v, 0.4) + 100 * np.mod(q, -0.4),
    lambda t, q, v, k: np.where(q < v, 1.0, 2.0) + np.where(v <= q, 10.0, 20.0) + np.where(q == v, 5.0, 7.0),
    lambda t, q, v, k: np.where((q > 0) & (v > 0), q, v) + np.where((q > 0) | (v > 0), k, t),
    lambda t, q, v, k: np.where(~(q > 0), q, k),
    lambda t, q, v, k: np.sin(q * v) * np.sin(q * v) + np.cos(q * v),
]


@pytest.mark.parametrize("k", range(len(FUNCTIONS)))
def test_values(k):
    with np.errstate(all="ignore"):
        expected = float(FUNCTIONS[k](*map(np.float64, (T, Q, V, K))))
    assert value(written(FUNCTIONS[k]), 0) == pytest.approx(expected, rel=1e-13)


def test_several_programs_share_their_numbers():
    found = written(*FUNCTIONS)
    assert len(set(found.numbers)) == len(found.numbers)
    assert len(found.rows) == found.first[-1] == len(found.checked)
    for k, function in enumerate(FUNCTIONS):
        with np.errstate(all="ignore"):
            expected = float(function(*map(np.float64, (T, Q, V, K))))
        assert value(found, k) == pytest.approx(expected, rel=1e-13)


def test_common_parts_have_one_row():
    found = written(lambda t, q, v, k: np.sin(q * v) + np.cos(q * v) + np.sin(q * v) * t)
    codes = [row[0] for row in found.rows]
    assert codes.count(op.SIN) == codes.count(op.COS) == codes.count(op.STATE) // 2 == 1


def test_the_last_row_is_the_expression_even_if_it_occurs_inside_of_itself():
    """Rows that a remainder needs again come before it."""
    found = written(lambda t, q, v, k: np.mod(v, 0.4) - np.mod(v, 0.4) + v, lambda t, q, v, k: v)
    assert value(found, 0) == pytest.approx(V)
    assert value(found, 1) == V


def test_what_has_no_program_has_no_rows():
    q = SYMBOLS.x[0]
    found = programs([None, Gate(q, q), q], [], [], SYMBOLS)
    assert found.first == (0, 0, 0, 1)


def test_rows_of_forcings_that_may_hide_a_pulse_are_checked():
    t, q = SYMBOLS.t, SYMBOLS.x[0]
    pulse = Exp(-(t**2)) + q
    found = programs([pulse], [pulse], [pulse], SYMBOLS)
    marks = [found.checked[found.first[k] : found.first[k + 1]] for k in range(3)]
    assert not any(marks[0])
    assert not any(marks[2])
    codes = [row[0] for row in found.rows[found.first[1] : found.first[2]]]
    checked = [code for code, mark in zip(codes, marks[1], strict=True) if mark]
    assert checked == [op.EXP, op.SUM]


@pytest.mark.parametrize(
    ("exponent", "code"),
    [
        (3.0, op.WHOLE_POWER),
        (-7.0, op.WHOLE_POWER),
        (2.0**31 - 1.0, op.WHOLE_POWER),
        (1.0 - 2.0**31, op.WHOLE_POWER),
        (2.5, op.FIXED_POWER),
        # Whole numbers in rows have 32 bits.
        (2.0**31, op.FIXED_POWER),
        (-(2.0**31), op.FIXED_POWER),
        (1e12, op.FIXED_POWER),
    ],
)
def test_powers_with_whole_numbers_that_a_row_can_hold(exponent, code):
    found = programs([SYMBOLS.x[0] ** exponent], [], [], SYMBOLS)
    (*_, (own, _, power, _)) = found.rows
    assert own == code
    assert (power if code == op.WHOLE_POWER else found.numbers[power]) == exponent
