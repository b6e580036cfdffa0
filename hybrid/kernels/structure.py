"""Named arrays, numbers and functions that cross from one kernel to another as a single address.

A tuple of two dozen arrays is two hundred machine words, copied at every call and again for every kernel
that the compiler has to build. A structure is a table of words in memory instead: its class lists the fields
and their numba types, an instance fills the table once, and ``work.gradient`` in a kernel reads the array's
address and shape there. What the table holds never changes, so the compiler reads it once, not in each turn
of a loop; what the arrays hold may change freely.
"""

import struct

import numpy as np
from numba import types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np.arrayobj import populate_array


class StructureType(types.Type):
    """The numba type of a structure: its name and the numba types of its ``fields``."""

    def __init__(self, name, fields):
        super().__init__(name)
        self.fields = fields

    def place(self, field):
        """First word of a field in the table."""
        place = 0
        for name, kind in self.fields.items():
            if name == field:
                break
            place += 1 + (kind.ndim if isinstance(kind, types.Array) else 0)
        return place


class Structure:
    """Base of the structures: subclasses annotate their fields with numba types.

    ``table`` holds the fields' words: a number itself, the address of a function or of another structure,
    the address and the shape of an array. The fields are fixed; ``replace`` makes a changed copy.
    """

    def __init_subclass__(cls):
        """Derive the numba type from the annotations."""
        cls.numba_type = StructureType(cls.__name__, cls.__annotations__)
        cls.words = {name: _words_of(name, kind) for name, kind in cls.__annotations__.items()}

    def __init__(self, **values):
        fields = self.numba_type.fields
        if values.keys() != fields.keys():
            raise TypeError(
                f"{type(self).__name__} has the fields {', '.join(fields)}; got {', '.join(values)}."
            )
        self.__dict__.update(values)
        words = []
        for name, words_of in self.words.items():
            words += words_of(values[name])
        self._fill(np.array(words, dtype=np.int64))

    def _fill(self, table):
        self.__dict__["table"] = table
        self.__dict__["address"] = _address(table)

    def __setattr__(self, name, value):
        raise AttributeError(f"{type(self).__name__}.{name} is fixed; replace({name}=...) makes a copy.")

    def replace(self, **changes):
        """A copy with some fields changed."""
        copy, table = object.__new__(type(self)), self.table.copy()
        copy.__dict__.update(self.__dict__)
        for name, value in changes.items():
            place, words = self.numba_type.place(name), self.words[name](value)
            table[place : place + len(words)] = words
            copy.__dict__[name] = value
        copy._fill(table)
        return copy


def _address(array):
    # Ten times as fast as its ctypes view.
    return array.__array_interface__["data"][0]


def _array_words(name, kind):
    dtype, ndim = np.dtype(str(kind.dtype)), kind.ndim

    def words(value):
        fits = isinstance(value, np.ndarray) and value.ndim == ndim and value.flags.c_contiguous
        if not fits or value.dtype != dtype:
            raise TypeError(f"{name} must be a contiguous array of type {kind}; got {value!r}.")
        return (_address(value), *value.shape)

    return words


def _words_of(name, kind):
    """The function that turns a field into words. Structures are made for every run, so it is quick."""
    if isinstance(kind, types.Array):
        return _array_words(name, kind)
    if isinstance(kind, types.Float):
        return lambda value: struct.unpack("q", struct.pack("d", value))
    if isinstance(kind, StructureType | types.FunctionType):
        return lambda value: (value.address,)
    return lambda value: (int(value),)


@register_model(StructureType)
class _Address(models.OpaqueModel):
    pass


@typeof_impl.register(Structure)
def _typeof(value, context):
    return value.numba_type


@unbox(StructureType)
def _unbox(kind, value, c):
    address = c.pyapi.object_getattr_string(value, "address")
    pointer = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    return NativeValue(pointer)


@infer_getattr
class _Fields(AttributeTemplate):
    key = StructureType

    def generic_resolve(self, structure, field):
        return _seen_by_kernels(structure.fields.get(field))


def _seen_by_kernels(kind):
    """The type a field has in a kernel: a function is a bare pointer there, which costs nothing to call."""
    if isinstance(kind, types.FunctionType):
        return types.ExternalFunctionPointer(kind.signature, None)
    return kind


@lower_getattr_generic(StructureType)
def _field(context, builder, structure, address, field):
    kind = structure.fields[field]
    place = structure.place(field)

    def word(offset, llvm_type):
        table = builder.bitcast(address, llvm_type.as_pointer())
        loaded = builder.load(builder.gep(table, [context.get_constant(types.intp, place + offset)]))
        loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
        return loaded

    if isinstance(kind, types.Array):
        return _array(context, builder, kind, word)
    return word(0, context.get_value_type(_seen_by_kernels(kind)))


def _array(context, builder, kind, word):
    """An array that owns nothing: the structure on the side of Python keeps its memory."""
    integer = context.get_value_type(types.intp)
    shape = [word(1 + axis, integer) for axis in range(kind.ndim)]
    itemsize = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    strides = [itemsize]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    array = context.make_array(kind)(context, builder)
    data = word(0, context.get_data_type(kind.dtype).as_pointer())
    populate_array(array, data=data, shape=shape, strides=strides, itemsize=itemsize, meminfo=None)
    return array._getvalue()
