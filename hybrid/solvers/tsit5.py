"""Tsit5: order 5 for loose tolerances, with a fourth-order interpolant."""

from __future__ import annotations

from typing import ClassVar

import attrs
import numpy as np

from hybrid.solvers.solver import Solver
from hybrid.solvers.tableau import Row, Tableau, bernstein_from_powers, dense

_C = (0.0, 0.161, 0.327, 0.9, 0.9800255409045097, 1.0, 1.0)
_B = {
    0: 0.09646076681806523,
    1: 0.01,
    2: 0.4798896504144996,
    3: 1.379008574103742,
    4: -3.290069515436081,
    5: 2.324710524099774,
}
_A: tuple[Row, ...] = (
    {},
    {0: 0.161},
    {0: -0.008480655492356989, 1: 0.335480655492357},
    {0: 2.8971530571054935, 1: -6.359448489975075, 2: 4.3622954328695815},
    {0: 5.325864828439257, 1: -11.748883564062828, 2: 7.4955393428898365, 3: -0.09249506636175525},
    {
        0: 5.86145544294642,
        1: -12.92096931784711,
        2: 8.159367898576159,
        3: -0.071584973281401,
        4: -0.028269050394068383,
    },
    _B,
)
_ERROR = {
    0: -0.00178001105222577714,
    1: -0.0008164344596567469,
    2: 0.007880878010261995,
    3: -0.1447110071732629,
    4: 0.5823571654525552,
    5: -0.45808210592918697,
    6: 0.015151515151515152,
}
# Coefficients of theta, theta^2, theta^3, theta^4 of each stage's weight.
_POWERS = (
    (1.0, -2.763706197274826, 2.9132554618219126, -1.0530884977290216),
    (0.0, 0.13169999999999998, -0.2234, 0.1017),
    (0.0, 3.9302962368947516, -5.941033872131505, 2.490627285651253),
    (0.0, -12.411077166933676, 30.33818863028232, -16.548102889244902),
    (0.0, 37.50931341651104, -88.1789048947664, 47.37952196281928),
    (0.0, -27.896526289197286, 65.09189467479366, -34.87065786149661),
    (0.0, 1.5, -4.0, 2.5),
)


@attrs.frozen
class Tsit5(Solver):
    """Explicit pair of order 5(4) by Tsitouras; the last stage is the first stage of the next step.

    References
    ----------
    Ch. Tsitouras, Runge-Kutta pairs of order 5(4) satisfying only the first column simplifying assumption,
    Computers and Mathematics with Applications 62 (2011) 770-775, doi:10.1016/j.camwa.2011.06.002.

    Examples
    --------
    >>> import hybrid, models
    >>> solver = hybrid.Tsit5(rtol=1e-5, atol=1e-7)
    >>> arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0), solver=solver)
    >>> round(arc.jumps[0].t, 4)
    0.4515
    """

    tableau: ClassVar[Tableau] = Tableau(
        order=5,
        error_order=5,
        a=dense(_A, 7),
        b=dense([_B], 6)[0],
        c=np.array(_C),
        error=dense([_ERROR], 7)[0],
        second_error=np.zeros(7),
        interpolant=bernstein_from_powers(np.vstack([np.zeros(7), np.transpose(_POWERS)])),
    )
