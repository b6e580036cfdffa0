"""Which case holds at a state: all cases are tried, so that none and several are seen."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import attrs
import numpy as np

from hybrid.expression.nodes import Expression, node
from hybrid.expression.operations import Absolute, And, LessEqual
from hybrid.transform.contacts.contact import Contact
from hybrid.transform.contacts.events import BREAKS, SETTLES, STOPS, SUDDEN, Event
from hybrid.transform.contacts.problem import DEPENDENT, NOISE, Case, Level, Outcome, holds, outcome
from hybrid.transform.contacts.statuses import (
    HELD,
    IDLE,
    OPEN,
    SIGNS,
    SLIPS_DOWN,
    SLIPS_UP,
    STICKS,
    Statuses,
    closed_statuses,
)
from hybrid.transform.contacts.view import Mechanics, View

# Solutions whose speeds differ by more than this share of their terms are several.
SEVERAL = 1e-6


@attrs.frozen(eq=False)
class Found:
    """A consistent case and what it leads to."""

    case: Case
    outcome: Outcome


def consistent(
    level: Level, options: Sequence[Sequence[str]], stuck: Sequence[int]
) -> list[Found]:
    """The consistent cases of a problem in numbers, those with fewest forces first.

    Parameters
    ----------
    options
        What may hold, by contact.
    stuck
        As for `outcome`.
    """
    found = []
    for statuses in sorted(product(*options), key=_forces):
        case = Case(statuses, merged_in(level, statuses), (False,) * len(statuses))
        reached = outcome(level, case, stuck)
        if reached is not None and holds(reached.conditions):
            found.append(Found(case, reached))
    return found


def _forces(statuses: Statuses) -> tuple[int, int]:
    """How many normal forces there are; of cases with as many, those that stick come first."""
    return sum(each != OPEN for each in statuses), -sum(each == STICKS for each in statuses)


def merged_in(level: Level, statuses: Statuses) -> tuple[int | None, ...]:
    """By contact that sticks: an earlier one whose friction acts in the same direction."""
    found: list[int | None] = [None] * len(statuses)
    sticking = [i for i, each in enumerate(statuses) if each == STICKS]
    for place, j in enumerate(sticking):
        for i in sticking[:place]:
            if found[i] is None and _is_parallel(level, level.across(i), level.across(j)):
                found[j] = i
                break
    return tuple(found)


def _is_parallel(level: Level, i: int, j: int) -> bool:
    G = level.delassus
    return bool(G[i][i] * G[j][j] - G[i][j] ** 2 <= DEPENDENT * G[i][i] * G[j][j])


def several(level: Level, found: Sequence[Found]) -> list[Found]:
    """The first of each kind: cases that lead to the same speeds are one."""
    kinds: list[Found] = []
    for each in found:
        if not any(_is_alike(level, each, other) for other in kinds):
            kinds.append(each)
    return kinds


def _is_alike(level: Level, one: Found, other: Found) -> bool:
    pairs = zip(one.outcome.after, other.outcome.after, level.noise, strict=True)
    return all(abs(a - b) <= SEVERAL * noise for a, b, noise in pairs)


def by_history(level: Level, found: Sequence[Found]) -> list[Found]:
    """The cases without those in which a contact slips that static friction, if larger, keeps at rest."""
    kept = {
        k
        for each in found
        for k, status in enumerate(each.case.statuses)
        if status == STICKS and level.static[k] > level.friction[k]
    }
    return [each for each in found if not any(each.case.statuses[k] in SIGNS for k in kept)]


@attrs.frozen
class Decision:
    """What happens at an event.

    Attributes
    ----------
    closed
        The contacts whose gaps are closed.
    approaching
        Those of them that approach: they have restitution.
    impulses
        What holds at each of these while velocities change; None if they do not.
    resting
        Those of them that do not separate.
    sliding
        The signs of their slips before forces act, 0 for one that does not slip.
    forces
        What holds at each of these then.
    """

    closed: tuple[int, ...]
    approaching: tuple[int, ...]
    impulses: Case | None
    resting: tuple[int, ...]
    sliding: tuple[int, ...]
    forces: Case

    def target(self, count: int) -> tuple[Statuses, tuple[int | None, ...]]:
        """What holds at each of all contacts afterwards, and whose friction each shares."""
        statuses, merged = [OPEN] * count, [None] * count
        for i, status, other in zip(self.resting, self.forces.statuses, self.forces.merged, strict=True):
            statuses[i] = status
            merged[i] = None if other is None else self.resting[other]
        return tuple(statuses), tuple(merged)


@attrs.frozen
class Undecided:
    """Why nothing is decided.

    Attributes
    ----------
    name
        ``painleve`` if no case is consistent, ``not unique`` if several are.
    contacts
        Those that are concerned.
    sudden
        Whether it is velocities that have no solution, or several.
    cases
        What is consistent, by contact.
    """

    name: str
    contacts: tuple[int, ...]
    sudden: bool
    cases: tuple[Statuses, ...] = ()


NONE, SEVERAL_CASES = "painleve", "not unique"


@attrs.frozen(eq=False)
class Judge:
    """Decides events of a mechanical system.

    Attributes
    ----------
    together
        Gaps below this are closed.
    """

    mechanics: Mechanics
    together: float

    def decide(
        self, event: Event, statuses: Statuses, t: float, x: np.ndarray, parameters: np.ndarray
    ) -> Decision | Undecided:
        """What happens at an event in a mode in which these statuses hold."""
        view = self.mechanics.at(t, x, parameters)
        closed = self.closed(event, statuses, view)
        impulses, approaching = None, []
        if event.kind in SUDDEN:
            approaching = self.approaching(event, statuses, closed, view)
            restitution = [view.restitution[i] if i in approaching else 0.0 for i in closed]
            level = self.mechanics.impacts(view, closed, restitution)
            if event.kind == SETTLES:
                impulses = stopped(level)
                after = outcome(level, impulses, range(len(closed)))
                assert after is not None, "directions that depend on each other are left out"
            else:
                options = [(OPEN, *closed_statuses(self.contact(i))) for i in closed]
                kinds = several(level, found := consistent(level, options, range(len(closed))))
                if len(kinds) != 1:
                    return _undecided(closed, kinds, True)
                impulses, after = found[0].case, found[0].outcome
            rows = self.mechanics.rows_of(closed)
            velocities = view.moved(after.forces, rows, view.velocities)
            x = np.array([*x[: len(velocities)], *velocities])
            resting = [
                i
                for k, i in enumerate(closed)
                if after.after[level.row(k)] <= NOISE * level.noise[level.row(k)]
            ]
            moving = self.mechanics.at(t, x, parameters)
            sliding = [self._sliding(moving, i) for i in resting]
        else:
            moving, resting = view, [*closed]
            sliding = [
                0 if event.kind == STOPS and i == event.contact else SIGNS.get(statuses[i], 0) for i in closed
            ]
        parts = tuple(closed), tuple(approaching), impulses
        return self._rest(event, statuses, parts, moving, resting, sliding)

    def _rest(
        self,
        event: Event,
        statuses: Statuses,
        parts: tuple[Any, ...],
        view: View,
        resting: Sequence[int],
        sliding: Sequence[int],
    ) -> Decision | Undecided:
        """What holds after an event, from accelerations."""
        level = self.mechanics.forces(view, resting)
        options = [self._options(event, statuses, i, sign) for i, sign in zip(resting, sliding, strict=True)]
        stuck = [k for k, sign in enumerate(sliding) if sign == 0]
        found = by_history(level, consistent(level, options, stuck))
        kinds = several(level, found)
        if len(kinds) != 1:
            return _undecided(resting, kinds, False)
        case = self._with_idle(level, found[0], resting)
        return Decision(*parts, tuple(resting), tuple(sliding), case)

    def start(
        self, t: float, x: np.ndarray, parameters: np.ndarray
    ) -> Decision | Undecided:
        """What holds at a start; contacts that approach are open, since their impact is still to come."""
        view = self.mechanics.at(t, x, parameters)
        rows = [self.mechanics.places[i][0] for i in range(len(self.mechanics.contacts))]
        resting = [
            i
            for i, row in enumerate(rows)
            if abs(view.gaps[i]) <= self.together and abs(view.speeds[row]) <= NOISE * view.fast[row]
        ]
        sliding = [self._sliding(view, i) for i in resting]
        nothing = Event(SETTLES), (OPEN,) * len(rows)
        return self._rest(*nothing, (tuple(resting), (), None), view, resting, sliding)

    def named(
        self, statuses: Statuses, t: float, x: np.ndarray, parameters: np.ndarray
    ) -> tuple[Statuses, tuple[int | None, ...]]:
        """The statuses of a mode that a call names, and whose friction each contact shares there."""
        closed = [i for i, each in enumerate(statuses) if each != OPEN]
        level = self.mechanics.forces(self.mechanics.at(t, x, parameters), closed)
        merged: list[int | None] = [None] * len(statuses)
        for i, other in zip(closed, merged_in(level, tuple(statuses[i] for i in closed)), strict=True):
            merged[i] = None if other is None else closed[other]
        return statuses, tuple(merged)

    def closed(self, event: Event, statuses: Statuses, view: View) -> list[int]:
        """The contacts whose gaps are closed at an event."""
        found = []
        for i, status in enumerate(statuses):
            near = event.kind in SUDDEN and self.is_near(event, view, i)
            if status != OPEN or i == event.contact or near:
                found.append(i)
        return found

    def approaching(
        self, event: Event, statuses: Statuses, closed: Sequence[int], view: View
    ) -> list[int]:
        """The closed contacts that approach, those of the event among them; none at the limit of chatter."""
        if event.kind == SETTLES:
            return []
        rows = self.mechanics.places
        return [
            i
            for i in closed
            if i == event.contact or (statuses[i] == OPEN and view.speeds[rows[i][0]] < 0.0)
        ]

    def is_near(self, event: Event, view: View, i: int) -> Any:
        """Whether a contact is closed at an event that changes velocities, in numbers or as an expression.

        At the limit of chatter one that moves is not: it would get further than gaps that count as closed, even
        against the largest acceleration that the forces could give it.
        """
        near = _not_larger(_size(view.gaps[i]), self.together)
        if event.kind != SETTLES:
            return near
        row = self.mechanics.places[i][0]
        height = view.speeds[row] * view.speeds[row]
        still = _not_larger(height, self.together * view.strong[row])
        return And(near, still) if isinstance(near, Expression) else near and still

    def contact(self, i: int) -> Contact:
        """What the author gave."""
        return self.mechanics.contacts[i].contact

    def _sliding(self, view: View, i: int) -> int:
        row = self.mechanics.places[i][1]
        if row is None or abs(view.speeds[row]) <= NOISE * view.fast[row]:
            return 0
        return 1 if view.speeds[row] > 0 else -1

    def _options(self, event: Event, statuses: Statuses, i: int, sliding: int) -> tuple[str, ...]:
        if sliding:
            return OPEN, SLIPS_UP if sliding > 0 else SLIPS_DOWN
        possible = closed_statuses(self.contact(i))
        if event.kind == BREAKS and i == event.contact:
            possible = tuple(each for each in possible if each != STICKS)
        return OPEN, *possible

    def _with_idle(self, level: Level, found: Found, resting: Sequence[int]) -> Case:
        """The case with the contacts named that stay closed only because others are."""
        case = found.case
        statuses = [*case.statuses]
        pushing = [level.row(k) for k, each in enumerate(statuses) if each != OPEN]
        for k, each in enumerate(statuses):
            row = level.row(k)
            if each == OPEN and _is_implied(level, row, pushing):
                statuses[k] = IDLE
        return attrs.evolve(case, statuses=tuple(statuses))


def stopped(level: Level) -> Case:
    """The case that stops all contacts: impulses of those whose directions do not depend on others."""
    statuses: list[str] = []
    for i in range(len(level.places)):
        pushing = [level.row(k) for k, each in enumerate(statuses) if each == HELD]
        statuses.append(IDLE if _is_implied(level, level.row(i), pushing) else HELD)
    return Case(tuple(statuses), (None,) * len(statuses), (False,) * len(statuses))


def _size(value: Any) -> Any:
    return Absolute(value) if isinstance(value, Expression) else abs(value)


def _not_larger(value: Any, most: Any) -> Any:
    return LessEqual(value, node(most)) if isinstance(value, Expression) else value <= most


def _is_implied(level: Level, row: int, others: Sequence[int]) -> bool:
    """Whether the direction of a row is a combination of those of other rows."""
    if not others:
        return False
    rows = [*others, row]
    G = np.array([[level.delassus[i][j] for j in rows] for i in rows], dtype=float)
    sizes = np.sqrt(np.diag(G))
    smallest = np.linalg.eigvalsh(G / np.outer(sizes, sizes))[0]
    return bool(smallest <= DEPENDENT)


def _undecided(contacts: Sequence[int], kinds: Sequence[Found], sudden: bool) -> Undecided:
    name = SEVERAL_CASES if kinds else NONE
    return Undecided(name, tuple(contacts), sudden, tuple(each.case.statuses for each in kinds))
