"""Counts crossings missed or doubled at random near-double roots, and measures errors of event times.

``python -m benchmarks.events --runs 2000`` runs that many motions with known roots, with each solver
of the library and with SciPy.
"""

from __future__ import annotations

import argparse
import math
import time
from fractions import Fraction

import numpy as np
from scipy.integrate import solve_ivp

import models
from benchmarks.common import heading, table
from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, Taylor, Transition, Tsit5, simulate

TOLERANCES = (1e-6, 1e-8, 1e-10, 1e-12)


def random_pairs(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two close real roots and two complex pairs: ``(count, 2)``, ``(count, 2)``, ``(count, 2)``.

    The distance of the real roots is ``10^-u`` with ``u`` uniform in 0..8, in an interval of length 1. The
    complex pairs, given by real and imaginary parts, contribute positive factors that are not constant.
    """
    apart = 10.0 ** -rng.uniform(0, 8, count)
    first = rng.uniform(0, 1 - apart)
    roots = np.column_stack([first, first + apart])
    return roots, rng.uniform(-0.5, 1.5, (count, 2)), rng.uniform(0.3, 1.0, (count, 2))


# The roots as those of a motion: x' is the derivative of the polynomial, and the roots are parameters.
def polynomial_motion(bent: bool) -> HybridSystem:
    def derivative(t, p):
        a, b = t - p.r1, t - p.r2
        s1, s2 = (t - p.a1) ** 2 + p.b1**2, (t - p.a2) ** 2 + p.b2**2
        return (a + b) * s1 * s2 + 2 * a * b * ((t - p.a1) * s2 + (t - p.a2) * s1)

    return HybridSystem(
        name="near-double roots",
        state=("x", "n"),
        parameters=dict.fromkeys(NAMES, 0.5),
        modes=[Mode("run", lambda t, x, p: (derivative(t, p), 0.0))],
        transitions=[
            Transition(
                "run",
                "run",
                Guard((lambda t, x, p: np.sin(x.x) + x.x**3) if bent else (lambda t, x, p: x.x)),
                Reset(lambda t, x, p: (x.x, x.n + 1)),
            )
        ],
    )


NAMES = ("r1", "r2", "a1", "a2", "b1", "b2")


def start_value(values: np.ndarray) -> float:
    """The polynomial at zero, rounded once."""
    r1, r2, a1, a2, b1, b2 = map(Fraction, values.tolist())
    return float(r1 * r2 * (a1 * a1 + b1 * b1) * (a2 * a2 + b2 * b2))


def depth_of(values: np.ndarray) -> float:
    r1, r2, a1, a2, b1, b2 = values
    m = 0.5 * (r1 + r2)
    return (0.5 * (r2 - r1)) ** 2 * ((m - a1) ** 2 + b1**2) * ((m - a2) ** 2 + b2**2)


def whole_runs(rng: np.random.Generator, pairs: int) -> list[list[str]]:
    roots, real, imaginary = random_pairs(rng, pairs)
    values = np.column_stack([roots, real, imaginary])
    rows = []
    for bent in (False, True):
        system = polynomial_motion(bent)
        for method in (Taylor, DOP853, Tsit5):
            tally, solver = Tally(pairs), method(rtol=1e-10, atol=1e-12)
            # Compile before the clock starts.
            simulate(system, (1.0, 0.0), (0.0, 0.0), mode="run", solver=solver)
            begin = time.perf_counter()
            for row in values:
                x0 = start_value(row)
                parameters = dict(zip(NAMES, row.tolist(), strict=True))
                arc = simulate(
                    system, (x0, 0.0), (0.0, 1.0), mode="run", parameters=parameters, solver=solver
                )
                tally.add(
                    len(arc.jumps), len(arc.grazings), depth_of(row) <= 1e-12 + 1e-10 * max(abs(x0), 1.0)
                )
            guard = "sin x + x^3" if bent else "x"
            rows.append(tally.row(f"{method.__name__}, guard {guard}", time.perf_counter() - begin))
    for largest in (math.inf, 0.01):
        tally = Tally(pairs)
        begin = time.perf_counter()
        for row in values:
            tally.add(
                scipy_crossings(row, largest), 0, depth_of(row) <= 1e-12 + 1e-10 * max(start_value(row), 1.0)
            )
        name = "SciPy DOP853, events" + ("" if math.isinf(largest) else f", max_step {largest}")
        rows.append(tally.row(name, time.perf_counter() - begin))
    return rows


class Tally:
    """Counts of missed and doubled crossings that the tolerance resolves, and of unresolved cases."""

    def __init__(self, pairs: int) -> None:
        self.pairs, self.missed, self.doubled, self.reported, self.silent = pairs, 0, 0, 0, 0

    def add(self, found: int, grazings: int, within: bool) -> None:
        if found != 2 and within:
            self.reported += grazings > 0
            self.silent += grazings == 0
        else:
            self.missed += max(2 - found, 0)
            self.doubled += max(found - 2, 0)

    def row(self, name: str, seconds: float) -> list[str]:
        unresolved = f"{self.reported + self.silent}, of which reported {self.reported}"
        return [
            name,
            str(self.pairs),
            str(self.missed),
            str(self.doubled),
            unresolved,
            f"{seconds / self.pairs * 1e6:.0f} us",
        ]


def scipy_crossings(row: np.ndarray, largest: float) -> int:
    r1, r2, a1, a2, b1, b2 = row.tolist()

    def field(t, x):
        a, b = t - r1, t - r2
        s1, s2 = (t - a1) ** 2 + b1**2, (t - a2) ** 2 + b2**2
        return [(a + b) * s1 * s2 + 2 * a * b * ((t - a1) * s2 + (t - a2) * s1)]

    options = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-12, "max_step": largest}
    solution = solve_ivp(field, (0.0, 1.0), [start_value(row)], events=lambda t, x: x[0], **options)
    return len(solution.t_events[0])


def event_times() -> list[list[str]]:
    """Errors of the bounce times of a ball, in ulp: the first, and the largest of ten."""
    ball = models.bouncing_ball()
    e, g = Fraction(0.5), Fraction(9.81)
    # The ball starts on the ground, so that the exact times are rational: 2 v (1 + e + ... + e^(k-1)) / g.
    speed = Fraction(3.0)
    rows = []
    for method in (Taylor, DOP853, Tsit5):
        for rtol in TOLERANCES:
            solver = method(rtol=rtol, atol=rtol / 100)
            arc = simulate(ball, (0.0, 3.0), (0.0, 1.2223), parameters={"e": 0.5}, solver=solver)
            exact = [2 * speed / g * sum(e**i for i in range(k + 1)) for k in range(10)]
            errors = [
                float(abs(Fraction(float(t)) - truth) / Fraction(float(np.spacing(float(truth)))))
                for t, truth in zip(arc.jumps.t[:10], exact, strict=True)
            ]
            rows.append([method.__name__, f"{rtol:.0e}", f"{errors[0]:.1f}", f"{max(errors):.1f}"])
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=2000, help="runs per solver, and with SciPy")
    arguments = parser.parse_args()
    heading("Crossings found of two that are 10^-u apart in a unit interval, u uniform in 0..8.")
    rng = np.random.default_rng(0)
    rows = whole_runs(rng, arguments.runs)
    table(["", "pairs", "missed", "doubled", "other than two, dip within tolerance", "time per pair"], rows)
    print("Error of the times of ten bounces of a ball, e = 0.5, in units in the last place.\n")
    table(["solver", "rtol = 100 atol", "first", "largest"], event_times())


if __name__ == "__main__":
    main()
