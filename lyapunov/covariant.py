"""Covariant Lyapunov vectors: the directions that grow with each exponent, through jumps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Unpack

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import HybridSystem, Status, arguments
from hybrid.display.progress import progress_bar
from hybrid.display.tables import counted
from hybrid.measures.averages import TaperedMean, standard_error, taper_inflation
from hybrid.orbits.triangles import Interval, Triangles
from hybrid.shared import shares
from hybrid.simulation.ending import status_of
from hybrid.simulation.labelled import Names, attributes, with_counters
from hybrid.simulation.trajectory import Trajectory
from hybrid.system.graph import as_system
from hybrid.system.growth import growing
from hybrid.transform.aged import aged
from lyapunov.asked import Averaging, begun, numbers_of
from lyapunov.directions import generic_directions
from lyapunov.estimates import interval_length

if TYPE_CHECKING:
    import xarray


@attrs.frozen(eq=False, repr=False)
class CovariantVectors:
    """Covariant Lyapunov vectors at the starts of ``N`` intervals of one orbit.

    If a mode has an `hybrid.After`, states and vectors have the time since the entry as their last component
    but for counters.

    Attributes
    ----------
    vectors
        ``(N, n, n)``: unit vectors as columns, in the order of the exponents. The tangent map takes each to a
        multiple of the next one, except for a vector that a jump annihilates: that one is mapped to zero.
    exponents, standard_error
        ``(n,)``, as those of :func:`lyapunov.lyapunov_spectrum`; minus infinity for an annihilated direction.
    growths
        ``(N, n)``: growth rate of each vector over its interval. Their means are the exponents.
    angles
        ``(N,)``: smallest angle, in radians, between the unstable space, spanned by the vectors with positive
        exponents, and the stable one, spanned by those with negative exponents. Zero is a tangency. nan
        without one of the two. Exponents that cannot be told from zero belong to neither.
    t, x, mode
        Times ``(N,)``, states ``(N, n)`` and names of the modes ``(N,)`` at the starts of the intervals.
    interval
        Length of an interval in units of time.
    status
        How the run ended.
    names
        Names of the state's components, and units where the system has them.

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from lyapunov import covariant_vectors
    >>> found = covariant_vectors(models.solvable_oscillator(), (0.3, 0.0), interval=1.0, intervals=50)
    >>> round(float(found.exponents[0]), 3), found.vectors.shape
    (0.5, (50, 2, 2))
    >>> bool(np.allclose(np.linalg.norm(found.vectors, axis=1), 1.0))
    True
    """

    vectors: np.ndarray
    exponents: np.ndarray
    standard_error: np.ndarray
    growths: np.ndarray
    angles: np.ndarray
    t: np.ndarray
    x: np.ndarray
    mode: np.ndarray
    interval: float
    status: Status
    names: Names

    def __len__(self) -> int:
        return len(self.vectors)

    def to_xarray(self) -> xarray.Dataset:
        """The vectors, with the axes ``sample``, ``state`` and ``exponent``."""
        import xarray

        return xarray.Dataset(
            {
                "vectors": (
                    ("sample", "state", "exponent"),
                    with_counters(self.vectors, len(self.names.state)),
                ),
                "exponents": ("exponent", self.exponents, self.names.rate),
                "standard_error": ("exponent", self.standard_error, self.names.rate),
                "growths": (("sample", "exponent"), self.growths, self.names.rate),
                "angles": ("sample", self.angles, {"units": "rad"}),
                "x": (("sample", "state"), self.x, self.names.states),
                "mode": ("sample", self.mode),
            },
            {
                "t": ("sample", self.t, self.names.of("t")),
                "exponent": np.arange(1, len(self.exponents) + 1),
                **self.names.coords(),
            },
            attributes("covariant vectors", self.status),
        )

    def __repr__(self) -> str:
        values = ", ".join(f"{value:.6g}" for value in self.exponents)
        return (
            f"<CovariantVectors at {counted(len(self), 'point')}, exponents [{values}], {self.status.brief}>"
        )


@growing
@shares(Averaging)
def covariant_vectors(
    system: HybridSystem,
    x0: ArrayLike,
    *,
    progress: bool = False,
    **asked: Unpack[Averaging],
) -> CovariantVectors:
    r"""Covariant Lyapunov vectors by the method of Ginelli and others.

    Forward, the tangent map of interval ``k`` is :math:`A_k Q_k = Q_{k+1} R_k`. Backward, the coefficients of
    the vectors in these bases follow from

    .. math:: C_k = R_k^{-1} C_{k+1} D_k,

    with upper triangles :math:`C_k` whose columns the diagonal matrices :math:`D_k` bring to unit length. The
    columns of :math:`Q_k C_k` are the vectors. Jumps belong to the tangent map with their saltation matrices.
    A direction that a jump annihilates is the solution of :math:`R_k c = 0`: it is known from its own future
    up to that jump, and no inverse is needed.

    Vectors of equal exponents, as those of a complex pair of multipliers, are not unique: only the space that
    they span is. Lengths and angles are those in the units of the model's states.

    Parameters
    ----------
    system, x0
        As for :func:`hybrid.simulate`.
    intervals
        Number of points, which are an interval of time apart.
    transient
        Number of intervals to run before the first point, in which the orbit reaches the attractor and the
        bases settle, and once more after the last point, in which the triangles settle backward. The error of
        both falls like ``exp(-transient * interval * gap)`` with the smallest gap between two exponents.
    progress
        Whether to show a progress bar.

    Returns
    -------
    CovariantVectors
        With fewer points and a status if the run ends early; the last ones then lack their backward
        transient.

    Raises
    ------
    ModelError
        If the model cannot be compiled, or an argument does not fit it (ArgumentError).

    References
    ----------
    F. Ginelli, P. Poggi, A. Turchi, H. Chaté, R. Livi, A. Politi, Phys. Rev. Lett. 99 (2007) 130601,
    doi:10.1103/PhysRevLett.99.130601; P. V. Kuptsov, U. Parlitz, J. Nonlinear Sci. 22 (2012) 727,
    doi:10.1007/s00332-012-9126-5, section 4.

    Examples
    --------
    >>> import models
    >>> from lyapunov import covariant_vectors
    >>> found = covariant_vectors(models.solvable_oscillator(), (0.3, 0.0), interval=1.0, intervals=50)
    >>> found.vectors.shape
    (50, 2, 2)
    >>> bool(abs(found.exponents[0] - 0.5) < 1e-6)
    True
    """
    n = aged(as_system("system", system)).tangent_dimension
    basis = generic_directions(n, n)
    transient, intervals = numbers_of(asked)
    progress = arguments.flag("progress", progress)
    trajectory = begun(system, x0, asked, basis)
    total = 2 * transient + intervals
    length = interval_length(trajectory, asked["interval"], total)
    triangles, passed = Triangles(trajectory, length, basis), []
    with trajectory.stop, progress_bar(total, "Covariant vectors", progress) as bar:
        for i, each in enumerate(triangles.following(total)):
            bar.update()
            if i >= transient:
                passed.append(each)
    return _result(trajectory, passed, intervals, length, triangles.code)


def _result(
    trajectory: Trajectory, passed: list[Interval], count: int, length: float, code: int
) -> CovariantVectors:
    n = trajectory.system.tangent_dimension
    vectors, growths = _backward(passed, n, count)
    kept = passed[:count]
    by_basis = np.array([each.growth for each in kept]).reshape(-1, n) / length
    mean = TaperedMean(n)
    mean.add(by_basis)
    exponents, error = mean.value(), standard_error(by_basis) * taper_inflation()
    # A growth rate is known to the error of the solver's steps.
    steps = trajectory.steps / max(len(passed), 1)
    zero = np.abs(exponents) <= 2 * np.nan_to_num(error) + trajectory.method.rtol * steps / length
    return CovariantVectors(
        vectors=vectors,
        exponents=exponents,
        standard_error=error,
        growths=growths / length,
        angles=angles_between(vectors[:, :, (exponents > 0) & ~zero], vectors[:, :, (exponents < 0) & ~zero]),
        t=np.array([each.t for each in kept]),
        x=np.array([each.x for each in kept]).reshape(-1, trajectory.model.dimension),
        mode=np.array([each.mode for each in kept], dtype=str),
        interval=length,
        status=status_of(trajectory, code),
        names=Names(trajectory.system.state_names, dict(trajectory.system.units)),
    )


def _backward(passed: list[Interval], n: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Vectors ``(N, n, n)`` and logarithms of their growth ``(N, n)`` at the first ``count`` intervals."""
    # Column j starts in the span of the first j vectors, with a part along the last of them.
    columns = np.eye(n)
    vectors, growths = [], []
    for i in range(len(passed) - 1, -1, -1):
        growth = np.zeros(n)
        for triangle in reversed(passed[i].triangles):
            columns, lengths = pulled_back(triangle, columns)
            growth += lengths
        if i < count:
            vectors.append(passed[i].basis @ columns)
            growths.append(growth)
    return np.array(vectors[::-1]).reshape(-1, n, n), np.array(growths[::-1]).reshape(-1, n)


