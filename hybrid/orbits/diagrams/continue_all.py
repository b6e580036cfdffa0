"""The whole diagram over a parameter: every branch that bifurcations lead to."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.display.progress import progress_bar
from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.branch import Bifurcation, Branch
from hybrid.orbits.continuation.continue_orbit import continue_orbit
from hybrid.orbits.continuation.switch_branch import switch_branch
from hybrid.orbits.continuation.watch import OfArc, checked_outputs
from hybrid.orbits.diagrams.diagram import Diagram, Origin
from hybrid.orbits.diagrams.same import is_known
from hybrid.orbits.equilibria.branch import EquilibriumBifurcation, EquilibriumBranch
from hybrid.orbits.equilibria.continue_equilibrium import continue_equilibrium
from hybrid.orbits.equilibria.equilibrium import Equilibrium
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.simulation.plan import check_solver
from hybrid.solvers import Solver, Taylor
from hybrid.status import SUCCESS, Status, StatusCode

# Bifurcations from which another branch is followed. At the others the branch goes on by itself.
SWITCHED = ("flip", "branch point", "Hopf", "boundary")
# A bifurcation this near to the one at which its branch was found is that one, in units of the range.
SAME_VALUE = 1e-6

Start = PeriodicOrbit | Equilibrium


def continue_all(
    start: Start | Sequence[Start],
    parameter: str,
    span: tuple[float, float],
    *,
    depth: int = 2,
    most: int = 50,
    outputs: Mapping[str, OfArc] | None = None,
    solver: Solver | None = None,
    max_steps: int = 2000,
    progress: bool | None = None,
) -> Diagram:
    """The branches of orbits and equilibria that are joined to some starts, over one parameter.

    Each branch is followed both ways. At flips, branch points and Hopf points, and at boundaries of
    equilibria, the other branch is followed too, down to a depth. A branch that is known already is not
    followed again.

    Parameters
    ----------
    start
        From `periodic_orbit` or `equilibrium`, or several of them.
    parameter, span
        As for `continue_orbit`; the span contains the value of each start.
    depth
        How many switches lead from a start to a branch at most.
    most
        Largest number of branches.
    outputs
        Functions of an arc, by name, as of `continue_orbit`; for branches of orbits.
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
        If an argument does not fit, as for `continue_orbit` and `continue_equilibrium`.

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
    starts = [start] if isinstance(start, PeriodicOrbit | Equilibrium) else _listed(start)
    depth, most = arguments.count("depth", depth, 0), arguments.count("most", most, 1)
    progress = None if progress is None else arguments.flag("progress", progress)
    method = Taylor(rtol=1e-12, atol=1e-14) if solver is None else check_solver(solver)
    walker = _Walker(parameter, span, checked_outputs(outputs, starts[0].system), method, max_steps)
    waiting: deque[tuple[Start, int, Origin | None]] = deque((each, 0, None) for each in starts)
    stopped = False
    with progress_bar(None, "Diagram", progress, "branch") as bar:
        while waiting and len(walker.branches) < most and not stopped:
            first, level, origin = waiting.popleft()
            if any(is_known(first, branch, method) for branch in walker.branches):
                continue
            branch = walker.follow(first, origin)
            bar.update(True)
            stopped = branch.status.code == StatusCode.INTERRUPTED
            if level < depth and not stopped:
                there = walker.switched(len(walker.branches) - 1)
                waiting += [(found, level + 1, at) for found, at in there]
    return walker.diagram(left=len(waiting), stopped=stopped)


def _listed(start: object) -> list[Start]:
    wanted = "be an orbit of periodic_orbit, an equilibrium, or several of them"
    found = arguments.items("start", start, wanted, least=1)
    for each in found:
        if not isinstance(each, PeriodicOrbit | Equilibrium):
            raise arguments.refusal("start", wanted, each)
    return found


@attrs.define(eq=False)
class _Walker:
    """Branches that have been followed, and how."""

    parameter: str
    span: tuple[float, float]
    outputs: Mapping[str, OfArc]
    solver: Solver
    max_steps: int
    branches: list[Branch | EquilibriumBranch] = attrs.field(factory=list)
    origins: list[Origin | None] = attrs.field(factory=list)
    notes: list[str] = attrs.field(factory=list)

    def follow(self, start: Start, origin: Origin | None) -> Branch | EquilibriumBranch:
        """The branch of a start, which is kept."""
        branch: Branch | EquilibriumBranch
        options: dict[str, Any] = {"max_steps": self.max_steps, "progress": False}
        if isinstance(start, Equilibrium):
            branch = continue_equilibrium(start, self.parameter, self.span, **options)
        else:
            options |= {"outputs": self.outputs or None, "solver": self.solver}
            branch = continue_orbit(start, self.parameter, self.span, **options)
        if not branch.status.ok and branch.status.code != StatusCode.INTERRUPTED:
            self.notes.append(f"Branch {len(self.branches)}: {branch.status.message}")
        self.branches.append(branch)
        self.origins.append(origin)
        return branch

    def switched(self, i: int) -> Iterator[tuple[Start, Origin]]:
        """What begins or crosses at the bifurcations of a branch."""
        for each in self.branches[i].bifurcations:
            if each.kind not in SWITCHED or self._is_origin(i, each):
                continue
            if isinstance(each, Bifurcation) and each.kind == "Hopf":
                # The branch of cycles begins there; the equilibrium is not an orbit.
                continue
            if isinstance(each, EquilibriumBifurcation) and each.kind == "boundary" and not each.modes:
                continue
            try:
                found = switch_branch(each, solver=self.solver)
            except ArgumentError as why:
                self.notes.append(f"Branch {i}, {each.kind} at {self.parameter} = {each.value:.10g}: {why}")
                continue
            low, high = sorted(self.span)
            if low <= found.parameters[self.parameter] <= high:
                yield found, Origin(i, each)

    def _is_origin(self, i: int, each: Bifurcation | EquilibriumBifurcation) -> bool:
        """Whether a branch was found at a bifurcation."""
        origin = self.origins[i]
        near = SAME_VALUE * abs(self.span[1] - self.span[0])
        if origin is None or abs(origin.bifurcation.value - each.value) > near:
            return False
        one, other = origin.bifurcation, each
        if not (isinstance(one, EquilibriumBifurcation) and isinstance(other, EquilibriumBifurcation)):
            return True
        sizes = np.abs(one.equilibrium.x) + np.abs(other.equilibrium.x)
        return bool(np.all(np.abs(one.equilibrium.x - other.equilibrium.x) <= SAME_VALUE * sizes.max()))

    def diagram(self, left: int, stopped: bool) -> Diagram:
        """All that was followed."""
        count = len(self.branches)
        told = f"{count} branches." if count != 1 else "1 branch."
        status = attrs.evolve(SUCCESS, message=told)
        if stopped:
            status = Status(StatusCode.INTERRUPTED, f"Interrupted after {told}", "Call again for the rest.")
        elif left:
            status = Status(
                StatusCode.NOT_CONVERGED, f"{told} {left} more starts were not followed.", "Raise most=."
            )
        elif self.notes:
            status = attrs.evolve(SUCCESS, message=f"{told} See .notes for what was not followed.")
        first = self.branches[0]
        return Diagram(
            system=first.system,
            name=self.parameter,
            branches=tuple(self.branches),
            origins=tuple(self.origins),
            outputs=dict(self.outputs),
            notes=tuple(self.notes),
            status=status,
        )
