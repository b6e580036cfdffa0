"""Structures: a kernel reads the values that Python wrote."""

import numba
import numpy as np
import pytest

from hybrid.kernels.types.kinds import CUBE, INDICES, INTEGER, MATRIX, REAL, VECTOR, function
from hybrid.kernels.types.numba_door.numba_types import signature_of
from hybrid.kernels.types.structure import Layout, Structure


@numba.cfunc(signature_of(REAL, REAL))
def double(x):
    return 2.0 * x


class Parcel(Structure):
    count: INTEGER
    vector: VECTOR
    function: function(REAL, REAL)
    matrix: MATRIX
    size: REAL
    cube: CUBE


class Box(Structure):
    places: INDICES
    parcel: Parcel


def parcel():
    return Parcel(
        count=-7,
        vector=np.arange(3.0),
        function=double,
        matrix=np.arange(6.0).reshape(2, 3),
        size=0.1,
        cube=np.arange(24.0).reshape(2, 3, 4),
    )


@numba.njit
def read(box, out):
    inner = box.parcel
    out[0], out[1], out[2] = inner.count, inner.size, inner.function(inner.size)
    out[3], out[4] = inner.matrix[1, 0], inner.cube[1, 2, 3]
    out[5] = inner.matrix.shape[0] * 100 + inner.matrix.shape[1] * 10 + inner.vector.shape[0]
    inner.vector[2] += inner.matrix[0].sum()
    box.places[1] = 42


def test_a_kernel_reads_every_kind_of_field_and_writes_into_arrays():
    inner = parcel()
    box = Box(places=np.zeros(2, dtype=np.int64), parcel=inner)
    out = np.zeros(6)
    read(box, out)
    np.testing.assert_array_equal(out, [-7.0, 0.1, 0.2, 3.0, 23.0, 233.0])
    np.testing.assert_array_equal(inner.vector, [0.0, 1.0, 5.0])
    np.testing.assert_array_equal(box.places, [0, 42])


def test_replace_changes_a_copy():
    inner = parcel()
    changed = inner.replace(count=3)
    assert (inner.count, changed.count) == (-7, 3)
    assert changed.vector is inner.vector


def test_replace_changes_arrays_and_their_shapes():
    changed = parcel().replace(matrix=np.arange(12.0).reshape(3, 4), vector=np.zeros(5), size=0.25)
    out = np.zeros(6)
    read(Box(places=np.zeros(2, dtype=np.int64), parcel=changed), out)
    np.testing.assert_array_equal(out, [-7.0, 0.25, 0.5, 4.0, 23.0, 345.0])


def test_fields_are_fixed():
    with pytest.raises(AttributeError, match=r"Parcel.count is fixed; replace\(count=...\) makes a copy."):
        parcel().count = 3


@pytest.mark.parametrize(
    "wrong",
    [np.arange(3), np.arange(6.0)[::2], np.zeros((1, 3)), [0.0, 1.0], np.arange(3, dtype=np.float32)],
)
def test_an_array_that_is_not_what_the_kernels_expect_is_refused(wrong):
    with pytest.raises(TypeError, match="vector must be a contiguous array"):
        parcel().replace(vector=wrong)


def test_missing_fields_are_named():
    with pytest.raises(TypeError, match="Box has the fields places, parcel; got places"):
        Box(places=np.zeros(2, dtype=np.int64))


