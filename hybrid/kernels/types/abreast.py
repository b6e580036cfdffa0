"""Runs that take their steps together."""

from hybrid.kernels.types.kinds import INDEX_MATRIX, INDICES, INTEGER, MATRIX, VECTOR, function
from hybrid.kernels.types.structure import Structure

SERIES_ABREAST = function(None, INTEGER, VECTOR, VECTOR, VECTOR, INTEGER, MATRIX)


class Abreast(Structure):
    """What a step of ``W`` runs abreast needs; an entry of a vector or matrix has one number of each run.

    ``series`` computes the series of a mode in ``powers (order + 3 + guards, columns)``, ``able (modes,)`` is
    1 for a mode that has one; tangent vectors begin at column ``tangent_start`` and have ``tangent_columns``
    of a mode each. ``lanes (modes, entries)`` is where the runs aboard are, at the start of their next step
    (``lanes``). ``weights (n (1 + k),)``, ``polynomial`` and ``moved`` are scratch. A step leaves ``ends
    (2,)``: the time and the length that it took; and by run, in ``fired (W,)``, the transition whose guard it
    has reached.
    """

    series: SERIES_ABREAST
    able: INDICES
    tangent_start: INTEGER
    tangent_columns: INDICES
    powers: MATRIX
    lanes: MATRIX
    weights: VECTOR
    polynomial: VECTOR
    moved: VECTOR
    ends: VECTOR
    fired: INDICES


class Crew(Structure, counters=("steps", "refused", "parameters", "most")):
    """Runs ``tasks (R,)``, by address, that are advanced together, each to the time ``cycles`` and ``phases``.

    ``state (R, 3)``: the code of each. ``rooms (R, 4)`` and ``clocks (R,)`` are what is known of the next
    step of each; ``waiting (modes, R)`` the runs that wait for others in their mode, ``counts (modes,)`` of
    them; of ``parameters`` there are so many, and a run leaves its lane after ``most`` steps; ``aboard (modes, W)`` those that are in a lane, -1 for none.
    """

    counters: INDICES
    tasks: INDICES
    cycles: INDICES
    phases: VECTOR
    state: INDEX_MATRIX
    rooms: MATRIX
    clocks: INDICES
    waiting: INDEX_MATRIX
    counts: INDICES
    aboard: INDEX_MATRIX
