"""What the runs that settle on attractors know, and how far one of them is."""

from hybrid.kernels.types.kinds import INDICES, INTEGER, MATRIX, REAL, VECTOR
from hybrid.kernels.types.structure import Structure


class Known(Structure):
    """The points of known attractors on the section, sorted by the component ``axis``.

    ``points (P, n)`` belong to the attractors ``owner (P,)``, counted from 0, and to the modes ``mode (P,)``.
    A state is near a point of attractor ``a`` if no component is farther than ``radius[a]``, of shape
    ``(A, n)``; ``widest`` is the largest radius along the axis. ``turns (n,)`` are the lengths of a turn of
    angles, 0 for other components: angles are near up to whole turns.
    """

    points: MATRIX
    owner: INDICES
    mode: INDICES
    radius: MATRIX
    turns: VECTOR
    axis: INTEGER
    widest: REAL


class Section(Structure):
    """Where the points of a run are taken.

    At each crossing of a surface if the first ``markers`` transitions mark one; otherwise at ``phase`` of
    each forcing period, or every ``interval`` of time where that is above zero. A start is decided by
    ``wanted`` points in succession near one attractor, and given up after ``most`` points.
    """

    markers: INTEGER
    phase: REAL
    interval: REAL
    wanted: INTEGER
    most: INTEGER


class Progress(Structure, counters=("cycle", "under_way", "points", "near", "streak"), numbers=("phase",)):
    """How far the run of one start is.

    ``points`` counts those of the section so far, ``streak`` the last ones near attractor ``near``. The next
    point is at ``cycle`` and ``phase``, and the run is ``under_way`` to it; on a section with markers that
    says that the jump which waits has been looked at.
    """

    counters: INDICES
    numbers: VECTOR