def pulled_back(triangle: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit columns ``(n, n)`` that a triangle takes to multiples of ``columns``, and how it makes them grow.

    A column whose entry in the diagonal of the triangle is zero becomes the direction that the triangle
    annihilates; the logarithm of its growth is minus infinity.
    """
    gone = np.diag(triangle) == 0.0
    if not gone.any():
        before = np.triu(np.linalg.solve(triangle, columns))
    else:
        before = np.zeros_like(columns)
        for j, lost in enumerate(gone):
            size = j if lost else j + 1
            wanted = -triangle[:j, j] if lost else columns[:size, j]
            before[:size, j] = np.linalg.lstsq(triangle[:size, :size], wanted, rcond=None)[0]
            before[j, j] = 1.0 if lost else before[j, j]
    sizes = np.linalg.norm(before, axis=0)
    return before / sizes, np.where(gone, -np.inf, -np.log(sizes))


def angles_between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Smallest angle ``(N,)`` between the spans of columns ``(N, n, a)`` and ``(N, n, b)``; nan without one.

    It is found from its sine where it is small and from its cosine where it is large (Björck and Golub 1973,
    doi:10.1090/S0025-5718-1973-0348991-3).
    """
    if not first.shape[2] or not second.shape[2]:
        return np.full(len(first), np.nan)
    if first.shape[2] < second.shape[2]:
        first, second = second, first
    one, other = np.linalg.qr(first)[0], np.linalg.qr(second)[0]
    inside = one.swapaxes(1, 2) @ other
    cosine = np.linalg.svd(inside, compute_uv=False)[:, 0]
    sine = np.linalg.svd(other - one @ inside, compute_uv=False)[:, -1]
    return np.asarray(np.arctan2(sine, cosine))
