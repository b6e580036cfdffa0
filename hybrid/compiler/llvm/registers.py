"""Instructions that fill registers, take them apart and write them to rows of series."""

from __future__ import annotations

from typing import Any, NamedTuple

from llvmlite import ir

from hybrid.kernels.instructions.registers import DOUBLE, address_of_values, vector_of
from hybrid.kernels.types.codes import NARROW, WIDE


class Vectors(NamedTuple):
    """The vector registers of a processor: numbers in the widest one, and how many of them sums may fill."""

    widest: int
    room: int


def lane_numbers(first: int, count: int) -> Any:
    """Consecutive numbers of lanes, which shuffles choose."""
    return ir.Constant(ir.VectorType(ir.IntType(32), count), list(range(first, first + count)))


def write_down(builder: Any, matrix: Any, row: Any, column: Any, stride: Any, lanes: Any) -> None:
    """The instructions of ``store_down``."""
    address = matrix.address(row, column)
    for lane in range(NARROW):
        builder.store(builder.extract_element(lanes, ir.IntType(32)(lane)), address)
        address = builder.gep(address, [stride], source_etype=DOUBLE)


def write_row(builder: Any, matrix: Any, row: Any, column: Any, numbers: Any) -> None:
    """The instructions of ``store_row``, of numbers or of registers of four numbers.

    A processor stalls when it reads as one register what has just been written as two. So a row is written
    in registers as wide as those in which ``convolved`` reads it.
    """
    if numbers[0].type == DOUBLE:
        numbers = [*numbers, *[DOUBLE(0.0)] * (sum(widths(len(numbers))) - len(numbers))]
        numbers = [four(builder, *numbers[i : i + NARROW]) for i in range(0, len(numbers), NARROW)]
    address, place = matrix.address(row, column), 0
    for width in widths(NARROW * len(numbers)):
        parts = numbers[place // NARROW : (place + width) // NARROW]
        vector = parts[0] if len(parts) == 1 else builder.shuffle_vector(*parts, lane_numbers(0, width))
        target = address_of_values(builder, matrix.beside(address, place), vector.type)
        builder.store(vector, target, align=8, whole=True)
        place += width


def four(builder: Any, *numbers: Any) -> Any:
    """The instructions of ``four``."""
    vector = vector_of(NARROW)([0.0] * NARROW)
    for lane, value in enumerate(numbers):
        vector = builder.insert_element(vector, value, ir.IntType(32)(lane))
    return vector


def parted(builder: Any, vector: Any) -> list[Any]:
    """The registers of four numbers that a register holds."""
    nothing, count = vector.type(ir.Undefined), vector.type.count
    places = [lane_numbers(lane, NARROW) for lane in range(0, count, NARROW)]
    return [vector] if count == NARROW else [builder.shuffle_vector(vector, nothing, each) for each in places]


def joined(builder: Any, parts: list[Any]) -> Any:
    """The register that holds those of four numbers."""
    while len(parts) > 1:
        count = 2 * parts[0].type.count
        pairs = zip(parts[::2], parts[1::2], strict=True)
        parts = [builder.shuffle_vector(*each, lane_numbers(0, count)) for each in pairs]
    return parts[0]


def widths(count: int) -> list[int]:
    """Widths of the registers in which a row of ``count`` numbers is written."""
    rest = count % WIDE
    return [WIDE] * (count // WIDE) + ([] if rest == 0 else [NARROW if rest <= NARROW else WIDE])
