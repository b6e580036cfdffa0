"""Radau IIA: implicit method of order 5 for stiff modes."""

from __future__ import annotations

from typing import ClassVar

import attrs
import numpy as np

from hybrid.solvers.solver import Solver
from hybrid.solvers.tableau import Tableau, bernstein_from_powers

_ROOT = 6**0.5
_C = np.array([(4 - _ROOT) / 10, (4 + _ROOT) / 10, 1.0])
_A = np.array(
    [
        [(88 - 7 * _ROOT) / 360, (296 - 169 * _ROOT) / 1800, (-2 + 3 * _ROOT) / 225],
        [(296 + 169 * _ROOT) / 1800, (88 + 7 * _ROOT) / 360, (-2 - 3 * _ROOT) / 225],
        [(16 - _ROOT) / 36, (16 + _ROOT) / 36, 1 / 9],
    ]
)
# Reciprocal of the real eigenvalue of the inverse of A.
_GAMMA_0 = 1 / (3 + 3 ** (2 / 3) - 3 ** (1 / 3))
# Weights of the stages' increments, eq. (8.18).
_E = np.array([-13 - 7 * _ROOT, -13 + 7 * _ROOT, -1.0]) / 3


def _with_start(rows: np.ndarray) -> np.ndarray:
    """Weights of the three stages, preceded by a zero weight of the derivative at the start."""
    return np.hstack([np.zeros((len(rows), 1)), rows])


def _integrals() -> np.ndarray:
    """Coefficients of ``theta, theta^2, theta^3`` (rows) in the integrals of the Lagrange polynomials."""
    lagrange = np.linalg.inv(np.vander(_C, increasing=True))
    return lagrange / np.array([[1.0], [2.0], [3.0]])


@attrs.frozen
class RadauIIA(Solver):
    r"""Implicit method of order 5 for stiff modes: three-stage Radau IIA collocation.

    .. math::

        K_i = f\Bigl(t + c_i h,\; x + h \sum_j a_{ij} K_j\Bigr), \qquad x(t + h) = x + h \sum_j b_j K_j

    The method is L-stable (stable however stiff the mode) and stiffly accurate (it keeps its order on the
    slow manifold). The stages of the state come from a simplified Newton iteration with the model's Jacobian.
    The stages of the tangent vectors come from one more linear solve, without iteration. The interpolant is
    the collocation polynomial, of order 3 within a step; at events the state has the order of the step.

    The tolerances also bound the error of the interpolant, so that no event is missed within a step. At the
    ends of steps the error is far smaller: there ``rtol = 1e-7`` is about as accurate as 1e-10 with an
    explicit pair. Fast transients are resolved, not stepped over.

    References
    ----------
    E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, 2nd ed., Springer 1996, section IV.8,
    doi:10.1007/978-3-642-05221-7: the method (table IV.5.6), its iteration (eqs. 8.10, 8.11), its error
    estimate (eqs. 8.18, 8.19).

    Examples
    --------
    >>> import numpy as np
    >>> import hybrid
    >>> field = lambda t, x, p: (-1e5 * (x.y - np.cos(t)),)
    >>> fast = hybrid.HybridSystem(state=("y",), modes=[hybrid.Mode("relax", field)])
    >>> arc = hybrid.simulate(fast, (0.0,), (0.0, 10.0), solver=hybrid.RadauIIA(rtol=1e-6, atol=1e-8))
    >>> bool(abs(arc.x[-1, 0] - np.cos(10.0)) < 1e-4), arc.steps < 500
    (True, True)
    """

    attempt: ClassVar[tuple[str, str]] = ("hybrid.kernels.steps.radau", "attempt_radau")
    tableau: ClassVar[Tableau] = Tableau(
        order=5,
        error_order=4,
        a=_with_start(np.vstack([np.zeros(3), _A])),
        b=_A[2],
        c=np.array([0.0, *_C]),
        error=_GAMMA_0 * np.array([1.0, *(_E @ _A)]),
        second_error=np.zeros(4),
        interpolant=_with_start(bernstein_from_powers(np.vstack([np.zeros(3), _integrals()]))),
        implicit=True,
    )
