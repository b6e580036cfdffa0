"""Four numbers in one vector register, as a type of the compiler: arithmetic on four tangent vectors at once.

In plain Python ``Lanes`` are arrays ``(4,)``, so the same code runs compiled and in plain Python.
"""

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import models, overload, register_jitable, register_model

from hybrid.kernels.instructions.registers import (
    FUSED,
    Matrix,
    built_in,
    everywhere,
    read,
    vector_of,
    whole_registers,
    widths,
    write,
)
from hybrid.kernels.types.codes import NARROW
from hybrid.kernels.types.numba_door.building import intrinsic, unpack_tuple
from hybrid.kernels.types.numba_door.part_compiler import PartCompiler

# These functions are small and run at every order: without inlining, the call would cost as much as the work.
HERE: Any = {
    "_nrt": False,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "forceinline": True,
    "pipeline_class": PartCompiler,
}


class LanesType(types.Type):
    """The numba type of four numbers side by side."""

    def __init__(self):
        super().__init__("Lanes")


LANES = LanesType()

register_jitable(whole_registers)


@register_model(LanesType)
class _Register(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, vector_of(NARROW))


def matrix_of(context, builder, kind, matrix):
    """The ``Matrix`` of a numba array."""
    array = context.make_array(kind)(context, builder, matrix)
    return Matrix(builder, array.data, unpack_tuple(builder, array.shape)[1])


def load(matrix, row, column):
    """Four entries of a row."""
    return matrix[row, column : column + NARROW].copy()


def four(a, b, c, d):
    """Four numbers side by side."""
    return np.array([a, b, c, d])


def store(matrix, row, column, lanes):
    """Write four entries of a row, from a register or from one number for all."""
    matrix[row, column : column + NARROW] = lanes


def store_down(matrix, row, column, stride, lanes):
    """Write four entries of a row that are ``stride`` columns apart."""
    matrix[row, column : column + NARROW * stride : stride] = lanes


def store_row(matrix, row, column, numbers):
    """Write a tuple of numbers side by side, in registers padded with zeros; or registers of four numbers."""
    numbers = np.concatenate([np.atleast_1d(each) for each in numbers])
    filled = sum(widths(len(numbers)))
    matrix[row, column : column + filled] = [*numbers, *[0.0] * (filled - len(numbers))]


@overload(load, jit_options=HERE)
def _overload_load(matrix, row, column):
    return lambda matrix, row, column: _read_register(matrix, row, column)


@overload(store, jit_options=HERE)
def _overload_store(matrix, row, column, lanes):
    return lambda matrix, row, column, lanes: _write_register(matrix, row, column, lanes)


@intrinsic
def _read_register(typing_context, matrix, row, column):
    def generate(context, builder, signature, arguments):
        return read(
            builder, matrix_of(context, builder, matrix, arguments[0]).address(*arguments[1:]), NARROW
        )

    return LANES(matrix, types.intp, types.intp), generate


@intrinsic
def _write_register(typing_context, matrix, row, column, lanes):
    kind = LANES if lanes == LANES else types.float64

    def generate(context, builder, signature, arguments):
        array, row, column, value = arguments
        vector = value if kind == LANES else everywhere(builder, value, NARROW)
        write(builder, vector, matrix_of(context, builder, matrix, array).address(row, column))
        return context.get_dummy_value()

    return types.void(matrix, types.intp, types.intp, kind), generate


def square_root(lanes):
    """Square root of each number."""
    return np.sqrt(lanes)


def magnitude(lanes):
    """Absolute value of each number."""
    return abs(lanes)


def four_times(number):
    """The same number in every lane."""
    return np.full(NARROW, number)


def larger(a, b):
    """The larger number in each lane; ``b`` where one is nan."""
    return np.where(a > b, a, b)


def largest(lanes):
    """The largest of the four numbers."""
    return max(lanes)


def largest_of_each(a, b, c, d):
    """The largest number of each of four registers, as one register."""
    return np.array([max(a), max(b), max(c), max(d)])


def places():
    """The places of the numbers in a register, as numbers from 0 on."""
    return np.arange(float(NARROW))


