"""Taylor series generated from the model: exact if a mode allows it, else with variable steps."""

from __future__ import annotations

from typing import ClassVar

import attrs

from hybrid.solvers.dop853 import DOP853
from hybrid.solvers.solver import Solver
from hybrid.solvers.tableau import Tableau


@attrs.frozen
class Taylor(Solver):
    r"""The default solver: each mode is advanced by the method that suits its field.

    - **Exact**: the field is affine in the state, with constant coefficients and polynomial, harmonic or
      exponential forcing. Its series is summed to rounding, whatever the tolerances, in steps as long as
      the series allows. If the solutions are polynomials, one step covers the whole time between jumps.
    - **Desingularised**: the field has half-integer powers of a guard, as in a Hertz contact. The mode is
      advanced in its own time ``s``, ``dt = w ds`` with ``w`` the square root of the guard, in which the
      solution is smooth, also at entry and exit. If the rate of the guard also has the factor ``w``, as for
      the level of a tank that empties, ``h' = -sqrt(h)``, the root is smooth in time, and is integrated.
      Thirds, quarters and so on have roots of their own order.
    - **Taylor series**: any other analytic field. Order and steps follow from the tolerances (Jorba and Zou
      2005, section 3).
    - **Runge-Kutta pair** DOP853: fields that cannot be traced or have kinks inside the mode.

    ``print(hybrid.compile_system(system))`` shows the method of each mode, and the reason. Crossings are
    isolated on the guards' own series: in exact modes no crossing is missed unless rounding hides it, in
    other modes none of the computed solution.

    The recurrences follow from the traced expressions. The tolerances bound the last terms of the state's
    series as those of :class:`DOP853` bound its error estimate; the bound for tangent vectors is a tenth of
    ``rtol``.

    References
    ----------
    A. Jorba, M. Zou, "A software package for the numerical integration of ODEs by means of high-order Taylor
    methods", Experimental Mathematics 14(1), 99-117, 2005, doi:10.1080/10586458.2005.10128904.

    Examples
    --------
    >>> import hybrid, models
    >>> solver = hybrid.Taylor(rtol=1e-12, atol=1e-14)
    >>> arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0), solver=solver)
    >>> arc.propagators, round(arc.jumps[0].t, 6)
    ({'flight': 'exact'}, 0.451524)
    """

    tableau: ClassVar[Tableau] = DOP853.tableau
    by_series: ClassVar[bool] = True
