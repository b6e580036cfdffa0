"""The tangent vectors to start with."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.linalg import qr

from hybrid import HybridSystem, arguments, compile_system
from hybrid.simulation.plan import check_solver
from hybrid.simulation.trajectory import Trajectory
from hybrid.solvers import Solver
from hybrid.transform.aged import aged, least_dimension

# A direction of which less than this share is left is one that the mode does not allow.
LEAST_SHARE = 1e-8


def number_of_exponents(system: HybridSystem, k: int | None) -> int:
    """How many exponents are asked for; None for as many as all modes have."""
    most = least_dimension(compile_system(system).system)
    return most if k is None else arguments.count("k", k, 1, most, ", the dimension of the state")


def first_vectors(system: HybridSystem, k: int, solver: Solver | None) -> np.ndarray:
    """Tangent vectors to start with for ``k`` exponents, as columns, with the age last."""
    n = aged(compile_system(system).system).tangent_dimension
    by_sum_rule = 1 < k == n and check_solver(solver).tableau.implicit
    return generic_directions(n, k - by_sum_rule)


@cache
def generic_directions(n: int, k: int) -> np.ndarray:
    """Orthonormal directions ``(n, k)``, always the same, with a nonzero component along every axis.

    Axes are often invariant, for example the axis of a clock. A first vector along such an axis would never
    grow with the largest exponent.
    """
    directions, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(n, n)))
    # Read-only, because the cache returns the same array to every caller.
    directions.flags.writeable = False
    return np.asarray(directions[:, :k])


def orthonormal_at_start(trajectory: Trajectory) -> None:
    """Make the tangent vectors of a run orthonormal again where its mode has taken some directions from them.

    If there are more vectors than directions, the last ones are zero: their exponents are minus infinity.
    """
    if trajectory.system.age is None and not trajectory.holds:
        return
    trajectory.replace_tangents(trajectory.tangent_matrix)
    directions, sizes, _ = qr(trajectory.tangent_matrix, mode="economic", pivoting=True)
    kept = np.abs(np.diag(sizes)) > LEAST_SHARE * np.abs(sizes[0, 0])
    trajectory.replace_tangents(directions * kept)
