"""Time of the paper's Benettin column: omega = 7.40, M = 10000 periods, four tangent vectors."""

from __future__ import annotations

from functools import partial
from itertools import product

import numpy as np

import models
from benchmarks.common import heading, least_time, table
from hybrid import DOP853, Taylor, periodic_orbit
from lyapunov import floquet_exponents, lyapunov_spectrum

# A point of the orbit of one period, and its exponents, from an independent computation with 60 digits.
START = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
EXACT = np.array([-0.05489356622830292, -0.05489356622830292, -0.39487603377169705, -0.39487603377169705])
PERIODS = 10_000
TOLERANCES = (1e-6, 2e-8, 1e-8, 1e-10)


def main() -> None:
    heading(
        f"Spectrum of the founding system, {PERIODS} periods, 4 tangent vectors, one core, compiled first.\n"
        "Target: error of every exponent at most 1e-6 within 2.5 s."
    )
    system = models.vibroimpact()
    lyapunov_spectrum(system, START, intervals=1, transient=0)
    rows = []
    for method, tolerance in product((Taylor, DOP853), TOLERANCES):
        solver = method(rtol=tolerance, atol=tolerance / 100)
        compute = partial(
            lyapunov_spectrum, system, START, intervals=PERIODS, transient=20, solver=solver, history=False
        )
        seconds = least_time(compute)
        spectrum = compute()
        error = np.abs(np.sort(spectrum.exponents)[::-1] - EXACT).max()
        rows.append(
            [
                method.__name__,
                f"{tolerance:.0e}",
                f"{seconds:.2f} s",
                f"{error:.1e}",
                f"{abs(spectrum.sum_defect):.1e}",
                "yes" if error <= 1e-6 and seconds <= 2.5 else "no",
            ]
        )
    table(["solver", "rtol = 100 atol", "least of 7", "largest error", "sum defect", "target met"], rows)
    orbit = periodic_orbit(system, START)
    print(f"Floquet, for comparison: error {np.abs(floquet_exponents(orbit) - EXACT).max():.1e}")


if __name__ == "__main__":
    main()
