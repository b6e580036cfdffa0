"""Which case holds at a state: all cases are tried, so that none and several are seen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from hybrid.expression.linear import size_of
from hybrid.expression.nodes import ZERO, Expression, node
from hybrid.expression.operations import And, LessEqual
from hybrid.transform.contacts.contact import Contact
from hybrid.transform.contacts.events import BREAKS, IMPACT, SETTLES, STOPS, SUDDEN, ContactEvent
from hybrid.transform.contacts.problem import NOISE, SHARED, Combination, Level, Outcome, outcome
from hybrid.transform.contacts.solutions import (
    Found,
    borne,
    by_history,
    consistent,
    is_implied,
    is_shared,
    several,
    stopped,
)
from hybrid.transform.contacts.statuses import (
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
from hybrid.transform.deciding import NothingDecided


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
        What holds at each of these while velocities change, in each phase of the impact; empty if they do
        not.
    resting
        Those of them that do not separate.
    sliding
        The signs of their slips before forces act, 0 for one that does not slip.
    forces
        What holds at each of these then.
    """

    closed: tuple[int, ...]
    approaching: tuple[int, ...]
    impulses: tuple[Combination, ...]
    resting: tuple[int, ...]
    sliding: tuple[int, ...]
    forces: Combination

    def target(self, count: int) -> Combination:
        """What holds at each of all contacts afterwards."""
        return self.forces.of_all(self.resting, count)


@attrs.frozen
class Undecided(NothingDecided):
    """Why nothing is decided: ``painleve`` if no case is consistent, ``not unique`` if several are.

    Attributes
    ----------
    contacts
        Those that are concerned.
    sudden
        Whether it is velocities that have no solution, or several.
    cases
        What is consistent, by contact.
    """

    contacts: tuple[int, ...]
    sudden: bool
    cases: tuple[Statuses, ...] = ()


NONE, SEVERAL_CASES = "painleve", "not unique"
NEWTON, POISSON, SEQUENTIAL = LAWS = "newton", "poisson", "sequential"
# Cases by phases, impulses and speeds afterwards by rows.
Ended = tuple[tuple[Combination, ...], list[float], list[float]]


