"""How far a solution carries its components over a period, where the rounding of its states hides that."""

from __future__ import annotations

from itertools import pairwise

import attrs
import numpy as np

from hybrid.kernels.types import codes
from hybrid.simulation.periods import split_time
from hybrid.simulation.trajectory import Trajectory

EPSILON = float(np.finfo(float).eps)
# Intervals of a period, at the ends and in the middle of which rates are taken.
INTERVALS = 64


@attrs.frozen(eq=False)
class Drift:
    """How far components at rest are carried, as the integral of their rates.

    A difference of the two ends knows this only up to the rounding of the states; the integral has no such
    error.

    Attributes
    ----------
    components
        Their indices ``(r,)``.
    moved, blur
        How far they are carried, and the error of that ``(r,)``.
    slopes
        Derivatives of ``moved`` in the start ``(r, n)``.
    """

    components: np.ndarray
    moved: np.ndarray
    blur: np.ndarray
    slopes: np.ndarray


def drift(
    trajectory: Trajectory, end: float, jumps: np.ndarray, resting: np.ndarray, magnitude: np.ndarray
) -> Drift | None:
    """The drift of those components for which the integral is more exact than the difference of the ends.

    The trajectory stands at its start and carries the columns of the identity. ``end`` is the time at the end
    of the period, ``jumps`` the times of jumps, ``resting (n,)`` says which components hardly move, and
    ``magnitude (n,)`` is the size of the states. None if there is no such component, or no end.
    """
    start = trajectory.t
    # Column 0 is how far the state is carried, the others are the derivatives of that in the start.
    carried, coarse, size = _integrals(trajectory, np.union1d(np.linspace(start, end, INTERVALS + 1), jumps))
    if not np.all(np.isfinite(carried)):
        return None
    error = np.abs(carried - coarse)
    error += EPSILON * size
    blur, slopes = error[:, 0], np.where(np.abs(carried) > error, carried, 0.0)[:, 1:]
    known = np.where(magnitude > 0, magnitude, 1.0)
    with np.errstate(over="ignore"):  # a size of 1e-300 beside one of 1e300
        row = (error[:, 1:] / known[:, None] * magnitude).max(axis=1)
    chosen = np.flatnonzero(resting & (blur <= EPSILON * known) & (row <= EPSILON))
    if len(chosen) == 0:
        return None
    return Drift(chosen, carried[chosen, 0], blur[chosen], slopes[chosen])


# Beyond the largest float an integral is infinite or nan: no digit of it is known.
@np.errstate(over="ignore", invalid="ignore")
def _integrals(trajectory: Trajectory, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Integrals ``(n, 1 + n)`` of the rates of state and vectors, by Simpson's rule and the trapezoidal one.

    Jumps at ``times`` add what they change. The last array is the integral of the rates' moduli. All
    are nan where the run does not reach its end.
    """
    n = trajectory.system.tangent_dimension
    fine, coarse, size = (np.zeros((n, 1 + n)) for _ in range(3))
    for begin, stop in pairwise(times):
        first = _rates(trajectory)
        if _to(trajectory, 0.5 * (begin + stop)) != codes.DONE:
            return fine * np.nan, coarse, size
        middle = _rates(trajectory)
        code = _to(trajectory, stop)
        last, length = _rates(trajectory), stop - begin
        fine += length / 6 * (first + 4 * middle + last)
        coarse += length / 2 * (first + last)
        size += length * np.abs(middle)
        if code == codes.MAX_JUMPS:
            changed = _jumped(trajectory)
            fine, coarse = fine + changed, coarse + changed
        elif code != codes.DONE:
            return fine * np.nan, coarse, size
    return fine, coarse, size


def _to(trajectory: Trajectory, t: float) -> int:
    """Advance to a time, or up to the next jump."""
    place = split_time(t, trajectory.model.period)
    return trajectory.advance_to(*place, trajectory.no_record(), max_jumps=trajectory.jumps)


def _rates(trajectory: Trajectory) -> np.ndarray:
    """Time derivatives ``(n, 1 + n)`` of the state and of the tangent vectors."""
    n = trajectory.system.tangent_dimension
    return np.column_stack(
        [trajectory.field()[:n], trajectory.jacobian()[:n, :n] @ trajectory.tangent_matrix]
    )


def _jumped(trajectory: Trajectory) -> np.ndarray:
    """Make the jumps at which the trajectory stands; what they add ``(n, 1 + n)`` to state and vectors."""
    before, run = _state_and_vectors(trajectory), trajectory.run
    trajectory.advance_to(int(run.cycle), float(run.phase), trajectory.no_record(), max_steps=int(run.steps))
    return _state_and_vectors(trajectory) - before


def _state_and_vectors(trajectory: Trajectory) -> np.ndarray:
    """The state without counters, and the tangent vectors: ``(n, 1 + n)``."""
    return np.column_stack([trajectory.x[: trajectory.system.tangent_dimension], trajectory.tangent_matrix])
