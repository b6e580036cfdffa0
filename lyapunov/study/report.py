"""Tables of the study as text and as CSV files."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.display.tables import table
from hybrid.measures.averages import running_tapered_mean
from lyapunov.floquet import floquet_exponents
from lyapunov.study.column import PAPERS, PaperColumn, printed, running, steady
from lyapunov.study.paper import DOUBTFUL, PAPER, ROWS
from lyapunov.study.runs import STARTS, Regime
from lyapunov.study.tangents import TRAP_OMEGA, Explanation, Trap

# A candidate counts as an explanation if it leaves at most this share of the disagreement.
EXPLAINS = 0.5


def histories(regime: Regime) -> dict[str, np.ndarray]:
    """Every estimate of the first exponent as a history ``(M,)``, by its heading in the tables."""
    first, second = regime.spectra[0], regime.spectra[1]
    two = regime.two_orbit
    return {
        "(7)": two.single_piece,
        "(8)": two.telescoped,
        "(9)": two.undivided,
        "(10) I": first.benettin_history[:, 0],
        "(10) II": second.benettin_history[:, 0],
        "two-orbit": running_tapered_mean(two.renormalised_growths[:, None])[:, 0],
        "tapered": first.history[:, 0],
    }


def paper_columns(omega: float) -> dict[str, tuple[float | None, ...]]:
    """The paper's columns by the same headings; empty at a frequency that the paper does not have."""
    paper = PAPER.get(omega)
    if paper is None:
        return {}
    return {
        "(7)": paper.single_piece,
        "(8)": paper.telescoped,
        "(9)": paper.undivided,
        "(10) I": paper.benettin_first_start,
        "(10) II": paper.benettin_second_start,
    }


def regime_text(regime: Regime) -> str:
    """Table of one frequency with the paper's figures beside ours, and a description of the regime."""
    ours, theirs = histories(regime), paper_columns(regime.omega)
    headings, rows = ["M"], [[str(M)] for M in rows_up_to(regime)]
    for name, history in ours.items():
        headings.append(name)
        for row, M in zip(rows, rows_up_to(regime), strict=True):
            row.append(number(history[M - 1] if len(history) >= M else None))
        if any(value is not None for value in theirs.get(name, ())):
            headings.append("paper")
            for row, M in zip(rows, rows_up_to(regime), strict=True):
                row.append(number(theirs[name][ROWS.index(M)] if M in ROWS else None))
    expected = f"; the paper: {PAPER[regime.omega].regime}, {PAPER[regime.omega].expected}" if theirs else ""
    title = f"omega = {regime.omega:.2f} rad/s: {regime.kind}{expected}"
    parts = [
        title,
        "-" * len(title),
        table(headings, rows, numbers=True),
        "",
        *_starts(regime),
        *_spectrum(regime),
    ]
    parts += _orbit(regime) + _trouble(regime)
    return "\n".join(parts)


def rows_up_to(regime: Regime) -> list[int]:
    """Rows of the paper that the study reaches, or else the last interval of the study."""
    intervals = regime.spectra[0].intervals
    return [M for M in ROWS if intervals >= M] or [max(intervals, 1)]


def _starts(regime: Regime) -> list[str]:
    lines = []
    for start, spectrum, impacts in zip(STARTS, regime.spectra, regime.impacts_per_period, strict=True):
        lines.append(
            f"Start {start.label:3} ({start.text}): {impacts:.3f} impacts per period, "
            f"first exponent {spectrum.exponents[0]:.6f} +- {spectrum.standard_error[0]:.1g}"
        )
    first, others = regime.impacts_per_period[0], regime.impacts_per_period[1:]
    apart = [
        start.label for start, value in zip(STARTS[1:], others, strict=True) if abs(value - first) > 0.05
    ]
    if apart:
        lines.append(f"Start {' and '.join(apart)} leads to another attractor than start I: they coexist.")
    return lines


def _spectrum(regime: Regime) -> list[str]:
    first = regime.spectra[0]
    values = "  ".join(f"{value:.8f}" for value in first.exponents)
    return [
        f"Spectrum from start I:   {values}",
        f"Sum {first.exponents.sum():.8f}, by the sum rule {first.sum_rule:.8f}",
    ]


def _orbit(regime: Regime) -> list[str]:
    orbit = regime.orbit
    if not orbit.status.ok:
        return [f"Orbit of one period: none found, residual {orbit.residual:.1e}."]
    stable = "stable" if np.all(np.abs(orbit.multipliers) < 1) else "unstable"
    values = "  ".join(f"{value:.8f}" for value in floquet_exponents(orbit))
    return [f"Floquet exponents:       {values}  ({stable} orbit of one period)"]


def _trouble(regime: Regime) -> list[str]:
    results: list[Any] = [*regime.spectra, regime.two_orbit, regime.section, regime.arc]
    return [f"! {result!r}: {result.status}" for result in results if not result.status.ok]


