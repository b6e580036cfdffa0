"""Compiled statements give the bits of plain arithmetic."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from llvmlite import binding, ir

from hybrid.compiler.llvm.calls import NUMBER, WHOLE
from hybrid.compiler.llvm.lowering import LoweringError
from hybrid.compiler.llvm.wanted import MATRIX_SIGNATURE, VECTOR_SIGNATURE
from hybrid.compiler.statements.code import at, call, do, either, equal, get, less, loop, put, several, when
from hybrid.compiler.statements.values import assignments
from hybrid.compiler.taylor.coefficients import OUT
from hybrid.kernels.types.numba_door.builder import Builder
from tests.hybrid.code import both
from tests.hybrid.expression.formulas import anything, expression_of

X = np.array([0.7, -1.3, 0.0, 2.5])
P = np.array([0.3])
x, out = ([at(name, i) for i in range(4)] for name in ("x", "out"))
p, t, a, n, i, j = at("p", 0), *map(get, "tanij")
LENGTH = call("length", "x")
# Functions whose last bit depends on the library.
INEXACT = {*("sin", "cos", "tan", "tanh", "atan", "exp", "**")}


def results(body, x=X, kind=VECTOR_SIGNATURE, index=0, bodies=None):
    """The contents of ``out`` after the interpreter and after machine code."""
    found = []
    for run in both(*(bodies or [body]), kind=kind):
        found.append(np.full(4 if kind is VECTOR_SIGNATURE else (4, 4), 7.0))
        run(index, 0.25, np.array(x, dtype=float), P, found[-1])
    return found


@pytest.mark.parametrize(
    "term",
    [
        x[0] + x[1] * t - x[3] / p,
        -x[1],
        call("+", 3, call("*", 2, 1.5)),
        x[1] / x[2],
        call("%", x[1], x[0]),
        call("%", x[0], x[1]),
        call("%", -x[3], 2.5),
        call("copysign", 1.0, call("%", x[3], -2.5)) + 2 * call("copysign", 1.0, call("%", -x[3], 2.5)),
        call("np.fmod", x[1], x[0]),
        x[0] ** 1.7,
        call("max", x[0], x[1], x[3], 1e-300),
        call("abs", x[1]) + call("sqrt", x[3]),
        call("np.floor", x[1]) + call("np.ceil", x[1]) + call("np.trunc", x[1]),
        either(less(x[0], x[3]), 1.0, 0.0),
        either(call("and", less(x[0], x[3]), call("<=", x[3], 2.0)), 1.0, call("sqrt", x[3])),
        either(call("or", call(">", x[0], 1.0), call("not", call(">=", x[1], 0.0))), x[0], x[1]),
        either(call("and", equal(x[0], 0.7), call("!=", x[1], 0.7)), 1.0, 0.0),
        call("copysign", x[0], x[1]),
        math.inf,
        7 * call("listed", (0.5, -1.5, 2.5), LENGTH - 2) + call("listed", (3, 1), 1),
    ],
    ids=str,
)
def test_a_term(term):
    np.testing.assert_array_equal(*results([put(out[0], term)]))


def test_several_are_read_before_they_are_written():
    found = results([put(several(out[:2]), several(x[1::-1])), put(several(out[:2]), several(out[1::-1]))])
    np.testing.assert_array_equal(found, [[0.7, -1.3, 7.0, 7.0]] * 2)


@pytest.mark.parametrize(
    "term", [call("sin", n), call("atan2", n, 3), call("abs", -n), call("max", 1, n), call("np.floor", n)]
)
def test_whole_numbers_are_numbers_to_functions(term):
    found = results([put(n, 2), put(out[0], term + n)])
    np.testing.assert_allclose(*found, rtol=4e-16)


def test_a_comparison_with_nan_is_false():
    body = [
        put(a, x[0]),
        put(out[0], either(call(">", a, 0.0), 1.0, either(less(a, 0.0), -1.0, a))),
        put(out[1], either(call("!=", a, a), 2.0, 3.0)),
    ]
    for found in results(body, x=[math.nan] * 4):
        np.testing.assert_array_equal(found[:2], [math.nan, 2.0])


def test_nothing_is_fused_where_it_is_not_allowed():
    """``a*b - a*b`` is zero, not the rounding error of the product."""
    found = results([put(a, x[0] * x[1]), put(out[0], x[0] * x[1] - a)])
    assert found[0][0] == found[1][0] == 0.0


def test_loops_count_as_python_does():
    inner = [put(a, a + (i + 10 * j) * at("x", j))]
    body = [
        put(a, 0.0),
        loop("i", 0, 4, [loop("j", 1, LENGTH, inner, step=2), put(at("out", i), a)]),
        loop("k", 3, 3, [put(at("out", get("k")), 99.0)]),
        loop("k", 1, 3, [put(at("out", get("k")), at("out", get("k")) + get("k"))]),
    ]
    np.testing.assert_array_equal(*results(body))


def test_turns_that_do_not_wait_for_one_another():
    """They read and write arrays of the function, of numbers and of four numbers."""
    turn = get("turn")
    body = [
        ("array", "numbers", 4),
        ("array", "lanes", 4),
        ("repeat", "turn", 4, [put(at("numbers", turn), at("x", turn) * 2.0)]),
        ("repeat", "turn", 4, [put(at("lanes", turn), call("four_times", at("numbers", 3 + -1 * turn)))]),
        ("repeat", "turn", 4, [do("store", OUT, turn, 0, at("lanes", turn) + turn)]),
    ]
    for found in results(body, kind=MATRIX_SIGNATURE):
        np.testing.assert_array_equal(found, (2.0 * X[::-1] + np.arange(4))[:, None] * np.ones(4))


def test_matrices():
    row = LENGTH - 2
    body = [put(at("out", row, 1), x[0]), put(at("out", 1, row + 1), at("out", row, 1) * 2.0)]
    np.testing.assert_array_equal(*results(body, kind=MATRIX_SIGNATURE))


@pytest.mark.parametrize("index", [0, 1, 2, -1])
def test_cases_and_branches(index):
    """A variable of one case or branch is independent of the same variable of another one."""
    both_sides = when(less(t, 1.0), [put(a, x[0]), put(out[0], a)], [put(a, LENGTH), put(out[1], a)])
    bodies = [[both_sides], [put(a, LENGTH), put(out[0], a)], []]
    np.testing.assert_array_equal(*results(None, index=index, bodies=bodies))


@pytest.mark.parametrize(
    ("statement", "told"),
    [
        (put(out[0], call("unknown", x[0])), "unknown"),
        (put(out[0], get("y")), "y has no value yet"),
        (put(t, 1.0), "t is an argument"),
        (put(get("index"), 1), "index is an argument"),
        (put(out[0], either(x[0], 1.0, 0.0)), "is no condition"),
    ],
)
def test_other_code_is_refused(statement, told):
    with pytest.raises(LoweringError, match=told):
        both([statement], kind=VECTOR_SIGNATURE)


def test_a_variable_keeps_its_type():
    with pytest.raises(LoweringError, match="n is i64 in one place and double in another"):
        both([put(n, 1), put(n, x[0])], kind=VECTOR_SIGNATURE)


def test_what_one_branch_sets_is_unknown_after_it():
    """Its value after the other branch would be whatever the memory held."""
    body = [when(less(0.0, t), [put(a, t)], [put(a, 2.0 * t)]), put(out[0], a)]
    with pytest.raises(LoweringError, match=r"\ba\b"):
        both(body, kind=VECTOR_SIGNATURE)
    both([put(a, 0.0), *body], kind=VECTOR_SIGNATURE)


@settings(max_examples=10)
@given(st.lists(anything, min_size=20, max_size=20))
def test_any_expression(several):
    """Only functions of a library may differ in their last bits."""
    bodies = [assignments([out[0]], [expression_of(each)]) for each in several]
    runs = both(*bodies, kind=VECTOR_SIGNATURE)
    for index, body in enumerate(bodies):
        found = np.full((2, 1), 7.0)
        for run, result in zip(runs, found, strict=True):
            run(index, 0.25, X, P, result)
        np.testing.assert_allclose(*found, rtol=1e-13, atol=1e-13, err_msg=str(body))
        if not any(f"'{name}'" in str(body) for name in INEXACT):
            np.testing.assert_array_equal(*found, err_msg=str(body))


def test_types_that_do_not_fit_are_refused():
    function = ir.Function(ir.Module(), ir.FunctionType(ir.VoidType(), [NUMBER, WHOLE]), "f")
    number, whole = function.args
    builder = Builder(function.append_basic_block("body"))
    place = builder.alloca(NUMBER)
    with pytest.raises(ValueError, match="fadd of double and i64"):
        builder.fadd(number, whole)
    with pytest.raises(TypeError, match="i64 cannot be stored at double"):
        builder.store(whole, place)
    assert builder.bitcast(number, NUMBER) is number


def test_lines_are_read_by_llvm():
    """LLVM reads the lines, including addresses, aligned stores and flags."""
    module = ir.Module()
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [ir.PointerType(), WHOLE]), "f")
    address, index = function.args
    builder = Builder(function.append_basic_block("body"))
    here = builder.gep(address, [builder.mul(index, WHOLE(3))], source_etype=NUMBER)
    value = builder.fmul(builder.load(here, align=8, typ=NUMBER), NUMBER(-0.5), flags=("contract",))
    builder.store(builder.fadd(value, NUMBER(float("inf"))), here, align=8)
    bits = builder.load(here, typ=WHOLE)
    builder.store(builder.sub(bits, WHOLE(1)), builder.gep(address, [index], source_etype=WHOLE))
    builder.store(value, here, align=8, whole=True)
    builder.ret_void()
    binding.parse_assembly(str(module)).verify()
    assert "fmul contract double" in str(module)
    # LLVM takes no volatile store apart.
    assert str(module).count("store volatile double") == 1


@pytest.mark.parametrize("sign", "+-*/")
def test_four_numbers_at_once_and_one(sign):
    """One number counts for all four, before and after the operator."""
    rows = [call("load", OUT, k, 0) for k in range(6)]
    terms = [(rows[0], 3), (3, rows[1]), (rows[2], x[1]), (x[1], rows[3]), (rows[4], rows[5])]
    body = [do("store", OUT, k, 0, call(sign, *pair)) for k, pair in enumerate(terms)]
    body.append(do("store", OUT, 5, 0, -rows[5]))
    apply = {"+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide}[sign]
    start = np.arange(1.0, 25.0).reshape(6, 4)
    pairs = [(start[0], 3.0), (3.0, start[1]), (start[2], X[1]), (X[1], start[3]), (start[4], start[5])]
    for run in both(body):
        found = start.copy()
        run(0, 0.25, X, P, 0, found)
        np.testing.assert_array_equal(found, [*(apply(*pair) for pair in pairs), -start[5]])
