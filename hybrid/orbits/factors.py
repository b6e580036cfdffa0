"""The fundamental matrix of a run as a product of well-conditioned factors."""

from __future__ import annotations

from collections.abc import Callable

import attrs
import numpy as np

from hybrid.kernels.types import codes
from hybrid.orbits.closing import jumps_at_once, same_time
from hybrid.orbits.periodic_schur import ProductEigenvalues, product_eigenvalues, rowwise_qr
from hybrid.simulation.periods import split_time
from hybrid.simulation.trajectory import Trajectory
from hybrid.status import StatusCode

# The tangent vectors are orthonormalised where their condition number is above this, or their size leaves the
# range.
WORST_CONDITION = 1e2
SMALLEST, LARGEST = 1e-50, 1e50
# A step of an implicit method that strains them by more than this is taken again, shorter.
LONGEST_STEP = 1e3
SHORTER = 0.25
# Units of the states that differ by less than this from those that suit a run are good enough.
OTHER_UNITS = 1e3
MOST_ATTEMPTS = 3


@attrs.frozen(eq=False)
class Factors:
    """A fundamental matrix ``(n, n)`` as a product, in units of the states that suit it.

    Attributes
    ----------
    matrices
        The factors ``(n, n)`` in the order in which they are applied. Their product is ``D^-1 Phi D`` with
        the units of the states in the diagonal matrix ``D``: it has the eigenvalues of ``Phi``.
    singular
        Indices of the factors whose jump has a singular saltation matrix.
    units
        The units ``(n,)`` in which all factors have rows and columns of about the same size. They are known
        only after the run; with others it may have lost digits.
    code
        How the run ended.
    """

    matrices: list[np.ndarray]
    singular: set[int]
    units: np.ndarray
    code: int


class Products:
    """Tangent vectors that are orthonormal in given units, and the factors that made them so."""

    def __init__(self, trajectory: Trajectory, units: np.ndarray) -> None:
        self.trajectory, self.units = trajectory, units
        self.basis = np.eye(len(units))
        self.matrices: list[np.ndarray] = []
        self.singular: set[int] = set()
        self.sizes = np.zeros((len(units), len(units)))
        trajectory.replace_tangents(np.diag(units))

    @property
    def vectors(self) -> np.ndarray:
        """The tangent vectors ``(n, n)`` in the units."""
        return self.trajectory.tangent_matrix / self.units[:, None]

    def orthonormalise(self, *, singular: bool = False) -> None:
        """Make the vectors orthonormal, and keep the factor; a ``singular`` one annihilates a direction."""
        if singular:
            self.singular.add(len(self.matrices))
        vectors = self.vectors
        self.sizes += self._sizes_of(vectors)
        self.basis, triangle = rowwise_qr(vectors)
        self.matrices.append(triangle)
        self.trajectory.replace_tangents(self.units[:, None] * self.basis)

    def fly(self, place: tuple[int, float]) -> int:
        """Advance to a place in time or up to the next jump; DONE, MAX_JUMPS, or why the run ends early."""
        trajectory, run = self.trajectory, self.trajectory.run
        implicit = bool(trajectory.method.implicit)
        while True:
            if trajectory.stop.is_set():
                return StatusCode.INTERRUPTED
            before = run.saved() if implicit else None
            steps, record = int(run.steps), trajectory.no_record()
            if steps >= trajectory.max_steps:
                return codes.MAX_STEPS
            code = trajectory.advance_to(*place, record, max_steps=steps + 1, max_jumps=trajectory.jumps)
            if code not in (codes.MAX_STEPS, codes.MAX_JUMPS, codes.DONE):
                return code
            vectors = self.vectors
            if not np.all(np.isfinite(vectors)):
                return codes.NON_FINITE
            sizes = np.linalg.svd(vectors, compute_uv=False)
            if before is not None and sizes[0] > WORST_CONDITION * LONGEST_STEP * sizes[-1]:
                length = run.last_step
                run.restore(before)
                run.next_step = SHORTER * length
                trajectory.replace_tangents(trajectory.tangent_matrix)
                continue
            if sizes[0] > WORST_CONDITION * sizes[-1] or not SMALLEST < sizes[0] < LARGEST:
                self.orthonormalise()
            if code != codes.MAX_STEPS:
                return code

    def jump(self, place: tuple[int, float]) -> int:
        """Make the jumps of this instant, with a factor of their own."""
        trajectory, run = self.trajectory, self.trajectory.run
        self.orthonormalise()
        run.log_determinant = 0.0
        code = trajectory.advance_to(*place, trajectory.no_record(), max_steps=int(run.steps))
        if code in (codes.MAX_STEPS, codes.DONE):
            self.orthonormalise(singular=not run.log_determinant > -np.inf)
        return code

    @property
    def factors(self) -> list[np.ndarray]:
        """The factors so far."""
        return [*self.matrices, self.vectors]

    @property
    def all_sizes(self) -> np.ndarray:
        """Sizes ``(n, n)`` of the entries of the tangent maps so far."""
        return self.sizes + self._sizes_of(self.vectors)

    def ended(self, code: int) -> Factors:
        """The factors of a run that has ended with a code."""
        return Factors(self.factors, self.singular, suited(self.units, self.all_sizes), code)

    def _sizes_of(self, vectors: np.ndarray) -> np.ndarray:
        with np.errstate(invalid="ignore"):  # a limit of no size leaves vectors without bound
            found = np.abs(vectors @ self.basis.T)
        return found if np.all(np.isfinite(found)) else np.zeros_like(found)


