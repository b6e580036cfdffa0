"""Generated text gives the same bits as machine code and as Python."""

import math
import re
from contextlib import suppress
from fractions import Fraction

import numpy as np
import pytest
from hybrid.expression.code import assignments, power_text
from hypothesis import given, settings
from hypothesis import strategies as st
from llvmlite import binding, ir

from hybrid.compiler.llvm.calls import NUMBER, WHOLE
from hybrid.compiler.llvm.lowering import MATRIX_SIGNATURE, VECTOR_SIGNATURE, LoweringError, parsed
from hybrid.compiler.llvm.machine import machine_code
from hybrid.expression.nodes import Number
from hybrid.kernels.types.numba_door.builder import Builder
from tests.hybrid.expression.formulas import anything, expression_of
from tests.hybrid.text import both

X = np.array([0.7, -1.3, 0.0, 2.5])
P = np.array([0.3])


def results(lines, x=X, kind=VECTOR_SIGNATURE, index=0, size=4):
    """The contents of ``out`` after Python and after machine code."""
    found = []
    for run in both(lines, kind):
        out = np.full(size if kind is VECTOR_SIGNATURE else (size, size), 7.0)
        with np.errstate(all="ignore"):
            run(index, 0.25, np.array(x, dtype=float), P, out)
        found.append(out)
    return found


@pytest.mark.parametrize(
    "line",
    [
        "out[0] = x[0] + x[1]*t - x[3]/p[0]",
        "out[0] = -x[1]",
        "out[0] = 3 + 2*1.5",
        "out[0] = x[1]/x[2]",
        "out[0] = x[1] % x[0]",
        "out[0] = x[0] % x[1]",
        "out[0] = (-x[3]) % 2.5",
        "out[0] = copysign(1.0, x[3] % (-2.5)) + 2*copysign(1.0, (-x[3]) % 2.5)",
        "out[0] = np.fmod(x[1], x[0])",
        "out[0] = x[0]**1.7",
        "out[0] = max(x[0], x[1], x[3], 1e-300)",
        "out[0] = abs(x[1]) + sqrt(x[3])",
        "out[0] = np.floor(x[1]) + np.ceil(x[1]) + np.trunc(x[1])",
        "out[0] = (1.0 if x[0] < x[3] else 0.0)",
        "out[0] = (1.0 if x[0] < x[3] <= 2.0 else sqrt(x[3]))",
        "out[0] = (x[0] if (x[0] > 1.0) or (not (x[1] >= 0.0)) else x[1])",
        "out[0] = (1.0 if (x[0] == 0.7) and (x[1] != 0.7) else 0.0)",
        "out[0] = copysign(x[0], x[1])",
        "out[len(x) - 1] = inf",
        "out[0], out[1] = x[1], x[0]",
        "pass",
    ],
)
def test_a_statement(line):
    np.testing.assert_array_equal(*results([line]))


@pytest.mark.parametrize("call", ["sin(n)", "atan2(n, 3)", "abs(-n)", "max(1, n)", "np.floor(n)"])
def test_whole_numbers_are_numbers_to_functions(call):
    found = results(["n = 2", f"out[0] = {call} + n"])
    np.testing.assert_allclose(*found, rtol=4e-16)


def test_a_comparison_with_nan_is_false():
    lines = [
        "u = x[0]",
        "out[0] = (1.0 if u > 0.0 else -1.0 if u < 0.0 else u)",
        "out[1] = (2.0 if u != u else 3.0)",
    ]
    out = results(lines, x=[math.nan] * 4)
    np.testing.assert_array_equal(*out)
    assert math.isnan(out[1][0])
    assert out[1][1] == 2.0


def test_nothing_is_fused_where_it_is_not_allowed():
    """``a*b - a*b`` is zero, not the rounding error of the product."""
    found = results(["a = x[0]*x[1]", "out[0] = x[0]*x[1] - a"])
    assert found[0][0] == found[1][0] == 0.0


def test_loops_count_as_python_does():
    lines = [
        "s = 0.0",
        "for i in range(4):",
        "    for j in range(1, len(x), 2):",
        "        s = s + (i + 10*j)*x[j]",
        "    out[i] = s",
        "for k in range(3, 3):",
        "    out[k] = 99.0",
        "for k in range(1, 3):",
        "    out[k] = out[k] + k",
    ]
    np.testing.assert_array_equal(*results(lines))


def test_matrices():
    lines = ["r = len(x) - 2", "out[r, 1] = x[0]", "out[1, r + 1] = out[r, 1]*2.0"]
    np.testing.assert_array_equal(*results(lines, kind=MATRIX_SIGNATURE))


@pytest.mark.parametrize("index", [0, 1, -1])
def test_branches(index):
    """A variable of one branch is independent of the same variable of another branch."""
    lines = ["if index == 0:", "    y = x[0]", "    out[0] = y", "elif index == 1:", "    y = len(x)"]
    lines += ["    out[0] = y", "else:", "    out[0] = 5.0"]
    np.testing.assert_array_equal(*results(lines, index=index))


