"""Totals over structures, and the rows of the tables."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence

import numpy as np

from benchmarks.adversarial.compare import Outcome
from benchmarks.adversarial.instants import Compared
from benchmarks.adversarial.pool import Hung
from benchmarks.adversarial.trial import Part

COUNTS = ("runs", "crossings", "missed", "invented", "doubled", "mistimed", "off_zero", "stopped", "unclear")
# Edges of the sharpness bins in the chart; guards without a sharpness are in no bin.
EDGES = 10.0 ** np.arange(0.0, 4.01, 0.5)
Table = tuple[Sequence[str], list[list[str]]]


class Tally:
    """All outcomes by method and family."""

    def __init__(self) -> None:
        self.outcomes: dict[str, dict[str, list[Outcome]]] = defaultdict(lambda: defaultdict(list))
        self.hung: dict[str, int] = defaultdict(int)
        self.seconds: dict[str, float] = defaultdict(float)
        self.doubts = 0

    def add(self, part: Part) -> None:
        for family, outcome in zip(part.families, part.outcomes, strict=True):
            self.outcomes[part.method][family].append(outcome)
        for name, seconds in part.seconds.items():
            self.seconds[name] += seconds
        self.doubts += part.doubts

    def hang(self, hung: Hung) -> None:
        self.hung[hung.method] += hung.run >= 0

    def of(self, method: str) -> list[Outcome]:
        return [outcome for outcomes in self.outcomes[method].values() for outcome in outcomes]


class InstantTally:
    """All comparisons with the exact rules by method."""

    def __init__(self) -> None:
        self.compared: dict[str, list[Compared]] = defaultdict(list)
        self.hung: dict[str, int] = defaultdict(int)

    def add(self, part: Compared) -> None:
        self.compared[part.method].append(part)

    def hang(self, hung: Hung) -> None:
        self.hung[hung.method] += hung.run >= 0


def instant_rows(tally: InstantTally) -> Table:
    rows = []
    for method, every in tally.compared.items():
        kinds = Counter(kind for one in every for _, kind, _ in one.differences)
        said = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common())
        rows.append(
            [
                method,
                str(sum(one.cases for one in every)),
                str(sum(one.firings for one in every)),
                str(kinds.total()),
                str(tally.hung[method]),
                said or "-",
            ]
        )
    return ["method", "systems", "transitions fired", "runs that differ", "hung", "how"], rows


def counts(outcomes: list[Outcome]) -> list[str]:
    return [str(sum(getattr(outcome, name) for outcome in outcomes)) for name in COUNTS]


def method_rows(tally: Tally) -> Table:
    rows = []
    for method in tally.outcomes:
        rows.append([method, *counts(tally.of(method)), str(tally.hung[method])])
    return ["method", "guards", *(name.replace("_", " ") for name in COUNTS[1:]), "hung"], rows


def family_rows(tally: Tally, method: str) -> Table:
    rows = [[family, *counts(outcomes)] for family, outcomes in sorted(tally.outcomes[method].items())]
    return [f"{method}: family", "guards", *(name.replace("_", " ") for name in COUNTS[1:])], rows


def error_rows(tally: Tally) -> Table:
    """Errors of event times in units of the rounding error."""
    rows = []
    for method in tally.outcomes:
        errors = np.concatenate([outcome.errors for outcome in tally.of(method)] or [np.zeros(0)])
        quantiles = np.quantile(errors, (0.5, 0.9, 0.99)) if len(errors) else np.zeros(3)
        rows.append([method, *(f"{value:.2g}" for value in quantiles)])
    return ["error of event times / rounding", "median", "90 %", "99 %"], rows


def by_sharpness(tally: Tally, method: str) -> np.ndarray:
    """Shares ``(bins, 3)`` of crossings missed, invented and doubled; nan for bins without crossings."""
    outcomes = tally.of(method)
    sharpness = np.concatenate([outcome.sharpness for outcome in outcomes])
    numbers = np.concatenate([outcome.per_run for outcome in outcomes])
    place = np.digitize(sharpness, EDGES) - 1
    shares = np.full((len(EDGES) - 1, 3), np.nan)
    for i in range(len(shares)):
        sums = numbers[place == i].sum(axis=0)
        if sums[0]:
            shares[i] = sums[1:] / sums[0]
    return shares
