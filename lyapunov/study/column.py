"""The paper's Benettin column, formula (10), beside the paper's method from several starts."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import attrs
import numpy as np

from hybrid import HybridSystem
from lyapunov.study.ode23s import Ode23s
from lyapunov.study.paper import PAPER, ROWS
from lyapunov.study.runs import STARTS, Settings, Start

LAST_ROW = ROWS[-1]
# The tolerances that fit the column of 7.40 and 7.46 best among round ones; the paper does not print its own.
PAPERS = Ode23s(rtol=1e-6, atol=1e-8)
# Periods that the demo can afford from start I, the first three rows of the column, and from start II.
AFFORDABLE = {"I": 1000, "II": 500}

Column = tuple[float | None, ...]


def printed(omega: float, label: str) -> Column:
    """The paper's column for its first or second start, one entry per row of ``ROWS``."""
    paper = PAPER.get(omega)
    columns = {} if paper is None else {"I": paper.benettin_first_start, "II": paper.benettin_second_start}
    return columns.get(label, (None,) * len(ROWS))


def running(growths: np.ndarray) -> Column:
    """Means of growth rates ``(N,)`` after as many periods as the rows say; None beyond the end."""
    return tuple(float(growths[:M].mean()) if len(growths) >= M else None for M in ROWS)


def steady(column: Column) -> Column:
    """Mean growth rates between each row and the next, which do not depend on the start of the run.

    A mean over M periods contains the growth of the first ones, which hangs on the first direction of the
    vector and fades like 1/M. The difference ``M2 mean(M2) - M1 mean(M1)`` is the growth in between.
    """
    return tuple(
        None if one is None or two is None else (M2 * two - M1 * one) / (M2 - M1)
        for M1, M2, one, two in zip(ROWS, ROWS[1:], column, column[1:], strict=False)
    )


@attrs.frozen(eq=False)
class PaperColumn:
    """One frequency by the paper's method: growth rates ``(N,)`` by the label of the start, no transient."""

    omega: float
    growths: dict[str, np.ndarray]


@cache
def growths_from(
    system: HybridSystem, method: Ode23s, omega: float, start: Start, periods: int
) -> np.ndarray:
    """Growth rates ``(periods,)`` of one vector, without a transient; kept, since two tables need them."""
    return method.growths(system, start.x0, omega=omega, k=1, periods=periods)[:, 0]


def paper_columns_by_its_method(
    system: HybridSystem, omegas: Sequence[float], settings: Settings
) -> list[PaperColumn]:
    """Growth rates of one vector from starts I and II at each frequency."""
    tasks = [(omega, start) for omega in omegas for start in STARTS if start.label in AFFORDABLE]

    def growths(task: tuple[float, Start]) -> np.ndarray:
        omega, start = task
        periods = min(settings.intervals, AFFORDABLE[start.label])
        return growths_from(system, PAPERS, omega, start, periods)

    with ThreadPoolExecutor() as pool:
        found = dict(zip(tasks, pool.map(growths, tasks), strict=True))
    return [
        PaperColumn(omega, {start.label: found[each, start] for each, start in tasks if each == omega})
        for omega in omegas
    ]
