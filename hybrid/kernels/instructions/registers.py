"""LLVM's instructions for numbers side by side in vector registers."""

from typing import NamedTuple

from llvmlite import ir

from hybrid.kernels.instructions.loops import declared, variable
from hybrid.kernels.types.codes import NARROW, WIDE

FUSED = ("contract",)
NUMBER = ir.DoubleType()


class Vectors(NamedTuple):
    """The vector registers of a processor: numbers in the widest one, and how many of them sums may fill."""

    widest: int
    room: int


def vector_of(width):
    """The type of a register of ``width`` numbers."""
    return ir.VectorType(NUMBER, width)


def everywhere(builder, number, width):
    """One number in every lane."""
    nothing = vector_of(width)(ir.Undefined)
    vector = builder.insert_element(nothing, number, ir.IntType(32)(0))
    lanes = ir.VectorType(ir.IntType(32), width)
    return builder.shuffle_vector(vector, nothing, lanes([0] * width))


def lane_numbers(first, count):
    """Consecutive numbers of lanes, which shuffles choose."""
    return ir.Constant(ir.VectorType(ir.IntType(32), count), list(range(first, first + count)))


def built_in(builder, name, width, *arguments):
    """Call a function that the compiler provides for vectors, such as ``fabs``."""
    kind = vector_of(width)
    function = ir.FunctionType(kind, [kind] * len(arguments))
    return builder.call(declared(builder.module, function, f"llvm.{name}.v{width}f64"), arguments)


def multiply_add(builder, a, b, c):
    """``a * b + c`` as one operation: LLVM does not fuse by itself what it adds to the sum of a loop."""
    return built_in(builder, "fmuladd", c.type.count, a, b, c)


class Matrix:
    """Writes the instructions that address entries of a matrix with this data pointer and column count."""

    def __init__(self, builder, data, columns):
        self.builder, self.data, self.columns = builder, data, columns

    def address(self, row, column):
        """Address of an entry."""
        builder = self.builder
        place = builder.add(builder.mul(row, self.columns), column)
        return builder.gep(self.data, [place], source_etype=NUMBER)

    def walker(self, row, column):
        """A variable that holds the address of an entry."""
        return variable(self.builder, self.address(row, column))

    def walk(self, walker, rows):
        """Move a walker on by a number of rows; returns the address that it held."""
        builder = self.builder
        here = builder.load(walker)
        further = builder.mul(self.columns, self.columns.type(rows))
        builder.store(builder.gep(here, [further], source_etype=NUMBER), walker)
        return here

    def beside(self, address, columns):
        """Address of the entry ``columns`` further in the same row."""
        return self.builder.gep(address, [self.columns.type(columns)], source_etype=NUMBER)


def read(builder, address, width):
    """The vector at an address."""
    return builder.load(address, align=8, typ=vector_of(width))


def write(builder, vector, address):
    """Store a vector at an address."""
    builder.store(vector, _address_of(builder, address, vector.type), align=8)


def _address_of(builder, address, kind):
    """An address as that of values of a type: the pointers that come from numba know what they point to."""
    return builder.bitcast(address, kind.as_pointer())


def write_down(builder, matrix, row, column, stride, lanes):
    """The instructions of ``store_down``."""
    address = matrix.address(row, column)
    for lane in range(NARROW):
        builder.store(builder.extract_element(lanes, ir.IntType(32)(lane)), address)
        address = builder.gep(address, [stride], source_etype=NUMBER)


def write_row(builder, matrix, row, column, numbers):
    """The instructions of ``store_row``, of numbers or of registers of four numbers.

    A processor stalls when it reads as one register what has just been written as two. So a row is written
    in registers as wide as those in which ``convolved`` reads it.
    """
    if numbers[0].type == NUMBER:
        numbers = [*numbers, *[NUMBER(0.0)] * (sum(widths(len(numbers))) - len(numbers))]
        numbers = [four(builder, *numbers[i : i + NARROW]) for i in range(0, len(numbers), NARROW)]
    address, place = matrix.address(row, column), 0
    for width in widths(NARROW * len(numbers)):
        parts = numbers[place // NARROW : (place + width) // NARROW]
        vector = parts[0] if len(parts) == 1 else builder.shuffle_vector(*parts, lane_numbers(0, width))
        target = _address_of(builder, matrix.beside(address, place), vector.type)
        builder.store(vector, target, align=8, whole=True)
        place += width


def four(builder, *numbers):
    """The instructions of ``four``."""
    vector = vector_of(NARROW)([0.0] * NARROW)
    for lane, value in enumerate(numbers):
        vector = builder.insert_element(vector, value, ir.IntType(32)(lane))
    return vector


def parted(builder, vector):
    """The registers of four numbers that a register holds."""
    nothing, count = vector.type(ir.Undefined), vector.type.count
    places = [lane_numbers(lane, NARROW) for lane in range(0, count, NARROW)]
    return [vector] if count == NARROW else [builder.shuffle_vector(vector, nothing, each) for each in places]


def joined(builder, parts):
    """The register that holds those of four numbers."""
    while len(parts) > 1:
        count = 2 * parts[0].type.count
        pairs = zip(parts[::2], parts[1::2], strict=True)
        parts = [builder.shuffle_vector(*each, lane_numbers(0, count)) for each in pairs]
    return parts[0]


def whole_registers(width, register):
    """``width`` columns, rounded up to whole vector registers of ``register`` columns."""
    return (width + register - 1) // register * register


def widths(count):
    """Widths of the registers in which a row of ``count`` numbers is written."""
    rest = count % WIDE
    return [WIDE] * (count // WIDE) + ([] if rest == 0 else [NARROW if rest <= NARROW else WIDE])