def tolerance_text(trap: Trap) -> str:
    """Table of the exponents with tangent vectors inside and outside the error control."""
    total = trap.truth.sum()
    cells = [
        [f"{tolerance:.0e}", *(f"{v:.6f}" for v in (a[0], a[-1], b[0], b[-1])), f"{b.sum() - total:.0e}"]
        for tolerance, a, b in zip(trap.tolerances, trap.inside, trap.outside, strict=True)
    ]
    exact = ["exact", *(f"{v:.6f}" for v in trap.truth[[0, -1, 0, -1]]), ""]
    title = f"Tangent vectors outside the error control, omega = {TRAP_OMEGA:.2f}"
    headings = ["rtol = atol", "inside: first", "last", "outside: first", "last", "their sum off by"]
    return "\n".join(
        [
            title,
            "-" * len(title),
            table(headings, [*cells, exact], numbers=True),
            "",
            "Outside, the exponents are wrong but their sum is right, so the sum rule does not detect it.",
        ]
    )


def explanation_text(found: Sequence[Explanation]) -> str:
    """Table of the candidates, and the verdict, which may leave the question open."""
    omegas = list(found[0].exponents)
    paper = [number(DOUBTFUL.get(omega)) for omega in omegas]
    cells = [["the paper's Benettin column", *paper, ""]]
    cells += [[e.text, *(number(e.exponents[omega]) for omega in omegas), number(e.misfit)] for e in found]
    title = "Last values of the paper's Benettin column, and candidate explanations"
    headings = ["", *(f"{omega:.2f}" for omega in omegas), "off by"]
    return "\n".join([title, "-" * len(title), table(headings, cells, numbers=True), "", verdict(found)])


def verdict(found: Sequence[Explanation]) -> str:
    """The result of the comparison, in words."""
    as_it_is, *others = found
    if math.isnan(as_it_is.misfit):
        frequencies = " and ".join(f"{omega:.2f}" for omega in DOUBTFUL)
        return f"A verdict needs both {frequencies} among the frequencies."
    best = min(others, key=lambda explanation: explanation.misfit)
    left = f"{best.misfit:.4f} of a disagreement of {as_it_is.misfit:.4f}"
    if best.misfit > EXPLAINS * as_it_is.misfit:
        return f"Open: the closest candidate, {best.text}, still leaves {left}."
    closest = f"Closest: {best.text}, which leaves {left}.\nIt is one of {len(others)} candidates. "
    if best.papers_method:
        return closest + (
            "It is the paper's method; its tolerances are not printed there and\n"
            "were chosen here. Its error in the tangent map of one impact predicts these values: "
            "docs/papers-table.md."
        )
    return closest + (
        "Its method and tolerance replace the paper's ode23s, which\n"
        "integrated across the impacts at an unknown tolerance. This is an indication, not a proof."
    )


def column_text(columns: Sequence[PaperColumn]) -> str:
    """Table of the paper's Benettin column beside its method from two starts, as far as the runs go."""
    cells = []
    for column in columns:
        sides = [
            side
            for label, growths in column.growths.items()
            for side in (printed(column.omega, label), running(growths))
        ]
        reached = [i for i in range(len(ROWS)) if sides[1][i] is not None]
        omega = f"{column.omega:.2f}"
        cells += [[omega, str(ROWS[i]), *(number(side[i]) for side in sides)] for i in reached]
        for i in reached[:-1]:
            between = [number(steady(side)[i]) for side in sides]
            cells.append([omega, f"{ROWS[i]} to {ROWS[i + 1]}", *between])
    title = "The paper's Benettin column by the paper's method"
    if not cells:
        return f"{title}: needs at least {ROWS[0]} periods."
    method = f"ode23s straight through, RelTol = {PAPERS.rtol:.0e}, AbsTol = {PAPERS.atol:.0e}, no transient."
    return "\n".join(
        [
            title,
            "-" * len(title),
            method,
            "The paper does not print its starts. They matter in the first rows, less in the growth between.",
            "",
            table(["omega", "M", "paper I", "ode23s I", "paper II", "ode23s II"], cells, numbers=True),
            "",
            "All rows up to M = 10000, and the reason for the difference: docs/papers-table.md.",
        ]
    )


def number(value: float | None) -> str:
    """At most four significant digits; an empty text for None or nan."""
    if value is None or math.isnan(value):
        return ""
    return f"{value:.2e}" if 0 < abs(value) < 1e-3 else f"{value:.4f}" if abs(value) < 1 else f"{value:.2f}"


def write_histories(folder: Path, regime: Regime) -> None:
    """Write ``exponents_<omega>.csv``: one row per period, one column per estimate."""
    columns = histories(regime)
    length = min(map(len, columns.values()))
    rows = ([M + 1, *(history[M] for history in columns.values())] for M in range(length))
    _write(folder / f"exponents_{regime.omega:.2f}.csv", ["M", *columns], rows)


def write_tolerances(folder: Path, trap: Trap) -> None:
    """Write ``tolerances.csv``: exponents inside and outside the error control."""
    headings = [f"{side} {i}" for side in ("inside", "outside") for i in range(1, 5)]
    rows = np.column_stack([trap.tolerances, trap.inside, trap.outside])
    _write(folder / "tolerances.csv", ["tolerance", *headings], rows.tolist())


def write_explanations(folder: Path, found: Sequence[Explanation]) -> None:
    """Write ``explanations.csv``: one row per candidate."""
    omegas = list(found[0].exponents)
    rows = ([e.text, *(e.exponents[omega] for omega in omegas), e.misfit] for e in found)
    _write(folder / "explanations.csv", ["candidate", *omegas, "misfit"], rows)


def _write(path: Path, headings: Sequence[object], rows: Iterable[Sequence[object]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(headings)
        writer.writerows(rows)
