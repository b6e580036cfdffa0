"""LLVM's instructions as lines of text, written immediately.

llvmlite creates an object with operands for each instruction and writes all of them as text at the end.
Nearly all instructions of a model are loads, stores, addresses and arithmetic: this module writes their text
immediately.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir


class Line:
    """The text of an instruction; the object also represents the value of the instruction."""

    __slots__ = ("reference", "text", "type")

    def __init__(self, kind: Any, reference: str, text: str) -> None:
        self.type, self.reference, self.text = kind, reference, text

    def __str__(self) -> str:
        return self.text

    def get_reference(self) -> str:
        """Name of the value in other instructions."""
        return self.reference


def _text(kind: Any) -> str:
    """A type as LLVM's text, kept with the type: each model has types of its own."""
    found: str | None = getattr(kind, "text_of_line", None)
    if found is None:
        found = kind.text_of_line = str(kind)
    return found


def _reference(value: Any) -> str:
    return value.reference if type(value) is Line else str(value.get_reference())


def _arithmetic(operation: str) -> Callable[..., Line]:
    def write(self: Builder, a: Any, b: Any, name: str = "", flags: Sequence[str] = ()) -> Line:
        if a.type != b.type:
            raise ValueError(f"{operation} of {a.type} and {b.type}: the types must be equal")
        words = " ".join((operation, *flags, _text(a.type)))
        return self.written(a.type, f"{words} {_reference(a)}, {_reference(b)}")

    return write


class Builder(ir.IRBuilder):
    """A builder of llvmlite that writes the most common instructions as lines of text."""

    count = 0
    # The vector registers of the processor that code is written for.
    vectors: Any = None

    def written(self, kind: Any, text: str) -> Line:
        """Add an instruction whose value has this type."""
        self.count += 1
        reference = f'%"line.{self.count}"'
        return self._added(Line(kind, reference, f"{reference} = {text}"))

    def _added(self, line: Line) -> Line:
        self._block.instructions.insert(self._anchor, line)
        self._anchor += 1
        return line

    add, sub, mul = map(_arithmetic, ("add", "sub", "mul"))
    fadd, fsub, fmul, fdiv = map(_arithmetic, ("fadd", "fsub", "fmul", "fdiv"))

    def load(self, ptr: Any, name: str = "", align: int | None = None, typ: Any = None) -> Line:
        """The value stored at an address, of this type, or that of the variable at the address."""
        kind = typ or ptr.allocated_type
        text = f"load {_text(kind)}, {_text(ptr.type)} {_reference(ptr)}"
        return self.written(kind, text if align is None else f"{text}, align {align}")

    def store(self, value: Any, ptr: Any, align: int | None = None, *, whole: bool = False) -> Line:
        """Store a value at an address; ``whole`` as one register, also where LLVM would store its halves."""
        if not ptr.type.is_opaque and ptr.type.pointee != value.type:
            raise TypeError(f"{value.type} cannot be stored at {ptr.type}")
        words = "store volatile" if whole else "store"
        text = f"{words} {_text(value.type)} {_reference(value)}, {_text(ptr.type)} {_reference(ptr)}"
        return self._added(Line(ir.VoidType(), "", text if align is None else f"{text}, align {align}"))

    def gep(self, ptr: Any, indices: Sequence[Any], *, source_etype: Any) -> Any:
        """The address ``indices[0]`` entries of a type after ``ptr``; ``indices`` has one entry."""
        [index] = indices
        entry, place = _text(source_etype), f"{_text(index.type)} {_reference(index)}"
        return self.written(ptr.type, f"getelementptr {entry}, {_text(ptr.type)} {_reference(ptr)}, {place}")

    def bitcast(self, value: Any, typ: Any, name: str = "") -> Any:
        """The same bits as a value of another type."""
        if value.type == typ:
            return value
        return self.written(typ, f"bitcast {_text(value.type)} {_reference(value)} to {_text(typ)}")
