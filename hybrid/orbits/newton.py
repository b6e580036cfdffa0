"""Newton's method for a solution that ends where it begins: one integration, and the step after it."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.orbits.rest import EPSILON, Drift
from hybrid.status import Status, StatusCode
from hybrid.system.graph import HybridSystem
from hybrid.system.periodicity import unclosed

# Rounding of the end of an orbit, in units in the last place of its largest states: the largest gap accepted
# when Newton's method makes no more progress.
ROUNDING_OF_GAP = 100
# The matrix of Newton's method is as rounded: what is below this share of its size is not known.
UNKNOWN = ROUNDING_OF_GAP * EPSILON


def length(vector: np.ndarray) -> float:
    """Euclidean length of a vector; the squares of its components may leave the range of numbers."""
    largest = float(np.abs(vector).max())
    return largest * float(np.linalg.norm(vector / largest)) if 0.0 < largest < np.inf else largest


@attrs.frozen(eq=False)
class Point:
    """Unknowns of the shooting: a state, the time there, and the time to close."""

    x: np.ndarray
    t: float
    period: float


@attrs.frozen(eq=False)
class Departure:
    """Distances ``off (h,)`` from the held values of conserved quantities, and the slopes ``(h, n)``."""

    off: np.ndarray
    slopes: np.ndarray

    def sizes(self, scale: np.ndarray) -> np.ndarray:
        """What a step of one ``scale (n,)`` changes the quantities by ``(h,)``."""
        found = np.linalg.norm(self.slopes * scale, axis=1)
        return np.where(found > 0.0, found, 1.0)

    def rows(self, scale: np.ndarray) -> np.ndarray:
        """The gradients ``(h, n)`` in the scaled state, each of length one."""
        return np.asarray(self.slopes * scale / self.sizes(scale)[:, None])

    def distances(self, scale: np.ndarray) -> np.ndarray:
        """Distances ``(h,)`` from the held values in the scaled state."""
        return np.asarray(self.off / self.sizes(scale))

    def within(self, known: np.ndarray) -> bool:
        """Whether the point has the held values, as far as its components are ``known (n,)``."""
        return bool(np.all(np.abs(self.off) <= np.abs(self.slopes) @ known))


@attrs.frozen(eq=False)
class Shot:
    """What one integration over the period gives.

    ``extent (n,)`` is how far each component moves, ``magnitude (n,)`` its largest absolute value; a cyclic
    component has the extent 0, since its motion tells nothing of an orbit. ``drift``
    knows how far components at rest are carried. ``beyond`` names the transitions whose guards the start lies
    beyond. ``departure`` is how far the start is from the values of conserved quantities that are held.
    ``at_steps`` is the largest
    absolute value at the ends of steps, which the solver's tolerances control. ``more_waits`` tells whether
    more delays are under way at the end than at the start, or fewer.
    """

    point: Point
    mode: str
    end: np.ndarray
    end_mode: str
    fundamental: np.ndarray
    field: np.ndarray
    end_field: np.ndarray
    extent: np.ndarray
    magnitude: np.ndarray
    status: Status
    system: HybridSystem
    drift: Drift | None = None
    beyond: tuple[str, ...] = ()
    departure: Departure | None = None
    at_steps: float = np.inf
    more_waits: bool = False

    @property
    def gap(self) -> np.ndarray:
        """Distance ``(n,)`` from the start to the end, without whole turns of angles and without shifts."""
        gap = unclosed(self.system, self.end - self.point.x)
        if self.drift is not None:
            gap[self.drift.components] = self.drift.moved
        return gap

    @property
    def slopes(self) -> np.ndarray:
        """Derivatives ``(n, n)`` of the gap in the start.

        A cyclic component has no gap. In the place of its row is that of its start, which stays as it is.
        """
        identity = np.eye(len(self.end))
        slopes = np.where(self.cyclic[:, None], identity, self.fundamental - identity)
        if self.drift is not None:
            slopes[self.drift.components] = self.drift.slopes
        return slopes

    @property
    def cyclic(self) -> np.ndarray:
        """Whether each component ``(n,)`` is cyclic."""
        return np.asarray(self.system.is_cyclic[: len(self.end)])

    @property
    def reached(self) -> bool:
        """Whether the run is valid up to its end; where an order mattered it is that of the order listed."""
        return self.status.ok or self.status.code == StatusCode.AMBIGUOUS_ORDER

    @property
    def whole(self) -> bool:
        """Whether the run came back to its mode, with as much under way, and with finite tangent vectors."""
        back = self.reached and self.end_mode == self.mode and not self.more_waits
        return back and bool(np.all(np.isfinite(self.fundamental)))

    @property
    def rounding(self) -> np.ndarray:
        """The gap ``(n,)`` that rounding of the start and of the end may make."""
        share = ROUNDING_OF_GAP * EPSILON * self.magnitude
        return np.asarray(share + np.abs(self.fundamental) @ share)

    def growth(self, scale: np.ndarray) -> float:
        """The largest modulus of a multiplier: errors of the start grow by that."""
        return float(np.abs(np.linalg.eigvals(self.fundamental / scale[:, None] * scale)).max())

    def size(self, scale: np.ndarray) -> float:
        """The residual in units of ``scale (n,)``, infinite where there is none."""
        if not self.whole:
            return np.inf
        gap = self.gap / scale
        return length(gap if self.departure is None else np.append(gap, self.departure.distances(scale)))

    def closes(self, tolerance: float, rounding: np.ndarray, nothing: np.ndarray | float = 0.0) -> bool:
        """Whether the ends agree to a share of the orbit's motion, or to rounding, in every component.

        Components at rest have to be carried nowhere, as far as their integrals and the states are known.
        ``nothing (n,)`` counts as zero.
        """
        most = np.maximum(tolerance * self.extent, rounding)
        if self.drift is not None:
            known = np.maximum(tolerance * self.extent, ROUNDING_OF_GAP * EPSILON * self.magnitude)
            most[self.drift.components] = self.drift.blur + np.abs(self.drift.slopes) @ known
        if self.departure is not None and not self.departure.within(most):
            return False
        return self.whole and bool(np.all(np.abs(self.gap) <= np.maximum(most, nothing)))


@attrs.frozen(eq=False)
class Newton:
    """Newton's step in units of ``scale (n,)``, so that the units of the states do not matter.

    ``first (n,)`` is the scale of the first shot, ``moved (n,)`` is how far the last step went; where the
    period is unknown too the state stays in the plane ``plane (n,)``, in units of ``first``, through
    ``anchor (n,)``, across the field there.
    """

    scale: np.ndarray
    first: np.ndarray
    moved: np.ndarray
    free_period: bool
    anchor: np.ndarray
    plane: np.ndarray

    @classmethod
    def begin(cls, shot: Shot, atol: float, free_period: bool) -> Newton:
        """From the first shot; sizes below the solver's absolute tolerance count as that."""
        scale = np.maximum(shot.magnitude, max(atol, np.finfo(float).tiny))
        with np.errstate(over="ignore"):  # a field of 1e300 beside a component of 1e-14
            plane = np.where(shot.cyclic, 0.0, shot.field / scale)
        return cls(scale, scale, np.zeros_like(scale), free_period, shot.point.x, plane)

    def advanced(self, shot: Shot, better: Shot) -> Newton:
        """After the step from a shot to a better one."""
        scale = np.maximum(self.scale, better.magnitude)
        return attrs.evolve(self, scale=scale, moved=better.point.x - shot.point.x)

    def measure(self, shot: Shot) -> np.ndarray:
        """Units ``(n,)`` of the gap in which a step of one scale changes each component by about one.

        A component at rest answers to its start, and to that of the others, by far less than one.
        """
        units = self.scale.copy()
        if shot.drift is not None:
            answers = np.abs(shot.drift.slopes * self.scale).max(axis=1)
            own = units[shot.drift.components]
            units[shot.drift.components] = np.where(answers > 0, answers, own)
        return units

    def measurable(self, shot: Shot) -> bool:
        """Whether the gap and its derivatives in units of the scale are within the range of floats."""
        with np.errstate(over="ignore", invalid="ignore"):
            return bool(
                np.all(np.isfinite(self._matrix(shot))) and np.all(np.isfinite(self._right(shot, self.scale)))
            )

    def step(self, shot: Shot, smallest: float = UNKNOWN) -> tuple[np.ndarray, float]:
        """Newton step of the state and of the period.

        It leaves out the directions in which the matrix is smaller than a share ``smallest`` of its largest
        singular value: by default rounding.
        """
        step = np.linalg.lstsq(self._matrix(shot), self._right(shot, self.measure(shot)), rcond=smallest)[0]
        longer = step[-1] * shot.point.period if self.free_period else 0.0
        return step[: len(shot.end)] * self.scale, float(longer)

    def drift(self, shot: Shot, other: Shot, farthest: float) -> np.ndarray:
        """Parts ``(n, m)`` of another shot's gap that no step shorter than ``farthest`` removes.

        Each column is a part, in the units of the state, along a direction of the gap in which the matrix of
        the shot is nearly singular; ``farthest`` is a share of the scale.
        """
        n = len(shot.end)
        left, sizes, _ = np.linalg.svd(self._matrix(shot), full_matrices=False)
        units = self.measure(shot)
        parts = left.T @ self._right(shot, units)
        far = left[:, np.abs(parts) > farthest * sizes]
        along = far.T @ self._right(other, units)
        return (far * along)[:n] * units[:, None]

    def free_directions(self, shot: Shot, other: Shot) -> bool:
        """Whether orbits are side by side: a direction of the start that the equations leave free.

        The smallest singular value of the matrix is then no larger than the error of the matrix, which the
        ``other`` shot tells: one with tighter tolerances, after the next step.
        """
        matrix = self._matrix(shot)
        sizes = np.linalg.svd(matrix, compute_uv=False)
        error = float(np.linalg.norm(self._matrix(other) - matrix, 2))
        return bool(sizes[-1] <= 2.0 * error + len(matrix) * EPSILON * sizes[0])

    def nearly_singular(self, shot: Shot, share: float) -> bool:
        """Whether the smallest singular value of the matrix is at most a share of the largest."""
        sizes = np.linalg.svd(self._matrix(shot), compute_uv=False)
        return bool(sizes[-1] <= share * sizes[0])

    def led_astray(self, shot: Shot, farthest: float) -> bool:
        """Whether the method went far along a direction in which the matrix is zero to rounding.

        That is more than so many times the size of the first shot. Where orbits come in families, the steps
        leave such directions out.
        """
        n = len(shot.end)
        _, sizes, right = np.linalg.svd(self._matrix(shot))
        family = right[sizes <= UNKNOWN * sizes[0], :n]
        gone = family.T @ (family @ ((shot.point.x - self.anchor) / self.scale)) * self.scale
        return bool(np.any(np.abs(gone) > farthest * self.first))

    def _matrix(self, shot: Shot) -> np.ndarray:
        """Derivatives of the gap, and of the place in the plane, in the state and in the period."""
        units = self.measure(shot)
        matrix = shot.slopes / units[:, None] * self.scale
        if self.free_period:
            speed = np.where(shot.cyclic, 0.0, shot.end_field / units * shot.point.period)
            matrix = np.block([[matrix, speed[:, None]], [self._across()[None, :], np.zeros((1, 1))]])
        if shot.departure is None:
            return matrix
        held = shot.departure.rows(self.scale)
        return np.vstack([matrix, np.pad(held, ((0, 0), (0, matrix.shape[1] - held.shape[1])))])

    def _right(self, shot: Shot, units: np.ndarray) -> np.ndarray:
        gap = shot.gap / units
        if self.free_period:
            gap = np.append(gap, self._across() @ ((shot.point.x - self.anchor) / self.scale))
        return -gap if shot.departure is None else -np.append(gap, shot.departure.distances(self.scale))

    def _across(self) -> np.ndarray:
        """The unit normal ``(n,)`` of the plane."""
        row = self.plane * (self.scale / self.first)
        return np.asarray(row / max(float(np.linalg.norm(row)), np.finfo(float).tiny))
