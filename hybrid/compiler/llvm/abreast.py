"""The code of the series of runs abreast: a number in it is a register with one number of each run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

from llvmlite import ir

from hybrid.compiler.llvm.calls import CALLS, NUMBER, WHOLE
from hybrid.compiler.llvm.columns import write_convolved
from hybrid.compiler.llvm.lowering import TRUTH, Body
from hybrid.compiler.llvm.registers import joined
from hybrid.compiler.llvm.wanted import Signature
from hybrid.compiler.llvm.waves import sine
from hybrid.compiler.statements.code import LoweringError
from hybrid.kernels.instructions.loops import declared
from hybrid.kernels.instructions.registers import Matrix, everywhere, vector_of
from hybrid.kernels.types.codes import ABREAST, NARROW

ROW = vector_of(ABREAST)
MASK = ir.VectorType(TRUTH, ABREAST)
ABREAST_SIGNATURE = Signature(("index", "t", "x", "p", "order", "out"), (WHOLE, 1, 1, 1, WHOLE, 2))
# Functions that LLVM has for whole registers; of the others, each number of a register is taken by itself.
OF_REGISTERS = {
    **{name: name for name in ("sqrt", "copysign")},
    **{f"np.{name}": name for name in ("floor", "ceil", "trunc", "rint")},
    "abs": "fabs",
}
# Operations that are functions, and other functions of one number at a time.
NAMED: Mapping[str, str] = {"%": "remainder", "**": "pow"}
EACH = ("cos", "exp", "log", "log10", "log2", "pow", "sin")


class AbreastBody(Body):
    """Writes the instructions of the series of runs abreast.

    Whole numbers are the same for all runs, and so are the conditions that compare them.
    """

    def value(self, term: Any) -> Any:
        """Write a term, and return its value."""
        return self._all(NUMBER(term)) if type(term) is float else super().value(term)

    def number(self, value: Any) -> Any:
        """A value as one number of each run."""
        if value.type == WHOLE:
            value = self.builder.sitofp(value, NUMBER)
        return self._all(value) if value.type == NUMBER else value

    def truth(self, term: Any) -> Any:
        """A term as a condition."""
        value = self.value(term)
        if value.type not in (TRUTH, MASK):
            raise LoweringError(f"{term} is no condition")
        return value

    def _all(self, number: Any) -> Any:
        if isinstance(number, ir.Constant):
            return ROW([number.constant] * ABREAST)
        return everywhere(self.builder, number, ABREAST)

    def _place(self, array: Any, indices: Sequence[Any]) -> Any:
        """The address of the first number of an entry."""
        places = [self.value(each) for each in indices]
        last = self.builder.mul(places[-1], WHOLE(ABREAST))
        if isinstance(array, Matrix):
            return array.address(places[0], last)
        return self.builder.gep(array.data, [last], source_etype=NUMBER)

    def _at(self, _: str, name: str, *indices: Any) -> Any:
        if name in self.arrays:
            raise LoweringError("arrays of a function are not known for runs abreast")
        return self.builder.load(self._place(self.values[name], indices), align=8, typ=ROW)

    def _set_entry(self, array: Any, indices: Sequence[Any], value: Any) -> None:
        address = self._place(array, indices)
        self.builder.store(self.number(value), self.builder.bitcast(address, ROW.as_pointer()), align=8)

    def _get(self, _: str, name: str) -> Any:
        if name == "t":
            return self.builder.load(self.values["t"].data, align=8, typ=ROW)
        return super()._get(_, name)

    def _listed(self, _: str, numbers: Sequence[Any], index: Any) -> Any:
        value = super()._listed(_, numbers, index)
        return value if value.type == WHOLE else self.number(value)

    def _length(self, _: str, array: str) -> Any:
        return self.builder.sdiv(self.values[array].length, WHOLE(ABREAST))

    def _negative(self, _: str, term: Any) -> Any:
        value = self.value(term)
        return self.builder.neg(value) if value.type == WHOLE else self.builder.fneg(value, flags=self.flags)

    def _both(self, _: str, a: Any, b: Any) -> Any:
        return self.builder.and_(*self._alike(a, b))

    def _either(self, _: str, a: Any, b: Any) -> Any:
        return self.builder.or_(*self._alike(a, b))

    def _alike(self, *terms: Any) -> list[Any]:
        """Conditions that may be combined: of each run, if one of them is."""
        values = [self.truth(each) for each in terms]
        if all(each.type == TRUTH for each in values):
            return values
        return [
            each if each.type == MASK else everywhere_true(self.builder, each, ABREAST) for each in values
        ]

    def _if(self, _: str, condition: Any, *branches: Any) -> Any:
        decided = self.truth(condition)
        return self.builder.select(decided, *(self.number(self.value(each)) for each in branches))

    def _when(self, condition: Any, body: Sequence[Any], other: Sequence[Any]) -> None:
        if self.truth(condition).type != TRUTH:
            raise LoweringError("a branch is taken by all runs abreast, or by none")
        super()._when(condition, body, other)

    def _convolved(self, _: str, __: Any, order: Any, lefts: Any, rights: Any, known: int) -> tuple[Any, ...]:
        """As ``convolved_pairs``, for the sums of two orders of several pairs."""
        builder, found = self.builder, dict[str, Any]()
        for each in (*lefts[1:], *rights[1:]):
            # Pairs with one first factor have one value for it, and read it once.
            found.setdefault(repr(each), builder.mul(self.value(each), WHOLE(ABREAST)))
        firsts, seconds = ([found[repr(each)] for each in terms[1:]] for terms in (lefts, rights))
        widths, at, fours = [ABREAST] * len(firsts), self.value(order), ABREAST // NARROW
        sums = write_convolved(builder, self.values["out"], at, firsts, seconds, widths, known, pairs=True)
        return tuple(joined(builder, sums[i : i + fours]) for i in range(0, len(sums), fours))

    def _call(self, name: str, terms: Sequence[Any]) -> Any:
        if name not in CALLS or not (CALLS[name].on_numbers or name in OF_REGISTERS or name in EACH):
            raise LoweringError(f"runs abreast do not have {name}")
        return self._function(name, [self.number(self.value(term)) for term in terms])

    def _function(self, name: str, registers: Sequence[Any]) -> Any:
        builder = self.builder
        if name == "max":
            return CALLS[name](builder, *registers)
        if name in ("sin", "cos"):
            return sine(builder, *registers, shift=int(name == "cos"))
        if name in OF_REGISTERS:
            kind = ir.FunctionType(ROW, [ROW] * len(registers))
            function = declared(builder.module, kind, f"llvm.{OF_REGISTERS[name]}.v{ABREAST}f64")
            return builder.call(function, registers)
        result = ROW(ir.Undefined)
        for lane in range(ABREAST):
            place = ir.IntType(32)(lane)
            numbers = [builder.extract_element(each, place) for each in registers]
            result = builder.insert_element(result, CALLS[name](builder, *numbers), place)
        return result

    def _arithmetic(self, operation: str, left: Any, right: Any) -> Any:
        a, b = self.value(left), self.value(right)
        if a.type == b.type == WHOLE and operation in self.WHOLE_OPERATIONS:
            return self.WHOLE_OPERATIONS[operation](self.builder, a, b)
        a, b = self.number(a), self.number(b)
        if operation in NAMED:
            return self._function(NAMED[operation], [a, b])
        return self.OPERATIONS[operation](self.builder, a, b, flags=self.flags)

    TERMS: ClassVar[dict[str, Callable[..., Any]]] = {
        **Body.TERMS,
        **dict.fromkeys(("+", "-", "*", "/", "//", "**", "%"), _arithmetic),
        "convolved": _convolved,
        "at": _at,
        "listed": _listed,
        "get": _get,
        "neg": _negative,
        "and": _both,
        "or": _either,
        "if": _if,
        "length": _length,
    }
    STATEMENTS: ClassVar[dict[str, Callable[..., None]]] = {**Body.STATEMENTS, "when": _when}


def everywhere_true(builder: Any, condition: Any, width: int) -> Any:
    """One condition in every lane."""
    nothing = ir.VectorType(TRUTH, width)(ir.Undefined)
    vector = builder.insert_element(nothing, condition, ir.IntType(32)(0))
    return builder.shuffle_vector(vector, nothing, ir.VectorType(ir.IntType(32), width)([0] * width))
