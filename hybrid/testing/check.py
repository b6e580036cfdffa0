"""Check every property of one system in one call."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Container, Iterable
from typing import Any

import attrs
import numpy as np
from hypothesis import HealthCheck, Phase, Verbosity
from hypothesis import given as with_drawn
from hypothesis import settings as hypothesis_settings
from hypothesis.errors import Unsatisfiable, UnsatisfiedAssumption
from hypothesis.strategies import SearchStrategy

from hybrid import arguments
from hybrid.compiler.compiled import compile_system
from hybrid.display.progress import Progress, progress_bar
from hybrid.solvers import Solver
from hybrid.system.graph import HybridSystem, as_system, laws_of
from hybrid.system.growth import finished, stage_of
from hybrid.system.labels import named
from hybrid.system.laws import Laws
from hybrid.testing.case import TIGHT, Case
from hybrid.testing.contacts import (
    COEFFICIENTS,
    FORCES,
    GAPS,
    IMPACTS,
    check_coefficients,
    check_contact_forces,
    check_gaps,
    check_impacts,
)
from hybrid.testing.coverage import FIRES, Coverage
from hybrid.testing.crossings import CROSSINGS, check_crossings
from hybrid.testing.derivatives import DERIVATIVES, check_derivatives
from hybrid.testing.dimensions import DIMENSIONS, check_dimensions
from hybrid.testing.ends import ENDS, SIDES_AFTER, check_ends, check_sides_after
from hybrid.testing.engine import LIBRARY, Engine
from hybrid.testing.errors import PropertyError
from hybrid.testing.events import JUMPS, SIDES, check_jumps, check_sides
from hybrid.testing.functions import (
    ANGLES,
    COMPILED,
    PERIOD,
    SHORTEST,
    check_angles,
    check_compiled,
    check_period,
    check_shortest_period,
)
from hybrid.testing.invariance import (
    CUT,
    ELASTIC,
    NAMES,
    ORDER,
    SAMPLES,
    SCALE,
    SPLIT,
    check_cut,
    check_elastic,
    check_names,
    check_order,
    check_samples,
    check_scale,
    check_split,
    turned,
)
from hybrid.testing.landing import LANDINGS, LIMITS, check_landings, check_limits
from hybrid.testing.laws import declared_too, law_checks
from hybrid.testing.outputs import OUTPUTS, check_outputs
from hybrid.testing.reads import READS, check_reads, numbers_read
from hybrid.testing.report import PropertyReport, SystemReport
from hybrid.testing.saltation import (
    CONTINUITY,
    EXTENSION,
    FLOW_DIRECTION,
    SALTATION,
    SUM_RULE,
    check_continuity,
    check_extension,
    check_flow_direction,
    check_saltation,
    check_sum_rule,
)
from hybrid.testing.strategies import Ranges, cases
from hybrid.testing.ticks import check_ticks
from hybrid.testing.units import UNITS, check_units
from hybrid.testing.waits import TICKS
from hybrid.transform.aged import aged
from hybrid.transform.contacts.growth import contacts_of

# Properties of the functions, at the start of a case, and of the whole run; laws are others.
OF_CONTACTS = {
    COEFFICIENTS: check_coefficients,
    GAPS: check_gaps,
    FORCES: check_contact_forces,
    IMPACTS: check_impacts,
}
WITHOUT_RUN = (DERIVATIVES, COMPILED, PERIOD, ANGLES, SIDES_AFTER, LIMITS, ENDS, *OF_CONTACTS)


def check_system(
    system: HybridSystem,
    *,
    states: Ranges | SearchStrategy[Any] | None = None,
    parameters: Ranges | SearchStrategy[Any] | None = None,
    t_span: tuple[float, float] | None = None,
    mode: str | None = None,
    passable: Iterable[str] = (),
    laws: Laws | None = None,
    examples: int = 50,
    solver: Solver = TIGHT,
    engine: Engine = LIBRARY,
    progress: bool | None = None,
) -> SystemReport:
    """Check every property of a hybrid system on drawn runs, and report the smallest failure in words.

    The same runs are drawn each time. A run that chatters, grazes, reaches two guards together or depends on
    the tolerances is cut short before that or discarded; the report counts the discarded runs.

    Parameters
    ----------
    system
        The model.
    states, parameters
        Ranges ``(low, high)``, numbers or strategies by name. By default states are drawn from -2 to 2, and
        parameters within a fifth of their declared values.
    t_span
        Time span that contains the runs; by default two forcing periods, or a span estimated from the fields.
    mode
        Mode that runs start in; by default any mode whose guards allow the state.
    passable
        Names of transitions whose guard the state may cross and stay in the same mode.
    laws
        What the author knows, beside the laws that the system carries. Starts are drawn where no
        ``invariant`` is negative and every ``equal`` is zero.
    examples
        Number of runs to draw.
    solver
        Method and tolerances, which should be tight.
    engine
        Computes runs and derivatives.
    progress
        Whether to show progress bars; by default in a terminal or a notebook, after two seconds. pytest shows
        them with ``-s``. A bar goes on beyond ``examples`` while a failing case is made smaller.

    Returns
    -------
    SystemReport
        The properties checked, the number of examples of each, and why examples were discarded.

    Raises
    ------
    PropertyError
        If a property fails, or if no run could be judged.
    ModelError
        If the model cannot be compiled, or an argument does not fit it (ArgumentError).

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import check_system
    >>> report = check_system(models.bouncing_ball(), examples=5)
    >>> report.unchecked
    ('The saltation matrix is the identity ...', 'An elastic ...')
    """
    as_system("system", system)
    examples = arguments.count("examples", examples, 1)
    progress = None if progress is None else arguments.flag("progress", progress)
    if system.aging and system.age is None:
        # Only with the time since its mode was entered does a state tell how a run goes on.
        states, system = _with_age(states, system), aged(system)
    known = laws_of(system, laws)
    while True:
        drawn = cases(
            system,
            states=states,
            parameters=parameters,
            t_span=t_span,
            mode=mode,
            passable=passable,
            solver=solver,
            engine=engine,
            laws=laws,
        )
        coverage = Coverage.of(system)
        with progress_bar(examples, "Runs drawn", progress, "run") as bar:
            _search(drawn, counted(coverage.see, bar), examples)
        # The modes of a system that is made in stages are those that these runs need.
        if system.growth is None or system.growth.current is system:
            break
        system = stage_of(system)
    system = finished(system)
    flip = None if known.elastic is None else turned("elastic", system, known.elastic)
    tally = _Tally(coverage, _properties(system, known, flip), law_checks(known))
    tally.once(READS, lambda: check_reads(attrs.evolve(system, laws=known)))
    if system.units:
        tally.once(DIMENSIONS, lambda: check_dimensions(system))
    if contacts_of(system) is not None and states is not None:
        tally.once(GAPS, coverage.check_starts)
    aimed = list(coverage.aimed())
    for case in aimed:
        coverage.see(case)
    tally.once(FIRES, coverage.check)
    if system.period is not None:
        tally.once(SHORTEST, lambda: check_shortest_period(system, coverage.cases))
    with progress_bar(examples, "Runs judged", progress, "run") as bar:
        _search(drawn, counted(tally.judge, bar), examples)
    for case in aimed:
        tally.judge(case)
    return tally.report(flip is None)


def _with_age(states: Any, system: HybridSystem) -> Any:
    """The states to draw, where a mode is entered."""
    age = system.tangent_dimension
    if isinstance(states, SearchStrategy):
        return states.map(lambda x: (*x[:age], 0.0, *x[age:]))
    return {**named("states", states), aged(system).state_names[age]: 0.0}


def _properties(
    system: HybridSystem, laws: Laws, flip: Callable[[np.ndarray], np.ndarray] | None
) -> dict[str, Callable[[Case], None]]:
    """The properties in the order in which they are checked: what is nearest to the author's text first."""
    touching = {} if contacts_of(system) is None else OF_CONTACTS
    properties: dict[str, Callable[[Case], None]] = {
        **touching,
        DERIVATIVES: check_derivatives,
        COMPILED: check_compiled,
        PERIOD: check_period,
        ANGLES: check_angles,
        SIDES_AFTER: check_sides_after,
        LIMITS: check_limits,
        **law_checks(laws),
        ENDS: lambda case: declared_too(case, check_ends),
        SIDES: check_sides,
        LANDINGS: check_landings,
        CROSSINGS: check_crossings,
        TICKS: check_ticks,
        JUMPS: check_jumps,
        OUTPUTS: check_outputs,
        UNITS: check_units,
        NAMES: check_names,
        ORDER: check_order,
        SCALE: check_scale,
        SPLIT: check_split,
        SAMPLES: check_samples,
        CUT: check_cut,
        CONTINUITY: check_continuity,
        EXTENSION: check_extension,
        FLOW_DIRECTION: check_flow_direction,
        SALTATION: check_saltation,
        SUM_RULE: check_sum_rule,
    }
    applies = {
        PERIOD: system.period is not None,
        ANGLES: bool(system.angles),
        OUTPUTS: bool(system.outputs),
        LANDINGS: any(each.reset is not None for each in system.transitions),
        TICKS: any(each.clock for each in system.transitions),
        LIMITS: any(each.accumulates_to for each in system.transitions),
        ORDER: len(system.transitions) > 1 and not system.listed_order,
    }
    properties = {name: check for name, check in properties.items() if applies.get(name, True)}
    if flip is not None:
        properties[ELASTIC] = lambda case: check_elastic(case, flip)
    return properties


def counted(judge: Callable[[Case], None], bar: Progress) -> Callable[[Case], None]:
    """A judge that counts its cases on a bar."""

    def judged(case: Case) -> None:
        bar.update()
        judge(case)

    return judged


def _search(drawn: SearchStrategy[Case], judge: Callable[[Case], None], examples: int) -> None:
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


class _Tally:
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
