"""Check every property of one system in one call."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import attrs
from hypothesis.strategies import SearchStrategy

from hybrid import arguments
from hybrid.display.progress import progress_bar
from hybrid.solvers import Solver
from hybrid.system.graph import HybridSystem, as_system, laws_of
from hybrid.system.growth import finished, stage_of
from hybrid.system.labels import named
from hybrid.system.laws import Laws
from hybrid.testing.case import TIGHT
from hybrid.testing.contacts import (
    GAPS,
)
from hybrid.testing.coverage import FIRES, Coverage
from hybrid.testing.dimensions import DIMENSIONS, check_dimensions
from hybrid.testing.elastic import turned
from hybrid.testing.engine import LIBRARY, Engine
from hybrid.testing.functions import (
    SHORTEST,
    check_shortest_period,
)
from hybrid.testing.laws import law_checks
from hybrid.testing.properties import properties_of
from hybrid.testing.reads import READS, check_reads
from hybrid.testing.report import SystemReport
from hybrid.testing.strategies import Ranges, cases
from hybrid.testing.tally import Tally, counted, search
from hybrid.transform.aged import aged
from hybrid.transform.contacts.growth import contacts_of


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
            search(drawn, counted(coverage.see, bar), examples)
        # The modes of a system that is made in stages are those that these runs need.
        if system.growth is None or system.growth.current is system:
            break
        system = stage_of(system)
    system = finished(system)
    flip = None if known.elastic is None else turned("elastic", system, known.elastic)
    tally = Tally(coverage, properties_of(system, known, flip), law_checks(known))
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
        search(drawn, counted(tally.judge, bar), examples)
    for case in aimed:
        tally.judge(case)
    return tally.report(flip is None)


def _with_age(states: Any, system: HybridSystem) -> Any:
    """The states to draw, where a mode is entered."""
    age = system.tangent_dimension
    if isinstance(states, SearchStrategy):
        return states.map(lambda x: (*x[:age], 0.0, *x[age:]))
    return {**named("states", states), aged(system).state_names[age]: 0.0}
