"""The whole diagram over a parameter: every branch that bifurcations lead to."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from hybrid import arguments
from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.progress import progress_bar
from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.watch import OfArc, checked_outputs
from hybrid.orbits.diagrams.diagram import Diagram
from hybrid.orbits.diagrams.leads import Lead, Start, numbers_of
from hybrid.orbits.diagrams.same import is_same_value
from hybrid.orbits.diagrams.seen import seen_of
from hybrid.orbits.diagrams.store import DiagramStore
from hybrid.orbits.diagrams.walker import How, Walker
from hybrid.orbits.equilibria.equilibrium import Equilibrium
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.simulation.identity import facts_from
from hybrid.simulation.plan import check_solver
from hybrid.simulation.seal import SEAL, sealed
from hybrid.solvers import Solver, Taylor
from hybrid.transform.aged import original_of

if TYPE_CHECKING:
    import xarray


def continue_all(
    start: Start | Sequence[Start],
    parameter: str,
    span: tuple[float, float],
    *,
    depth: int = 2,
    most: int = 50,
    sweep: xarray.Dataset | None = None,
    outputs: Mapping[str, OfArc] | None = None,
    store: str | os.PathLike[str] | None = None,
    solver: Solver | None = None,
    max_steps: int = 2000,
    progress: bool | None = None,
) -> Diagram:
    """The branches of orbits and equilibria that are joined to some starts, over one parameter.

    Each branch is followed both ways. At flips, branch points and Hopf points, and at boundaries of
    equilibria, the other branch is followed too, down to a depth. A branch that is known already is not
    followed again.

    No bifurcation joins an isola to another branch. A sweep finds it if it has a stable part: each attractor
    that a sweep has seen is compared with the branches, and where it is on none it is closed by Newton's
    method and followed, too. What is on no branch in the end, such as chaos, is listed.

    Parameters
    ----------
    start
        From `periodic_orbit` or `equilibrium`, or several of them, at values of the parameter that may
        differ; all other parameters are the same. Those on a branch of another one add none.
    parameter, span
        As for `continue_orbit`; the span contains the value of each start.
    depth
        How many switches lead from a start, or from an attractor of the sweep, to a branch at most.
    most
        Largest number of branches.
    sweep
        What ``basin_fractions(system, over, along={parameter: values}, starts=20)`` has seen, at the
        parameters of the start and, of a forced system, at its phase ``t0``. Values out of the span are left
        out. Periodic motion of more than 8 points is listed, and not followed.
    outputs
        Functions of an arc, by name, as of `continue_orbit`; for branches of orbits.
    store
        Folder of a store. Each branch is written when it is done, and the same call again goes on from
        there; `open_diagram` opens it. Needs the extra ``grid``.
    solver
        Method and tolerances for orbits, by default ``Taylor(rtol=1e-12, atol=1e-14)``.
    max_steps
        Largest number of steps of a branch in either direction.
    progress
        Whether to show the number of branches; by default in a terminal or a notebook, after two seconds.

    Returns
    -------
    Diagram
        With a status; after Ctrl-C it has the branches so far.

    Raises
    ------
    ArgumentError
        If an argument does not fit, as for `continue_orbit` and `continue_equilibrium`; if the store was made
        by another call; the text names the difference.

    Examples
    --------
    >>> import hybrid
    >>> cubic = hybrid.HybridSystem(
    ...     state=("x",),
    ...     parameters={"a": -1.0},
    ...     modes=[hybrid.Mode("flow", lambda t, x, p: (p.a * x.x - x.x**3,))],
    ... )
    >>> diagram = hybrid.continue_all(hybrid.equilibrium(cubic, (0.2,)), "a", (-1.0, 1.0))
    >>> len(diagram), [each.kind for each in diagram[0].bifurcations]
    (2, ['branch point'])
    """
    starts = _checked_starts(start, parameter, span)
    depth, most = arguments.count("depth", depth, 0), arguments.count("most", most, 1)
    progress = None if progress is None else arguments.flag("progress", progress)
    method = Taylor(rtol=1e-12, atol=1e-14) if solver is None else check_solver(solver)
    measured = checked_outputs(outputs, starts[0].system)
    steps = arguments.count("max_steps", max_steps, 1)
    how = How(original_of(starts[0].system), parameter, span, depth, measured, method, steps)
    seen = None if sweep is None else seen_of(sweep, starts[0], parameter, span, method)
    kept = None if store is None else DiagramStore(store, _facts(how, starts, sweep))
    walker = Walker(how, [Lead(each) for each in starts], seen, kept)
    with CTRL_C, progress_bar(None, "Diagram", progress, "branch") as bar:
        with CTRL_C.ending():
            walker.walk(most, bar)
        found = walker.diagram(stopped=CTRL_C.is_set())
    if kept is not None:
        kept.finish(found.to_xarray())
    return found


def _facts(how: How, starts: Sequence[Start], sweep: xarray.Dataset | None) -> dict[str, str]:
    """What decides a diagram, by name."""
    given = {
        "model": how.system,
        "parameter": how.parameter,
        "span": tuple(map(float, how.span)),
        "depth": how.depth,
        "max_steps": how.max_steps,
        "solver": how.solver,
        "sweep": None if sweep is None else sealed(sweep.drop_attrs()).attrs[SEAL],
        **{f"output_{name}": each for name, each in how.outputs.items()},
        **{f"start {i + 1}": numbers_of(each) for i, each in enumerate(starts)},
    }
    return facts_from(given)


def _checked_starts(start: object, parameter: str, span: tuple[float, float]) -> list[Start]:
    """The starts, which are of one model with one set of the other parameters."""
    starts = [start] if isinstance(start, PeriodicOrbit | Equilibrium) else _listed(start)
    first = starts[0]
    arguments.known("parameter: Parameter", parameter, first.system.parameters, "Parameters")
    for i, each in enumerate(starts):
        if original_of(each.system).state_names != original_of(first.system).state_names:
            raise ArgumentError(
                f"start[{i}] is one of another system than start[0]: give those of one system."
            )
        if not (each.closes if isinstance(each, PeriodicOrbit) else each.status.ok):
            raise ArgumentError(f"start[{i}] has not converged: {each.status.message}")
        arguments.span_around("span", span, parameter, each.parameters[parameter])
        for name, value in each.parameters.items():
            known = first.parameters[name]
            if name != parameter and not is_same_value(value, known):
                raise ArgumentError(
                    f"start[{i}] has {name} = {value:.12g}, and start[0] has {name} = {known:.12g}: "
                    f"all parameters but {parameter!r} must be the same."
                )
    return starts


def _listed(start: object) -> list[Start]:
    wanted = "be an orbit of periodic_orbit, an equilibrium, or several of them"
    found = arguments.items("start", start, wanted, least=1)
    for each in found:
        if not isinstance(each, PeriodicOrbit | Equilibrium):
            raise arguments.refusal("start", wanted, each)
    return found
