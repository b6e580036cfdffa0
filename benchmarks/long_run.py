"""Errors after a million forcing periods: the phase of impacts, and the energy of a conservative system.

``python -m benchmarks.long_run --periods 100000`` runs a tenth of the periods.
"""

from __future__ import annotations

import argparse
import math
import time

import attrs
import numpy as np

import models
from benchmarks.common import heading, table
from hybrid import HybridSystem, Taylor
from hybrid.kernels.types import codes
from hybrid.simulation.trajectory import start
from hybrid.solvers import Solver
from models.one_impact import one_impact_orbits

# Elastic, undamped and unforced; the period only counts the time.
CONSERVATIVE = {"xi1": 0.0, "xi2": 0.0, "P": 0.0}
START = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
TOLERANCES = (1e-9, 1e-11, 1e-13, 1e-14, 1e-15)


def energy(p: dict[str, float], x: np.ndarray) -> float:
    """Energy in J of the founding system: both bodies, both springs, and the contact's ``2/5 K z^(5/2)``."""
    x1, x2, v1, v2 = x
    k1, k2 = p["m1"] * p["omega1"] ** 2, p["m2"] * p["omega2"] ** 2
    stretched = x1 - x2 + p["D"]
    motion = 0.5 * (p["m1"] * v1**2 + p["m2"] * v2**2)
    return motion + 0.5 * (k1 * x1**2 + k2 * stretched**2) + 0.4 * p["K"] * max(x1 - x2, 0.0) ** 2.5


def energy_drift(solver: Solver, counts: np.ndarray) -> tuple[np.ndarray, int]:
    """Largest relative change of the energy up to each number of periods, and the number of impacts."""
    system = models.vibroimpact()
    trajectory = start(system, START, 0.0, parameters=CONSERVATIVE, solver=solver)
    p = {**system.parameters, **CONSERVATIVE}
    before, record = energy(p, trajectory.x), trajectory.no_record()
    drift = []
    for count in counts:
        assert trajectory.advance_to(int(count), 0.0, record) == codes.DONE
        drift.append(abs(energy(p, trajectory.x) / before - 1))
    return np.maximum.accumulate(drift), trajectory.jumps // 2


def phase_error(system: HybridSystem, periods: int, solver: Solver) -> float:
    """Largest phase error of an impact of the stable orbit, checked at some sixty of the ``periods``."""
    p = dict(models.impact_oscillator().parameters)
    (orbit,) = one_impact_orbits(**p)
    period, phase = 2 * math.pi / p["w"], orbit.theta / p["w"]
    trajectory = start(system, (p["d"], -p["r"] * orbit.V), phase, solver=solver)
    record, largest = trajectory.no_record(), 0.0
    for count in np.unique(np.geomspace(1, periods, 60).astype(int)):
        assert trajectory.advance(phase + (count + 0.5) * period, record) == codes.DONE
        found = float(trajectory.run.last_jump_phase) - phase
        largest = max(largest, abs(found - round(found / period) * period))
    return largest


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--periods", type=int, default=1_000_000)
    arguments = parser.parse_args()
    periods = arguments.periods
    heading(f"{periods} forcing periods.")
    split = models.impact_oscillator()
    plain = attrs.evolve(split, period=None)
    rows = []
    for name, system in (("periods and a phase", split), ("time as one number", plain)):
        begin = time.process_time()
        error = phase_error(system, periods, Taylor())
        rows.append([name, f"{error:.1e}", f"{time.process_time() - begin:.0f} s"])
    table(["impact oscillator, rtol = 1e-10", "largest error of the phase of an impact", "time"], rows)
    counts = np.unique(np.geomspace(1, periods, 40).astype(int))
    shown = [count for count in (1_000, 10_000, 100_000, 1_000_000) if count <= periods]
    rows = []
    for tolerance in TOLERANCES:
        begin = time.process_time()
        drift, impacts = energy_drift(Taylor(rtol=tolerance, atol=tolerance / 100), counts)
        spent = time.process_time() - begin
        cells = [f"{drift[np.searchsorted(counts, count, side='right') - 1]:.1e}" for count in shown]
        rows.append([f"{tolerance:.0e}", *cells, str(impacts), f"{spent:.0f} s"])
    columns = [f"after {count}" for count in shown]
    table(["rtol = 100 atol", *columns, "impacts", "time"], rows)


if __name__ == "__main__":
    main()
