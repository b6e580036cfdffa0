"""The equations of an orbit, stretch by stretch: each ends where the next one begins, and in time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hybrid.orbits.continuation.flow import Flow, Landing
from hybrid.orbits.continuation.route import Loop
from hybrid.system.periodicity import closed_change

# The gap of each equation counts as closed at this share of the sizes.
CLOSED = 1e-10


def stretch_by_stretch(
    loop: Loop, flows: Sequence[Flow], landings: Sequence[Landing | None], turns: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The equations without units and without the last one, which closes the orbit.

    Their derivatives ``(m, m + k)`` in states, times and parameters, and their values ``(m,)``. Angles close
    up to whole ``turns (n,)``.
    """
    count, n = loop.x.shape
    first, last = count * n, count * n + count + 1
    matrix, values = np.zeros((last, last + len(loop.values))), np.zeros(last)
    for i, (flow, landing) in enumerate(zip(flows, landings, strict=True)):
        rows, own, times = slice(i * n, (i + 1) * n), first + i, slice(first + i, first + i + 2)
        reached = flow.by_unknowns
        if landing is None:
            values[rows] = flow.end
            _join(i, loop, landings, matrix[own], values)
        else:
            row = landing.gradient[:n] @ reached
            row[n + 1] += landing.gradient[-1]
            row[n + 2 :] += landing.gradient[n:-1]
            matrix[own, rows], matrix[own, times], matrix[own, last:] = (
                row[:n],
                row[n : n + 2],
                row[n + 2 :],
            )
            values[own] = landing.height
            reached = landing.slopes[:, :n] @ reached
            reached[:, n + 1] += landing.slopes[:, -1]
            reached[:, n + 2 :] += landing.slopes[:, n:-1]
            values[rows] = landing.after
        matrix[rows, rows] = reached[:, :n]
        matrix[rows, times] = reached[:, n : n + 2]
        matrix[rows, last:] = reached[:, n + 2 :]
    here = np.arange(first)
    matrix[here, (here + n) % first] -= 1.0
    change = values[:first].reshape(count, n) - np.roll(loop.x, -1, axis=0)
    values[:first] = (closed_change(change, turns) if turns.any() else change).ravel()
    return matrix, values


def _join(
    i: int, loop: Loop, landings: Sequence[Landing | None], row: np.ndarray, values: np.ndarray
) -> None:
    """A stretch that goes on smoothly ends at its share of the time between two jumps."""
    count, times, first = len(landings), loop.times, loop.x.size
    if all(landing is None for landing in landings):
        begin, end = 0, count
        if i == count - 1:
            # The time of the start stays. The last equation fixes the phase of an autonomous orbit.
            row[first] = 1.0
            return
    else:
        begin = i
        while begin > 0 and landings[begin - 1] is None:
            begin -= 1
        end = i + 1
        while landings[end - 1] is None:
            end += 1
    share = (i + 1 - begin) / (end - begin)
    row[first + i + 1] += 1.0
    row[first + begin] -= 1.0 - share
    row[first + end] -= share
    values[first + i] = times[i + 1] - (1.0 - share) * times[begin] - share * times[end]


def hold(
    departure: tuple[np.ndarray, np.ndarray],
    gradients: np.ndarray,
    scale: np.ndarray,
    place: tuple[int, int],
    matrix: np.ndarray,
    values: np.ndarray,
) -> None:
    """Conserved quantities have the values that they are held at, from which they depart at a stretch.

    Where all other equations hold, the gap along the ``gradients (h, n)`` is zero by itself. The shortest
    way to the held values, in units of ``scale (n,)``, is put in its place. ``place`` is the stretch at
    whose start they are held, and the number of all.
    """
    (off, slopes), (i, count), n = departure, place, len(scale)
    first, last = count * n, count * n + count + 1
    rows = np.arange(n) + (i - 1) % count * n
    back = np.linalg.pinv(gradients * scale, rcond=CLOSED) * scale[:, None]
    kept = np.eye(n) - back @ gradients
    matrix[rows], values[rows] = kept @ matrix[rows], kept @ values[rows] + back @ off
    columns = [*range(i * n, (i + 1) * n), *range(last, matrix.shape[1]), first + i]
    matrix[np.ix_(rows, columns)] += back @ slopes
