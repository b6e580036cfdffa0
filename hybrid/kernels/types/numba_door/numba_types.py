"""How the compiler sees kinds and structures: a field is read from the table of words.

Only the compilation of kernels imports this module.
"""

from functools import cache
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    lower_setattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np.arrayobj import populate_array

from hybrid.kernels.types.kinds import TRUTH, Array, Function, Number, Pair, is_bundle
from hybrid.kernels.types.numba_door.lowering import WORD, array_of
from hybrid.kernels.types.structure import Structure


class StructureType(types.Type):
    """The compiler's type of a class of structures."""

    def __init__(self, kind):
        # The compiler takes types of one name for one type.
        super().__init__(f"{kind.__module__}.{kind.__qualname__}")
        self.entries = kind._entries
        self.places = kind._places
        self.fields = {name: numba_type(field) for name, field in kind._fields.items()}


@cache
def numba_type(kind):
    """The compiler's type of a kind, or of a class of structures; a function is a bare pointer."""
    if kind is None:
        return types.void
    if kind == TRUTH:
        return types.boolean
    if isinstance(kind, Number):
        return getattr(types, kind.dtype)
    if isinstance(kind, Array):
        return types.Array(getattr(types, kind.dtype), kind.ndim, "C")
    if isinstance(kind, Pair):
        return types.UniTuple(numba_type(kind.number), 2)
    if is_bundle(kind):
        return types.BaseTuple.from_types([numba_type(each) for each in kind.__annotations__.values()], kind)
    if isinstance(kind, Function):
        return types.ExternalFunctionPointer(signature_of(kind.result, *kind.arguments), None)  # type: ignore[arg-type]
    return StructureType(kind)


def signature_of(result, *arguments):
    """The signature of a function whose result and arguments are of these kinds."""
    return numba_type(result)(*map(numba_type, arguments))


@register_model(StructureType)
class _Address(models.OpaqueModel):
    pass


@typeof_impl.register(Structure)
def _typeof(value, context):
    kind: Any = type(value)
    return numba_type(kind)


@unbox(StructureType)
def _unbox(kind, value, c):
    address = c.pyapi.object_getattr_string(value, "address")
    pointer = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    return NativeValue(pointer)


@infer_getattr
class _Fields(AttributeTemplate):
    key = StructureType

    def generic_resolve(self, value, attr):  # type: ignore[override]
        if attr in value.entries:
            kind = value.fields[value.entries[attr][0]]
            return kind.dtype if kind.ndim == 1 else _column_type(kind)
        return value.fields.get(attr)


@lower_getattr_generic(StructureType)
def _field(context, builder, structure, address, field):
    if field in structure.entries:
        return _entry_of(context, builder, structure, address, field)
    kind = structure.fields[field]
    place = structure.places[field]

    def word(offset, llvm_type):
        return word_in(context, builder, address, place + offset, llvm_type)

    if isinstance(kind, types.Array):
        return array_in(context, builder, kind, word)
    return word(0, context.get_value_type(kind))


@lower_setattr_generic(StructureType)
def _set_entry(context, builder, signature, arguments, field):
    structure, _ = signature.args
    address, value = arguments
    builder.store(value, _place_of_entry(context, builder, structure, address, field))


def _column_type(kind):
    """The type of a column of a matrix: its numbers lie a row apart."""
    return kind.copy(ndim=1, layout="A")


def _entry_of(context, builder, structure, address, name):
    """The value of a named entry of a vector, or the named column of a matrix."""
    field, _ = structure.entries[name]
    kind = structure.fields[field]
    if kind.ndim == 1:
        entry = _place_of_entry(context, builder, structure, address, name)
        return builder.load(entry, typ=context.get_value_type(kind.dtype))
    place, integer = structure.places[field], context.get_value_type(types.intp)
    rows, width = (word_in(context, builder, address, place + axis, integer) for axis in (1, 2))
    itemsize = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    column = context.make_array(_column_type(kind))(context, builder)
    data = _place_of_entry(context, builder, structure, address, name)
    strides = [builder.mul(width, itemsize)]
    populate_array(column, data=data, shape=[rows], strides=strides, itemsize=itemsize, meminfo=None)
    return column._getvalue()


def _place_of_entry(context, builder, structure, address, name):
    """Address of a named entry."""
    field, index = structure.entries[name]
    array = word_in(context, builder, address, structure.places[field], ir.PointerType())
    place = context.get_constant(types.intp, index)
    number = context.get_value_type(structure.fields[field].dtype)
    return builder.gep(array, [place], inbounds=True, source_etype=number)


def word_in(context, builder, address, place, llvm_type):
    """A word of the table, which never changes."""
    word = builder.gep(address, [context.get_constant(types.intp, place)], source_etype=WORD)
    loaded = builder.load(word, typ=llvm_type)
    loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
    return loaded


def array_in(context, builder, kind, word):
    """An array that owns nothing: the structure on the side of Python keeps its memory."""
    integer = context.get_value_type(types.intp)
    shape = [word(1 + axis, integer) for axis in range(kind.ndim)]
    return array_of(context, builder, kind, word(0, ir.PointerType()), shape)
