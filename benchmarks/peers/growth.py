"""Growth of one tangent vector, as a package returns it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class Growth(NamedTuple):
    """The vector at the start ``(n,)``, its mean growth rate, and the exponent that the package returns.

    Both exclude the first ``left_out`` intervals if the package allows it.
    """

    vector: np.ndarray
    left_out: int
    mean: float
    exponent: float


# Maps a tolerance to a run whose functions are compiled.
Method = Callable[[float], Callable[[], Growth]]
