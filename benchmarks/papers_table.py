"""The paper's Benettin column by the paper's method: every printed row, a scan of tolerances, and one impact.

Run ``python -m benchmarks.papers_table`` with rows, scan, prediction, recurrence or figure.
Each takes some minutes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

import models
from benchmarks.common import file_in, heading, options, table
from lyapunov import lyapunov_spectrum
from lyapunov.study.column import LAST_ROW, printed, running, steady
from lyapunov.study.impact import by_ode23s, impacts, measure
from lyapunov.study.ode23s import Ode23s
from lyapunov.study.paper import DOUBTFUL, PAPER, ROWS
from lyapunov.study.runs import STARTS

SYSTEM = models.vibroimpact()
PAPERS = Ode23s(1e-6, 1e-8)
WORKERS = 2
SCANNED_RTOLS = (1e-3, 1e-4, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7)
SCANNED_ATOLS = (1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
SCANNED_PERIODS, SKIPPED = 600, 100
# Tolerances at which the chaos of 7.92 may end, and periods to settle and to watch.
LOOSE, SETTLING, WATCHED = ((1e-6, 1e-8), (3e-7, 5e-6), (3e-7, 6e-6), (1e-6, 1e-5)), 3000, 212
PREDICTED = ((1e-3, 1e-6), (1e-4, 1e-8), (1e-5, 1e-8), (1e-6, 1e-6), (1e-6, 1e-7), (1e-6, 1e-8), (1e-7, 1e-9))


def parallel(work: Callable[..., Any], tasks: Iterable[Sequence[Any]]) -> list[Any]:
    """The results of ``work(*task)``; the kernels release the lock of the interpreter."""
    with ThreadPoolExecutor(WORKERS) as pool:
        return list(pool.map(lambda task: work(*task), tasks))


def rows(method: Ode23s, omegas: Sequence[float]) -> None:
    """Means after M periods from each start, without a transient and after 1000 periods."""
    tasks = [(omega, start) for omega in omegas for start in STARTS]

    def growths(omega: float, start: Any) -> np.ndarray:
        return method.growths(SYSTEM, start.x0, omega=omega, k=1, periods=LAST_ROW + 1000)[:, 0]

    found = dict(zip(((omega, start.label) for omega, start in tasks), parallel(growths, tasks), strict=True))
    for omega in omegas:
        columns = {f"paper {label}": printed(omega, label) for label in ("I", "II")}
        columns = {name: values for name, values in columns.items() if any(v is not None for v in values)}
        for start in STARTS:
            columns[start.label] = running(found[omega, start.label])
        for start in STARTS:
            columns[f"{start.label}, later"] = running(found[omega, start.label][1000:])
        print(f"omega = {omega:.2f}\n")
        cells = [[str(M), *(text(values[i]) for values in columns.values())] for i, M in enumerate(ROWS)]
        for i in range(1, len(ROWS)):
            between = [text(steady(values)[i - 1]) for values in columns.values()]
            cells.append([f"{ROWS[i - 1]} to {ROWS[i]}", *between])
        table(["M", *columns], cells)


def scan() -> None:
    """Means of one vector over 500 periods after 100, over both tolerances."""
    tasks = [(rtol, atol, omega) for rtol in SCANNED_RTOLS for atol in SCANNED_ATOLS for omega in PAPER]

    def exponent(rtol: float, atol: float, omega: float) -> float:
        growths = Ode23s(rtol, atol).growths(SYSTEM, STARTS[0].x0, omega=omega, k=1, periods=SCANNED_PERIODS)
        return float(growths[SKIPPED:].mean())

    found = dict(zip(tasks, parallel(exponent, tasks), strict=True))
    cells = []
    for rtol in SCANNED_RTOLS:
        for atol in SCANNED_ATOLS:
            values = {omega: found[rtol, atol, omega] for omega in PAPER}
            misfit = max(abs(values[omega] - value) for omega, value in DOUBTFUL.items())
            cells.append([f"{rtol:.0e}", f"{atol:.0e}", *map(text, values.values()), text(misfit)])
    table(["RelTol", "AbsTol", *(f"{omega:.2f}" for omega in PAPER), "off by"], cells)


def prediction() -> None:
    """Exponents at 7.40 from the map of one impact, beside those of a long run."""
    windows = impacts(SYSTEM, 7.40)

    def both(rtol: float, atol: float, at_once: int) -> list[str]:
        method = Ode23s(rtol, atol)
        found = [measure(window, by_ode23s(method, at_once)) for window in windows]
        predicted = np.mean([each.predicted_exponents()[0] for each in found])
        periods = 500 if at_once == 1 else 300
        growths = method.growths(SYSTEM, STARTS[0].x0, omega=7.40, k=at_once, periods=periods + SKIPPED)
        run = growths[SKIPPED:, : min(2, at_once)].mean()
        shears = [
            window.relative(each.contact - window.contact)[1, 0]
            for window, each in zip(windows, found, strict=True)
        ]
        speed = max(abs(each.restitution_error) for each in found)
        volume = max(abs(each.volume_error) for each in found)
        numbers = (np.mean(shears), predicted, run)
        return [
            *(f"{value:.0e}" for value in (rtol, atol)),
            str(at_once),
            *(f"{value:.4f}" for value in numbers),
            *(f"{value:.0e}" for value in (speed, volume)),
        ]

    tasks = [(*tolerances, at_once) for at_once in (1, 4) for tolerances in PREDICTED]
    off = ("shear off", "predicted", "long run", "restitution off", "determinant off")
    columns = ["RelTol", "AbsTol", "vectors", *off]
    table(columns, parallel(both, tasks))
    relative, halfway = windows[0].relative(windows[0].contact), windows[0].halfway()
    print(f"Exact map of gap and rate across the contact: {np.array2string(relative, precision=5)}")
    print(f"Rate per unit of gap halfway: {halfway[1, 0]:.1f} per second, at the end {relative[1, 0]:.4f}.")


def recurrence() -> None:
    """How nearly the numerical orbit at 7.92 repeats itself, and what the library finds from its end."""
    cells, omega = [], 7.92
    period = 2 * np.pi / omega
    for rtol, atol in LOOSE:
        method, x, vector = Ode23s(rtol, atol), np.array(STARTS[0].x0), np.full((4, 1), 0.5)
        points, rates = [], []
        for _ in range(SETTLING + WATCHED):
            x, vector = method.carry(SYSTEM, x, vector, (0.0, period), omega=omega)
            length = np.linalg.norm(vector)
            vector = vector / length
            points.append(x)
            rates.append(np.log(length) / period)
        late = np.array(points[SETTLING:])
        distances = [np.abs(late[p:] - late[:-p]).max() for p in range(1, WATCHED // 2)]
        least = int(np.argmin(distances))
        exact = lyapunov_spectrum(SYSTEM, x, k=1, parameters={"omega": omega}, intervals=10_000)
        repeats = [str(least + 1), f"{distances[least]:.4f}", f"{np.ptp(late):.2f}"]
        growth = text(float(np.mean(rates[-WATCHED:])))
        library = f"{exact.exponents[0]:.4f} +- {exact.standard_error[0]:.4f}"
        cells.append([f"{rtol:.0e}", f"{atol:.0e}", *repeats, growth, library])
    table(
        ["RelTol", "AbsTol", "repeats after", "within", "extent", "exponent", "library from its end"],
        cells,
    )


def text(value: float | None) -> str:
    return "" if value is None or np.isnan(value) else f"{value:.4f}"


def main() -> None:
    parser = options(__doc__)
    parser.add_argument("part", choices=("rows", "scan", "prediction", "recurrence", "figure"))
    parser.add_argument("--rtol", type=float, default=PAPERS.rtol)
    parser.add_argument("--atol", type=float, default=PAPERS.atol)
    parser.add_argument("--omega", type=float, nargs="+", default=list(PAPER), help="those of the rows")
    chosen = parser.parse_args()
    started = time.perf_counter()
    heading(f"The founding system by ode23s straight through: {chosen.part}")
    if chosen.part == "rows":
        print(f"RelTol = {chosen.rtol:.0e}, AbsTol = {chosen.atol:.0e}, one tangent vector.\n")
        rows(Ode23s(chosen.rtol, chosen.atol), chosen.omega)
    elif chosen.part == "scan":
        scan()
    elif chosen.part == "prediction":
        prediction()
    elif chosen.part == "recurrence":
        recurrence()
    else:
        from benchmarks.papers_table_figure import PICTURE, figure

        figure(file_in(chosen.output, PICTURE))
    print(f"{time.perf_counter() - started:.0f} s")


if __name__ == "__main__":
    main()
