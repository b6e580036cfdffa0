"""Runs from many starts, one after another in the same memory."""

from hybrid.kernels.types.kinds import INDEX_MATRIX, INDICES, INTEGER, MATRIX
from hybrid.kernels.types.structure import Structure


class Starts(Structure, counters=("reached", "resumed")):
    """The starts ``origins (N, n)`` of runs, and the memory in which they run.

    ``run_words`` and ``work_words`` are the memory of run and work, ``fresh_run`` and ``fresh_work`` what
    that holds at the start. All runs start in the mode ``named``, or in the one that allows the start if that
    is NO_MODE; ``verdicts`` are what each guard says of the last start. ``found (N, ...)`` are rows of what
    is found. The runs up to ``reached`` are complete; that one is to be ``resumed`` if it has begun. Each run
    may take ``max_steps`` and ``max_jumps``.
    """

    counters: INDICES
    origins: MATRIX
    named: INTEGER
    verdicts: INDICES
    run_words: INDICES
    fresh_run: INDICES
    work_words: INDICES
    fresh_work: INDICES
    found: INDEX_MATRIX
    max_steps: INTEGER
    max_jumps: INTEGER
