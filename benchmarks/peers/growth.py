"""What a package hands back of the growth of one tangent vector."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class Growth(NamedTuple):
    """The vector at the start ``(n,)``, the mean rate at which it grew, and the exponent that is printed.

    The first intervals are left out of both, as far as the package allows.
    """

    vector: np.ndarray
    left_out: int
    mean: float
    exponent: float


# From the tolerance to a run, for which everything is compiled.
Method = Callable[[float], Callable[[], Growth]]
