"""Named arrays, numbers and functions that cross from one kernel to another as a single address.

A tuple of two dozen arrays is two hundred machine words, copied at every call and again for every kernel
that the compiler has to build. A structure is a table of words in memory instead: its class lists the fields
and their kinds, an instance fills the table once, and ``work.gradient`` in a kernel reads the array's
address and shape there. What the table holds never changes, so the compiler reads it once, not in each turn
of a loop; what the arrays hold may change freely.

Structures that are made again and again, with other numbers in arrays of the same shapes, come from a
``Layout``.
"""

import math
from ctypes import addressof, c_char
from itertools import accumulate
from typing import Any, ClassVar

import numpy as np

from hybrid.kernels.types.kinds import address_of, width_of, words_of

# Bytes of a word of a table, of a number in an array, and of a cache line.
WORD = 8
LINE = 64
# Structures that a layout keeps for later: a few threads at work at once.
MOST_SPARES = 4


class Structure:
    """Base of the structures: subclasses annotate their fields with kinds (``kinds``) or structures.

    ``table`` holds the fields' words: a number itself, the address of a function or of another structure,
    the address and the shape of an array. The fields are fixed; ``replace`` makes a changed copy.

    Numbers that change during a run are entries of an array. They have names, in the order of the entries:
    after ``class Run(Structure, counters=("mode", "cycle"))``, ``run.mode`` reads and writes
    ``run.counters[0]``, in a kernel and in Python. The columns of a matrix have names in the same way.
    """

    # What is found of each class: the kinds of its fields, the field and the place of each named entry, how a
    # field becomes words, and where its words begin.
    _fields: ClassVar[dict[str, Any]]
    _entries: ClassVar[dict[str, tuple[str, int]]]
    _words: ClassVar[dict[str, Any]]
    _places: ClassVar[dict[str, int]]

    def __init_subclass__(cls, **named_entries):
        """Find the place of each field from the annotations, and the fields of the named entries."""
        entries = {
            name: (field, index) for field, names in named_entries.items() for index, name in enumerate(names)
        }
        # Underscored: a field may have any other name.
        cls._fields = dict(cls.__annotations__)
        cls._entries = entries
        for name, (field, index) in entries.items():
            setattr(cls, name, _entry(field, index, cls._fields[field].ndim))
        cls._words = {name: words_of(name, kind) for name, kind in cls._fields.items()}
        ends = accumulate(map(width_of, cls._fields.values()), initial=0)
        cls._places = dict(zip(cls._fields, ends, strict=False))

    def __init__(self, **values):
        _check_fields(type(self), values)
        self.__dict__.update(values)
        words = []
        for name, convert in self._words.items():
            words += convert(values[name])
        self._fill(np.array(words, dtype=np.int64))

    def _fill(self, table):
        self.__dict__["table"] = table
        self.__dict__["address"] = address_of(table)

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
        if name not in self._entries:
            raise AttributeError(f"{type(self).__name__}.{name} is fixed; replace({name}=...) makes a copy.")
        object.__setattr__(self, name, value)

    def put(self, **numbers):
        """Set numbers, between calls of kernels; for an owner who shares the structure with nobody."""
        for name, value in numbers.items():
            [self.table[self._places[name]]] = self._words[name](value)
        self.__dict__.update(numbers)

    def replace(self, **changes):
        """A copy with some fields changed."""
        copy, table = object.__new__(type(self)), self.table.copy()
        copy.__dict__.update(self.__dict__)
        for name, value in changes.items():
            # Word by word: ten times as fast as a slice.
            for place, word in enumerate(self._words[name](value), self._places[name]):
                table[place] = word
        copy.__dict__.update(changes)
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
        fields = kind._fields
        _check_fields(kind, [*shapes, *shared])
        table: list[int] = []
        moving: list[bool] = []
        offsets, end = {}, 0
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
        self.first = None
        self.head = head
        self.moving = np.array(moving, dtype=np.int64)
        self.table = np.array(table, dtype=np.int64) + head * self.moving
        self.length = head + end
        self.arrays = {
            name: (shapes[name], np.dtype(fields[name].dtype), head + offset)
            for name, offset in offsets.items()
        }

    def zeros(self):
        """A structure whose arrays are zero."""
        structure = self.unwritten()
        structure._memory[self._places_of(structure)] = 0
        return structure

    def begin_as(self, structure):
        """Let ``renew`` give arrays what those of this structure hold now."""
        self.first = structure._memory[self._places_of(structure)].copy()

    def renew(self, structure):
        """Let the arrays of a structure hold what ``begin_as`` was given."""
        structure._memory[self._places_of(structure)] = self.first

    def unwritten(self):
        """A structure whose arrays hold what the memory held: for those who write before they read."""
        return self._spare() or self._structure_in(np.empty(self.length + LINE, dtype=np.uint8))

    def words(self, structure):
        """What the arrays of a structure hold, as one array of words that is a view."""
        return structure._memory[self._places_of(structure)].view(np.int64)

    def take_back(self, structure):
        """Keep a structure of this layout that nobody else holds any more, nor any of its arrays."""
        if len(self.spares) < MOST_SPARES:
            self.spares.append(structure)

    def _places_of(self, structure):
        """Where the arrays of a structure lie in its memory, behind the table."""
        return slice(structure._begin + self.head, structure._begin + self.length)

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
    """The property of a named entry of an array field: a number, or a column of a matrix."""
    place = index if ndim == 1 else (slice(None), index)

    def write(structure, value):
        getattr(structure, field)[place] = value

    if ndim > 1:
        return property(lambda structure: getattr(structure, field)[place], write)
    return property(lambda structure: getattr(structure, field).item(index), write)


def _check_fields(kind, given):
    fields = kind._fields
    if set(given) != fields.keys():
        raise TypeError(f"{kind.__name__} has the fields {', '.join(fields)}; got {', '.join(given)}.")


def _whole_lines(size):
    """Bytes rounded up to whole cache lines."""
    return -(-size // LINE) * LINE
