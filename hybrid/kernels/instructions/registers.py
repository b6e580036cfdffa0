"""LLVM's instructions for numbers side by side in vector registers."""

from llvmlite import ir

from hybrid.kernels.instructions.loops import declared, variable

FUSED = ("contract",)
DOUBLE = ir.DoubleType()


def vector_of(width):
    """The type of a register of ``width`` numbers."""
    return ir.VectorType(DOUBLE, width)


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
        place = builder.add(builder.mul(row, self.columns), column)
        return builder.gep(self.data, [place], source_etype=DOUBLE)

    def walker(self, row, column):
        """A variable that holds the address of an entry."""
        return variable(self.builder, self.address(row, column))

    def walk(self, walker, rows):
        """Move a walker on by a number of rows; returns the address that it held."""
        builder = self.builder
        here = builder.load(walker)
        further = builder.mul(self.columns, self.columns.type(rows))
        builder.store(builder.gep(here, [further], source_etype=DOUBLE), walker)
        return here

    def beside(self, address, columns):
        """Address of the entry ``columns`` further in the same row."""
        return self.builder.gep(address, [self.columns.type(columns)], source_etype=DOUBLE)


def read(builder, address, width):
    """The vector at an address."""
    return builder.load(address, align=8, typ=vector_of(width))


def write(builder, vector, address):
    """Store a vector at an address."""
    builder.store(vector, address_of_values(builder, address, vector.type), align=8)


def address_of_values(builder, address, kind):
    """An address as that of values of a type: the pointers that come from numba know what they point to."""
    return builder.bitcast(address, kind.as_pointer())


def whole_registers(width, register):
    """``width`` columns, rounded up to whole vector registers of ``register`` columns."""
    return (width + register - 1) // register * register
