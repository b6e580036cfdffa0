"""Numba's helpers for those who write LLVM's instructions into a kernel."""

from numba.core.cgutils import alloca_once_value, for_range, for_range_slice, unpack_tuple

__all__ = ["alloca_once_value", "for_range", "for_range_slice", "unpack_tuple"]
