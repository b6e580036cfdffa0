"""Drawn cases are judged: for every property until one fails, then for that one alone."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Container

from hypothesis import HealthCheck, Phase, Verbosity
from hypothesis import given as with_drawn
from hypothesis import settings as hypothesis_settings
from hypothesis.errors import Unsatisfiable, UnsatisfiedAssumption
from hypothesis.strategies import SearchStrategy

from hybrid.compiler.compiled import compile_system
from hybrid.display.progress import Progress
from hybrid.testing.case import Case
from hybrid.testing.coverage import Coverage
from hybrid.testing.elastic import ELASTIC
from hybrid.testing.errors import PropertyError
from hybrid.testing.properties import WITHOUT_RUN
from hybrid.testing.reads import numbers_read
from hybrid.testing.report import PropertyReport, SystemReport


def counted(judge: Callable[[Case], None], bar: Progress) -> Callable[[Case], None]:
    """A judge that counts its cases on a bar."""

    def judged(case: Case) -> None:
        bar.update()
        judge(case)

    return judged


def search(drawn: SearchStrategy[Case], judge: Callable[[Case], None], examples: int) -> None:
    """Judge drawn cases; raise the failure of the smallest case that fails.

    Hypothesis draws other cases where the text of ``search`` is another one.
    """

    @hypothesis_settings(
        max_examples=examples,
        database=None,
        deadline=None,
        derandomize=True,
        phases=(Phase.generate, Phase.shrink),
        report_multiple_bugs=False,
        suppress_health_check=list(HealthCheck),
        verbosity=Verbosity.quiet,
    )
    @with_drawn(drawn)
    def search(case: Case) -> None:
        judge(case)

    failure = None
    try:
        search()
    except PropertyError as error:
        failure = str(error)
    except Unsatisfiable:
        pass
    if failure is not None:
        raise PropertyError(failure)


class Tally:
    """Checks cases for every property until one fails, then for that one only, so that it can shrink."""

    def __init__(
        self, coverage: Coverage, properties: dict[str, Callable[[Case], None]], laws: Container[str]
    ) -> None:
        self.coverage = coverage
        self.properties = properties
        self.laws = laws
        self.held = Counter(dict.fromkeys(properties, 0))
        self.discarded: dict[str, Counter[str]] = {name: Counter() for name in properties}
        self.unfit: Counter[str] = Counter()
        self.cut: Counter[str] = Counter()
        self.fit = 0
        self.failed: str | None = None

    def once(self, name: str, check: Callable[[], None]) -> None:
        """Check what needs no run."""
        self.held[name], self.discarded[name] = 0, Counter()
        try:
            check()
        except UnsatisfiedAssumption as reason:
            self.discarded[name][str(reason)] += 1
        else:
            self.held[name] += 1

    def judge(self, case: Case) -> None:
        """Check a case for every property that can be judged on it."""
        is_fit = self.failed is not None or self._is_fit(case)
        names = [self.failed] if self.failed else [*self.properties]
        failures: list[tuple[str, PropertyError]] = []
        for name in names:
            if failures and name not in self.laws:
                break
            if not (is_fit or name in WITHOUT_RUN or name in self.laws):
                continue
            try:
                self.properties[name](case)
            except UnsatisfiedAssumption as reason:
                self.discarded[name][str(reason)] += 1
            except PropertyError as error:
                failures.append((name, error))
                if name not in self.laws:
                    break
            else:
                self.held[name] += 1
        if failures:
            # Of several laws that fail the first to fail on the run is nearest to the mistake.
            times = [math.inf if each.time is None else each.time for _, each in failures]
            self.failed, first = failures[times.index(min(times))]
            raise first

    def _is_fit(self, case: Case) -> bool:
        try:
            cut = case.run.cut
        except UnsatisfiedAssumption as reason:
            self.unfit[str(reason)] += 1
            return False
        self.fit += 1
        self.cut.update([cut] if cut else [])
        return True

    def report(self, without_elastic: bool) -> SystemReport:
        """What was found, if any run could be judged."""
        system, coverage = self.coverage.system, self.coverage
        name = system.name or "The system"
        if not self.fit:
            reasons = "".join(f"\n  {count} times: {why}" for why, count in self.unfit.most_common(3))
            raise PropertyError(
                f"{name}: none of {self.unfit.total()} runs could be judged.{reasons}\n"
                "  likely: a guard with the wrong direction or threshold, if guards are named above; else "
                "ranges of states that no mode allows, or a time span that does not suit the model: give "
                "states=, t_span= or mode=."
            )
        found = [PropertyReport(name, self.held[name], self.discarded[name]) for name in self.held]
        if without_elastic:
            found.append(PropertyReport(ELASTIC, 0, Counter({"Laws(elastic=...) is not given": 1})))
        told = compile_system(system).emitted.discontinuities
        jumps = {mode: text for mode, text in zip(system.mode_names, told, strict=True) if text}
        return SystemReport(
            name,
            tuple(found),
            unfit=self.unfit,
            cut=self.cut,
            ends=coverage.ends,
            jumps=coverage.jumps,
            visits=coverage.visits,
            one_sided=coverage.one_sided,
            dead_ends=coverage.dead_ends,
            numbers=numbers_read(system),
            discontinuities=jumps,
            gains=coverage.gains,
        )
