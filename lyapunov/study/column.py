"""The paper's Benettin column, formula (10), beside the paper's method from several starts."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import attrs
import numpy as np

from hybrid import HybridSystem
from lyapunov.study.ode23s import Ode23s
from lyapunov.study.paper import PAPER, ROWS
from lyapunov.study.runs import STARTS, Settings

LAST_ROW = ROWS[-1]
# The tolerances that fit the column of 7.40 and 7.46 best among round ones; the paper does not print its own.
PAPERS = Ode23s(rtol=1e-6, atol=1e-8)
# Periods that the demo can afford: the first two rows of the column.
AFFORDABLE = 500

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


def paper_columns_by_its_method(
    system: HybridSystem, omegas: Sequence[float], settings: Settings
) -> list[PaperColumn]:
    """Growth rates of one vector from starts I and II at each frequency."""
    starts = STARTS[:2]
    periods = min(settings.intervals, AFFORDABLE)

    def growths(task: tuple[float, int]) -> np.ndarray:
        omega, start = task
        return PAPERS.growths(system, starts[start].x0, omega=omega, k=1, periods=periods)[:, 0]

    with ThreadPoolExecutor() as pool:
        found = list(pool.map(growths, [(omega, i) for omega in omegas for i in range(len(starts))]))
    return [
        PaperColumn(omega, {start.label: found[len(starts) * i + j] for j, start in enumerate(starts)})
        for i, omega in enumerate(omegas)
    ]
