"""Time per forcing period of the founding system, compared with SciPy's DOP853 with events and restarts."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp

import models
from benchmarks.common import heading, least_time, table
from hybrid import DOP853, Taylor, simulate

# A point of the stable orbit of one period, so that the exact state after any number of periods is known.
START = np.array([-0.007658062420196343, -0.004116745569399487, 0.05565196468250694, -0.3562158269965381])
DISTURBED = START + np.array([1e-3, 0.0, 0.0, 0.0])
PERIODS = 200
TOLERANCES = (1e-6, 1e-8, 1e-10)


def scipy_run(span: float) -> Callable[[float], np.ndarray]:
    """End state at a tolerance by SciPy, as a careful user would write it: one terminal event per mode."""
    p = models.vibroimpact().parameters
    chi, d1, d2 = p["m2"] / p["m1"], 2 * p["xi1"] * p["omega1"], 2 * p["xi2"] * p["omega2"]
    w1, w2, gap, stiffness = p["omega1"] ** 2, p["omega2"] ** 2, p["D"], p["K"]
    a, omega, m1, m2 = p["P"] / p["m1"], p["omega"], p["m1"], p["m2"]

    def free(t, x):
        x1, x2, v1, v2 = x
        coupling = d2 * (v1 - v2) + w2 * (x1 - x2 + gap)
        return (v1, v2, -d1 * v1 - w1 * x1 - chi * coupling + a * np.cos(omega * t), coupling)

    def contact(t, x):
        v1, v2, a1, a2 = free(t, x)
        force = stiffness * max(x[0] - x[1], 0.0) ** 1.5
        return (v1, v2, a1 - force / m1, a2 + force / m2)

    def hit(t, x):
        return x[0] - x[1]

    def leave(t, x):
        return x[0] - x[1]

    hit.terminal, hit.direction = True, 1
    leave.terminal, leave.direction = True, -1

    def run(tolerance: float) -> np.ndarray:
        t, x, touching = 0.0, DISTURBED, False
        while t < span:
            solution = solve_ivp(
                contact if touching else free,
                (t, span),
                x,
                method="DOP853",
                events=leave if touching else hit,
                rtol=tolerance,
                atol=tolerance / 100,
            )
            t, x = solution.t[-1], solution.y[:, -1]
            touching = (not touching) if solution.status == 1 else touching
        return x

    return run


def main() -> None:
    heading(
        f"Founding system over {PERIODS} forcing periods, with its contacts: microseconds per period.\n"
        "Error: of the state at the end, against this library at rtol = 1e-14."
    )
    system = models.vibroimpact()
    period = system.forcing_period()
    assert period is not None
    span = PERIODS * period
    reference = simulate(system, DISTURBED, (0.0, span), solver=DOP853(rtol=1e-14, atol=1e-16)).x[-1]

    def ours(method: type[Taylor] | type[DOP853], tolerance: float) -> np.ndarray:
        solver = method(rtol=tolerance, atol=tolerance / 100)
        return simulate(system, DISTURBED, (0.0, span), solver=solver, samples=[span]).x[-1]

    theirs = scipy_run(span)
    points: dict[str, list[tuple[float, float]]] = {"Taylor": [], "DOP853": [], "SciPy": []}
    rows = []
    for tolerance in TOLERANCES:
        runs = (
            ("Taylor", partial(ours, Taylor), 10),
            ("DOP853", partial(ours, DOP853), 10),
            ("SciPy", theirs, 3),
        )
        for name, run, repeats in runs:
            error = float(np.abs(run(tolerance) - reference).max())
            seconds = least_time(lambda run=run, tolerance=tolerance: run(tolerance), repeats)
            points[name].append((error, seconds))
            rows.append([f"{tolerance:.0e}", name, f"{seconds / PERIODS * 1e6:.1f}", f"{error:.1e}"])
    table(["rtol = 100 atol", "", "us per period", "error"], rows)
    for name in ("Taylor", "DOP853"):
        ratios = [seconds / at_error(points[name], error) for error, seconds in points["SciPy"]]
        listed = ", ".join(f"{ratio:.0f}" for ratio in ratios)
        print(f"Ratio of SciPy's time to the time of {name} at the same error: {listed}")


def at_error(points: list[tuple[float, float]], error: float) -> float:
    """Seconds for an error, interpolated on logarithmic scales and constant beyond the measured points."""
    errors, seconds = np.log(np.array(sorted(points))).T
    return float(np.exp(np.interp(np.log(error), errors, seconds)))


if __name__ == "__main__":
    main()
