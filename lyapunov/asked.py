"""What the averages along an orbit ask alike: arguments with their types, defaults and descriptions."""

from collections.abc import Mapping
from typing import Annotated, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from hybrid import HybridSystem, arguments
from hybrid.shared import Shared
from hybrid.simulation.trajectory import Trajectory, start
from hybrid.solvers import Solver

OF_A_RUN = "As for :func:`hybrid.simulate`."


class Averaging(TypedDict, total=False):
    """Where an orbit begins, and the intervals of time that are averaged over."""

    mode: Annotated[str | None, Shared(None, OF_A_RUN)]
    parameters: Annotated[Mapping[str, float] | None, Shared(None, OF_A_RUN)]
    solver: Annotated[Solver | None, Shared(None, OF_A_RUN)]
    t0: Annotated[float, Shared(0.0, "Time at the start.")]
    intervals: Annotated[int, Shared(1000, "Number of intervals to average over.")]
    interval: Annotated[
        float | None,
        Shared(
            None,
            "Length of an interval; by default the forcing period, or for an autonomous system the time "
            "scale of its field at the start: the reciprocal of the spectral radius of ``abs(D_x f)`` there.",
        ),
    ]
    transient: Annotated[
        int,
        Shared(
            200,
            "Number of intervals to run first, with tangent vectors, and discard: 200 by default, since "
            "exponents belong to the attractor.",
        ),
    ]


def numbers_of(asked: Averaging) -> tuple[int, int]:
    """How many intervals are discarded, and how many are averaged over."""
    intervals = arguments.count("intervals", asked["intervals"], 1)
    return arguments.count("transient", asked["transient"], 0), intervals


def begun(
    system: HybridSystem, x0: ArrayLike, asked: Averaging, tangent: np.ndarray | None = None
) -> Trajectory:
    """A trajectory at its start."""
    return start(
        system,
        x0,
        asked["t0"],
        mode=asked["mode"],
        parameters=asked["parameters"],
        solver=asked["solver"],
        tangent=tangent,
    )
