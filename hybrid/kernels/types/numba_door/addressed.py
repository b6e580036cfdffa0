"""Structures by their addresses, so that a kernel may choose among many."""

from functools import cache

from numba import types

from hybrid.kernels.types.numba_door.building import intrinsic
from hybrid.kernels.types.numba_door.numba_types import numba_type


@cache
def structure_at(structure):
    """The function of kernels that returns the structure of a class at an address."""

    @intrinsic
    def at(typing_context, address):
        kind = numba_type(structure)

        def generate(context, builder, signature, arguments):
            return builder.inttoptr(arguments[0], context.get_value_type(kind))

        return kind(types.int64), generate

    return at
