"""How numba compiles kernels: no further than to intermediate code (``part_compiler``).

``export`` makes machine code of the kernels that Python calls or hands to other kernels.
"""

from typing import Any

from numba import njit

import hybrid.kernels.types.numba_door.numba_types  # noqa: F401 (so that kernels may take structures)
from hybrid.kernels.types.numba_door.part_compiler import PartCompiler

# Sums may be reordered and fused, but nan and infinity keep their meaning in comparisons (``math.isfinite``
# takes the difference of a number and itself, which may be taken for zero). Kernels allocate nothing and own
# nothing, so no references are counted.
KERNEL: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "nsz"},
    "_nrt": False,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": PartCompiler,
}
# Small and called at every stage: the call would cost as much as the work.
INLINE: dict[str, Any] = KERNEL | {"forceinline": True}


def exported(result, *arguments):
    """Decorate a kernel that Python calls or hands to other kernels; the kinds are those of its signature.

    For other kernels it is a function like any other, which becomes part of them.
    """

    def declare(function):
        kernel = njit(**KERNEL)(function)
        kernel.exported = result, arguments
        return kernel

    return declare
