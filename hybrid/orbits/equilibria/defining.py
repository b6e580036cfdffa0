"""What holds along a curve of bifurcations of an equilibrium over two parameters, as regular equations."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.orbits.equilibria.curve import Spot
from hybrid.orbits.equilibria.equations import Barrier, Reduced
from hybrid.orbits.equilibria.normal_forms import critical_pair


@attrs.frozen(eq=False)
class BoundaryPoint:
    """An equilibrium on a guard; the unknowns are the state and the two parameters ``(n + 2,)``."""

    part: Reduced
    barrier: Barrier

    def residual(self, u: np.ndarray) -> np.ndarray:
        """Values ``(n + 1,)``."""
        return np.append(self.part.residual(u), self.barrier.height.value(self.part.equations.known(u)))

    def jacobian(self, u: np.ndarray) -> np.ndarray:
        """Derivatives ``(n + 1, n + 2)``."""
        return np.vstack([self.part.jacobian(u), self.barrier.height.jacobian(self.part.equations.known(u))])

    def extra(self, u: np.ndarray, units: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The unknowns before the state at a point, none, and their units."""
        return np.empty(0), np.empty(0)

    def renewed(self, part: Reduced, whole: np.ndarray) -> BoundaryPoint:
        """The equations at another point."""
        return BoundaryPoint(part, self.barrier)


@attrs.frozen(eq=False)
class FoldPoint:
    """An eigenvalue zero: before the state comes its eigenvector ``v``, of length 1."""

    part: Reduced

    def residual(self, whole: np.ndarray) -> np.ndarray:
        """Values ``(2 n + 1,)``."""
        v, u = np.split(whole, [self.part.equations.n])
        rows = self.part.jacobian(u)
        return np.concatenate([self.part.residual(u), rows[:, :-2] @ v, [v @ v - 1.0]])

    def jacobian(self, whole: np.ndarray) -> np.ndarray:
        """Derivatives ``(2 n + 1, 2 n + 2)``."""
        n = self.part.equations.n
        v, u = np.split(whole, [n])
        rows = self.part.jacobian(u)
        along = self.part.second_along(u, np.append(v, [0.0, 0.0]))
        return np.block(
            [
                [np.zeros((n, n)), rows],
                [rows[:, :-2], along],
                [2.0 * v[None, :], np.zeros((1, n + 2))],
            ]
        )

    def extra(self, u: np.ndarray, units: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The eigenvector at a point, and the units of its entries."""
        v = np.linalg.svd(self.part.jacobian(u)[:, :-2])[2][-1]
        return v, _units_of(v, units)

    def renewed(self, part: Reduced, whole: np.ndarray) -> FoldPoint:
        """The equations at another point."""
        return FoldPoint(part)


@attrs.frozen(eq=False)
class HopfPoint:
    """A pair ``+- i omega``: before the state come its eigenvector ``a + i b``, of length 1, and ``omega``.

    The phase of the eigenvector is that of ``like`` (n,), complex, as far as it can be.
    """

    part: Reduced
    like: np.ndarray

    def residual(self, whole: np.ndarray) -> np.ndarray:
        """Values ``(3 n + 2,)``."""
        a, b, omega, u = self._split(whole)
        matrix, (c, d) = self.part.equations.matrix(u), (self.like.real, self.like.imag)
        return np.concatenate(
            [
                self.part.residual(u),
                matrix @ a + omega * b,
                matrix @ b - omega * a,
                [a @ a + b @ b - 1.0, c @ b - d @ a],
            ]
        )

    def jacobian(self, whole: np.ndarray) -> np.ndarray:
        """Derivatives ``(3 n + 2, 3 n + 3)``."""
        equations, n = self.part.equations, self.part.equations.n
        a, b, omega, u = self._split(whole)
        known, one = equations.known(u), np.eye(n)
        matrix = equations.matrix(u)
        alongs = [equations.rates.second_along(known, np.append(each, [0.0, 0.0])) for each in (a, b)]
        none = np.zeros((1, n + 3))
        return np.block(
            [
                [np.zeros((n, 2 * n + 1)), self.part.jacobian(u)],
                [matrix, omega * one, b[:, None], alongs[0]],
                [-omega * one, matrix, -a[:, None], alongs[1]],
                [2.0 * a[None, :], 2.0 * b[None, :], none],
                [-self.like.imag[None, :], self.like.real[None, :], none],
            ]
        )

    def extra(self, u: np.ndarray, units: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The eigenvector and the frequency at a point, and their units."""
        omega = critical_pair(self.part.equations.within(u)).imag
        entries = _units_of(self.like, units)
        return np.concatenate([self.like.real, self.like.imag, [omega]]), np.concatenate(
            [entries, entries, [omega]]
        )

    def renewed(self, part: Reduced, whole: np.ndarray) -> HopfPoint:
        """The equations at another point, with the eigenvector there."""
        a, b, _, _ = self._split(whole)
        return HopfPoint(part, a + 1j * b)

    def _split(self, whole: np.ndarray) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
        n = self.part.equations.n
        return whole[:n], whole[n : 2 * n], float(whole[2 * n]), whole[2 * n + 1 :]


Defining = BoundaryPoint | FoldPoint | HopfPoint


def _units_of(vector: np.ndarray, units: np.ndarray) -> np.ndarray:
    """Units of the entries of an eigenvector, from those of the unknowns ``(n + 2,)``."""
    sizes = units[:-2]
    return sizes * float((np.abs(vector) / sizes).max())


def defining_of(spot: Spot) -> Defining:
    """The defining equations that a point of a curve solves."""
    assert isinstance(spot.system, BoundaryPoint | FoldPoint | HopfPoint)
    return spot.system


def state_of(spot: Spot) -> np.ndarray:
    """The state and the two parameters ``(n + 2,)`` of a point of a curve."""
    return spot.u[-(defining_of(spot).part.equations.n + 2) :]
