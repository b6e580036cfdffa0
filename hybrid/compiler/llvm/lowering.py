"""The code of compiled functions as LLVM's instructions.

The code (``hybrid.compiler.statements.code``) alone gives the type of each value: a float, a 64-bit integer,
a truth value, or four numbers in a register. So no types have to be inferred, and a function is ready in
milliseconds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import attrs
from llvmlite import ir

from hybrid.compiler.llvm.calls import CALLS, NUMBER, WHOLE
from hybrid.compiler.llvm.engine import vectors
from hybrid.compiler.llvm.wanted import NO_CALLS, CaseTable, Function, OwnFunction
from hybrid.compiler.statements.code import KNOWN, LoweringError
from hybrid.kernels.instructions.loops import loop
from hybrid.kernels.instructions.registers import Matrix, everywhere, vector_of
from hybrid.kernels.types.codes import NARROW
from hybrid.kernels.types.numba_door.arrays import array_kind, parts_of
from hybrid.kernels.types.numba_door.builder import Builder

TRUTH = ir.IntType(1)
ADDRESS = ir.PointerType()
LANES = vector_of(NARROW)
ARRAYS = {axes: array_kind(axes) for axes in (1, 2)}
# Numba's structure of a vector of floats: memory info, parent, number of items, bytes per item, data, shape,
# strides.
NUMBA_ARRAY = ir.LiteralStructType(
    [ADDRESS, ADDRESS, WHOLE, WHOLE, ADDRESS, ir.ArrayType(WHOLE, 1), ir.ArrayType(WHOLE, 1)]
)


@attrs.frozen
class Vector:
    """An array: the address of its data, its length, and the type of its entries."""

    data: Any
    length: Any
    kind: Any = NUMBER


def lower(module: Any, written: Function, calls: Mapping[str, OwnFunction | CaseTable] = NO_CALLS) -> None:
    """Add a function to an LLVM module; ``calls`` are functions of the user and tables of cases.

    Raises
    ------
    LoweringError
        If the code has something that compiled functions do not have.
    """
    kinds = [ARRAYS.get(kind, kind) for kind in written.signature.types]
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), written.name)
    function.attributes.add("nounwind")
    (written.body or Body)(function, written, calls).write(written.cases)


class Body:
    """Writes the instructions of one function."""

    def __init__(
        self, function: Any, written: Function, calls: Mapping[str, OwnFunction | CaseTable]
    ) -> None:
        self.flags, self.calls = ("contract",) if written.fused else (), calls
        self.arguments = dict(zip(written.signature.names, function.args, strict=True))
        # Variables are allocated in the first block: LLVM turns only those into registers.
        self.front = ir.IRBuilder(function.append_basic_block("front"))
        self.builder = Builder(function.append_basic_block("body"))
        self.builder.vectors = vectors()
        self.values: dict[str, Any] = {}
        self.variables: dict[str, Any] = {}
        # Arrays of this function: their sizes, until they are first written.
        self.arrays: dict[str, Vector | int] = {}
        for (name, argument), kind in zip(self.arguments.items(), written.signature.types, strict=True):
            self.values[name] = argument if kind not in ARRAYS else self._array_argument(kind, argument)

    def _array_argument(self, axes: int, argument: Any) -> Vector | Matrix:
        data, sizes = parts_of(self.builder, argument, axes)
        return Vector(data, sizes[0]) if axes == 1 else Matrix(self.builder, data, sizes[1])

    def write(self, cases: Sequence[Any]) -> None:
        """Write the whole function."""
        builder = self.builder
        end = builder.append_basic_block("end")
        if any(not indices for indices, _ in cases):
            [(_, statements)] = cases
            self.block(statements)
            builder.branch(end)
        else:
            choice = builder.switch(self.arguments["index"], end)
            for indices, statements in cases:
                place = builder.append_basic_block("case")
                for index in indices:
                    choice.add_case(WHOLE(index), place)
                builder.position_at_end(place)
                self._alone(statements)
                builder.branch(end)
        builder.position_at_end(end)
        self.builder.ret_void()
        front, body, *_ = self.builder.function.basic_blocks
        self.front.position_at_end(front)
        self.front.branch(body)

    def block(self, statements: Sequence[Any]) -> None:
        """Write statements in order."""
        for kind, *parts in statements:
            self.STATEMENTS[kind](self, *parts)

    def value(self, term: Any) -> Any:
        """Write a term, and return its value."""
        if type(term) is int:
            return WHOLE(term)
        if type(term) is float:
            return NUMBER(term)
        operation, *parts = term
        known = self.TERMS.get(operation)
        return self._call(operation, parts) if known is None else known(self, operation, *parts)

    # Statements.

    def _set(self, place: Any, term: Any) -> None:
        self._store(place, self.value(term))

    def _store(self, place: Any, value: Any) -> None:
        kind, *parts = place
        if kind == "several":
            for each, part in zip(parts, value, strict=True):
                self._store(each, part)
        elif kind == "at":
            name, *indices = parts
            array = self._local(name, value) if name in self.arrays else self.values[name]
            self._set_entry(array, indices, value)
        else:
            self._store_variable(parts[0], value)

    def _set_entry(self, array: Any, indices: Sequence[Any], value: Any) -> None:
        self.builder.store(self.number(value), self._place(array, indices))

    def _store_variable(self, name: str, value: Any) -> None:
        if name in self.values:
            raise LoweringError(f"{name} is an argument and cannot be assigned")
        if isinstance(value, tuple):
            self.variables[name] = value
            return
        variable = self.variables.get(name)
        if variable is None:
            variable = self.variables[name] = self.front.alloca(value.type, name=name)
        kept = variable.allocated_type
        if kept != WHOLE:
            value = self.number(value)
        if kept != value.type:
            raise LoweringError(f"{name} is {kept} in one place and {value.type} in another")
        self.builder.store(value, variable)

    def _local(self, name: str, value: Any) -> Vector:
        """An array of this function, whose entries have the type of the first value."""
        found = self.arrays[name]
        if isinstance(found, int):
            size, kind = WHOLE(found), self.number(value).type
            found = self.arrays[name] = Vector(self.front.alloca(kind, size), size, kind)
        return found

    def _do(self, term: Any) -> None:
        self.value(term)

    def _alone(self, statements: Sequence[Any]) -> None:
        """A block that may not run: a variable first assigned in it is unknown after it."""
        before = dict(self.variables), dict(self.values)
        self.block(statements)
        self.variables, self.values = before

    def _when(self, condition: Any, body: Sequence[Any], other: Sequence[Any]) -> None:
        with self.builder.if_else(self.truth(condition)) as (then, otherwise):
            for branch, statements in ((then, body), (otherwise, other)):
                with branch:
                    self._alone(statements)

    def _for(self, name: str, start: Any, stop: Any, step: Any, body: Sequence[Any]) -> None:
        with loop(self.builder, *map(self.value, (start, stop, step))) as index:
            self._store_variable(name, index)
            self.block(body)

    def _repeat(self, name: str, count: int, body: Sequence[Any]) -> None:
        self._for(name, 0, count, 1, body)

    def _whole(self, name: str, number: int) -> None:
        self.values[name] = WHOLE(number)

    def _array(self, name: str, size: int) -> None:
        self.arrays[name] = size

    STATEMENTS: ClassVar[dict[str, Callable[..., None]]] = {
        "set": _set,
        "do": _do,
        "when": _when,
        "for": _for,
        "repeat": _repeat,
        "whole": _whole,
        "array": _array,
    }

    # Terms.

    def number(self, value: Any) -> Any:
        """A value as a float."""
        return self.builder.sitofp(value, NUMBER) if value.type == WHOLE else value

    def truth(self, term: Any) -> Any:
        """A term as a condition."""
        value = self.value(term)
        if value.type != TRUTH:
            raise LoweringError(f"{term} is no condition")
        return value

    def _get(self, _: str, name: str) -> Any:
        if name in self.values:
            return self.values[name]
        if name not in self.variables:
            raise LoweringError(f"{name} has no value yet")
        variable = self.variables[name]
        return variable if isinstance(variable, tuple) else self.builder.load(variable)

    def _place(self, array: Any, indices: Sequence[Any]) -> Any:
        """The address of an entry."""
        places = [self.value(each) for each in indices]
        if isinstance(array, Matrix):
            return array.address(*places)
        return self.builder.gep(array.data, places, source_etype=array.kind)

    def _at(self, _: str, name: str, *indices: Any) -> Any:
        array: Any = self.arrays[name] if name in self.arrays else self.values[name]
        kind = NUMBER if isinstance(array, Matrix) else array.kind
        return self.builder.load(self._place(array, indices), typ=kind)

    def _listed(self, _: str, numbers: Sequence[Any], index: Any) -> Any:
        kind = WHOLE if all(type(each) is int for each in numbers) else NUMBER
        entries = ir.ArrayType(kind, len(numbers))
        module = self.builder.module
        place = ir.GlobalVariable(module, entries, module.get_unique_name("listed"))
        place.linkage, place.global_constant = "internal", True
        place.initializer = entries([kind(each) for each in numbers])
        address = self.builder.bitcast(place, kind.as_pointer())
        return self.builder.load(self.builder.gep(address, [self.value(index)], source_etype=kind), typ=kind)

    def _item(self, _: str, term: Any, place: int) -> Any:
        value = self.value(term)
        if isinstance(value, tuple | list):
            return value[place]
        return self.builder.extract_element(value, ir.IntType(32)(place))

    def _rounded(self, _: str, term: Any) -> Any:
        flags, self.flags = self.flags, ()
        value = self.value(term)
        self.flags = flags
        return value

    def _several(self, _: str, *terms: Any) -> tuple[Any, ...]:
        return tuple(map(self.value, terms))

    def _negative(self, _: str, term: Any) -> Any:
        value = self.value(term)
        if value.type == WHOLE:
            return self.builder.neg(value)
        if value.type == LANES:
            # A product, since it can be fused with an addition.
            return self.builder.fmul(everywhere(self.builder, NUMBER(-1.0), NARROW), value, flags=self.flags)
        return self.builder.fneg(value, flags=self.flags)

    def _arithmetic(self, operation: str, left: Any, right: Any) -> Any:
        a, b = self.value(left), self.value(right)
        if a.type == b.type == WHOLE and operation in self.WHOLE_OPERATIONS:
            return self.WHOLE_OPERATIONS[operation](self.builder, a, b)
        a, b = self.number(a), self.number(b)
        if LANES in (a.type, b.type):
            a, b = (each if each.type == LANES else everywhere(self.builder, each, NARROW) for each in (a, b))
        return self.OPERATIONS[operation](self.builder, a, b, flags=self.flags)

    OPERATIONS: ClassVar[dict[str, Callable[..., Any]]] = {
        "+": Builder.fadd,
        "-": Builder.fsub,
        "*": Builder.fmul,
        "/": Builder.fdiv,
        "%": lambda builder, a, b, flags: CALLS["remainder"](builder, a, b),
        "**": lambda builder, a, b, flags: CALLS["pow"](builder, a, b),
    }
    # Integers are counts here. They are not negative in a division, so ``sdiv`` equals ``//``.
    WHOLE_OPERATIONS: ClassVar[dict[str, Callable[..., Any]]] = {
        "+": Builder.add,
        "-": Builder.sub,
        "*": Builder.mul,
        "//": ir.IRBuilder.sdiv,
    }

    def _compared(self, symbol: str, left: Any, right: Any) -> Any:
        a, b = self.value(left), self.value(right)
        if a.type == b.type == WHOLE:
            return self.builder.icmp_signed(symbol, a, b)
        compare = self.builder.fcmp_unordered if symbol == "!=" else self.builder.fcmp_ordered
        return compare(symbol, self.number(a), self.number(b))

    def _both(self, _: str, a: Any, b: Any) -> Any:
        return self.builder.and_(self.truth(a), self.truth(b))

    def _either(self, _: str, a: Any, b: Any) -> Any:
        return self.builder.or_(self.truth(a), self.truth(b))

    def _not(self, _: str, term: Any) -> Any:
        return self.builder.not_(self.truth(term))

    def _if(self, _: str, condition: Any, *branches: Any) -> Any:
        decided = self.truth(condition)
        if all(map(_is_at_hand, branches)):
            return self.builder.select(decided, *(self.number(self.value(each)) for each in branches))
        result = self.front.alloca(NUMBER)
        with self.builder.if_else(decided) as places:
            for place, each in zip(places, branches, strict=True):
                with place:
                    self.builder.store(self.number(self.value(each)), result)
        return self.builder.load(result)

    def _length(self, _: str, array: str) -> Any:
        return self.values[array].length

    TERMS: ClassVar[dict[str, Callable[..., Any]]] = {
        "get": _get,
        "at": _at,
        "listed": _listed,
        "item": _item,
        "several": _several,
        "rounded": _rounded,
        "if": _if,
        "neg": _negative,
        **dict.fromkeys(("+", "-", "*", "/", "//", "**", "%"), _arithmetic),
        **dict.fromkeys(("<", "<=", ">", ">=", "==", "!="), _compared),
        "and": _both,
        "or": _either,
        "not": _not,
        "length": _length,
    }

    # Calls.

    def _call(self, name: str, terms: Sequence[Any]) -> Any:
        known = self.calls.get(name)
        if isinstance(known, CaseTable):
            table = self.builder.inttoptr(WHOLE(known.address), ADDRESS)
            place = self.builder.gep(table, [self.arguments["index"]], source_etype=WHOLE)
            return self._called(self.builder.load(place, typ=WHOLE), [*self.arguments.values()])
        if known is not None:
            return self._own_call(known, terms)
        if name not in CALLS:
            raise LoweringError(f"compiled functions do not have {name}")
        call = CALLS[name]
        arguments = []
        for place, term in enumerate(terms):
            if place in KNOWN.get(name, ()):
                arguments.append(term)
                continue
            value = self.value(term)
            # Whole numbers alone are columns.
            if isinstance(value, tuple) and any(each.type != WHOLE for each in value):
                value = [self.number(each) for each in value]
            arguments.append(self.number(value) if call.on_numbers else value)
        return call(self.builder, *arguments)

    def _own_call(self, function: OwnFunction, terms: Sequence[Any]) -> tuple[Any, ...]:
        """The numbers that a function of the user writes."""
        numbers = self.front.alloca(NUMBER, WHOLE(function.size))
        given = [self.value(term) if type(term) is int else self.values[term[1]] for term in terms]
        arguments = [
            self._for_numba(each) if isinstance(each, Vector) else each
            for each in (*given, Vector(numbers, WHOLE(function.size)))
        ]
        self._called(WHOLE(function.address), arguments)
        places = [self.builder.gep(numbers, [WHOLE(i)], source_etype=NUMBER) for i in range(function.size)]
        return tuple(self.builder.load(place, typ=NUMBER) for place in places)

    def _for_numba(self, vector: Vector) -> Any:
        """An array as a function takes it that numba has compiled."""
        parts = (ADDRESS(None), ADDRESS(None), vector.length, WHOLE(8), vector.data)
        array = NUMBA_ARRAY(ir.Undefined)
        for place, part in enumerate(parts):
            array = self.builder.insert_value(array, part, place)
        for place, part in enumerate((vector.length, WHOLE(8)), len(parts)):
            array = self.builder.insert_value(array, part, [place, 0])
        return array

    def _called(self, address: Any, arguments: Sequence[Any]) -> None:
        """A call of machine code of this process; llvmlite still asks its address for the signature."""
        kind = ir.FunctionType(ir.VoidType(), [each.type for each in arguments])
        self.builder.call(self.builder.inttoptr(address, kind.as_pointer()), arguments)


def _is_at_hand(term: Any) -> bool:
    """Whether a value costs so little that it may be computed even if it is not used."""
    return type(term) in (int, float) or term[0] == "get"
