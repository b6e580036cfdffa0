"""What kernels compute with arrays, loops and calls is what Python computes."""

import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from hybrid.compiler.cache.kernel import file_of, kernels_in
from hybrid.kernels.types.codes import NARROW
from hybrid.kernels.types.kinds import CUBE, INDEX_MATRIX, INDICES, INTEGER, MATRIX, REAL, VECTOR, text_of
from hybrid.kernels.types.numba_door.export import exports_of, object_code
from hybrid.kernels.types.options import KERNEL, exported
from hybrid.kernels.types.structure import Structure
from tests.hybrid.kernels.plain import plain


class Box(Structure, names=("one", "two"), columns=("left", "right")):
    """A structure with every kind of field."""

    vector: VECTOR
    matrix: MATRIX
    cube: CUBE
    indices: INDICES
    index_matrix: INDEX_MATRIX
    names: INDICES
    columns: MATRIX
    count: INTEGER


@njit(**KERNEL)
def weigh(row, factor):
    total = 0.0
    for i in range(row.shape[0]):
        total += factor * row[i] * (i + 1)
    return total


@njit(**KERNEL)
def place_of(matrix, i):
    """Several results, and an array made in another block than it is used in."""
    row = matrix[i]
    if row[0] > 0.0:
        row = matrix[0]
    return row[1], row.shape[0] + matrix.size


@exported(REAL, Box, INTEGER, REAL)
def read(box, k, x):
    """Entries by one, two and three places; rows of matrices and slices of cubes; from the end; columns."""
    cube, last = box.cube, box.vector[-1]
    page = cube[k]
    total = last + 2.0 * box.matrix[k, -1] + 3.0 * box.matrix[-1, k] + box.indices[k] * x
    total += 5.0 * cube[k, 1, 2] + 7.0 * page[1, k] + 11.0 * page[k][0] + 13.0 * cube[0, k][1]
    total += 17.0 * box.index_matrix[k, 1] + 19.0 * box.left[k] + 23.0 * box.right[k] + box.one - 3 * box.two
    total += weigh(box.matrix[k], x) + weigh(box.vector[k:], 2.0) + weigh(page[k], -1.0)
    value, places = place_of(box.matrix, k)
    return total + value + places + page.size + box.index_matrix.shape[1] + page.shape[1]


@exported(INTEGER, INTEGER, INTEGER, INTEGER, VECTOR)
def count(start, stop, step, out):
    """Loops up, down, by steps of a variable, one in another, left early; the variables after them."""
    turns, i = 0, 100
    for i in range(start, stop):
        if i % 3 == 1:
            continue
        for j in range(i, start - 2, -2):
            out[0] += 1.0
            if j == 5:
                break
        turns += i
    for k in range(stop):
        turns += 7 * k
    for k in range(stop, start, -1):
        out[1] += k
    for k in range(start, stop, step):
        out[2] += k
    for k in range(stop, start, -step):
        out[2] += 3 * k
    for k in range(stop, start, -NARROW):
        out[2] += 5 * k
    turns_of = range(3) if step > 2 else range(5, 0, -1)
    for k in turns_of:
        out[3] += 11 * k
    for _ in range(2):
        for k in range(3):
            out[3] += k
    return turns + 1000 * i


@exported(None, Box, INTEGER, REAL)
def write(box, k, x):
    """Entries, rows by entries, entries in place, whole numbers into floats, names and columns."""
    box.vector[k] = x
    box.vector[-1] += 2.0 * x
    box.matrix[k, 1] = k
    box.cube[k, 0, 1] -= x
    box.cube[k][1, 1] = 4
    box.indices[k] = k + 7
    box.index_matrix[k, 1] += 3
    box.one = k
    box.two += 5
    box.left[k] = x
    box.right[k] += x
    row = box.matrix[0]
    for i in range(row.shape[0]):
        row[i] *= 2.0
    box.matrix[1, :] = x


def box_of(numbers):
    """A box with two or three entries along every axis."""
    rng = np.random.default_rng(numbers)
    shapes = {"vector": (3,), "matrix": (3, 3), "cube": (3, 3, 3), "columns": (3, 2)}
    whole = {"indices": (3,), "index_matrix": (3, 2), "names": (2,)}
    return Box(
        **{name: rng.normal(size=shape) for name, shape in shapes.items()},
        **{name: rng.integers(-9, 9, size=shape) for name, shape in whole.items()},
        count=3,
    )


@pytest.fixture(scope="module")
def in_python():
    return plain(sys.modules[__name__])


@pytest.fixture(scope="module")
def compiled():
    exports = exports_of(sys.modules[__name__])
    signatures = {
        name: [text_of(each.result), *map(text_of, each.arguments)] for name, each in exports.items()
    }
    return kernels_in(file_of(signatures, object_code(exports)))


@given(seed=st.integers(0, 10**6), k=st.integers(0, 1), x=st.floats(-5.0, 5.0))
def test_reading(compiled, in_python, seed, k, x):
    box = box_of(seed)
    assert compiled["read"](box, k, x) == pytest.approx(in_python.read(box, k, x), rel=1e-12, abs=1e-12)


@given(start=st.integers(-4, 8), stop=st.integers(-4, 9), step=st.integers(1, 4))
def test_loops(compiled, in_python, start, stop, step):
    ours, expected = np.zeros(4), np.zeros(4)
    assert compiled["count"](start, stop, step, ours) == in_python.count(start, stop, step, expected)
    np.testing.assert_array_equal(ours, expected)


@given(seed=st.integers(0, 10**6), k=st.integers(0, 1), x=st.floats(-5.0, 5.0))
def test_writing(compiled, in_python, seed, k, x):
    ours, expected = box_of(seed), box_of(seed)
    compiled["write"](ours, k, x)
    in_python.write(expected, k, x)
    for name in ("vector", "matrix", "cube", "indices", "index_matrix", "names", "columns"):
        np.testing.assert_allclose(getattr(ours, name), getattr(expected, name), rtol=1e-15, atol=1e-15)