class TestLayout:
    """Structures in one block of memory behave like structures of separate arrays."""

    SHAPES = {"vector": (3,), "matrix": (2, 3)}  # noqa: RUF012

    def layout(self):
        return Layout(Parcel, self.SHAPES, count=-7, function=double, size=0.1, cube=parcel().cube)

    def test_a_kernel_finds_what_python_wrote_and_the_other_way_round(self):
        inner = self.layout().zeros()
        assert not inner.vector.any()
        inner.vector[:], inner.matrix[:] = parcel().vector, parcel().matrix
        box, out = Layout(Box, {"places": (2,)}, parcel=inner).zeros(), np.zeros(6)
        read(box, out)
        np.testing.assert_array_equal(out, [-7.0, 0.1, 0.2, 3.0, 23.0, 233.0])
        np.testing.assert_array_equal(inner.vector, [0.0, 1.0, 5.0])
        np.testing.assert_array_equal(box.places, [0, 42])

    def test_arrays_are_each_structures_own_and_begin_on_a_cache_line(self):
        layout = self.layout()
        one, other = layout.zeros(), layout.unwritten()
        arrays = [getattr(each, name) for each in (one, other) for name in self.SHAPES]
        for i, array in enumerate(arrays):
            assert array.shape == self.SHAPES["vector" if array.ndim == 1 else "matrix"]
            assert array.ctypes.data % 64 == 0
            assert not any(np.shares_memory(array, later) for later in arrays[i + 1 :])
        assert one.cube is other.cube
        assert one.vector is one.vector

    def test_what_is_taken_back_serves_again(self):
        layout = self.layout()
        one = layout.zeros()
        one.vector[:], one.matrix[:] = 1.0, 2.0
        layout.take_back(one)
        again, another = layout.zeros(), layout.zeros()
        assert again is one
        assert another is not one
        assert not again.vector.any()
        assert not again.matrix.any()
        out = np.zeros(6)
        again.vector[1], again.matrix[0, 2] = 5.0, 7.0
        read(Layout(Box, {"places": (2,)}, parcel=again).zeros(), out)
        np.testing.assert_array_equal(out, [-7.0, 0.1, 0.2, 0.0, 23.0, 233.0])
        np.testing.assert_array_equal(again.vector, [0.0, 5.0, 7.0])

    def test_a_structure_is_renewed(self):
        layout = self.layout()
        first, one = layout.zeros(), layout.zeros()
        first.vector[:], first.matrix[1] = 1.0, 2.0
        layout.begin_as(first)
        first.vector[:], one.matrix[:] = 7.0, 3.0
        layout.renew(one)
        assert one.vector.tolist() == [1.0] * 3
        assert one.matrix.tolist() == [[0.0] * 3, [2.0] * 3]

    def test_numbers_are_set_for_the_next_call(self):
        inner, out = self.layout().zeros(), np.zeros(6)
        changed = inner.replace(count=3)
        changed.put(count=5, size=0.75)
        assert (inner.count, changed.count, changed.size) == (-7, 5, 0.75)
        read(Layout(Box, {"places": (2,)}, parcel=changed).zeros(), out)
        assert out[:2].tolist() == [5.0, 0.75]

    def test_no_more_is_kept_than_a_few(self):
        layout = self.layout()
        for structure in [layout.zeros() for _ in range(100)]:
            layout.take_back(structure)
        assert len(layout.spares) < 10

    def test_an_array_outlives_its_structure(self):
        vector = self.layout().zeros().vector
        np.testing.assert_array_equal(vector, np.zeros(3))

    def test_arrays_can_have_no_length(self):
        inner = Layout(
            Parcel, {"vector": (0,), "matrix": (0, 3), "cube": (2, 0, 1)}, count=1, function=double, size=1.0
        )
        assert inner.zeros().matrix.shape == (0, 3)
        assert inner.zeros().cube.shape == (2, 0, 1)

    def test_replace_changes_a_copy_with_the_same_arrays(self):
        inner = self.layout().zeros()
        changed = inner.replace(count=3)
        assert (inner.count, changed.count) == (-7, 3)
        assert np.shares_memory(inner.vector, changed.vector)

    def test_what_is_no_field_is_named(self):
        with pytest.raises(AttributeError, match="Parcel has no field 'vectro'"):
            self.layout().zeros().vectro  # noqa: B018

    def test_missing_fields_are_named(self):
        with pytest.raises(TypeError, match="Box has the fields places, parcel; got places"):
            Layout(Box, {"places": (2,)})


class Place(Structure, counters=("mode", "cycle"), numbers=("phase",), table_of=("first", "second", "third")):
    counters: INDICES
    numbers: VECTOR
    table_of: MATRIX


@numba.njit(signature_of(None, Place, VECTOR))
def go_on(place, out):
    place.mode += 3
    place.cycle = place.mode * 2
    place.phase = place.phase + 0.5
    for row in range(place.second.shape[0]):
        place.second[row] = 10.0 * row + place.first[row]
    out[0], out[1] = place.phase, place.third[1]


class TestNamedEntries:
    def place(self):
        table = np.arange(12.0).reshape(4, 3)
        return Place(counters=np.array([1, 0]), numbers=np.array([0.25]), table_of=table)

    def test_kernels_read_and_write_them(self):
        place, out = self.place(), np.zeros(2)
        go_on(place, out)
        assert (place.mode, place.cycle, place.phase) == (4, 8, 0.75)
        assert place.counters.tolist() == [4, 8]
        assert out.tolist() == [0.75, 5.0]
        assert place.second.tolist() == [0.0, 13.0, 26.0, 39.0]
        assert place.table_of[:, 0].tolist() == [0.0, 3.0, 6.0, 9.0]
        assert place.third.tolist() == [2.0, 5.0, 8.0, 11.0]

    def test_python_reads_and_writes_them(self):
        place = self.place()
        place.cycle = 7
        place.third = [1.0, 2.0, 3.0, 4.0]
        assert place.counters.tolist() == [1, 7]
        assert place.table_of[:, 2].tolist() == [1.0, 2.0, 3.0, 4.0]
        with pytest.raises(AttributeError, match=r"Place\.numbers is fixed"):
            place.numbers = np.zeros(1)
        with pytest.raises(AttributeError, match=r"Place\.time is fixed"):
            place.time = 1.0
