"""Runs from many starts: each takes the next one when it is over."""

from hybrid.kernels.types.attractors import Known, Progress, Section
from hybrid.kernels.types.kinds import CUBE, INDEX_MATRIX, INDICES, INTEGER, MATRIX, VECTOR
from hybrid.kernels.types.structure import Structure


class Starts(Structure, counters=("now",)):
    """The starts ``origins (N, n)`` of runs in one memory; several memories share the starts.

    The run under way is from the start ``now``, -1 for none; the next one is in ``queue (1,)``.
    ``run_words`` and ``work_words`` are the memory of run and work; at the start the first holds
    ``fresh_run``, and the other zeros. All runs start in the mode ``named``, or in the one that allows the
    start if that is NO_MODE; ``verdicts`` are what each guard says of the last start. ``found (N, ...)`` are
    rows of what is found.
    """

    counters: INDICES
    queue: INDICES
    origins: MATRIX
    named: INTEGER
    verdicts: INDICES
    run_words: INDICES
    fresh_run: INDICES
    work_words: INDICES
    found: INDEX_MATRIX


class Sampled(Structure, counters=("sample",)):
    """Runs whose states ``(N, S, n)`` and modes are kept at ``S`` times, the last one the end.

    The next time is ``sample``; ``starts.found (N, 1)`` gets the number of jumps.
    """

    counters: INDICES
    starts: Starts
    cycles: INDICES
    phases: VECTOR
    states: CUBE
    modes: INDEX_MATRIX


class Settling(Structure):
    """Runs that settle on attractors; ``starts.found (N, 4)`` are described in ``kernels.runs.settle``."""

    starts: Starts
    known: Known
    section: Section
    progress: Progress
