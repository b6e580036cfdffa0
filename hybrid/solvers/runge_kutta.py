"""What all Runge-Kutta methods share: tolerances, and the kernel's view of the tableau."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import attrs

from hybrid.errors import ArgumentError

if TYPE_CHECKING:
    from hybrid.solvers.tableau import Tableau


def _positive(instance: Any, attribute: attrs.Attribute[Any], value: Any) -> None:
    if not value > 0:
        raise ArgumentError(f"{type(instance).__name__}: {attribute.name} must be positive; got {value!r}.")


@attrs.frozen
class RungeKutta:
    """Abstract base of the methods; use one of its subclasses.

    The error estimate of every component ``i`` of the state is kept below ``atol + rtol |x_i|`` in the root
    mean square. Tangent vectors are under the same control, each by itself: their components are kept below
    ``rtol (|v_i| + rms(v))``.

    Parameters
    ----------
    rtol, atol
        Relative and absolute tolerance a step; ``atol`` in the units of the state.
    max_step
        Longest step, in units of time.
    max_steps
        Most steps a run may try before it ends with a status.

    Raises
    ------
    ArgumentError
        If a value is not positive, or ``rtol`` below 1e-15.
    """

    tableau: ClassVar[Tableau]

    rtol: float = attrs.field(default=1e-10, kw_only=True, converter=float, validator=_positive)
    atol: float = attrs.field(default=1e-12, kw_only=True, converter=float, validator=_positive)
    max_step: float = attrs.field(default=float("inf"), kw_only=True, converter=float, validator=_positive)
    max_steps: int = attrs.field(default=1_000_000_000, kw_only=True, converter=int, validator=_positive)

    @rtol.validator
    def _check_rtol(self, attribute: attrs.Attribute[float], value: float) -> None:
        if value < 1e-15:
            raise ArgumentError(
                f"{type(self).__name__}: rtol = {value} is below what double precision can follow. "
                "Use 1e-15 or more."
            )
