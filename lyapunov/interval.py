"""The end of an interval of time, as kernels and Python see it."""

from hybrid.kernels.types.kinds import INDICES, VECTOR
from hybrid.kernels.types.structure import Structure


class End(Structure, counters=("cycle", "done"), numbers=("phase",)):
    """When an interval ends: after ``cycle`` whole periods and at the ``phase`` of the next.

    ``done`` is how many intervals the last call of a kernel has completed.
    """

    counters: INDICES
    numbers: VECTOR