def _operation(instruction):
    """An intrinsic for an operation on two registers, or on a register and a number."""

    @intrinsic
    def operate(typing_context, a, b):
        kinds = [each if each == LANES else types.float64 for each in (a, b)]

        def generate(context, builder, signature, arguments):
            vectors = [
                argument if kind == LANES else everywhere(builder, argument, NARROW)
                for kind, argument in zip(kinds, arguments, strict=True)
            ]
            return getattr(builder, instruction)(*vectors, flags=FUSED)

        return LANES(*kinds), generate

    return operate


def _function_of_each(name):
    """An intrinsic for a function that the compiler provides for vectors."""

    @intrinsic
    def call(typing_context, lanes):
        def generate(context, builder, signature, arguments):
            return built_in(builder, name, NARROW, *arguments)

        return LANES(LANES), generate

    return call


def _larger_of(builder, a, b):
    return builder.select(builder.fcmp_ordered(">", a, b), a, b)


@intrinsic
def _fill(typing_context, number):
    def generate(context, builder, signature, arguments):
        return everywhere(builder, arguments[0], NARROW)

    return LANES(types.float64), generate


@intrinsic
def _select_larger(typing_context, a, b):
    def generate(context, builder, signature, arguments):
        return _larger_of(builder, *arguments)

    return LANES(LANES, LANES), generate


@intrinsic
def _reduce_to_largest(typing_context, lanes):
    def generate(context, builder, signature, arguments):
        parts = [builder.extract_element(arguments[0], ir.IntType(32)(i)) for i in range(NARROW)]
        while len(parts) > 1:
            parts = [_larger_of(builder, *parts[i : i + 2]) for i in range(0, len(parts), 2)]
        return parts[0]

    return types.float64(LANES), generate


@intrinsic
def _reduce_each_to_largest(typing_context, a, b, c, d):
    def generate(context, builder, signature, arguments):
        def chosen(one, other, *places):
            mask = ir.Constant(ir.VectorType(ir.IntType(32), NARROW), list(places))
            return builder.shuffle_vector(one, other, mask)

        def larger_of_pairs(one, other):
            return _larger_of(builder, chosen(one, other, 0, 4, 2, 6), chosen(one, other, 1, 5, 3, 7))

        low, high = larger_of_pairs(*arguments[:2]), larger_of_pairs(*arguments[2:])
        return _larger_of(builder, chosen(low, high, 0, 1, 4, 5), chosen(low, high, 2, 3, 6, 7))

    return LANES(LANES, LANES, LANES, LANES), generate


@intrinsic
def _count_places(typing_context):
    def generate(context, builder, signature, arguments):
        return vector_of(NARROW)([float(place) for place in range(NARROW)])

    return LANES(), generate


_add, _subtract, _multiply, _divide = (_operation(name) for name in ("fadd", "fsub", "fmul", "fdiv"))
_square_root, _magnitude = _function_of_each("sqrt"), _function_of_each("fabs")


def _overload_operator(operation, function):
    @overload(operation, jit_options=HERE)
    def choose(a, b):
        if LANES in (a, b):
            return lambda a, b: function(a, b)
        return None


for _operator, _intrinsic in (
    (operator.add, _add),
    (operator.sub, _subtract),
    (operator.mul, _multiply),
    (operator.truediv, _divide),
):
    _overload_operator(_operator, _intrinsic)


@overload(operator.neg, jit_options=HERE)
def _overload_negative(a):
    if a == LANES:
        return lambda a: _multiply(-1.0, a)
    return None


@overload(square_root, jit_options=HERE)
def _overload_square_root(lanes):
    return lambda lanes: _square_root(lanes)


@overload(magnitude, jit_options=HERE)
def _overload_magnitude(lanes):
    return lambda lanes: _magnitude(lanes)


@overload(four_times, jit_options=HERE)
def _overload_four_times(number):
    return lambda number: _fill(number)


@overload(larger, jit_options=HERE)
def _overload_larger(a, b):
    return lambda a, b: _select_larger(a, b)


@overload(largest, jit_options=HERE)
def _overload_largest(lanes):
    return lambda lanes: _reduce_to_largest(lanes)


@overload(largest_of_each, jit_options=HERE)
def _overload_largest_of_each(a, b, c, d):
    return lambda a, b, c, d: _reduce_each_to_largest(a, b, c, d)


@overload(places, jit_options=HERE)
def _overload_places():
    return lambda: _count_places()
