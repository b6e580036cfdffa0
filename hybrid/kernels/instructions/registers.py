"""LLVM's instructions for numbers side by side in vector registers."""

from llvmlite import ir

from hybrid.kernels.instructions.loops import declared, variable
from hybrid.kernels.types.codes import NARROW, WIDE

FUSED = ("contract",)


def vector_of(width):
    """The type of a register of ``width`` numbers."""
    return ir.VectorType(ir.DoubleType(), width)


def everywhere(builder, number, width):
    """One number in every lane."""
    nothing = vector_of(width)(ir.Undefined)
    vector = builder.insert_element(nothing, number, ir.IntType(32)(0))
    lanes = ir.VectorType(ir.IntType(32), width)
    return builder.shuffle_vector(vector, nothing, lanes([0] * width))


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
        return builder.gep(self.data, [builder.add(builder.mul(row, self.columns), column)])

    def walker(self, row, column):
        """A variable that holds the address of an entry."""
        return variable(self.builder, self.address(row, column))

    def walk(self, walker, rows):
        """Move a walker on by a number of rows; returns the address that it held."""
        builder = self.builder
        here = builder.load(walker)
        builder.store(builder.gep(here, [builder.mul(self.columns, self.columns.type(rows))]), walker)
        return here

    def beside(self, address, columns):
        """Address of the entry ``columns`` further in the same row."""
        return self.builder.gep(address, [self.columns.type(columns)])


def read(builder, address, width):
    """The vector at an address."""
    return builder.load(builder.bitcast(address, vector_of(width).as_pointer()), align=8)


def write(builder, vector, address):
    """Store a vector at an address."""
    builder.store(vector, builder.bitcast(address, vector.type.as_pointer()), align=8)


def write_down(builder, matrix, row, column, stride, lanes):
    """The instructions of ``store_down``."""
    address = matrix.address(row, column)
    for lane in range(NARROW):
        builder.store(builder.extract_element(lanes, ir.IntType(32)(lane)), address)
        address = builder.gep(address, [stride])


def write_row(builder, matrix, row, column, numbers):
    """The instructions of ``store_row``.

    A processor stalls when it reads as one register what has just been written as two.
    """
    address = matrix.address(row, column)
    for place in range(0, sum(widths(len(numbers))), NARROW):
        vector = vector_of(NARROW)([0.0] * NARROW)
        for lane, value in enumerate(numbers[place : place + NARROW]):
            vector = builder.insert_element(vector, value, ir.IntType(32)(lane))
        target = builder.bitcast(matrix.beside(address, place), vector.type.as_pointer())
        builder.store(vector, target, align=8, whole=True)


def whole_registers(width, register):
    """``width`` columns, rounded up to whole vector registers of ``register`` columns."""
    return (width + register - 1) // register * register


def widths(count):
    """Widths of the registers in which a row of ``count`` numbers is written."""
    rest = count % WIDE
    return [WIDE] * (count // WIDE) + ([] if rest == 0 else [NARROW if rest <= NARROW else WIDE])