def suited(units: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """The units ``(n,)`` that suit tangent maps whose entries have these ``sizes (n, n)`` in other ones."""
    own = sizes * units[:, None] / units
    if not np.all(np.isfinite(own)):
        return units
    # SciPy's linear algebra takes long to import.
    from scipy.linalg import matrix_balance

    # SciPy makes whole numbers of the units too, as if they were a permutation.
    with np.errstate(invalid="ignore"):
        [found, _] = matrix_balance(own, permute=False, separate=True)[1]
    return np.asarray(found)


def fundamental_eigenvalues(start: Callable[[], Trajectory], t: float) -> ProductEigenvalues:
    """Eigenvalues of the fundamental matrix from a start to ``t``; nan where the run does not reach its end.

    The run is repeated in other units of the states if those of the model are far from suiting it.
    """
    trajectory = start()
    units = np.ones(trajectory.system.tangent_dimension)
    for attempt in range(MOST_ATTEMPTS):
        factors = fundamental_factors(trajectory if attempt == 0 else start(), t, units)
        if factors.code != codes.DONE or not all(np.all(np.isfinite(each)) for each in factors.matrices):
            unknown = np.full(len(units), np.nan)
            return ProductEigenvalues(unknown, unknown.astype(complex))
        change = factors.units / units
        if change.max() <= OTHER_UNITS * change.min():
            break
        units = factors.units
    return product_eigenvalues(factors.matrices, factors.singular)


def fundamental_factors(trajectory: Trajectory, t: float, units: np.ndarray) -> Factors:
    """Advance one period, to ``t``; returns the fundamental matrix as factors.

    The trajectory carries ``n`` tangent vectors. The factors are the upper triangles of ``A_j Q_{j-1} = Q_j
    R_j``, and the last ``Q`` with what follows, all in ``units (n,)`` of the states. The jumps of one instant
    have a factor of their own, so that what they annihilate is told from what a flight makes small.
    """
    place = split_time(t, trajectory.model.period)
    repeats = jumps_at_once(trajectory)
    products = Products(trajectory, units)
    while True:
        code = products.fly(place)
        if code == codes.MAX_JUMPS and repeats and same_time(trajectory.t, t, trajectory.model.period):
            code = codes.DONE
        if code != codes.MAX_JUMPS:
            return products.ended(code)
        code = products.jump(place)
        if code != codes.MAX_STEPS:
            return products.ended(code)
