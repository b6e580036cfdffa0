"""Base class of the solvers: tolerances, limits, and the coefficients that the kernels use."""

from __future__ import annotations

from math import ceil, log
from typing import TYPE_CHECKING, ClassVar, Self

import attrs

from hybrid import arguments
from hybrid.errors import ArgumentError

if TYPE_CHECKING:
    from hybrid.solvers.tableau import Tableau

# Below this rounding is all that a relative tolerance controls.
LEAST_RTOL = 1e-14
LOWEST_SERIES_ORDER = 12
# Higher orders take longer steps, whose errors show first in the energy of a contact.
HIGHEST_SERIES_ORDER = 28
# Orders added to the order with the fewest operations per unit of time, since each step has a fixed cost.
MORE_ORDERS = 6


@attrs.frozen
class Solver:
    """Abstract base of the solvers; use one of its subclasses.

    To add a solver, write a subclass with a ``tableau``. If it is not an explicit pair, it also names the
    kernel that attempts its steps.

    The error estimates of the state, divided by ``atol + rtol |x_i|`` for each component ``i``, are kept
    below 1 in the root mean square. Each tangent vector is controlled separately in the same way, with the
    scale ``rtol (|v_i| + rms(v))``.

    Parameters
    ----------
    rtol, atol
        Relative and absolute tolerance per step; ``atol`` in the units of the state.
    max_step
        Longest step, in units of time.
    max_steps
        Most steps a run may try before it ends with the status ``MAX_STEPS``.

    Raises
    ------
    ArgumentError
        If a value is not positive, ``rtol`` is below 1e-15 or above 1, or ``max_steps`` is not an integer.

    Examples
    --------
    >>> import hybrid
    >>> solver = hybrid.DOP853(rtol=1e-9, max_step=0.1)
    >>> isinstance(solver, hybrid.Solver), solver.rtol, solver.max_step
    (True, 1e-09, 0.1)
    """

    # Coefficients, error estimate and interpolant.
    tableau: ClassVar[Tableau]
    # Module and name of the kernel that attempts a step of an implicit method: a PART with the signature of
    # ``Attempts.attempt_implicit``.
    attempt: ClassVar[tuple[str, str]] = ("hybrid.kernels.steps.step", "no_attempt")
    # Whether every mode that has a series is advanced by it. Else only modes whose field has an infinite
    # slope at a guard are, in runs with tangent vectors.
    by_series: ClassVar[bool] = False

    rtol: float = attrs.field(default=1e-10, kw_only=True)
    atol: float = attrs.field(default=1e-12, kw_only=True)
    max_step: float = attrs.field(default=float("inf"), kw_only=True)
    max_steps: int = attrs.field(default=1_000_000_000, kw_only=True)

    def tightened(self, factor: float) -> Self:
        """The same solver with tolerances smaller by a factor, or as small as rounding lets them count.

        Raises
        ------
        ArgumentError
            If ``factor`` is not a positive number.
        """
        factor = arguments.positive("factor", factor)
        rtol = min(self.rtol, max(self.rtol / factor, LEAST_RTOL))
        return attrs.evolve(self, rtol=rtol, atol=self.atol * rtol / self.rtol)

    @property
    def series_order(self) -> int:
        """Order of the Taylor series of nonlinear modes.

        The series alone costs least at the order for which a step of 1/e of the convergence radius meets the
        tolerance. A few orders more make the steps longer.
        """
        return min(HIGHEST_SERIES_ORDER, max(LOWEST_SERIES_ORDER, ceil(-log(self.rtol)) + MORE_ORDERS))

    def __attrs_post_init__(self) -> None:
        name = type(self).__name__
        rtol = arguments.positive(f"{name}: rtol", self.rtol)
        if rtol < 1e-15:
            raise ArgumentError(
                f"{name}: rtol = {rtol} is too small for double precision. Use 1e-15 or more."
            )
        if rtol > 1:
            raise ArgumentError(f"{name}: rtol = {rtol} allows errors larger than the state. Use 1 or less.")
        checked = {
            "rtol": rtol,
            "atol": arguments.positive(f"{name}: atol", self.atol),
            "max_step": arguments.positive(f"{name}: max_step", self.max_step, infinite=True),
            "max_steps": arguments.count(f"{name}: max_steps", self.max_steps, 1),
        }
        for option, value in checked.items():
            object.__setattr__(self, option, value)
