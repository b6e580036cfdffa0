"""A decision as conditions on the state at the event, and as the state after it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import attrs
import numpy as np

from hybrid.expression.evaluation import Program
from hybrid.expression.nodes import ZERO, Expression, node
from hybrid.expression.operations import Less, LessEqual, Not
from hybrid.system.growth import Place
from hybrid.transform.contacts.decide import Decision, Judge
from hybrid.transform.contacts.events import BREAKS, IMPACT, SETTLES, SUDDEN, ContactEvent
from hybrid.transform.contacts.problem import NOISE, SHARED, Combination, Level, Outcome, matrix, outcome
from hybrid.transform.contacts.solutions import is_shared, stopped
from hybrid.transform.contacts.statuses import OPEN, SIGNS, STICKS
from hybrid.transform.contacts.view import Mechanics, View
from hybrid.transform.deciding import Written


@attrs.frozen(eq=False)
class Happening:
    """A decision at an event of a mode, that can be written.

    Attributes
    ----------
    event, now
        The event, and what holds in the mode.
    decision
        What happens.
    """

    judge: Judge
    event: ContactEvent
    now: Combination
    decision: Decision

    @property
    def mechanics(self) -> Mechanics:
        """The equations."""
        return self.judge.mechanics

    @property
    def opens(self) -> list[int]:
        """The closed contacts that neither the mode nor the event closes."""
        return [i for i in self.decision.closed if self.now.statuses[i] == OPEN and i != self.event.contact]

    def written(self, place: Place) -> Written:
        """The decision as expressions; ``place`` is where it was made."""
        view, numbers, decision = self.mechanics.view, self.mechanics.at(*place), self.decision
        conditions: list[Expression] = []
        state: list[Expression] | None = None
        if self.event.kind not in SUDDEN:
            conditions += self._stopped()
        if self.event.kind in SUDDEN:
            conditions += [*self._closed(), *self._approaching()]
            asked: list[Expression] = []
            last, forces = self._impact(numbers, asked)
            asked += self._slid() if self.event.kind == SETTLES else self._parted(*last)
            conditions += [] if self.judge.is_bounce(self.event, decision.closed) else asked
            velocities = view.moved(forces, self.mechanics.rows_of(decision.closed), view.velocities)
            state = [*self._coordinates(numbers), *map(node, velocities)]
            t, x, parameters = place
            x = np.array(Program(state).run(self.mechanics.space.values(t, x, parameters)), dtype=float)
            view = self.mechanics.with_velocities(state[len(velocities) :])
            numbers = self.mechanics.at(t, x, parameters)
        level, in_numbers = (self.mechanics.forces(each, decision.resting) for each in (view, numbers))
        stuck = [k for k, sign in enumerate(decision.sliding) if sign == 0]
        reached = _outcome(level, in_numbers, decision.forces, stuck)
        if self.event.kind == BREAKS and is_shared(decision.forces, self.now.of_closed(decision.resting)):
            conditions += [Less(SHARED * node(noise), node(value)) for value, noise in reached.conditions]
        else:
            conditions += _consistent(reached)
        return Written(conditions, state)

    def _impact(self, numbers: View, conditions: list[Expression]) -> tuple[tuple[Level, Outcome], list[Any]]:
        """The last problem of velocities with its outcome, and all impulses; conditions are added."""
        judge, view = self.judge, self.mechanics.view
        closed, approaching = self.decision.closed, self.decision.approaching
        level, in_numbers = (judge.first_phase(each, closed, approaching) for each in (view, numbers))
        everything = range(len(closed))
        first, *others = self.decision.impulses
        reached, known = _outcome(level, in_numbers, first, everything), _in_numbers(in_numbers, first)
        forces = [*reached.forces]
        for case in others:
            conditions += _consistent(reached)
            level = judge.next_phase(view, level, reached, closed, approaching)
            in_numbers = judge.next_phase(numbers, in_numbers, known, closed, approaching)
            reached, known = _outcome(level, in_numbers, case, everything), _in_numbers(in_numbers, case)
            forces = [a + b for a, b in zip(forces, reached.forces, strict=True)]
        if self.event.kind != SETTLES:
            conditions += _consistent(reached)
        return (level, reached), forces

    def _stopped(self) -> Iterator[Expression]:
        """That other slips end at an event, or do not."""
        for i, sign in zip(self.decision.resting, self.decision.sliding, strict=True):
            if self.now.statuses[i] in SIGNS and i != self.event.contact:
                still = self.judge.stops(self.event, self.mechanics.view, i)
                yield Not(still) if sign else still

    def _closed(self) -> Iterator[Expression]:
        """That these gaps are closed, of those that the mode and the event do not close, and no others."""
        for i, status in enumerate(self.now.statuses):
            if status == OPEN and i != self.event.contact:
                near = self.judge.is_near(self.event, self.mechanics.view, i)
                yield near if i in self.decision.closed else Not(near)

    def _approaching(self) -> Iterator[Expression]:
        """That these contacts approach, of those that the mode and the event leave open, and no others."""
        for i in self.opens if self.event.kind != SETTLES else []:
            moves_on = Less(self.mechanics.view.speeds[self.mechanics.places[i][0]], ZERO)
            yield moves_on if i in self.decision.approaching else Not(moves_on)

    def _slid(self) -> Iterator[Expression]:
        """That contacts slip or do not at the limit of chatter."""
        view = self.mechanics.view
        for i, sign in zip(self.decision.resting, self.decision.sliding, strict=True):
            row = self.mechanics.places[i][1]
            if row is not None:
                still = self.judge.is_still(view, row)
                yield Not(still) if sign else still
                if sign:
                    yield Less(ZERO, sign * view.speeds[row])

    def _parted(self, level: Level, reached: Outcome) -> Iterator[Expression]:
        """That contacts separate or do not, and slip or do not, after the impulses."""
        decision, case = self.decision, self.decision.impulses[-1]
        for k, i in enumerate(decision.closed):
            row = level.row(k)
            speed, noise = node(reached.after[row]), node(level.noise[row])
            if i not in decision.resting:
                yield Not(_not_positive(speed, noise))
                continue
            if speed != 0:
                yield _not_positive(speed, noise)
            if level.places[k][1] is None or case.statuses[k] == STICKS:
                continue
            row = level.across(k)
            slip, noise = node(reached.after[row]), node(level.noise[row])
            sign = decision.sliding[decision.resting.index(i)]
            if sign:
                yield Not(_not_positive(sign * slip, noise))
            else:
                yield _not_positive(slip, noise)
                yield _not_negative(slip, noise)

    def _coordinates(self, numbers: View) -> list[Expression]:
        """The coordinates afterwards: gaps that count as closed and stay so are closed, by the least move.

        The move is the smallest in the metric of the masses.
        """
        q: list[Expression] = [*self.mechanics.space.q]
        resting, view = self.decision.resting, self.mechanics.view
        if self.event.kind == IMPACT and self.event.contact < 0:
            # At a start a gap may be negative by rounding.
            resting = self.decision.closed
        if not set(self.opens) & set(resting):
            return q
        level, in_numbers = (self.mechanics.closing(each, resting) for each in (view, numbers))
        reached = _outcome(level, in_numbers, stopped(in_numbers, ()), ())
        return [*map(node, view.moved(reached.forces, self.mechanics.rows_of(resting), q))]


def _outcome(level: Level, in_numbers: Level, case: Combination, stuck: Sequence[int]) -> Outcome:
    found = outcome(level, case, stuck, matrix(in_numbers, case))
    assert found is not None, "only numbers can fail to determine forces"
    return found


def _in_numbers(level: Level, case: Combination) -> Outcome:
    found = outcome(level, case, ())
    assert found is not None, "the case was found in these numbers"
    return found


def _consistent(reached: Outcome) -> list[Expression]:
    """That a case is consistent."""
    found = [_not_negative(node(value), node(noise)) for value, noise in reached.conditions]
    for value, noise in reached.zeros:
        found += [_not_negative(node(value), node(noise)), _not_positive(node(value), node(noise))]
    return found


def _not_negative(value: Expression, noise: Expression) -> Expression:
    return LessEqual(-NOISE * noise, value)


def _not_positive(value: Expression, noise: Expression) -> Expression:
    return LessEqual(value, NOISE * noise)
