"""Structures by their addresses, so that a kernel may choose among many."""

from numba import types

from hybrid.kernels.types.layout import Task
from hybrid.kernels.types.numba_door.building import intrinsic
from hybrid.kernels.types.numba_door.numba_types import numba_type


@intrinsic
def task_at(typing_context, address):
    """The task at an address."""
    kind = numba_type(Task)

    def generate(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], context.get_value_type(kind))

    return kind(types.int64), generate
