"""Generated functions as LLVM's instructions, translated directly from their text.

The text is Python on numbers: assignments, arithmetic, branches, loops over ranges, entries of arrays, and
calls of ``CALLS``. The text alone gives the type of each value: a float, a 64-bit integer, a truth value, or
four numbers in a register. So no types have to be inferred, and a function is ready in milliseconds.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import reduce
from typing import Any, ClassVar

import attrs
from llvmlite import ir

from hybrid.compiler.llvm.calls import CALLS, NUMBER, WHOLE, Call
from hybrid.kernels.instructions.loops import loop
from hybrid.kernels.instructions.registers import Matrix, everywhere, vector_of
from hybrid.kernels.types.codes import NARROW
from hybrid.kernels.types.numba_door.builder import Builder
from hybrid.symbolic.branches import PARSER

TRUTH = ir.IntType(1)
ADDRESS = ir.PointerType()
LANES = vector_of(NARROW)
# Numba's structure of an array of floats: memory info, parent, number of items, bytes per item, data, shape,
# strides.
ARRAYS = {
    axes: ir.LiteralStructType(
        [
            ADDRESS,
            ADDRESS,
            WHOLE,
            WHOLE,
            ADDRESS,
            ir.ArrayType(WHOLE, axes),
            ir.ArrayType(WHOLE, axes),
        ]
    )
    for axes in (1, 2)
}
DATA, SHAPE = 4, 5
COMPARISONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}


class LoweringError(Exception):
    """A text uses syntax that generated functions do not have."""


@attrs.frozen
class Vector:
    """An array of numbers: the address of its data, and its length."""

    data: Any
    length: Any


@attrs.frozen
class OwnFunction:
    """A function of the user: the address of its machine code, and the number of values that it writes."""

    address: int
    size: int


@attrs.frozen
class CaseTable:
    """The cases of a function that are compiled already: where the address of each, by index, is stored.

    They take the arguments of the function.
    """

    address: int


NO_CALLS: Mapping[str, OwnFunction | CaseTable] = {}


@attrs.frozen
class Signature:
    """Names and types of the arguments of a function; an integer is an array with that number of axes."""

    names: tuple[str, ...]
    types: tuple[Any, ...]


VECTOR_SIGNATURE = Signature(("index", "t", "x", "p", "out"), (WHOLE, NUMBER, 1, 1, 1))
MATRIX_SIGNATURE = Signature(("index", "t", "x", "p", "out"), (WHOLE, NUMBER, 1, 1, 2))
SERIES_SIGNATURE = Signature(("index", "t", "x", "p", "order", "out"), (WHOLE, NUMBER, 1, 1, WHOLE, 2))


def lower(
    module: Any,
    written: ast.FunctionDef,
    signature: Signature,
    *,
    fused: bool,
    calls: Mapping[str, OwnFunction | CaseTable] = NO_CALLS,
) -> None:
    """Add a function to an LLVM module.

    Parameters
    ----------
    module
        The module, an ``llvmlite.ir.Module``.
    written
        The parsed function.
    signature
        Types of its arguments.
    fused
        Whether multiplications and additions may be fused.
    calls
        Functions of the user, and tables of cases, that the text may also call.

    Raises
    ------
    LoweringError
        If the function has other arguments, or syntax that generated text does not have.
    """
    names = tuple(argument.arg for argument in written.args.args)
    if names != signature.names:
        raise LoweringError(f"{written.name} takes {names}; a function of its kind takes {signature.names}")
    kinds = [ARRAYS.get(kind, kind) for kind in signature.types]
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), written.name)
    function.attributes.add("nounwind")
    _Body(function, signature, ("contract",) if fused else (), calls).write(written.body)


class _Body:
    """Writes the instructions of one function."""

    def __init__(
        self,
        function: Any,
        signature: Signature,
        flags: tuple[str, ...],
        calls: Mapping[str, OwnFunction | CaseTable],
    ) -> None:
        self.flags, self.calls = flags, calls
        self.arguments = dict(zip(signature.names, function.args, strict=True))
        # Variables are allocated in the first block: LLVM turns only those into registers.
        self.front = ir.IRBuilder(function.append_basic_block("front"))
        self.builder = Builder(function.append_basic_block("body"))
        self.values: dict[str, Any] = {}
        self.variables: dict[str, Any] = {}
        for name, kind, argument in zip(signature.names, signature.types, function.args, strict=True):
            self.values[name] = argument if kind not in ARRAYS else self._array(kind, argument)

    def _array(self, axes: int, argument: Any) -> Vector | Matrix:
        data = self.builder.extract_value(argument, DATA)
        sizes = [self.builder.extract_value(argument, [SHAPE, axis]) for axis in range(axes)]
        return Vector(data, sizes[0]) if axes == 1 else Matrix(self.builder, data, sizes[1])

    def write(self, statements: Iterable[ast.stmt]) -> None:
        """Write the whole function."""
        self.block(statements)
        self.builder.ret_void()
        front, body, *_ = self.builder.function.basic_blocks
        self.front.position_at_end(front)
        self.front.branch(body)

    def block(self, statements: Iterable[ast.stmt]) -> None:
        """Write statements in order."""
        for statement in statements:
            self.STATEMENTS.get(type(statement), _Body._unknown)(self, statement)

    def value(self, node: ast.expr) -> Any:
        """Write an expression, and return its value."""
        return self.EXPRESSIONS.get(type(node), _Body._unknown)(self, node)

    def _unknown(self, node: ast.AST) -> Any:
        raise LoweringError(f"generated text must not contain {ast.unparse(node)!r}")

    # Statements.

    def _pass(self, node: ast.Pass) -> None:
        pass

    def _assign(self, node: ast.Assign) -> None:
        value = self.value(node.value)
        for target in node.targets:
            self._store(target, value)

    def _store(self, target: ast.expr, value: Any) -> None:
        if isinstance(target, ast.Tuple):
            for each, part in zip(target.elts, value, strict=True):
                self._store(each, part)
        elif isinstance(target, ast.Subscript):
            self.builder.store(self.number(value), self._place(target))
        elif isinstance(target, ast.Name):
            self._store_variable(target.id, value)
        else:
            self._unknown(target)

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
        if kept == NUMBER:
            value = self.number(value)
        if kept != value.type:
            raise LoweringError(f"{name} is {kept} in one place and {value.type} in another")
        self.builder.store(value, variable)

    def _expression(self, node: ast.Expr) -> None:
        self.value(node.value)

    def _if(self, node: ast.If) -> None:
        """A chain of branches, without recursion: functions have one branch per mode or transition."""
        builder, before = self.builder, dict(self.variables)
        end = builder.append_basic_block("end")
        rest: list[ast.stmt] = [node]
        while len(rest) == 1 and isinstance(each := rest[0], ast.If):
            then, otherwise = builder.append_basic_block("then"), builder.append_basic_block("else")
            builder.cbranch(self.truth(each.test), then, otherwise)
            builder.position_at_end(then)
            self.block(each.body)
            builder.branch(end)
            builder.position_at_end(otherwise)
            # A variable first assigned in a branch is unknown after it: the other branches have not set it.
            self.variables, rest = dict(before), each.orelse
        self.block(rest)
        builder.branch(end)
        builder.position_at_end(end)
        self.variables = before

    def _for(self, node: ast.For) -> None:
        assert isinstance(node.iter, ast.Call)
        bounds = [self.value(argument) for argument in node.iter.args]
        start, stop, step = (WHOLE(0), *bounds, WHOLE(1)) if len(bounds) == 1 else (*bounds, WHOLE(1))[:3]
        with loop(self.builder, start, stop, step) as index:
            self._store(node.target, index)
            self.block(node.body)

    STATEMENTS: ClassVar[dict[type[ast.AST], Callable[[_Body, Any], None]]] = {
        ast.Pass: _pass,
        ast.Assign: _assign,
        ast.Expr: _expression,
        ast.If: _if,
        ast.For: _for,
    }

    # Expressions.

    def number(self, value: Any) -> Any:
        """A value as a float."""
        return self.builder.sitofp(value, NUMBER) if value.type == WHOLE else value

    def _constant(self, node: ast.Constant) -> Any:
        if type(node.value) is int:
            return WHOLE(node.value)
        if type(node.value) is float:
            return NUMBER(node.value)
        return self._unknown(node)

    def _name(self, node: ast.Name) -> Any:
        if node.id in self.values:
            return self.values[node.id]
        if node.id in self.variables:
            variable = self.variables[node.id]
            return variable if isinstance(variable, tuple) else self.builder.load(variable)
        if node.id in ("inf", "nan"):
            return NUMBER(float(node.id))
        return self._unknown(node)

    def _tuple(self, node: ast.Tuple) -> tuple[Any, ...]:
        return tuple(self.value(each) for each in node.elts)

    def _place(self, node: ast.Subscript) -> Any:
        """The address of an entry."""
        array, index = self.value(node.value), self.value(node.slice)
        if isinstance(array, Matrix):
            return array.address(*index)
        return self.builder.gep(array.data, [index], source_etype=NUMBER)

    def _subscript(self, node: ast.Subscript) -> Any:
        value = self.value(node.value)
        if isinstance(value, tuple):
            return value[ast.literal_eval(node.slice)]
        return self.builder.load(self._place(node), typ=NUMBER)

    def _negative(self, node: ast.UnaryOp) -> Any:
        if not isinstance(node.op, ast.USub):
            return self._unknown(node)
        value = self.value(node.operand)
        if value.type == WHOLE:
            return self.builder.neg(value)
        if value.type == LANES:
            # A product, since it can be fused with an addition.
            return self.builder.fmul(everywhere(self.builder, NUMBER(-1.0), NARROW), value, flags=self.flags)
        return self.builder.fneg(value, flags=self.flags)

    def _operation(self, node: ast.BinOp) -> Any:
        a, b = self.value(node.left), self.value(node.right)
        kind = type(node.op)
        if kind in self.WHOLE_OPERATIONS and a.type == b.type == WHOLE:
            return self.WHOLE_OPERATIONS[kind](self.builder, a, b)
        if kind not in self.OPERATIONS:
            return self._unknown(node)
        a, b = self.number(a), self.number(b)
        if LANES in (a.type, b.type):
            a, b = (each if each.type == LANES else everywhere(self.builder, each, NARROW) for each in (a, b))
        return self.OPERATIONS[kind](self.builder, a, b, flags=self.flags)

    OPERATIONS: ClassVar[dict[type[ast.AST], Callable[..., Any]]] = {
        ast.Add: Builder.fadd,
        ast.Sub: Builder.fsub,
        ast.Mult: Builder.fmul,
        ast.Div: Builder.fdiv,
        ast.Mod: lambda builder, a, b, flags: CALLS["remainder"](builder, a, b),
        ast.Pow: lambda builder, a, b, flags: CALLS["pow"](builder, a, b),
    }
    # Integers are counts here. They are not negative in a division, so ``sdiv`` equals ``//``.
    WHOLE_OPERATIONS: ClassVar[dict[type[ast.AST], Callable[..., Any]]] = {
        ast.Add: Builder.add,
        ast.Sub: Builder.sub,
        ast.Mult: Builder.mul,
        ast.FloorDiv: ir.IRBuilder.sdiv,
    }

    def truth(self, node: ast.expr) -> Any:
        """An expression as a condition."""
        value = self.value(node)
        if value.type != TRUTH:
            return self._unknown(node)
        return value

    def _comparison(self, node: ast.Compare) -> Any:
        values = [self.value(each) for each in (node.left, *node.comparators)]
        pairs = zip(node.ops, values, values[1:], strict=False)
        return reduce(self.builder.and_, [self._compared(type(op), a, b) for op, a, b in pairs])

    def _compared(self, kind: type[ast.cmpop], a: Any, b: Any) -> Any:
        symbol = COMPARISONS[kind]
        if a.type == b.type == WHOLE:
            return self.builder.icmp_signed(symbol, a, b)
        compare = self.builder.fcmp_unordered if symbol == "!=" else self.builder.fcmp_ordered
        return compare(symbol, self.number(a), self.number(b))

    def _connective(self, node: ast.BoolOp) -> Any:
        join = self.builder.and_ if isinstance(node.op, ast.And) else self.builder.or_
        return reduce(join, [self.truth(each) for each in node.values])

    def _not(self, node: ast.UnaryOp) -> Any:
        return self.builder.not_(self.truth(node.operand))

    def _unary(self, node: ast.UnaryOp) -> Any:
        return self._not(node) if isinstance(node.op, ast.Not) else self._negative(node)

    def _choice(self, node: ast.IfExp) -> Any:
        condition = self.truth(node.test)
        if all(_is_at_hand(each) for each in (node.body, node.orelse)):
            return self.builder.select(
                condition, *(self.number(self.value(e)) for e in (node.body, node.orelse))
            )
        result = self.front.alloca(NUMBER)
        with self.builder.if_else(condition) as (then, otherwise):
            for branch, each in ((then, node.body), (otherwise, node.orelse)):
                with branch:
                    self.builder.store(self.number(self.value(each)), result)
        return self.builder.load(result)

    def _call(self, node: ast.Call) -> Any:
        name = ast.unparse(node.func)
        if name == "len":
            [array] = (self.value(each) for each in node.args)
            return array.length
        known = self.calls.get(name)
        if isinstance(known, CaseTable):
            table = self.builder.inttoptr(WHOLE(known.address), ADDRESS)
            place = self.builder.gep(table, [self.arguments["index"]], source_etype=WHOLE)
            address = self.builder.load(place, typ=WHOLE)
            return self._called(address, [*self.arguments.values()])
        if known is not None:
            return self._own_call(known, node.args)
        call: Call | None = CALLS.get(name)
        if call is None:
            return self._unknown(node)
        arguments = [self._argument(call, i, each) for i, each in enumerate(node.args)]
        return call(self.builder, *arguments)

    def _own_call(self, function: OwnFunction, nodes: Sequence[ast.expr]) -> tuple[Any, ...]:
        """The numbers that a function of the user writes; array arguments are passed on unchanged."""
        names = [node.id if isinstance(node, ast.Name) else "" for node in nodes]
        pairs = zip(names, nodes, strict=True)
        arguments = [self.arguments[name] if name in self.arguments else self.value(n) for name, n in pairs]
        numbers = self.front.alloca(NUMBER, WHOLE(function.size))
        row = ARRAYS[1](ir.Undefined)
        size, width = WHOLE(function.size), WHOLE(8)
        nobody = ADDRESS(None)
        for place, part in enumerate((nobody, nobody, size, width, numbers)):
            row = self.builder.insert_value(row, part, place)
        for place, part in ((SHAPE, size), (SHAPE + 1, width)):
            row = self.builder.insert_value(row, part, [place, 0])
        arguments.append(row)
        self._called(WHOLE(function.address), arguments)
        places = [self.builder.gep(numbers, [WHOLE(i)], source_etype=NUMBER) for i in range(function.size)]
        return tuple(self.builder.load(place, typ=NUMBER) for place in places)

    def _called(self, address: Any, arguments: Sequence[Any]) -> None:
        """A call of machine code of this process; llvmlite still asks its address for the signature."""
        kind = ir.FunctionType(ir.VoidType(), [each.type for each in arguments])
        self.builder.call(self.builder.inttoptr(address, kind.as_pointer()), arguments)

    def _argument(self, call: Call, place: int, node: ast.expr) -> Any:
        if place in call.known:
            return ast.literal_eval(node)
        value = self.value(node)
        if isinstance(value, tuple):
            return [self.number(each) for each in value]
        return self.number(value) if call.on_numbers else value

    EXPRESSIONS: ClassVar[dict[type[ast.AST], Callable[[_Body, Any], Any]]] = {
        ast.Constant: _constant,
        ast.Name: _name,
        ast.Tuple: _tuple,
        ast.Subscript: _subscript,
        ast.UnaryOp: _unary,
        ast.BinOp: _operation,
        ast.Compare: _comparison,
        ast.BoolOp: _connective,
        ast.IfExp: _choice,
        ast.Call: _call,
    }


def _is_at_hand(node: ast.expr) -> bool:
    """Whether a value costs so little that it may be computed even if it is not used."""
    if isinstance(node, ast.UnaryOp):
        return _is_at_hand(node.operand)
    return isinstance(node, ast.Name | ast.Constant)


def parsed(source: str) -> dict[str, ast.FunctionDef]:
    """The functions of a text, by name."""
    with PARSER:
        nodes: Sequence[ast.stmt] = ast.parse(source).body
    return {node.name: node for node in nodes if isinstance(node, ast.FunctionDef)}
