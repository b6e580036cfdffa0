"""Check every property of one system in one call."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import attrs
import numpy as np
from hypothesis import HealthCheck, Phase, Verbosity, given
from hypothesis import settings as hypothesis_settings
from hypothesis.errors import Unsatisfiable, UnsatisfiedAssumption
from hypothesis.strategies import SearchStrategy

from hybrid import arguments
from hybrid.compiler.compiled import compile_system
from hybrid.solvers import Solver
from hybrid.system.graph import HybridSystem, as_system
from hybrid.testing.case import LIBRARY, TIGHT, Case, Engine, PropertyError, mode_after
from hybrid.testing.crossings import CROSSINGS, check_crossings
from hybrid.testing.derivatives import DERIVATIVES, check_derivatives
from hybrid.testing.ends import ENDS, check_ends
from hybrid.testing.events import JUMPS, SIDES, check_jumps, check_sides
from hybrid.testing.functions import COMPILED, PERIOD, check_compiled, check_period
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
from hybrid.testing.laws import as_laws, check_conserved, check_invariant, checks
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
from hybrid.testing.units import UNITS, check_units

# A property is reported as hardly checked if less than this share of its examples could be judged.
HARDLY = 0.1


@attrs.frozen
class PropertyReport:
    """Result for one property.

    Attributes
    ----------
    name
        The property, as a sentence.
    examples
        Number of examples on which the property was checked and held.
    discarded
        Number of examples that could not be judged, by reason.
    """

    name: str
    examples: int
    discarded: Counter[str]

    @property
    def checked(self) -> bool:
        """Whether the property was checked on any example."""
        return self.examples > 0

    def __str__(self) -> str:
        lost = sum(self.discarded.values())
        if not lost:
            return f"{self.name}: {self.examples} examples."
        if not self.checked:
            return f"NOT CHECKED: {self.name}: {_most_common(self.discarded)}."
        why = f"{lost} discarded ({_most_common(self.discarded)})"
        hardly = "HARDLY CHECKED: " if self.examples < HARDLY * (self.examples + lost) else ""
        return f"{hardly}{self.name}: {self.examples} examples, {why}."


@attrs.frozen
class SystemReport:
    """What :func:`check_system` checked; every property held.

    Attributes
    ----------
    properties
        One :class:`PropertyReport` per property.
    unfit
        Number of runs that could not be judged, by reason; only the model functions were checked at their
        starts.
    jumps
        How often each transition was taken, by name.
    visits
        How often each mode was entered or started in, by name.
    discontinuities
        Where the field of a mode is discontinuous, by mode: tangent vectors are not valid beyond.
    """

    name: str
    properties: tuple[PropertyReport, ...]
    unfit: Counter[str]
    jumps: Counter[str]
    visits: Counter[str]
    discontinuities: Mapping[str, str]

    @property
    def unchecked(self) -> tuple[str, ...]:
        """Properties that were checked on no example."""
        return tuple(found.name for found in self.properties if not found.checked)

    @property
    def never_seen(self) -> tuple[str, ...]:
        """Transitions that no run took and modes that no run visited."""
        return tuple(name for count in (self.jumps, self.visits) for name in count if not count[name])

    def __str__(self) -> str:
        lines = [f"{self.name}: no property failed."]
        if self.unfit:
            lines.append(f"- {self.unfit.total()} runs could not be judged ({_most_common(self.unfit)}).")
        lines += [f"- {found}" for found in self.properties]
        for mode, jumps in self.discontinuities.items():
            lines.append(
                f"- The field of mode {mode!r} jumps where {jumps}: tangent vectors are not valid beyond. "
                "Make its pieces modes joined by guards there."
            )
        if self.never_seen:
            lines.append(f"- Never seen: {', '.join(self.never_seen)}. Give ranges that reach them.")
        return "\n".join(lines)


def _most_common(reasons: Counter[str]) -> str:
    reason, most = reasons.most_common(1)[0]
    share = "" if most == reasons.total() else f"{most} of them: "
    return f"{share}{reason.rstrip('.')}"


def check_system(
    system: HybridSystem,
    *,
    states: Ranges | SearchStrategy[Any] | None = None,
    parameters: Ranges | SearchStrategy[Any] | None = None,
    t_span: tuple[float, float] | None = None,
    mode: str | None = None,
    elastic: Iterable[str] | Callable[[np.ndarray], np.ndarray] | None = None,
    passable: Iterable[str] = (),
    invariant: Mapping[str, Any] | None = None,
    conserved: Mapping[str, Any] | None = None,
    examples: int = 50,
    solver: Solver = TIGHT,
    engine: Engine = LIBRARY,
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
    elastic
        For a system that conserves energy: names of the components that change sign when time is reversed,
        or the involution of the state. The reversed run must return to its start. Not checked by default.
    passable
        Names of transitions whose guard the state may cross and stay in the same mode.
    invariant
        What is never negative: functions of ``(t, x, p)`` by name, or by mode mappings of names to functions.
        Starts are drawn from there. Finds walls that let the state through.
    conserved
        What never changes, such as an energy; given likewise. Finds wrong signs, factors and lost components.
    examples
        Number of runs to draw.
    solver
        Method and tolerances, which should be tight.
    engine
        Computes runs and derivatives.

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
    >>> report = check_system(models.bouncing_ball(), examples=5)
    >>> report.unchecked
    ('The declared period ...', 'The saltation matrix is the identity ...', 'The order ...', 'An elastic ...')
    """
    as_system("system", system)
    examples = arguments.count("examples", examples, 1)
    properties: dict[str, Callable[[Case], None]] = {
        ENDS: check_ends,
        DERIVATIVES: check_derivatives,
        COMPILED: check_compiled,
        PERIOD: check_period,
        JUMPS: check_jumps,
        SIDES: check_sides,
        CROSSINGS: check_crossings,
        SALTATION: check_saltation,
        FLOW_DIRECTION: check_flow_direction,
        CONTINUITY: check_continuity,
        EXTENSION: check_extension,
        SUM_RULE: check_sum_rule,
        SPLIT: check_split,
        SAMPLES: check_samples,
        NAMES: check_names,
        ORDER: check_order,
        SCALE: check_scale,
        UNITS: check_units,
        CUT: check_cut,
    }
    if any(each.reset is not None for each in system.transitions):
        properties[LANDINGS] = check_landings
    if any(each.accumulates_to for each in system.transitions):
        properties[LIMITS] = check_limits
    if elastic is not None:
        flip = turned("elastic", system, elastic)
        properties[ELASTIC] = lambda case: check_elastic(case, flip)
    properties |= checks("non-negative", as_laws("invariant", system, invariant), check_invariant)
    properties |= checks("conserved", as_laws("conserved", system, conserved), check_conserved)
    tally = _Tally(system, properties)
    drawn = cases(
        system,
        states=states,
        parameters=parameters,
        t_span=t_span,
        mode=mode,
        passable=passable,
        invariant=invariant,
        solver=solver,
        engine=engine,
    )
    _search(drawn, tally.judge, examples)
    return tally.report(elastic is None)


