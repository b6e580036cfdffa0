"""Parts of kernels: what they call is linked, once, and what they compute is what Python computes."""

import sys

import pytest
from numba import njit
from numba.core.event import Listener, install_listener

from hybrid.compiler.cache.kernel import file_of, kernels_in
from hybrid.compiler.cache.loader import compiled
from hybrid.kernels.types.kinds import INTEGER, REAL, text_of
from hybrid.kernels.types.numba_door.export import exports_of, object_code
from hybrid.kernels.types.options import INLINE, KERNEL, exported


@njit(**KERNEL)
def shared(x):
    return 3.0 * x + 1.0


@njit(**KERNEL)
def through_dead_branch(x, way):
    """Calls ``shared`` only where ``way`` is not zero, which LLVM sees not to be the case."""
    if way == 0:
        return x
    return shared(x)


@njit(**KERNEL)
def through_live_branch(x):
    return shared(x) - 1.0


@njit(**INLINE)
def squared(x):
    return x**2


@exported(REAL, REAL)
def dead_before_live(x):
    return through_dead_branch(x, 0) + through_live_branch(x)


@exported(REAL, REAL)
def live_before_dead(x):
    return through_live_branch(x) + through_dead_branch(x, 0)


@exported(REAL, REAL, INTEGER)
def operators(x, k):
    """Static and other operands, whole numbers and floats, variables that end in a loop."""
    total, left = -x, k
    while left > 0:
        step = max(x, 0.5) / left
        total += squared(step) - left % 3 + (left // 2) ** 2 + x**3
        left -= 1
    return total if not (x < 0.0 or k == 7) else abs(total)


@pytest.fixture(scope="module")
def kernels():
    exports = exports_of(sys.modules[__name__])
    signatures = {
        name: [text_of(export.result), *map(text_of, export.arguments)] for name, export in exports.items()
    }
    return kernels_in(file_of(signatures, object_code(exports)))


@pytest.mark.parametrize("order", ["dead_before_live", "live_before_dead"])
def test_a_part_that_a_dead_branch_calls_is_linked_where_it_is_needed(kernels, order):
    assert kernels[order](2.0) == 8.0


@pytest.mark.parametrize(("x", "k"), [(0.25, 5), (2.0, 4), (-1.5, 3), (2.0, 7), (1.0, 0)])
def test_operators_as_in_python(kernels, x, k):
    total = -x
    for left in range(k, 0, -1):
        total += (max(x, 0.5) / left) ** 2 - left % 3 + (left // 2) ** 2 + x**3
    expected = total if not (x < 0.0 or k == 7) else abs(total)
    assert kernels["operators"](x, k) == pytest.approx(expected, rel=1e-14)


def test_a_call_of_known_signature_is_not_worked_out_again(kernels):
    """A module whose functions have all been compiled needs no pass of numba."""
    passes = []

    class Counting(Listener):
        def on_start(self, event):
            passes.append(event.data["name"])

        def on_end(self, event):
            pass

    with install_listener("numba:run_pass", Counting()):
        assert compiled(__name__)
    assert passes == []
