"""Newton's method for a solution that ends where it begins: one integration, and the step after it."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.status import Status

EPSILON = float(np.finfo(float).eps)
# Rounding of the end of an orbit, in units in the last place of its largest states: the largest gap accepted
# when Newton's method makes no more progress.
ROUNDING_OF_GAP = 100


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
class Shot:
    """What one integration over the period gives.

    ``extent (n,)`` is how far each component moves, ``magnitude (n,)`` its largest absolute value. ``hidden
    (n,)`` is the part of the gap that is lost in the rounding of components that hardly move. ``beyond``
    names the transitions whose guards the start lies beyond.
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
    hidden: np.ndarray | float = 0.0
    beyond: tuple[str, ...] = ()

    @property
    def gap(self) -> np.ndarray:
        """Distance ``(n,)`` from the start to the end."""
        return np.asarray(self.end - self.point.x + self.hidden)

    @property
    def whole(self) -> bool:
        """Whether the run reached its end, in the mode where it began, with finite tangent vectors."""
        return self.status.ok and self.end_mode == self.mode and bool(np.all(np.isfinite(self.fundamental)))

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
        return length(self.gap / scale) if self.whole else np.inf

    def closes(self, tolerance: float, rounding: np.ndarray) -> bool:
        """Whether the ends agree to a share of the orbit's motion, or to rounding, in every component."""
        return self.whole and bool(np.all(np.abs(self.gap) <= np.maximum(tolerance * self.extent, rounding)))


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
            plane = shot.field / scale
        return cls(scale, scale, np.zeros_like(scale), free_period, shot.point.x, plane)

    def advanced(self, shot: Shot, better: Shot) -> Newton:
        """After the step from a shot to a better one."""
        scale = np.maximum(self.scale, better.magnitude)
        return attrs.evolve(self, scale=scale, moved=better.point.x - shot.point.x)

    def measurable(self, shot: Shot) -> bool:
        """Whether the gap and its derivatives in units of the scale are within the range of floats."""
        with np.errstate(over="ignore", invalid="ignore"):
            return bool(np.all(np.isfinite(self._matrix(shot))) and np.all(np.isfinite(self._right(shot))))

    def step(self, shot: Shot, smallest: float | None = None) -> tuple[np.ndarray, float]:
        """Newton step of the state and of the period.

        It leaves out the directions in which the matrix is smaller than a share ``smallest`` of its largest
        singular value: by default rounding.
        """
        step = np.linalg.lstsq(self._matrix(shot), self._right(shot), rcond=smallest)[0]
        longer = step[-1] * shot.point.period if self.free_period else 0.0
        return step[: len(shot.end)] * self.scale, float(longer)

    def drift(self, shot: Shot, other: Shot, farthest: float) -> np.ndarray:
        """Parts ``(n, m)`` of another shot's gap that no step shorter than ``farthest`` removes.

        Each column is a part, in the units of the state, along a direction of the gap in which the matrix of
        the shot is nearly singular; ``farthest`` is a share of the scale.
        """
        n = len(shot.end)
        left, sizes, _ = np.linalg.svd(self._matrix(shot))
        parts = left.T @ self._right(shot)
        far = left[:, np.abs(parts) > farthest * sizes]
        along = far.T @ self._right(other)
        return (far * along)[:n] * self.scale[:, None]

    def led_astray(self, shot: Shot, farthest: float) -> bool:
        """Whether the method went far along a direction in which the matrix is zero to rounding.

        That is more than so many times the size of the first shot. Where orbits come in families, the steps
        leave such directions out.
        """
        n = len(shot.end)
        _, sizes, right = np.linalg.svd(self._matrix(shot))
        family = right[sizes <= (n + 1) * EPSILON * sizes[0], :n]
        gone = family.T @ (family @ ((shot.point.x - self.anchor) / self.scale)) * self.scale
        return bool(np.any(np.abs(gone) > farthest * self.first))

    def _matrix(self, shot: Shot) -> np.ndarray:
        """Derivatives of the gap, and of the place in the plane, in the state and in the period."""
        n, scale = len(shot.end), self.scale
        matrix = (shot.fundamental - np.eye(n)) / scale[:, None] * scale
        if not self.free_period:
            return matrix
        speed = shot.end_field / scale * shot.point.period
        return np.block([[matrix, speed[:, None]], [self._across()[None, :], np.zeros((1, 1))]])

    def _right(self, shot: Shot) -> np.ndarray:
        gap = shot.gap / self.scale
        if not self.free_period:
            return -gap
        return np.append(-gap, -self._across() @ ((shot.point.x - self.anchor) / self.scale))

    def _across(self) -> np.ndarray:
        """The unit normal ``(n,)`` of the plane."""
        row = self.plane * (self.scale / self.first)
        return np.asarray(row / max(float(np.linalg.norm(row)), np.finfo(float).tiny))
