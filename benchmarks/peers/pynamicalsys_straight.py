"""pynamicalsys: its adaptive Runge-Kutta method across the contact, compiled with numba."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numba
import numpy as np
import sympy
from pynamicalsys import ContinuousDynamicalSystem

from benchmarks.peers.growth import Growth, Method
from benchmarks.peers.problem import ATOL_OVER_RTOL, equations, returning
from hybrid import HybridSystem

SEED = 13


def methods(system: HybridSystem, x0: Sequence[float], t_end: float, intervals: int) -> dict[str, Method]:
    """Methods for a system with one mode; the error control includes the tangent vector.

    The vector is normalised at each step. No transient is used, because pynamicalsys runs it without the
    tangent vector.
    """
    given = equations(system)
    (field,), n = given.fields, len(given.x)
    value = returning(field)
    # Replace the step function in the slope of max(z, 0)**1.5 by 1: it is multiplied by a root that is zero.
    slopes = returning(
        [e.diff(x).replace(sympy.Heaviside, lambda *_: sympy.Integer(1)) for e in field for x in given.x]
    )

    @numba.njit
    def motion(t: float, x: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        return value(t, x)

    @numba.njit
    def jacobian(t: float, x: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        return slopes(t, x).reshape(n, n)

    model = ContinuousDynamicalSystem(
        equations_of_motion=motion,
        jacobian=jacobian,
        system_dimension=n,
        number_of_parameters=0,
        parameters=[],
    )
    # The vector that pynamicalsys draws with this seed.
    vector = 2 * np.random.RandomState(SEED).rand(n) - 1

    def at(rtol: float) -> Callable[[], Growth]:
        def run(end: float = t_end) -> Growth:
            model.integrator("rk45", rtol=rtol, atol=rtol * ATOL_OVER_RTOL)
            found = float(model.lyapunov(x0, end, num_exponents=1, seed=SEED, endpoint=False))
            return Growth(vector, 0, found, found)

        run(t_end / intervals)
        return run

    return {"pynamicalsys rk45": at}
