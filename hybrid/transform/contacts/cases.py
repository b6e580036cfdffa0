"""A decision as conditions on the state at the event, and as the velocities after it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
import attrs
import numpy as np

from hybrid.expression.evaluation import Program
from hybrid.expression.nodes import ZERO, Expression, node
from hybrid.expression.operations import Less, LessEqual, Not
from hybrid.transform.contacts.decide import Decision, Judge
from hybrid.transform.contacts.events import SETTLES, SUDDEN, Event
from hybrid.transform.contacts.problem import NOISE, Case, Level, Outcome, matrix, outcome
from hybrid.transform.contacts.solutions import stopped
from hybrid.transform.contacts.statuses import OPEN, STICKS, Statuses
from hybrid.transform.contacts.view import View


@attrs.frozen(eq=False)
class Written:
    """A decision as expressions in the state at the event.

    Attributes
    ----------
    conditions
        What must hold for it.
    state
        The state after it; None if it stays.
    """

    conditions: list[Expression]
    state: list[Expression] | None


def written(
    judge: Judge,
    event: Event,
    statuses: Statuses,
    decision: Decision,
    place: tuple[float, np.ndarray, np.ndarray],
) -> Written:
    """A decision at an event of a mode as expressions; ``place`` is ``(t, x, parameters)`` where it was made."""
    mechanics, view = judge.mechanics, judge.mechanics.view
    conditions: list[Expression] = []
    if event.kind in SUDDEN:
        conditions += [
            *_closed(judge, event, statuses, decision),
            *_approaching(judge, event, statuses, decision),
        ]
    state: list[Expression] | None = None
    numbers = mechanics.at(*place)
    if decision.impulses:
        closed, approaching = decision.closed, decision.approaching
        levels = [judge.first_phase(each, closed, approaching) for each in (view, numbers)]
        forces: list[Any] = [0.0] * len(levels[0].before)
        for phase, case in enumerate(decision.impulses):
            if phase:
                pairs = zip((view, numbers), levels, ends, strict=True)
                levels = [judge.next_phase(*each, closed, approaching) for each in pairs]
            ends = [_outcome(*levels, case, range(len(closed))), _in_numbers(levels[1], case)]
            forces = [a + b for a, b in zip(forces, ends[0].forces, strict=True)]
            if event.kind != SETTLES:
                conditions += _consistent(ends[0])
        if event.kind == SETTLES:
            conditions += _slid(judge, decision)
        else:
            conditions += _parted(levels[0], ends[0], decision)
        velocities = view.moved(forces, mechanics.rows_of(closed), view.velocities)
        state = [*_closed_exactly(judge, decision, statuses, event, numbers), *map(node, velocities)]
        t, x, parameters = place
        x = np.array(Program(state).run(mechanics.space.values(t, x, parameters)), dtype=float)
        view, numbers = mechanics.with_velocities(state[len(velocities) :]), mechanics.at(t, x, parameters)
    level, in_numbers = (mechanics.forces(each, decision.resting) for each in (view, numbers))
    stuck = [k for k, sign in enumerate(decision.sliding) if sign == 0]
    conditions += _consistent(_outcome(level, in_numbers, decision.forces, stuck))
    return Written(conditions, state)


def _closed_exactly(
    judge: Judge, decision: Decision, statuses: Statuses, event: Event, numbers: View
) -> list[Expression]:
    """The coordinates after an event: gaps that count as closed and stay so are closed, by the least move.

    The move is the smallest in the metric of the masses.
    """
    mechanics = judge.mechanics
    q: list[Expression] = [*mechanics.space.q]
    if all(statuses[i] != OPEN or i == event.contact for i in decision.resting):
        return q
    view = mechanics.view
    level, in_numbers = (
        attrs.evolve(
            mechanics.forces(each, decision.resting),
            before=[mechanics.gap_of(each, row) for row in mechanics.rows_of(decision.resting)],
        )
        for each in (view, numbers)
    )
    reached = _outcome(level, in_numbers, stopped(in_numbers, ()), ())
    return [*map(node, view.moved(reached.forces, mechanics.rows_of(decision.resting), q))]


def _outcome(level: Level, in_numbers: Level, case: Case, stuck: Sequence[int]) -> Outcome:
    found = outcome(level, case, stuck, matrix(in_numbers, case))
    assert found is not None, "only numbers can fail to determine forces"
    return found


def _in_numbers(level: Level, case: Case) -> Outcome:
    found = outcome(level, case, ())
    assert found is not None, "the case was found in these numbers"
    return found


def _consistent(reached: Outcome) -> list[Expression]:
    """That a case is consistent."""
    return [_not_negative(node(value), node(noise)) for value, noise in reached.conditions]


def _closed(judge: Judge, event: Event, statuses: Statuses, decision: Decision) -> list[Expression]:
    """That these gaps are closed, of those that the mode and the event do not close, and no others."""
    found, view = [], judge.mechanics.view
    for i, status in enumerate(statuses):
        if status == OPEN and i != event.contact:
            found.append(judge.is_near(event, view, i) if i in decision.closed else Not(judge.is_near(event, view, i)))
    return found


def _approaching(judge: Judge, event: Event, statuses: Statuses, decision: Decision) -> list[Expression]:
    """That these contacts approach, of those that a mode and an event leave open, and no others."""
    if event.kind == SETTLES:
        return []
    found = []
    for i in decision.closed:
        if statuses[i] == OPEN and i != event.contact:
            moves_on = Less(judge.mechanics.view.speeds[judge.mechanics.places[i][0]], ZERO)
            found.append(moves_on if i in decision.approaching else Not(moves_on))
    return found


def _slid(judge: Judge, decision: Decision) -> list[Expression]:
    """That contacts slip or do not at the limit of chatter."""
    found, view = [], judge.mechanics.view
    for i, sign in zip(decision.resting, decision.sliding, strict=True):
        row = judge.mechanics.places[i][1]
        if row is not None:
            still = judge.is_still(view, row)
            found += [Not(still), Less(ZERO, sign * view.speeds[row])] if sign else [still]
    return found


def _parted(level: Level, reached: Outcome, decision: Decision) -> list[Expression]:
    """That contacts separate or do not, and slip or do not, after the impulses."""
    case = decision.impulses[-1]
    found = []
    for k, i in enumerate(decision.closed):
        row = level.row(k)
        speed = node(reached.after[row])
        if i not in decision.resting:
            found.append(Not(_not_positive(speed, node(level.noise[row]))))
            continue
        if speed != 0:
            found.append(_not_positive(speed, node(level.noise[row])))
        if level.places[k][1] is None or case.statuses[k] == STICKS:
            continue
        row = level.across(k)
        slip, noise = node(reached.after[row]), node(level.noise[row])
        sign = decision.sliding[decision.resting.index(i)]
        if sign == 0:
            found += [_not_positive(slip, noise), _not_negative(slip, noise)]
        else:
            found.append(Not(_not_positive(sign * slip, noise)))
    return found


def _not_negative(value: Expression, noise: Expression) -> Expression:
    return LessEqual(-NOISE * noise, value)


def _not_positive(value: Expression, noise: Expression) -> Expression:
    return LessEqual(value, NOISE * noise)
