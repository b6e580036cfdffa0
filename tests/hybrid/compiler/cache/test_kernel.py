"""Compiled kernels: every kind of argument and result, alone and from the file that stores them."""

import gc
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from threading import Barrier

import numpy as np
import pytest

from hybrid.compiler.cache.kernel import file_of, kernels_in
from hybrid.compiler.cache.loader import _without_collection
from hybrid.kernels.types.export import exports_of, object_code
from hybrid.kernels.types.kinds import (
    CUBE,
    INDEX_MATRIX,
    INDICES,
    INTEGER,
    MATRIX,
    REAL,
    TRUTH,
    VECTOR,
    Pair,
    function,
    text_of,
)
from hybrid.kernels.types.options import exported
from hybrid.kernels.types.structure import Structure

DOUBLING = function(REAL, REAL)


class Box(Structure, numbers=("first", "second")):
    numbers: VECTOR
    doubled: DOUBLING


@exported(REAL, REAL)
def double(x):
    return 2.0 * x


@exported(Pair(REAL), REAL)
def both_signs(x):
    return x, -x


@exported(REAL, Box, INTEGER, TRUTH, VECTOR, MATRIX, CUBE, INDICES, INDEX_MATRIX, DOUBLING)
def everything(box, number, flag, vector, matrix, cube, indices, places, twice):
    box.second = box.doubled(box.first) + twice(0.25)
    vector[1] = matrix[1, 2] + cube[1, 0, 3] if flag else -1.0
    indices[0] = places[2, 1] + number
    return 0.5 * vector.shape[0] + 10.0 * matrix.shape[1] + 100.0 * cube.shape[2]


@exported(TRUTH, REAL, REAL)
def is_less(a, b):
    return a < b


@exported(None, INDICES)
def count(places):
    places[0] += 1


@exported(INTEGER, INTEGER, INTEGER)
def difference(a, b):
    return a - b


@pytest.fixture(scope="module")
def content():
    exports = exports_of(sys.modules[__name__])
    assert set(exports) == {"double", "both_signs", "everything", "is_less", "count", "difference"}
    signatures = {
        name: [text_of(export.result), *map(text_of, export.arguments)] for name, export in exports.items()
    }
    return file_of(signatures, object_code(exports))


@pytest.fixture(scope="module")
def kernels(content):
    return kernels_in(content)


def arguments_of(kernels):
    box = Box(numbers=np.array([3.0, 0.0]), doubled=kernels["double"])
    matrix, cube = np.arange(6.0).reshape(2, 3), np.arange(24.0).reshape(2, 3, 4)
    places = np.arange(6).reshape(3, 2)
    return [box, -7, True, np.zeros(2), matrix, cube, np.zeros(1, dtype=np.int64), places, kernels["double"]]


def test_every_kind_of_argument(kernels):
    given = arguments_of(kernels)
    assert kernels["everything"](*given) == 0.5 * 2 + 10 * 3 + 100 * 4
    box, _, _, vector, _, _, indices, *_ = given
    assert box.numbers.tolist() == [3.0, 6.5]
    assert vector.tolist() == [0.0, 5.0 + 15.0]
    assert indices.tolist() == [5 - 7]
    given[2] = False
    kernels["everything"](*given)
    assert vector.tolist() == [0.0, -1.0]


@pytest.mark.parametrize(("a", "b"), [(1.0, 2.0), (2.0, 1.0), (-0.0, 0.0)])
def test_results_are_what_python_has(kernels, a, b):
    assert kernels["double"](a) == 2 * a
    assert kernels["is_less"](a, b) is (a < b)
    assert kernels["difference"](int(a), int(b)) == int(a) - int(b)
    assert kernels["difference"](-(2**62), 2**62 - 1) == -(2**63) + 1
    counts = np.zeros(1, dtype=np.int64)
    assert kernels["count"](counts) is None
    assert counts[0] == 1


def test_numbers_keep_every_bit(kernels):
    for number in (5e-324, -1.7e308, np.pi, np.inf):
        assert kernels["double"](number) == 2 * number
    assert np.isnan(kernels["double"](np.nan))


@pytest.mark.parametrize(
    ("place", "wrong"),
    [(3, np.zeros((2, 2))), (4, np.zeros((4, 2))[::2]), (6, np.zeros(1)), (7, [[1, 2]]), (5, None)],
)
def test_an_array_that_is_not_what_the_kernel_takes(kernels, place, wrong):
    given = arguments_of(kernels)
    given[place] = wrong
    with pytest.raises(TypeError, match=f"argument {place} of everything must be a contiguous array of type"):
        kernels["everything"](*given)


def test_a_missing_argument(kernels):
    with pytest.raises(ValueError, match="argument"):
        kernels["difference"](1)


def test_the_code_is_loaded_when_it_is_needed():
    content = file_of({"f": ["int64", "int64"]}, b"no machine code")
    assert kernels_in(content)["f"].name == "f"


def test_threads_load_the_code_once(content):
    """Code that one thread has loaded is not replaced, and so freed, by another one."""
    threads, interval = 8, sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    for _ in range(20):
        kernels, together = kernels_in(content), Barrier(threads)

        def address(_, kernels=kernels, together=together):
            together.wait()
            return kernels["double"].address

        with ThreadPoolExecutor(threads) as pool:
            assert len(set(pool.map(address, range(threads)))) == 1
    sys.setswitchinterval(interval)


def test_the_file_needs_no_compiler(content, tmp_path):
    """Another process calls the kernels without importing numba."""
    path = tmp_path / "kernels.o"
    path.write_bytes(content)
    program = (
        "import sys; from pathlib import Path; from hybrid.compiler.cache.kernel import kernels_in;"
        f"print(kernels_in(Path({str(path)!r}).read_bytes())['double'](1.5), 'numba' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout == "3.0 False\n", done.stderr


@pytest.mark.parametrize("collects", [True, False])
def test_the_search_for_garbage_goes_on_as_before(collects):
    before = gc.isenabled()
    try:
        (gc.enable if collects else gc.disable)()
        with suppress(ZeroDivisionError), _without_collection():
            assert not gc.isenabled()
            raise ZeroDivisionError
        assert gc.isenabled() == collects
    finally:
        (gc.enable if before else gc.disable)()
