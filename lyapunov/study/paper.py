"""Data: the figures printed in the paper that the study recomputes.

V. A. Bazhenov, O. S. Pogorelova, T. G. Postnikova, "Lyapunov exponents estimation for strongly nonlinear
nonsmooth discontinuous vibroimpact system", 2017: exponents in 1/s after M periods.
"""

from __future__ import annotations

import attrs

ROWS = (100, 500, 1000, 5000, 10000)


@attrs.frozen
class PaperRegime:
    """Figures of the paper for one frequency: one column entry per row of ``ROWS``, None if not printed."""

    regime: str
    single_piece: tuple[float | None, ...]
    telescoped: tuple[float | None, ...]
    undivided: tuple[float | None, ...]
    benettin_first_start: tuple[float | None, ...]
    benettin_second_start: tuple[float | None, ...]
    expected: str


_NOTHING = (None,) * len(ROWS)

PAPER = {
    7.40: PaperRegime(
        regime="periodic",
        single_piece=(-0.058, -0.031, -0.017, -0.0034, -0.015),
        telescoped=(-0.058, -0.043, -0.023, -0.0038, -0.0017),
        undivided=(-2.35, -13.0, -17.4, -19.7, -19.0),
        benettin_first_start=(-0.038, -0.061, -0.064, -0.066, -0.067),
        benettin_second_start=_NOTHING,
        expected="Floquet -0.056",
    ),
    7.46: PaperRegime(
        regime="quasi-periodic",
        single_piece=(None, None, None, None, 0.000243),
        telescoped=(0.000243, 3.81e-5, 0.000243, 3.46e-5, 2.76e-5),
        undivided=(0.024, -0.015, -0.026, -0.035, -0.036),
        benettin_first_start=(0.022, -0.0050, -0.0069, -0.0089, -0.0091),
        benettin_second_start=(0.019, -0.0037, -0.0067, -0.0089, -0.0091),
        expected="must be 0",
    ),
    7.92: PaperRegime(
        regime="chaotic",
        single_piece=(None, None, None, None, 0.00018),
        telescoped=(0.0106, -0.0007, 8.6e-5, 0.00016, 0.00019),
        undivided=(-1.16, -0.73, -0.70, -0.84, -1.64),
        benettin_first_start=(0.012, 0.0094, 0.014, 0.0060, 0.0030),
        benettin_second_start=(0.069, 0.027, 0.018, 0.014, 0.014),
        expected="positive",
    ),
}

# Last values of the paper's Benettin column that contradict the known exponents: at 7.40 the paper's own
# Floquet exponent is -0.056, and at 7.46 the motion is on a torus, whose first exponent is zero.
DOUBTFUL = {7.40: -0.067, 7.46: -0.0091}