def _search(drawn: SearchStrategy[Case], judge: Callable[[Case], None], examples: int) -> None:
    """Judge drawn cases; raise the failure of the smallest case that fails."""

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
    @given(drawn)
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

    def __init__(self, system: HybridSystem, properties: dict[str, Callable[[Case], None]]) -> None:
        self.system = system
        self.properties = properties
        self.held = Counter(dict.fromkeys(properties, 0))
        self.discarded: dict[str, Counter[str]] = {name: Counter() for name in properties}
        self.jumps = Counter(dict.fromkeys(system.transition_names, 0))
        self.visits = Counter(dict.fromkeys(system.mode_names, 0))
        self.unfit: Counter[str] = Counter()
        self.fit = 0
        self.failed: str | None = None

    def judge(self, case: Case) -> None:
        if self.failed:
            names = [self.failed]
        else:
            names = list(self.properties) if self._is_fit(case) else [ENDS, DERIVATIVES, COMPILED, PERIOD]
        for name in names:
            try:
                self.properties[name](case)
            except UnsatisfiedAssumption as reason:
                self.discarded[name][str(reason)] += 1
            except PropertyError:
                self.failed = name
                raise
            else:
                self.held[name] += 1

    def _is_fit(self, case: Case) -> bool:
        try:
            arc = case.run.arc
        except UnsatisfiedAssumption as reason:
            self.unfit[str(reason)] += 1
            return False
        self.fit += 1
        self.jumps.update(jump.transition for jump in arc.jumps)
        self.visits.update([str(arc.mode[0]), *map(mode_after, arc.jumps)])
        return True

    def report(self, without_elastic: bool) -> SystemReport:
        name = self.system.name or "The system"
        if not self.fit:
            reasons = "".join(f"\n  {count} times: {why}" for why, count in self.unfit.most_common(3))
            raise PropertyError(
                f"{name}: none of {self.unfit.total()} runs could be judged.{reasons}\n"
                "  likely: ranges of states that no mode allows, a guard with the wrong direction, or a time "
                "span that does not suit the model. Give states=, t_span= or mode=."
            )
        found = [PropertyReport(name, self.held[name], self.discarded[name]) for name in self.properties]
        if without_elastic:
            found.append(PropertyReport(ELASTIC, 0, Counter({"elastic= is not given": 1})))
        told = compile_system(self.system).emitted.discontinuities
        jumps = {mode: text for mode, text in zip(self.system.mode_names, told, strict=True) if text}
        return SystemReport(name, tuple(found), self.unfit, self.jumps, self.visits, jumps)
