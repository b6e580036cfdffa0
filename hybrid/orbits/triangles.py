"""The tangent map of a run, interval by interval, as upper triangles between orthonormal bases."""

from __future__ import annotations

from collections.abc import Iterator

import attrs
import numpy as np

from hybrid.kernels.types import codes
from hybrid.orbits.factors import fundamental_factors
from hybrid.orbits.periodic_schur import SINGULAR, rowwise_qr
from hybrid.simulation.trajectory import Trajectory


@attrs.frozen(eq=False)
class Interval:
    """One interval of a run and its tangent map ``A Q = Q' R``.

    Attributes
    ----------
    t, x, mode
        Time, state ``(n,)`` and name of the mode at the start of the interval.
    basis
        ``Q (n, n)``, orthonormal, at the start of the interval.
    triangles
        Upper triangles ``(n, n)`` in the order in which they are applied; their product is ``R``. An entry of
        a diagonal is exactly zero where a jump annihilates a direction.
    """

    t: float
    x: np.ndarray
    mode: str
    basis: np.ndarray
    triangles: list[np.ndarray]

    @property
    def growth(self) -> np.ndarray:
        """Logarithms ``(n,)`` of the diagonal of ``R``; minus infinity for an annihilated direction."""
        diagonals = np.abs([np.diag(each) for each in self.triangles])
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(diagonals).sum(axis=0))


class Triangles:
    """Takes a trajectory with ``n`` tangent vectors further, one interval at a time.

    Parameters
    ----------
    trajectory
        The run.
    interval
        Length of an interval.
    basis
        Orthonormal directions ``(n, n)`` at the start.
    """

    def __init__(self, trajectory: Trajectory, interval: float, basis: np.ndarray) -> None:
        self.trajectory, self.interval, self.basis = trajectory, interval, basis
        self.begin, self.done, self.code = trajectory.t, 0, codes.DONE

    def following(self, count: int) -> Iterator[Interval]:
        """The next ``count`` intervals; fewer if the run ends, for which ``code`` has the reason."""
        for _ in range(count):
            interval = self._next()
            if interval is None:
                return
            yield interval

    def _next(self) -> Interval | None:
        run, basis = self.trajectory, self.basis
        t, x, mode = run.t, run.x, run.mode
        end = self.begin + (self.done + 1) * self.interval
        factors = fundamental_factors(run, end, np.ones(len(basis)))
        self.code = factors.code
        if factors.code != codes.DONE:
            return None
        triangles = []
        for i, factor in enumerate(factors.matrices):
            basis, triangle = rowwise_qr(factor @ basis)
            triangles.append(_with_zeros(triangle) if i in factors.singular else triangle)
        found = Interval(t, x, mode, self.basis, triangles)
        self.basis, self.done = basis, self.done + 1
        return found


def _with_zeros(triangle: np.ndarray) -> np.ndarray:
    """The triangle of a singular map, with exact zeros for the directions that the map annihilates."""
    sizes = np.linalg.svd(triangle, compute_uv=False)
    lost = max(1, int(np.sum(sizes <= SINGULAR * sizes[0])))
    found = triangle.copy()
    for i in np.argsort(np.abs(np.diag(triangle)), kind="stable")[:lost]:
        found[i, i] = 0.0
    return found
