"""The features of runs over their last stretches, in rows of numbers that sweeps and stores keep."""

from __future__ import annotations

import math

import numpy as np

from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.progress import Progress, silent
from hybrid.kernels.types import codes
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.simulate import simulate
from hybrid.status import StatusCode
from hybrid.sweep.attractors.features import Features
from hybrid.sweep.attractors.find import collected, extent_of, round_of
from hybrid.sweep.attractors.runs import CODE, COLUMNS, MODE, NONE, OWNER, POINTS, Points, runs_of
from hybrid.sweep.attractors.search import known_of
from hybrid.sweep.attractors.setup import Setup
from hybrid.sweep.blocks import run_in_blocks

# Code of a run whose features are not all finite.
UNMEASURED = StatusCode.NOT_CONVERGED
# Last points of the way there in which a round is looked for.
LOOKED_AT = 256


def untouched(count: int, features: Features) -> np.ndarray:
    """Rows of starts that have not been run."""
    rows = np.full((count, COLUMNS + 2 * len(features.names)), np.nan)
    rows[:, OWNER], rows[:, POINTS], rows[:, CODE], rows[:, MODE] = NONE, 0, StatusCode.NOT_RUN, codes.NO_MODE
    return rows


def measured(setup: Setup, features: Features, origins: np.ndarray) -> np.ndarray:
    """Rows of starts: the columns of ``Runs``, the features ``(F,)``, and how far they changed ``(F,)``.

    The code of a start is SUCCESS if its run has finite features, and NOT_RUN after an interrupt.
    """
    rows = untouched(len(origins), features)
    # Python chooses no mode here: the kernel does, and tells the starts that violate every mode.
    rows[:, :COLUMNS] = runs_of(setup).settle(origins, known_of(setup, []), 0)
    rows[:, OWNER] = NONE
    begun = rows[:, CODE] == codes.MAX_STEPS
    rows[begun, CODE] = StatusCode.NOT_RUN
    with CTRL_C.ending():
        for i in np.flatnonzero(begun):
            if CTRL_C.is_set():
                break
            _measure(setup, features, origins[i], rows[i])
    return rows


def measured_in_threads(
    setup: Setup, features: Features, origins: np.ndarray, threads: int, bar: Progress | None = None
) -> np.ndarray:
    """The rows of `measured`, by several threads."""
    rows = untouched(len(origins), features)

    def run(block: range) -> None:
        part = slice(block.start, block.stop)
        rows[part] = measured(setup, features, origins[part])

    run_in_blocks(run, len(origins), threads, bar or silent())
    return rows


def features_in(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Features ``(N, F)`` in rows, and how far they changed from one stretch to the other ``(N, F)``."""
    values, changes = np.split(rows[:, COLUMNS:], 2, axis=1)
    return values, changes


def _measure(setup: Setup, features: Features, x0: np.ndarray, row: np.ndarray) -> None:
    """Fill in the row of a start."""
    points, length = settled(setup, x0, setup.marked.mode_names[int(row[MODE])])
    found: list[np.ndarray] = []
    for wait in (0, *pauses(setup)):
        if wait:
            collected(points, wait)
        arc = _stretch(setup, points, length) if points.code == codes.DONE else None
        if arc is not None:
            found.append(features.of(arc, f"the run from {tuple(x0.tolist())}"))
    if points.code == StatusCode.INTERRUPTED or CTRL_C.is_set():
        return
    row[POINTS] = setup.periods + sum(pauses(setup)) + len(found) * length
    if points.code != codes.DONE:
        row[CODE] = points.code
        return
    *before, last = found
    row[COLUMNS:] = *last, *np.abs(last - before).max(axis=0)
    row[CODE] = StatusCode.SUCCESS if np.isfinite(row[COLUMNS:]).all() else UNMEASURED


def pauses(setup: Setup) -> tuple[int, ...]:
    """Points between one stretch and the next.

    Stretches in succession would differ by too little where a run still settles, or goes slowly round a
    torus. Two lengths are not both whole turns of that.
    """
    return setup.periods // 2, setup.periods // 5


def settled(setup: Setup, x0: np.ndarray, mode: str) -> tuple[Points, int]:
    """A run after ``periods`` points, and how many points its stretches have.

    They have whole rounds if the run has come to a periodic orbit: otherwise two stretches would begin at
    different points of the round, and their features would differ.
    """
    points = Points(setup, x0, mode)
    states, places = collected(points, setup.periods)
    window = states[-LOOKED_AT:], places[-LOOKED_AT:]
    extent, share = extent_of(window[0], setup), math.sqrt(setup.solver.rtol)
    count = round_of(*window, extent, share, setup.turns) if points.code == codes.DONE else 0
    return points, -(-setup.recurrences // count) * count if count else setup.recurrences


def _stretch(setup: Setup, points: Points, length: int) -> HybridArc | None:
    """The run over its next points as an arc; None if it ends on its way."""
    run = points.trajectory
    x, mode, begin = run.x, run.mode, run.t
    collected(points, length)
    if points.code != codes.DONE:
        return None
    return simulate(
        setup.system, x, (begin, run.t), mode=mode, parameters=setup.parameters, solver=setup.solver
    )
