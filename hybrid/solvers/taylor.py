"""Taylor series generated from the model: exact where a mode allows it, of variable step elsewhere."""

from __future__ import annotations

from math import ceil, log
from typing import ClassVar

import attrs

from hybrid.solvers.dop853 import DOP853
from hybrid.solvers.solver import Solver
from hybrid.solvers.tableau import Tableau

LOWEST_SERIES_ORDER = 12
# What a contact loses by the longer steps of higher orders is felt by its energy first.
HIGHEST_SERIES_ORDER = 28
# Orders beyond those of the fewest operations per unit of time: a step has costs of its own.
MORE_ORDERS = 6


@attrs.frozen
class Taylor(Solver):
    r"""The default: each mode is advanced by what fits it.

    - A mode whose field is affine in the state, with constant coefficients and polynomial, harmonic or
      exponential forcing, is advanced by its series to rounding, whatever the tolerances, in steps as long as
      the series allows: **exact**. Where the solutions are polynomials a step is a whole flight.
    - A mode whose field has half-integer powers of a guard, such as a Hertz contact, is advanced on a clock
      of its own, ``dt = w ds`` with ``w`` the square root of the guard. Everything is smooth there, entry
      and exit included: **desingularised**. Where the rate of the guard has ``w`` as a factor too,
      such as the level of a tank that empties, ``h' = -sqrt(h)``, the root is smooth in time and is followed.
    - Any other mode with an analytic field is advanced by its **Taylor series**, of an order and with steps
      that follow from the tolerances (Jorba and Zou 2005, section 3).
    - What is left, fields that cannot be traced or have kinks inside the mode, by the **Runge-Kutta pair**
      DOP853.

    ``print(hybrid.compile_system(system))`` says which mode got what, and why. Guards are isolated on their
    own series; in exact modes no crossing can be missed that rounding does not hide.

    The recurrences follow from the traced expressions. The tolerances bound the last terms of the state as
    those of :class:`DOP853` bound its error estimate, and a tenth of ``rtol`` those of the tangent vectors.

    References
    ----------
    A. Jorba, M. Zou, "A software package for the numerical integration of ODEs by means of high-order Taylor
    methods", Experimental Mathematics 14(1), 99-117, 2005, doi:10.1080/10586458.2005.10128904.
    """

    tableau: ClassVar[Tableau] = DOP853.tableau

    @property
    def series_order(self) -> int:
        """Order of the series in nonlinear modes.

        Where a step of length 1/e of the convergence radius would meet the tolerance, the series alone would
        cost least; some orders more make it longer.
        """
        return min(HIGHEST_SERIES_ORDER, max(LOWEST_SERIES_ORDER, ceil(-log(self.rtol)) + MORE_ORDERS))
