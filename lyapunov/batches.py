"""A bounded number of batches of a growing series, for any length of a run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hybrid.measures.averages import Array

# Slots of the state of an accumulator.
CLOSED = 0
BATCH_SIZE = 1
IN_OPEN_BATCH = 2

# The state of an empty accumulator, whatever its batch sums hold.
EMPTY = (0, 1, 0)


def push(batch_sums: Array, state: NDArray[np.int64], values: Array) -> None:
    """Add ``values (k,)`` to ``batch_sums (B, k)``, ``B`` even; merge neighbours when all batches are full.

    ``state (3,)`` holds the number of closed batches, the number of values per batch, and the number of
    values in the open batch, which is the row after the closed ones. Kernels compile this function, so it
    uses arrays and integers only.
    """
    if state[CLOSED] == batch_sums.shape[0]:
        half = batch_sums.shape[0] // 2
        for i in range(half):
            for c in range(batch_sums.shape[1]):
                batch_sums[i, c] = batch_sums[2 * i, c] + batch_sums[2 * i + 1, c]
        state[CLOSED] = half
        state[BATCH_SIZE] *= 2
    row = state[CLOSED]
    for c in range(batch_sums.shape[1]):
        before = batch_sums[row, c] if state[IN_OPEN_BATCH] > 0 else 0.0
        batch_sums[row, c] = before + values[c]
    state[IN_OPEN_BATCH] += 1
    if state[IN_OPEN_BATCH] == state[BATCH_SIZE]:
        state[CLOSED] += 1
        state[IN_OPEN_BATCH] = 0


def closed_batch_means(batch_sums: Array, state: NDArray[np.int64]) -> Array:
    """Means ``(..., b, k)`` of the closed batches of accumulators in one state, without the open batch."""
    return batch_sums[..., : state[CLOSED], :] / state[BATCH_SIZE]