@attrs.frozen(eq=False)
class Judge:
    """Decides events of a mechanical system.

    Attributes
    ----------
    together
        Gaps below this are closed.
    law
        Of impacts: ``newton``, ``poisson``, or ``sequential`` for Newton's law of one contact after another.
    """

    mechanics: Mechanics
    together: float
    law: str = NEWTON

    def decide(
        self, event: ContactEvent, now: Combination, t: float, x: np.ndarray, parameters: np.ndarray
    ) -> Decision | Undecided:
        """What happens at an event ``now``, in a mode in which this holds."""
        statuses = now.statuses
        view = self.mechanics.at(t, x, parameters)
        closed = self.closed(event, statuses, view)
        impulses: tuple[Combination, ...] = ()
        approaching: list[int] = []
        if event.kind in SUDDEN:
            approaching = self.approaching(event, statuses, closed, view)
            level = self.first_phase(view, closed, approaching)
            still = [k for k, i in enumerate(closed) if self.is_still(view, self.mechanics.places[i][1])]
            ended = (
                self._stopped(level, still)
                if event.kind == SETTLES
                else self._impact(view, level, closed, approaching)
            )
            if isinstance(ended, Undecided):
                return ended
            impulses, forces, after = ended
            velocities = view.moved(forces, self.mechanics.rows_of(closed), view.velocities)
            x = np.array([*x[: len(velocities)], *velocities])
            rows = [level.row(k) for k in range(len(closed))]
            resting = [
                i
                for i, row in zip(closed, rows, strict=True)
                if after[row] <= NOISE * level.noise[row] and not self.is_bounce(event, closed)
            ]
            moving = self.mechanics.at(t, x, parameters)
            places = [level.places[closed.index(i)][1] for i in resting]
            sliding = [0 if row is None else _sign(after[row], level.noise[row]) for row in places]
            if event.kind == SETTLES:
                sliding = [0 if closed.index(i) in still else self._sliding(moving, i) for i in resting]
        else:
            moving, resting = view, [*closed]
            sliding = [0 if self.stops(event, view, i) else SIGNS.get(statuses[i], 0) for i in closed]
        parts = tuple(closed), tuple(approaching), impulses
        return self._rest(event, now, parts, moving, resting, sliding)

    def stops(self, event: ContactEvent, view: View, i: int) -> Any:
        """Whether a slip ends at an event that keeps velocities: the event's, or another one with it."""
        if event.kind == STOPS and i == event.contact:
            return True
        return self.is_still(view, self.mechanics.places[i][1])

    def is_bounce(self, event: ContactEvent, closed: Sequence[int]) -> bool:
        """Whether an impact is one of a single contact without friction, which nothing needs to be asked of.

        It leads to flight; where it takes all speed it is the limit of a chatter, which is over at once.
        """
        if event.kind != IMPACT or len(closed) != 1:
            return False
        [only] = closed
        return self.mechanics.contacts[only].restitution != 0 and not self.contact(only).has_friction

    def first_phase(self, view: View, closed: Sequence[int], approaching: Sequence[int]) -> Level:
        """The problem of the velocities of an impact; by Poisson's law of its compression."""
        newton = self.law != POISSON
        restitution = [view.restitution[i] if newton and i in approaching else 0.0 for i in closed]
        return self.mechanics.impacts(view, closed, restitution)

    def next_phase(
        self, view: View, level: Level, reached: Outcome, closed: Sequence[int], approaching: Sequence[int]
    ) -> Level:
        """The problem of an expansion: impulses of compression come back, and more if a gap would close."""
        given = [
            view.restitution[i] * reached.forces[level.row(k)] if i in approaching else 0.0
            for k, i in enumerate(closed)
        ]
        return attrs.evolve(level, before=reached.after, given=given)

    def _impact(
        self, view: View, level: Level, closed: Sequence[int], approaching: Sequence[int]
    ) -> Ended | Undecided:
        options = [(OPEN, *closed_statuses(self.contact(i))) for i in closed]
        cases: list[Combination] = []
        forces = np.zeros(len(level.before))
        while True:
            kinds = several(level, consistent(level, options, range(len(closed))))
            if len(kinds) != 1:
                return _undecided(closed, kinds, True)
            [found] = kinds
            cases.append(found.case)
            forces += np.array(found.outcome.forces, dtype=float)
            if len(cases) == (2 if self.law == POISSON else 1):
                return tuple(cases), list(forces), found.outcome.after
            level = self.next_phase(view, level, found.outcome, closed, approaching)

    def _stopped(self, level: Level, still: Sequence[int]) -> Ended:
        case = stopped(level, still)
        reached = outcome(level, case, ())
        assert reached is not None, "directions that depend on each other are left out"
        return (case,), reached.forces, reached.after

    def _rest(
        self,
        event: ContactEvent,
        now: Combination,
        parts: tuple[tuple[int, ...], tuple[int, ...], tuple[Combination, ...]],
        view: View,
        resting: Sequence[int],
        sliding: Sequence[int],
    ) -> Decision | Undecided:
        """What holds after an event, from accelerations."""
        level = self.mechanics.forces(view, resting)
        options = [self._options(i, sign) for i, sign in zip(resting, sliding, strict=True)]
        stuck = [k for k, sign in enumerate(sliding) if sign == 0]
        found = consistent(level, options, stuck)
        if event.kind == BREAKS:
            # What holds is over, unless the contacts can share what they bear in another way.
            before = now.of_closed(resting)
            found = [each for each in found if not is_shared(each.case, before) or each.margin > SHARED]
            # Where several contacts reach their bounds at once, all cases agree: the one that breaks slips,
            # and those that slip go on.
            slipping = [k for k, i in enumerate(resting) if i == event.contact or now.statuses[i] in SIGNS]
            found.sort(key=lambda each: sum(each.case.statuses[k] == STICKS for k in slipping))
            found.sort(key=lambda each: -each.margin if is_shared(each.case, before) else 0.0)
        found = by_history(level, found)
        kinds = several(level, found)
        if len(kinds) != 1:
            return _undecided(resting, kinds, False)
        case = self._with_idle(level, found[0], resting)
        closed, approaching, impulses = parts
        return Decision(closed, approaching, impulses, tuple(resting), tuple(sliding), case)

    def start(self, view: View) -> Decision | Undecided:
        """What holds at a start; contacts that approach are open, since their impact is still to come."""
        rows = [self.mechanics.places[i][0] for i in range(len(self.mechanics.contacts))]
        resting = [
            i
            for i, row in enumerate(rows)
            if abs(view.gaps[i]) <= self.together and abs(view.speeds[row]) <= NOISE * view.fast[row]
        ]
        sliding = [self._sliding(view, i) for i in resting]
        nothing = ContactEvent(SETTLES), Combination.of([OPEN] * len(rows))
        return self._rest(*nothing, (tuple(resting), (), ()), view, resting, sliding)

    def is_hit(self, view: View) -> bool:
        """Whether a contact approaches at a start whose gap is negative by rounding."""
        rows = [normal for normal, _ in self.mechanics.places]
        return any(
            gap < 0.0 and view.speeds[row] < -NOISE * view.fast[row]
            for gap, row in zip(view.gaps, rows, strict=True)
        )

    def named(self, statuses: Statuses, t: float, x: np.ndarray, parameters: np.ndarray) -> Combination:
        """The statuses of a mode that a call names, and how the contacts share what they bear there."""
        closed = [i for i, each in enumerate(statuses) if each != OPEN]
        level = self.mechanics.forces(self.mechanics.at(t, x, parameters), closed)
        case = Combination.of([statuses[i] for i in closed])
        return next(borne(level, case), case).of_all(closed, len(statuses))

    def closed(self, event: ContactEvent, statuses: Statuses, view: View) -> list[int]:
        """The contacts whose gaps are closed at an event."""
        found = []
        for i, status in enumerate(statuses):
            near = event.kind in SUDDEN and self.is_near(event, view, i)
            if status != OPEN or i == event.contact or near:
                found.append(i)
        return found

    def approaching(
        self, event: ContactEvent, statuses: Statuses, closed: Sequence[int], view: View
    ) -> list[int]:
        """The closed contacts that approach, those of the event among them; none at the limit of chatter."""
        if event.kind == SETTLES:
            return []
        rows = self.mechanics.places
        return [
            i for i in closed if i == event.contact or (statuses[i] == OPEN and view.speeds[rows[i][0]] < 0.0)
        ]

    def is_near(self, event: ContactEvent, view: View, i: int) -> Any:
        """Whether a contact is closed at an event that changes velocities, in numbers or as an expression.

        At the limit of chatter one that moves is not.
        """
        if self.law == SEQUENTIAL and event.kind == IMPACT:
            return ZERO if isinstance(view.gaps[i], Expression) else False
        near = _not_larger(size_of(view.gaps[i]), self.together)
        if event.kind != SETTLES:
            return near
        still = self.is_still(view, self.mechanics.places[i][0])
        return And(near, still) if isinstance(near, Expression) else near and still

    def is_still(self, view: View, row: int | None) -> Any:
        """Whether a direction counts as at rest at the limit of chatter, in numbers or as an expression.

        It gets no further than gaps that count as closed, even against the largest acceleration that the
        forces could give it. At the limit all speeds are rounding, so their sizes do not tell.
        """
        if row is None:
            return False
        return _not_larger(view.speeds[row] * view.speeds[row], self.together * view.strong[row])

    def contact(self, i: int) -> Contact:
        """What the author gave."""
        return self.mechanics.contacts[i].contact

    def _sliding(self, view: View, i: int) -> int:
        row = self.mechanics.places[i][1]
        return 0 if row is None else _sign(view.speeds[row], view.fast[row])

    def _options(self, i: int, sliding: int) -> tuple[str, ...]:
        if sliding:
            return OPEN, SLIPS_UP if sliding > 0 else SLIPS_DOWN
        return OPEN, *closed_statuses(self.contact(i))

    def _with_idle(self, level: Level, found: Found, resting: Sequence[int]) -> Combination:
        """The case with the contacts named that stay closed only because others are."""
        case = found.case
        statuses = [*case.statuses]
        pushing = [level.row(k) for k, each in enumerate(statuses) if each != OPEN]
        for k, each in enumerate(statuses):
            row = level.row(k)
            if each == OPEN and is_implied(level, row, pushing):
                statuses[k] = IDLE
        return attrs.evolve(case, statuses=tuple(statuses))


def _sign(speed: float, noise: float) -> int:
    """The sign of a speed, 0 for one that is rounding: what counts as one is its ``noise``."""
    return 0 if abs(speed) <= NOISE * noise else 1 if speed > 0 else -1


def _not_larger(value: Any, most: Any) -> Any:
    return LessEqual(value, node(most)) if isinstance(value, Expression) else value <= most


def _undecided(contacts: Sequence[int], kinds: Sequence[Found], sudden: bool) -> Undecided:
    name = SEVERAL_CASES if kinds else NONE
    return Undecided(name, tuple(contacts), sudden, tuple(each.case.statuses for each in kinds))
