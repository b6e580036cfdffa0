"""Runs that take their steps together."""

from hybrid.kernels.types.kinds import INDEX_MATRIX, INDICES, INTEGER, MATRIX, VECTOR, function
from hybrid.kernels.types.layout import Parts, Task
from hybrid.kernels.types.structure import Structure

# Numbers of a lane besides state, parameters, sizes: time, what it has lost in rounding, whole periods; the
# time since the entry, the longest step; the time until the next step must end; the time that the last stay
# took, and its share by which a step may exceed that; the steps taken, the integral of div f, whether the
# roots are those of a step, the period.
T, PHASE_LOW, CYCLE, SINCE, LONGEST_STEP, ROOM, STAY, AHEAD_OF_STAY, STEPS, DIVERGENCE = range(10)
FOLLOWS, PERIOD = 10, 11
LANE_NUMBERS = 12
# Those of each guard: its side, whether it is zero at the start of the step, the root that the last one left,
# and how far errors may have moved it at the end of the step.
PER_GUARD = 4
# Degree up to which a guard is looked at; the terms behind are a part of the band.
DEGREE = 14

SERIES_ABREAST = function(None, INTEGER, VECTOR, VECTOR, VECTOR, INTEGER, MATRIX)


class Abreast(Structure, counters=("distant", "stopping", "distant_at_stop")):
    """What a step of ``W`` runs abreast needs; an entry of a vector or matrix has one number of each run.

    ``series`` computes the series of a mode in ``powers (order + 5 + guards, columns)``, ``able (modes,)`` is
    1 for a mode that has one; tangent vectors begin at column ``tangent_start`` and have ``tangent_columns``
    of a mode each. ``lanes (modes, entries)`` is where the runs aboard are, at the start of their next step
    (``lanes``). ``weights (n (1 + k),)``, ``polynomial`` and ``moved`` are scratch. A step leaves by
    run, in ``ends (W,)``, the time that it took, and in ``fired (W,)`` the transition whose guard it has
    reached. ``distant`` has the bits of the runs that are far from all guards at its end, ``stopping``
    those of the runs that stop before, ``distant_at_stop`` those that are far from guards there. ``stops
    (2,)``: the part of the step after which a run stops, and by how much its tangent vector has been
    multiplied since the start.
    """

    counters: INDICES
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
    stops: VECTOR
    fired: INDICES


class Crew(Structure, counters=("parameters", "begun", "steps", "alone", "budget")):
    """Runs ``tasks (R,)``, by address, that are advanced together.

    Each goes to its own time, ``cycles`` and ``phases (R,)``, in no more than ``max_steps`` and ``max_jumps
    (R,)``. What is next when it gets there, or ends before, a function decides (``ONWARD``), which finds what
    belongs to a run at the address in ``jobs (R,)``. ``codes (R,)`` are GO_ON for runs under way, else how
    they ended; ``refused (R,)`` is 1 for a run whose next step is not taken abreast. ``rooms (R, 4)`` and
    ``clocks (R,)`` are what is known of the next step of each.

    ``waiting (modes + 1, R)`` are the runs that wait for others in their mode, and in the last row those that
    step alone: ``counts (modes + 1,)`` of them, round the row from ``heads (modes + 1,)`` on; ``aboard
    (modes, W)`` those that are in a lane, -1 for none.
    ``longest (modes,)`` is the number of steps after which a run leaves its lane. A model has so many
    ``parameters``; with ``begun`` 0 the runs have not been brought to their first steps. So many ``steps``
    have been taken abreast, and by runs ``alone``; a call ends when both have reached the ``budget``.
    """

    counters: INDICES
    tasks: INDICES
    jobs: INDICES
    cycles: INDICES
    phases: VECTOR
    max_steps: INDICES
    max_jumps: INDICES
    codes: INDICES
    refused: INDICES
    rooms: MATRIX
    clocks: INDICES
    waiting: INDEX_MATRIX
    counts: INDICES
    heads: INDICES
    aboard: INDEX_MATRIX
    longest: INDICES


# What a run does next, given its number and the code with which it has come to its time, or ended; GO_ON at
# the beginning. The result is GO_ON if it has a new time, or the code with which it is over.
ONWARD = function(INTEGER, Parts, Task, Crew, INTEGER, INTEGER)
