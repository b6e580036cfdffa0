"""Named arrays, numbers and functions that cross from one kernel to another as a single address.

A tuple of two dozen arrays is two hundred machine words, copied at every call and again for every kernel
that the compiler has to build. A structure is a table of words in memory instead: its class lists the fields
and their numba types, an instance fills the table once, and ``work.gradient`` in a kernel reads the array's
address and shape there. What the table holds never changes, so the compiler reads it once, not in each turn
of a loop; what the arrays hold may change freely.

Structures that are made again and again, with other numbers in arrays of the same shapes, come from a
``Layout``.
"""

import math
import struct
from ctypes import addressof, c_char

import numpy as np
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

# Bytes of a word of a table, of a number in an array, and of a cache line.
WORD = 8
LINE = 64
# Structures that a layout keeps for later: a few threads at work at once.
MOST_SPARES = 4


class StructureType(types.Type):
    """The numba type of a structure: its name, the numba types of its ``fields``, and its named entries.

    ``entries`` maps a name to the array field that holds it and to its index there: a number of a vector, or
    a column of a matrix.
    """

    def __init__(self, name, fields, entries):
        super().__init__(name)
        self.fields = fields
        self.entries = entries

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

    Numbers that change during a run are entries of an array. They have names, in the order of the entries:
    after ``class Run(Structure, counters=("mode", "cycle"))``, ``run.mode`` reads and writes
    ``run.counters[0]``, in a kernel and in Python. The columns of a matrix have names in the same way.
    """

    def __init_subclass__(cls, **named_entries):
        """Derive the numba type from the annotations and from the names of entries."""
        entries = {
            name: (field, index) for field, names in named_entries.items() for index, name in enumerate(names)
        }
        cls.numba_type = StructureType(cls.__name__, cls.__annotations__, entries)
        for name, (field, index) in entries.items():
            setattr(cls, name, _entry(field, index, cls.__annotations__[field].ndim))
        cls._entries = entries
        # Underscored: a field may have any other name.
        cls._words = {name: _words_of(name, kind) for name, kind in cls.__annotations__.items()}
        cls._places = {name: cls.numba_type.place(name) for name in cls.__annotations__}

    def __init__(self, **values):
        _check_fields(type(self), values)
        self.__dict__.update(values)
        words = []
        for name, words_of in self._words.items():
            words += words_of(values[name])
        self._fill(np.array(words, dtype=np.int64))

    def _fill(self, table):
        self.__dict__["table"] = table
        self.__dict__["address"] = _address(table)

    def __getattr__(self, name):
        """An array that came from a layout, when Python first looks at it."""
        known = self.__dict__
        if name not in known.get("_arrays", ()):
            raise AttributeError(f"{type(self).__name__} has no field {name!r}.")
        shape, dtype, offset = known["_arrays"][name]
        known[name] = view = np.ndarray(shape, dtype, known["_memory"], known["_begin"] + offset)
        return view

    def saved(self):
        """A copy of what the arrays hold, for ``restore``; the structure came from a layout."""
        return self._memory.copy()

    def restore(self, saved):
        """Put back what the arrays held."""
        self._memory[:] = saved

    def __setattr__(self, name, value):
        entry = self._entries.get(name)
        if entry is not None:
            array = getattr(self, entry[0])
            array[entry[1] if array.ndim == 1 else (slice(None), entry[1])] = value
            return
        raise AttributeError(f"{type(self).__name__}.{name} is fixed; replace({name}=...) makes a copy.")

    def replace(self, **changes):
        """A copy with some fields changed."""
        copy, table = object.__new__(type(self)), self.table.copy()
        copy.__dict__.update(self.__dict__)
        for name, value in changes.items():
            place, words = self._places[name], self._words[name](value)
            if len(words) == 1:
                # Ten times as fast as a slice.
                table[place] = words[0]
            else:
                table[place : place + len(words)] = words
            copy.__dict__[name] = value
        copy._fill(table)
        return copy


class Layout:
    """Where the arrays of a structure lie in one block of memory, for one set of shapes.

    Each run needs dozens of arrays, and those of the next run have the same shapes. With their places worked
    out once, a structure is one allocation and one sum of addresses; views of the arrays are made where
    Python looks at them. Each array begins on a cache line. A layout never changes, so threads may share it.

    Parameters
    ----------
    kind
        The class of the structures.
    shapes
        Shape of each array that every structure has for itself, by name.
    shared
        The other fields, common to all structures.
    """

    def __init__(self, kind, shapes, **shared):
        self.kind, self.shared = kind, shared
        fields = kind.numba_type.fields
        _check_fields(kind, [*shapes, *shared])
        table, moving, offsets, end = [], [], {}, 0
        for name in fields:
            if name in shapes:
                offsets[name] = end
                entry = (end, *shapes[name])
                end += _whole_lines(math.prod(shapes[name]) * WORD)
            else:
                entry = kind._words[name](shared[name])
            table += entry
            moving += [name in shapes] + [False] * (len(entry) - 1)
        # The table itself comes first. An offset becomes an address when the block's own is added.
        head = _whole_lines(len(table) * WORD)
        self.spares = []
        self.head = head
        self.moving = np.array(moving, dtype=np.int64)
        self.table = np.array(table, dtype=np.int64) + head * self.moving
        self.length = head + end
        self.arrays = {
            name: (shapes[name], np.dtype(str(fields[name].dtype)), head + offset)
            for name, offset in offsets.items()
        }

    def zeros(self):
        """A structure whose arrays are zero."""
        spare = self._spare()
        if spare is None:
            return self._structure_in(np.zeros(self.length + LINE, dtype=np.uint8))
        spare._memory[spare._begin + self.head :] = 0
        return spare

    def unwritten(self):
        """A structure whose arrays hold what the memory held: for those who write before they read."""
        return self._spare() or self._structure_in(np.empty(self.length + LINE, dtype=np.uint8))

    def words(self, structure):
        """What the arrays of a structure hold, as one array of words that is a view."""
        begin = structure._begin
        return structure._memory[begin + self.head : begin + self.length].view(np.int64)

    def take_back(self, structure):
        """Keep a structure of this layout that nobody else holds any more, nor any of its arrays."""
        if len(self.spares) < MOST_SPARES:
            self.spares.append(structure)

    def _spare(self):
        try:
            return self.spares.pop()
        except IndexError:
            return None

    def _structure_in(self, memory):
        # Three times as fast again as the address of any array, which may be empty or read-only.
        start = addressof(c_char.from_buffer(memory))
        begin = -start % LINE
        table = np.ndarray(self.table.shape, np.int64, memory, begin)
        np.multiply(self.moving, start + begin, table)
        np.add(table, self.table, table)
        made = object.__new__(self.kind)
        made.__dict__.update(
            self.shared, table=table, address=start + begin, _memory=memory, _begin=begin, _arrays=self.arrays
        )
        return made


def _entry(field, index, ndim):
    """The property that reads a named entry of an array field."""
    if ndim > 1:
        return property(lambda structure: getattr(structure, field)[:, index])
    return property(lambda structure: getattr(structure, field).item(index))


def _check_fields(kind, given):
    fields = kind.numba_type.fields
    if set(given) != fields.keys():
        raise TypeError(f"{kind.__name__} has the fields {', '.join(fields)}; got {', '.join(given)}.")


def _whole_lines(size):
    """Bytes rounded up to whole cache lines."""
    return -(-size // LINE) * LINE


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
        if field in structure.entries:
            kind = structure.fields[structure.entries[field][0]]
            return kind.dtype if kind.ndim == 1 else _column_type(kind)
        return _seen_by_kernels(structure.fields.get(field))


def _seen_by_kernels(kind):
    """The type a field has in a kernel: a function is a bare pointer there, which costs nothing to call."""
    if isinstance(kind, types.FunctionType):
        return types.ExternalFunctionPointer(kind.signature, None)
    return kind


@lower_getattr_generic(StructureType)
def _field(context, builder, structure, address, field):
    if field in structure.entries:
        return _entry_of(context, builder, structure, address, field)
    kind = structure.fields[field]
    place = structure.place(field)

    def word(offset, llvm_type):
        return _word(context, builder, address, place + offset, llvm_type)

    if isinstance(kind, types.Array):
        return _array(context, builder, kind, word)
    return word(0, context.get_value_type(_seen_by_kernels(kind)))


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
        return builder.load(_place_of_entry(context, builder, structure, address, name))
    place, integer = structure.place(field), context.get_value_type(types.intp)
    rows, width = (_word(context, builder, address, place + axis, integer) for axis in (1, 2))
    itemsize = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    column = context.make_array(_column_type(kind))(context, builder)
    data = _place_of_entry(context, builder, structure, address, name)
    strides = [builder.mul(width, itemsize)]
    populate_array(column, data=data, shape=[rows], strides=strides, itemsize=itemsize, meminfo=None)
    return column._getvalue()


def _place_of_entry(context, builder, structure, address, name):
    """Address of a named entry."""
    field, index = structure.entries[name]
    pointer = context.get_value_type(structure.fields[field].dtype).as_pointer()
    array = _word(context, builder, address, structure.place(field), pointer)
    return builder.gep(array, [context.get_constant(types.intp, index)], inbounds=True)


def _word(context, builder, address, place, llvm_type):
    """A word of the table, which never changes."""
    table = builder.bitcast(address, llvm_type.as_pointer())
    loaded = builder.load(builder.gep(table, [context.get_constant(types.intp, place)]))
    loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
    return loaded


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
