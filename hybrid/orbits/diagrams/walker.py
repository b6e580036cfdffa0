"""The walk along all branches of a diagram: what is followed next, and what is written down of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import count
from typing import Any

import attrs
import numpy as np

from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.progress import Progress
from hybrid.display.tables import counted
from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.branch import Bifurcation, Branch
from hybrid.orbits.continuation.continue_orbit import continue_orbit
from hybrid.orbits.continuation.switch_branch import switch_branch
from hybrid.orbits.continuation.watch import OfArc
from hybrid.orbits.diagrams import leads
from hybrid.orbits.diagrams.diagram import Diagram, Origin
from hybrid.orbits.diagrams.leads import Lead, Start
from hybrid.orbits.diagrams.same import is_known
from hybrid.orbits.diagrams.saved import branch_from
from hybrid.orbits.diagrams.seen import SeenAttractors
from hybrid.orbits.diagrams.store import DiagramStore
from hybrid.orbits.equilibria.branch import EquilibriumBifurcation, EquilibriumBranch
from hybrid.orbits.equilibria.continue_equilibrium import continue_equilibrium
from hybrid.orbits.equilibria.equilibrium import Equilibrium
from hybrid.orbits.kinds import KINDS
from hybrid.solvers import Solver
from hybrid.status import SUCCESS, Status, StatusCode
from hybrid.system.graph import HybridSystem

# A bifurcation this near to the one at which its branch was found is that one, in units of the range.
SAME_VALUE = 1e-6
# A branch is one that is known if all of so many of its orbits but one are.
SAMPLES = 5


@attrs.frozen(eq=False)
class How:
    """What a call of `continue_all` asks for, but for its starts."""

    system: HybridSystem
    parameter: str
    span: tuple[float, float]
    depth: int
    outputs: Mapping[str, OfArc]
    solver: Solver
    max_steps: int


@attrs.define(eq=False)
class Walker:
    """Branches that have been followed, and where others may begin.

    Attributes
    ----------
    how
        What is asked for.
    leads
        All starts in the order in which they were found; those before ``position`` are done.
    seen
        What a sweep has seen; None if there is none.
    store
        Where branches are written; None if they are not.
    """

    how: How
    leads: list[Lead]
    seen: SeenAttractors | None
    store: DiagramStore | None
    position: int = 0
    branches: list[Branch | EquilibriumBranch] = attrs.field(factory=list)
    origins: list[Origin | None] = attrs.field(factory=list)
    notes: list[str] = attrs.field(factory=list)
    # How many leads and notes the store has.
    _written: tuple[int, int] = attrs.field(init=False)

    @_written.default
    def _given(self) -> tuple[int, int]:
        return len(self.leads), 0

    def walk(self, most: int, bar: Progress) -> None:
        """Follow branches until there are no more, or as many as asked for, or Ctrl-C is pressed."""
        self._resume(most, bar)
        while len(self.branches) < most:
            lead = self._next()
            if lead is None or CTRL_C.is_set():
                return
            self._follow(lead)
            if CTRL_C.is_set():
                return
            if lead.origin is None and self._is_repeated():
                continue
            bar.update(True)
            if lead.level < self.how.depth:
                there = self._switched(len(self.branches) - 1)
                self.leads += [Lead(found, lead.level + 1, at) for found, at in there]
            if CTRL_C.is_set():
                return
            self._write()

    def _next(self) -> Lead | None:
        """The next start that is on no branch; when there is none, that of an attractor of the sweep."""
        while True:
            while self.position < len(self.leads):
                lead = self.leads[self.position]
                self.position += 1
                if not self._is_known(lead.start):
                    return lead
            start = None if self.seen is None else self.seen.unknown(self.branches)
            if start is None:
                return None
            self.leads.append(Lead(start))
            self.position += 1
            return self.leads[-1]

    def _is_known(self, start: Start) -> bool:
        return any(is_known(start, branch, self.how.solver) for branch in self.branches)

    def _is_repeated(self) -> bool:
        """Whether the last branch is one before, whose start was not known again; it is then left out.

        So it is if Newton's method leads from an orbit near a fold to the other one.
        """
        last = len(self.branches) - 1
        branch = self.branches[last]
        places = np.linspace(0, len(branch) - 1, SAMPLES + 2)[1:-1].astype(int).tolist()
        samples: list[Start] = [
            branch.orbit(i) if isinstance(branch, Branch) else branch.equilibrium(i) for i in places
        ]
        for i, other in enumerate(self.branches[:last]):
            if sum(is_known(each, other, self.how.solver) for each in samples) >= SAMPLES - 1:
                del self.branches[last], self.origins[last]
                self.notes = [each for each in self.notes if not each.startswith(f"Branch {last}:")]
                self.notes.append(f"A start on branch {i} was not known as one: its branch is left out.")
                if self.seen is not None:
                    self.seen.branch[self.seen.branch == last] = i
                return True
        return False

    def _follow(self, lead: Lead) -> None:
        """Follow the branch of a start, which is kept."""
        branch: Branch | EquilibriumBranch
        how, start = self.how, lead.start
        options: dict[str, Any] = {"max_steps": how.max_steps, "progress": False}
        if isinstance(start, Equilibrium):
            branch = continue_equilibrium(start, how.parameter, how.span, **options)
        else:
            options |= {"outputs": how.outputs or None, "solver": how.solver}
            branch = continue_orbit(start, how.parameter, how.span, **options)
        if not branch.status.ok and branch.status.code != StatusCode.INTERRUPTED:
            self.notes.append(f"Branch {len(self.branches)}: {branch.status.message}")
        self.branches.append(branch)
        self.origins.append(lead.origin)

    def _switched(self, i: int) -> Iterator[tuple[Start, Origin]]:
        """What begins or crosses at the bifurcations of a branch."""
        how = self.how
        for each in self.branches[i].bifurcations:
            kind = KINDS.get(each.kind)
            if kind is None or not kind.leads_on or self._is_origin(i, each):
                continue
            if isinstance(each, Bifurcation) and each.kind == "Hopf":
                # The branch of cycles begins there; the equilibrium is not an orbit.
                continue
            if isinstance(each, EquilibriumBifurcation) and each.kind == "boundary" and not each.modes:
                continue
            try:
                found = switch_branch(each, solver=how.solver)
            except ArgumentError as why:
                self.notes.append(f"Branch {i}, {each.kind} at {how.parameter} = {each.value:.10g}: {why}")
                continue
            low, high = sorted(how.span)
            if low <= found.parameters[how.parameter] <= high:
                yield found, Origin(i, each)

    def _is_origin(self, i: int, each: Bifurcation | EquilibriumBifurcation) -> bool:
        """Whether a branch was found at a bifurcation."""
        origin = self.origins[i]
        near = SAME_VALUE * abs(self.how.span[1] - self.how.span[0])
        if origin is None or abs(origin.bifurcation.value - each.value) > near:
            return False
        one, other = origin.bifurcation, each
        if not (isinstance(one, EquilibriumBifurcation) and isinstance(other, EquilibriumBifurcation)):
            return True
        sizes = np.abs(one.equilibrium.x) + np.abs(other.equilibrium.x)
        return bool(np.all(np.abs(one.equilibrium.x - other.equilibrium.x) <= SAME_VALUE * sizes.max()))

    def _write(self) -> None:
        """Write down the last branch, with all that the next one needs."""
        if self.store is None:
            return
        (some_leads, some_notes), seen = self._written, self.seen
        walk = {
            "position": self.position,
            "leads": [leads.written(each, self.branches) for each in self.leads[some_leads:]],
            "notes": self.notes[some_notes:],
            "seen": None if seen is None else [seen.position, seen.branch.tolist()],
        }
        self.store.write(len(self.branches) - 1, self.branches[-1].to_xarray(), walk)
        self._written = len(self.leads), len(self.notes)

    def _resume(self, most: int, bar: Progress) -> None:
        """Take the branches that earlier calls have written."""
        for i in count():
            written = None if self.store is None or i >= most else self.store.read(i)
            if written is None:
                return
            saved, walk = written
            self.branches.append(branch_from(self.how.system, saved))
            self.leads += [leads.read(each, self.how.system, self.branches) for each in walk["leads"]]
            self.position = walk["position"]
            self.origins.append(self.leads[self.position - 1].origin)
            self.notes += walk["notes"]
            if self.seen is not None:
                self.seen.position, self.seen.branch = walk["seen"][0], np.array(walk["seen"][1])
            self._written = len(self.leads), len(self.notes)
            bar.update(True)

    def diagram(self, *, stopped: bool) -> Diagram:
        """All that was followed; KeyboardInterrupt if there is nothing yet."""
        if not self.branches:
            raise KeyboardInterrupt
        found = f"{len(self.branches)} branches" if len(self.branches) != 1 else "1 branch"
        seen = self.seen
        notes = [*self.notes, *(() if seen is None else seen.notes())]
        waiting = () if stopped else self.leads[self.position :]
        left = [each for each in waiting if not self._is_known(each.start)]
        unseen = 0 if seen is None else len(seen.places) - seen.position
        status = attrs.evolve(SUCCESS, message=f"{found}.")
        if stopped:
            status = Status(StatusCode.INTERRUPTED, f"Interrupted after {found}.", "Call again for the rest.")
        elif left or unseen:
            told = [counted(len(left), "more start")] if left else []
            told += [f"{counted(unseen, 'attractor')} of the sweep"] if unseen else []
            message = f"{found}. Not looked at: {' and '.join(told)}."
            status = Status(StatusCode.NOT_CONVERGED, message, "Raise most=.")
        elif notes:
            status = attrs.evolve(SUCCESS, message=f"{found}. See .notes for what was not followed.")
        return Diagram(
            system=self.how.system,
            name=self.how.parameter,
            branches=tuple(self.branches),
            origins=tuple(self.origins),
            outputs=dict(self.how.outputs),
            notes=tuple(notes),
            status=status,
            sweep=None if seen is None else seen.dataset(dict(self.how.outputs), len(self.branches)),
        )
