"""A jump and a matrix in words, for what a failing property says."""

from __future__ import annotations

import numpy as np

from hybrid.simulation.jumps import Jump
from hybrid.testing.case import Case


def matrix_told(matrix: np.ndarray) -> str:
    """A matrix or vector on one line."""
    return np.array2string(
        np.asarray(matrix),
        separator=", ",
        formatter={"float_kind": lambda v: f"{v:.8g}"},
        max_line_width=10**6,
    ).replace("\n", "")


def jump_told(case: Case, jump: Jump) -> str:
    """A jump in words."""
    return (
        f"event {jump.transition!r} at t = {jump.t:.10g} from mode {jump.source!r} to {jump.target!r}: "
        f"{case.state_told(jump.x_minus)} becomes {case.state_told(jump.x_plus)}; guard's speed "
        f"{jump.transversality:.6g}"
    )