def test_as_many_branches_as_a_model_has_transitions():
    """A chain of branches is not nested: it may be longer than Python's recursion limit."""
    lines = [f"{'if' if i == 0 else 'elif'} index == {i}:\n        out[0] = {i}.0" for i in range(300)]
    _, run = both(lines, VECTOR_SIGNATURE)
    for index in (0, 150, 299):
        out = np.zeros(1)
        run(index, 0.0, X, P, out)
        assert out[0] == index


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("out[0] = x[0].real", "x[0].real"),
        ("out[0] = unknown(x[0])", "unknown"),
        ("out[0] = y", "'y'"),
        ("while t < 1.0: pass", "while"),
        ("out[0] = x[0] @ x[1]", "x[0] @ x[1]"),
        ("t = 1.0", "t is an argument"),
        ("index = 1", "index is an argument"),
        ("out[0] = 1.0 if x[0] else 0.0", "x[0]"),
        ("out[0] = 'a'", "'a'"),
    ],
)
def test_other_text_is_refused(line, told):
    with pytest.raises(LoweringError) as error:
        both([line], VECTOR_SIGNATURE)
    assert told in str(error.value)


def test_a_variable_keeps_its_type():
    with pytest.raises(LoweringError, match="n is i64 in one place and double in another"):
        both(["n = 1", "n = x[0]"], VECTOR_SIGNATURE)
    written = parsed("def written(a, b):\n    pass")["written"]
    with pytest.raises(LoweringError, match=r"takes \('a', 'b'\); a function of its kind takes \('index'"):
        machine_code([(written, VECTOR_SIGNATURE, False)])


def test_what_one_branch_sets_is_unknown_after_it():
    """Its value after the other branch would be whatever the memory held."""
    branches = ["if t > 0.0:", "    a = t", "else:", "    a = 2.0*t"]
    with pytest.raises(LoweringError, match=r"\ba\b"):
        both([*branches, "out[0] = a"], VECTOR_SIGNATURE)
    both(["a = 0.0", *branches, "out[0] = a"], VECTOR_SIGNATURE)


@settings(max_examples=10)
@given(st.lists(anything, min_size=20, max_size=20))
def test_any_expression(several):
    """Only sines may differ in a bit; where Python raises an error, IEEE gives a value."""
    written = [assignments(["out[0]"], [expression_of(each)]) for each in several]
    lines = []
    for i, each in enumerate(written):
        lines += [f"{'elif' if i else 'if'} index == {i}:", *(f"    {line}" for line in each)]
    as_python, as_machine_code = both(lines, VECTOR_SIGNATURE)
    for i, each in enumerate(written):
        expected, found = np.full(1, 7.0), np.full(1, 7.0)
        as_machine_code(i, 0.25, X, P, found)
        with np.errstate(all="ignore"), suppress(OverflowError):
            as_python(i, 0.25, X, P, expected)
            np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13, err_msg="\n".join(each))
            if not re.search(r"sin|cos|tan|exp|\*\*", "".join(each)):
                np.testing.assert_array_equal(found, expected, err_msg="\n".join(each))


@pytest.mark.parametrize("exponent", ["1/2", "3/2", "5/2", "-1/2", "-3/2", "-5/2"])
def test_half_integer_powers_are_products_with_a_root(exponent):
    text = power_text("z", Number(Fraction(exponent)), "k")
    assert "**" not in text
    value = eval(text, {"z": 1.7, "sqrt": math.sqrt})
    assert value == pytest.approx(1.7 ** float(Number(Fraction(exponent))), rel=1e-15)


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


@pytest.mark.parametrize("operator", "+-*/")
def test_four_numbers_at_once_and_one(operator):
    """One number counts for all four, before and after the operator."""
    lines = [
        f"store(out, 0, 0, load(out, 0, 0) {operator} 3)",
        f"store(out, 1, 0, 3 {operator} load(out, 1, 0))",
        f"store(out, 2, 0, load(out, 2, 0) {operator} x[1])",
        f"store(out, 3, 0, x[1] {operator} load(out, 3, 0))",
        f"store(out, 4, 0, load(out, 4, 0) {operator} load(out, 5, 0))",
        "store(out, 5, 0, -load(out, 5, 0))",
    ]
    start = np.arange(1.0, 25.0).reshape(6, 4)
    found = []
    for run in both(lines):
        out = start.copy()
        run(0, 0.25, X, P, 0, out)
        found.append(out)
    apply = {"+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide}[operator]
    expected = [
        apply(start[0], 3.0),
        apply(3.0, start[1]),
        apply(start[2], X[1]),
        apply(X[1], start[3]),
        apply(start[4], start[5]),
        -start[5],
    ]
    np.testing.assert_array_equal(found[0], expected)
    np.testing.assert_array_equal(found[1], expected)
