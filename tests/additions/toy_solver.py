"""A solver in one file: the pair of Bogacki and Shampine, of order 3 (doi:10.1016/0893-9659(89)90079-7)."""

from typing import ClassVar

import attrs
import numpy as np

from hybrid.solvers import Solver
from hybrid.solvers.tableau import Tableau

B = np.array([2 / 9, 1 / 3, 4 / 9])


@attrs.frozen
class BogackiShampine(Solver):
    """An explicit pair with four stages and the cubic Hermite interpolant."""

    tableau: ClassVar[Tableau] = Tableau(
        order=3,
        error_order=3,
        a=np.array([[0, 0, 0, 0], [1 / 2, 0, 0, 0], [0, 3 / 4, 0, 0], [*B, 0]]),
        b=B,
        c=np.array([0, 1 / 2, 3 / 4, 1]),
        error=np.append(B, 0.0) - np.array([7 / 24, 1 / 4, 1 / 3, 1 / 8]),
        second_error=np.zeros(4),
        interpolant=np.array([[0, 0, 0, 0], [1 / 3, 0, 0, 0], [*B, -1 / 3], [*B, 0]]),
    )
