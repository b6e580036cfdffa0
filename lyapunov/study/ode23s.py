"""The paper's method: ode23s straight through the contacts, state and tangent vectors as one system.

The method serves to explain published figures. It is not one of the library's solvers, since it does not know
about events.
"""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import HybridSystem
from hybrid.compiler.cache.loader import load_kernels
from lyapunov.directions import generic_directions
from lyapunov.study.places import COUNTERS, SCRATCH_ROWS, STEP_TOO_SMALL

# Parameters in the order of the compiled field.
PARAMETERS = ("m1", "omega1", "xi1", "m2", "omega2", "xi2", "P", "phi0", "omega", "D", "K")


class StepTooSmall(ArithmeticError):
    """No step of ode23s above the rounding of the time met the tolerance."""


@attrs.frozen(eq=False)
class Steps:
    """Accepted steps of one integration: times ``(N,)``, states ``(N, n)``, and counts of the work."""

    t: np.ndarray
    y: np.ndarray
    rejected: int
    evaluations: int


@attrs.frozen
class Ode23s:
    """Rosenbrock pair of order 2(3) with the step control of MATLAB's ode23s.

    The numerical Jacobian is made anew at each step, by one-sided differences with increments that adapt. The
    error is estimated in the largest norm, relative to the state but at least to ``atol / rtol``.

    Attributes
    ----------
    rtol, atol
        MATLAB's RelTol and AbsTol; its defaults are 1e-3 and 1e-6.

    References
    ----------
    L. F. Shampine, M. W. Reichelt, The MATLAB ODE Suite, SIAM Journal on Scientific Computing 18 (1997) 1,
    doi:10.1137/S1064827594276424; the increments are those of D. E. Salane, Adaptive routines for forming
    Jacobians numerically, Sandia National Laboratories, SAND86-1319 (1986).
    """

    rtol: float = 1e-3
    atol: float = 1e-6

    def steps(
        self, field: Any, y: ArrayLike, t_span: tuple[float, float], p: ArrayLike = (), most: int = 100_000
    ) -> Steps:
        """All accepted steps for a compiled field ``f(t, y, p, out)``, an object with an ``address``."""
        y = np.array(y, dtype=float)
        record = np.full((most, 1 + len(y)), np.nan)
        counters = self._integrate(field, y, t_span, np.asarray(p, dtype=float), record)
        used = record[: counters[0]]
        return Steps(t=used[:, 0], y=used[:, 1:], rejected=int(counters[1]), evaluations=int(counters[2]))

    def _integrate(
        self, field: Any, y: np.ndarray, t_span: tuple[float, float], p: np.ndarray, record: np.ndarray
    ) -> np.ndarray:
        kernels = load_kernels("lyapunov.study.kernels")
        work, counters = scratch(len(y))
        code = kernels.integrate(field, p, *t_span, y, self.rtol, self.atol, record, work, counters)
        if code == STEP_TOO_SMALL:
            raise StepTooSmall(f"ode23s at rtol = {self.rtol:g}, atol = {self.atol:g} stopped in {t_span}")
        return counters

    def growths(
        self, system: HybridSystem, x0: ArrayLike, *, omega: float, k: int, periods: int, transient: int = 0
    ) -> np.ndarray:
        """Growth rates ``(periods, k)`` of ``k`` tangent vectors on the founding system, in 1/s.

        Formula (10) of the paper is their running mean. With a transient, the vectors are carried through it
        too and their growth is discarded.
        """
        kernels = load_kernels("lyapunov.study.kernels")
        n = system.dimension
        y = np.concatenate([np.asarray(x0, dtype=float), generic_directions(n, k).T.ravel()])
        rates = np.empty((transient + periods, k))
        work, counters = scratch(len(y))
        done = kernels.growth_rates(
            kernels.founding_field,
            parameters_of(system, omega),
            0.0,
            2 * np.pi / omega,
            y,
            self.rtol,
            self.atol,
            rates,
            work,
            counters,
        )
        if done < len(rates):
            raise StepTooSmall(f"ode23s at rtol = {self.rtol:g} stopped in period {done}")
        return rates[transient:]

    def carry(
        self,
        system: HybridSystem,
        x: ArrayLike,
        vectors: np.ndarray,
        t_span: tuple[float, float],
        *,
        omega: float,
    ) -> tuple[np.ndarray, np.ndarray]:
        """State ``(n,)`` and tangent vectors ``(n, k)`` of the founding system at the end of ``t_span``."""
        kernels = load_kernels("lyapunov.study.kernels")
        n = system.dimension
        y = np.concatenate([np.asarray(x, dtype=float), vectors.T.ravel()])
        self._integrate(kernels.founding_field, y, t_span, parameters_of(system, omega), np.zeros((0, 1)))
        return y[:n], y[n:].reshape(-1, n).T


def parameters_of(system: HybridSystem, omega: float) -> np.ndarray:
    """Parameters of the founding system ``(11,)`` in the order of the compiled field."""
    values = {**system.parameters, "omega": omega}
    return np.array([values[name] for name in PARAMETERS], dtype=float)


def scratch(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Scratch memory and counters of the kernels for ``n`` equations."""
    return np.zeros((SCRATCH_ROWS + 2 * n, n)), np.zeros(COUNTERS + n, dtype=np.int64)
