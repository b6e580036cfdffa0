"""Numba's helpers for those who write LLVM's instructions into a kernel."""

from typing import Any

from numba import extending
from numba.core.cgutils import alloca_once_value, for_range, for_range_slice, unpack_tuple

__all__ = ["alloca_once_value", "for_range", "for_range_slice", "intrinsic", "unpack_tuple"]

# Kernels call an intrinsic without its first argument; numba's own types ask for it.
intrinsic: Any = extending.intrinsic
