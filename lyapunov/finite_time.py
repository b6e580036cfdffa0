"""Finite-time Lyapunov exponents: growth from a start over a given time, through jumps."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from hybrid import ArgumentError, HybridSystem, arguments
from hybrid.compiler.cache.loader import load_kernels
from hybrid.errors import HybridError
from hybrid.kernels.types import codes
from hybrid.orbits.factors import fundamental_factors
from hybrid.orbits.periodic_schur import product_eigenvalues
from hybrid.simulation.crew import TOGETHER, Crew, together
from hybrid.simulation.trajectory import Trajectory, start
from hybrid.solvers import Solver
from hybrid.system.graph import as_system
from hybrid.system.growth import growing
from hybrid.transform.aged import aged, least_dimension
from lyapunov.estimates import Flight, interval_length
from lyapunov.interval import end_at, maps_of

# By how much two sums of logarithms may differ that are the same but for the error of a run.
SAME = 1e-9
STARTS = "be a state (n,) or states of shape (N, n)"


@growing
def finite_time_exponents(
    system: HybridSystem,
    x0: ArrayLike,
    *,
    interval: float | None = None,
    intervals: int | None = None,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    t0: float = 0.0,
    solver: Solver | None = None,
) -> np.ndarray:
    r"""Growth rates over a time from a start, or from many; also over intervals one after the other.

    .. math:: \lambda_i(x_0, T) = \frac{1}{T} \ln \sigma_i\big(\Phi(t_0 + T, t_0)\big)

    with the singular values :math:`\sigma_i` of the fundamental matrix, in which each jump has its saltation
    matrix. The matrix is kept as a product of well-conditioned factors, so each exponent has its own relative
    accuracy, however far the others are. Singular values depend on the units of the states; the limit of
    :math:`\lambda_i` for long times does not.

    Parameters
    ----------
    system, mode, parameters, t0, solver
        As for :func:`hybrid.simulate`.
    x0
        A start ``(n,)``, or starts ``(N, n)``. Held components and counters come last and may be left out:
        they are 0 then.
    interval
        The time :math:`T`; by default as for :func:`lyapunov.lyapunov_spectrum`.
    intervals
        Number of intervals along the run, each with exponents of its own; by default one, without an axis.

    Returns
    -------
    (n,), (N, n), (intervals, n) or (N, intervals, n) array
        Largest first, in inverse units of time. Minus infinity for a direction that a jump annihilates; nan
        for an interval whose end a run does not reach, and for a start that no mode allows.

    Raises
    ------
    ModelError
        If the model cannot be compiled, or an argument does not fit it (ArgumentError).

    References
    ----------
    S. C. Shadden, F. Lekien, J. E. Marsden, Physica D 212 (2005) 271, section 2,
    doi:10.1016/j.physd.2005.10.007.

    Examples
    --------
    >>> import models
    >>> from lyapunov import finite_time_exponents
    >>> finite_time_exponents(models.bouncing_ball(), (1.0, 0.0), interval=0.1).round(3)
    array([ 0.5, -0.5])
    """
    as_system("system", system)
    starts = system.variables.completed(arguments.numbers("x0", x0, STARTS))
    count = 1 if intervals is None else arguments.count("intervals", intervals, 1)
    one = starts.ndim == 1
    if not one:
        _check(system, starts)
    found = np.full((1 if one else len(starts), count, least_dimension(system)), np.nan)
    origins, failures = (starts[None] if one else starts), list[HybridError]()

    def begin(i: int) -> Trajectory:
        vectors = np.eye(aged(system).tangent_dimension)
        return start(system, origins[i], t0, mode=mode, parameters=parameters, solver=solver, tangent=vectors)

    for first in range(0, len(origins), TOGETHER):
        flights = dict[int, Flight]()
        for i in range(first, min(first + TOGETHER, len(origins))):
            try:
                trajectory = begin(i)
                flights[i] = Flight(trajectory, interval_length(trajectory, interval, count))
            except HybridError as failure:
                failures.append(failure)
        not_told = _not_told(flights, found)
        for flight in flights.values():
            flight.trajectory.release()
        for i in not_told:
            try:
                _fill(found[i], begin(i), flights[i].length)
            except HybridError as failure:
                failures.append(failure)
    if failures and len(failures) == len(found):
        # Not one start is at fault, but another argument.
        raise failures[0]
    found = found[:, 0] if intervals is None else found
    return found[0] if one else found


def _check(system: HybridSystem, starts: np.ndarray) -> None:
    if starts.ndim != 2 or starts.shape[1] != system.dimension:
        raise ArgumentError(f"x0 must {STARTS}, here n = {system.dimension}; got shape {starts.shape}.")
    bad = np.flatnonzero(~np.isfinite(starts).all(axis=1))
    if bad.size:
        raise ArgumentError(f"x0 must be finite; got x0[{bad[0]}] = {starts[bad[0]].tolist()}.")
    system.variables.check_counts("x0", starts)


def _not_told(flights: Mapping[int, Flight], out: np.ndarray) -> list[int]:
    """Write the exponents of runs into their places in ``out``, but for those returned, which need factors.

    The runs take their steps together. Their maps are single matrices, which tell the exponents if no digit
    is lost in them. Then the logarithms of all singular values add up to what the sum rule says.
    """
    if not flights:
        return []
    trajectory = next(iter(flights.values())).trajectory
    plan, n, k = trajectory.plan, trajectory.model.dimension, trajectory.tangents
    if out.shape[2] < k:
        return [*flights]
    jobs = [maps_of(end_at(each.run), length, out.shape[1], n * k + 1) for each, length in flights.values()]
    tasks = [each.task(each.no_record()) for each, _ in flights.values()]
    crew = Crew(together(trajectory.compiled, plan, k), plan, tasks, jobs)
    crew.memory.max_steps[:] = trajectory.max_steps
    crew.memory.codes[:] = codes.GO_ON
    crew.go(load_kernels("lyapunov.kernels").maps_of_run, trajectory.stop)
    maps = np.stack([each.maps for each in jobs])
    whole = np.isfinite(maps).all(axis=(1, 2))
    vectors = np.where(whole[:, None, None], maps, 1.0)[:, :, :-1].reshape(*maps.shape[:2], k, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithms = np.log(np.linalg.svd(vectors[..., :k], compute_uv=False))
        told = whole & (np.abs(logarithms.sum(axis=2) - maps[:, :, -1]) <= SAME).all(axis=1)
    for i, is_told, each in zip(flights, told, logarithms, strict=True):
        if is_told:
            out[i] = each / flights[i].length
    return [i for i, is_told in zip(flights, told, strict=True) if not is_told]


def _fill(out: np.ndarray, trajectory: Trajectory, length: float) -> None:
    """Write the exponents of intervals of this length into ``out (intervals, n)``."""
    begin, units = trajectory.t, np.ones(trajectory.system.tangent_dimension)
    for i in range(len(out)):
        factors = fundamental_factors(trajectory, begin + (i + 1) * length, units)
        whole = all(np.all(np.isfinite(each)) for each in factors.matrices)
        if factors.code != codes.DONE or not whole:
            return
        # The squares of the singular values are the eigenvalues of the transposed matrix times the matrix.
        count = len(factors.matrices)
        product = [*factors.matrices, *(each.T for each in reversed(factors.matrices))]
        singular = [*factors.singular, *(2 * count - 1 - k for k in factors.singular)]
        out[i] = product_eigenvalues(product, singular).log_moduli[: out.shape[1]] / (2 * length)
