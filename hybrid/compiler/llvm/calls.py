"""Functions that code may call, as LLVM's instructions."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import perm
from typing import Any

import attrs
from llvmlite import ir

from hybrid.compiler.llvm.columns import (
    write_combination,
    write_combination_of_tangents,
    write_convolution,
    write_convolved,
    write_ends,
    write_spread,
)
from hybrid.compiler.llvm.doubled import write_divided_dot_product
from hybrid.compiler.llvm.registers import four, write_down, write_row
from hybrid.compiler.llvm.waves import sine
from hybrid.expression.operations import FUNCTIONS
from hybrid.kernels.instructions.loops import declared
from hybrid.kernels.instructions.registers import everywhere, read, vector_of, write
from hybrid.kernels.types.codes import HEAD, NARROW

NUMBER = ir.DoubleType()
WHOLE = ir.IntType(64)


@attrs.frozen
class Call:
    """A function that writes the instructions of a call.

    Attributes
    ----------
    writer
        Called with the builder and the arguments; returns the value.
    on_numbers
        Whether all arguments are floats.
    """

    writer: Callable[..., Any]
    on_numbers: bool = False

    def __call__(self, builder: Any, *arguments: Any) -> Any:
        """Write the instructions."""
        return self.writer(builder, *arguments)


def _of_libm(name: str) -> Call:
    """A function of the C math library."""
    return Call(lambda builder, *numbers: _declared(builder, name, numbers), on_numbers=True)


def _of_llvm(name: str) -> Call:
    """An intrinsic function of LLVM."""
    return Call(lambda builder, *numbers: _declared(builder, f"llvm.{name}.f64", numbers), on_numbers=True)


def _declared(builder: Any, name: str, numbers: tuple[Any, ...]) -> Any:
    kind = ir.FunctionType(NUMBER, [NUMBER] * len(numbers))
    return builder.call(declared(builder.module, kind, name), numbers)


def _remainder(builder: Any, a: Any, b: Any) -> Any:
    """Python's remainder: C's ``fmod``, plus the divisor if their signs differ."""
    zero = NUMBER(0.0)
    rest = builder.frem(a, b)
    is_negative = builder.fcmp_ordered("<", b, zero)
    differs = builder.xor(is_negative, builder.fcmp_ordered("<", rest, zero))
    whole = builder.select(is_negative, NUMBER(-0.0), zero)
    moved = builder.select(differs, builder.fadd(rest, b), rest)
    return builder.select(builder.fcmp_unordered("!=", rest, zero), moved, whole)


def _largest(builder: Any, *numbers: Any) -> Any:
    """As Python's ``max``: a later number replaces an earlier one only if it is larger."""
    largest, *others = numbers
    for other in others:
        largest = builder.select(builder.fcmp_ordered(">", other, largest), other, largest)
    return largest


def _load(builder: Any, matrix: Any, row: Any, column: Any) -> Any:
    return read(builder, matrix.address(row, column), NARROW)


def _store(builder: Any, matrix: Any, row: Any, column: Any, value: Any) -> None:
    lanes = everywhere(builder, value, NARROW) if value.type == NUMBER else value
    write(builder, lanes, matrix.address(row, column))


def _convolved(
    builder: Any, matrix: Any, order: Any, lefts: Any, firsts: Any, widths: Any, *others: Any, **pairs: bool
) -> Any:
    # The widths are part of the call: they come as a term.
    return write_convolved(builder, matrix, order, lefts, firsts, widths[1:], *others, **pairs)


def _spread(builder: Any, y: Any, n: int, matrix: Any, first: Any, stride: Any) -> None:
    write_spread(builder, y.data, y.length, n, matrix, first, stride)


def _table(builder: Any, p: Any, first: int, count: int, degree: int, order: int, u: Any) -> Any:
    """The piece by halving, without branches, then Horner's scheme."""

    def entry(place: Any, behind: int) -> Any:
        index = builder.add(place, WHOLE(first + behind))
        return builder.load(builder.gep(p.data, [index], source_etype=NUMBER), typ=NUMBER)

    def passes(place: Any, behind: int) -> Any:
        return builder.fcmp_ordered("<=", entry(place, HEAD + behind), u)

    passed, left = WHOLE(0), count
    while left > 1:
        half = left // 2
        further = builder.add(passed, WHOLE(half))
        passed = builder.select(passes(passed, half - 1), further, passed)
        left -= half
    passed = builder.select(passes(passed, 0), builder.add(passed, WHOLE(1)), passed)
    before = builder.select(builder.icmp_signed(">", passed, WHOLE(0)), passed, WHOLE(1))
    away = builder.fsub(u, entry(before, HEAD - 1))
    row = builder.mul(passed, WHOLE(degree + 1))
    total = None
    for k in range(degree, order - 1, -1):
        term = builder.fmul(NUMBER(float(perm(k, order))), entry(row, HEAD + count + k))
        total = term if total is None else builder.fadd(builder.fmul(total, away), term)
    return total


def _wave(name: str) -> Call:
    """The sine or the cosine, as a function of the module."""

    def write(builder: Any, x: Any) -> Any:
        function = builder.module.globals.get(name)
        if function is None:
            function = ir.Function(builder.module, ir.FunctionType(NUMBER, [NUMBER]), name)
            function.linkage = "internal"
            body, place = ir.IRBuilder(function.append_basic_block("body")), ir.IntType(32)(0)
            register = body.insert_element(vector_of(1)(ir.Undefined), function.args[0], place)
            body.ret(body.extract_element(sine(body, register, shift=int(name == "cosine")), place))
        return builder.call(function, [x])

    return Call(write, on_numbers=True)


IN_LLVM = ("copysign", "exp", "log", "log10", "log2", "pow", "sqrt")

CALLS = {
    # Functions of models are those of the C library, unless there is something better below.
    **{each.code: _of_libm(each.code) for each in FUNCTIONS if each.code},
    **{name: _of_llvm(name) for name in IN_LLVM},
    **{f"np.{name}": _of_llvm(name) for name in ("floor", "ceil", "trunc", "rint")},
    "sin": _wave("sine"),
    "cos": _wave("cosine"),
    "abs": _of_llvm("fabs"),
    "max": Call(_largest, on_numbers=True),
    "np.fmod": Call(lambda builder, a, b: builder.frem(a, b), on_numbers=True),
    "remainder": Call(_remainder, on_numbers=True),
    "load": Call(_load),
    "store": Call(_store),
    "store_down": Call(write_down),
    "store_row": Call(write_row),
    "table": Call(_table),
    "four": Call(four, on_numbers=True),
    "four_times": Call(lambda builder, number: everywhere(builder, number, NARROW)),
    "convolve": Call(write_convolution),
    "convolve_pairs": Call(partial(write_convolution, pairs=True)),
    "convolved": Call(_convolved),
    "convolved_pairs": Call(partial(_convolved, pairs=True)),
    "add_ends": Call(write_ends),
    "add_ends_of_pairs": Call(partial(write_ends, pairs=True)),
    "combine": Call(write_combination),
    "combine_tangents": Call(write_combination_of_tangents),
    "divided_dot_product": Call(write_divided_dot_product),
    "spread_tangents": Call(_spread),
}
