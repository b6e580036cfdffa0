"""The complementarity problem of closed contacts, at the level of velocities or of accelerations.

Both levels are alike. A contact has a normal speed (or acceleration) ``v`` and, with friction, a tangential
one; forces (impulses) ``f`` at the contacts change them by ``G f``, where ``G = W M^-1 W^T`` (Delassus). One
case says what holds at each contact, so its forces solve linear equations; it is consistent if certain
quantities are not negative. The same text computes with numbers, to find the consistent cases, and with
expressions, to write a case into a transition.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import attrs
import numpy as np

from hybrid.expression.linear import determinant, dot, size_of, solved
from hybrid.expression.nodes import Expression, multiply, node
from hybrid.transform.contacts.statuses import IDLE, OPEN, SIGNS, STICKS, Statuses

# What is smaller than this share of its terms is zero: it has been computed with rounding.
NOISE = 1e-9
# Contacts share what they bear in another way if that leaves so much of the terms until a bound.
SHARED = 1e-6
# Rows of a smaller singular value, relative to the largest, depend on each other.
DEPENDENT = 1e-9


@attrs.frozen
class Combination:
    """What holds at each contact.

    Attributes
    ----------
    statuses
        One for each contact.
    merged
        By contact: the contact that takes up the friction of this one too, as one of the two decides nothing
        that the other does not, like the feet of a block that lies flat.
    leans
        By contact that sticks because others do: its friction as a share of the bound, -1, 0 or 1. What a
        ladder's two ends bear is not determined, and these are the ends of what may be.
    lifts
        By contact: whether it opens under the normal impulse that it is given, instead of needing more.
    """

    statuses: Statuses
    merged: tuple[int | None, ...]
    leans: tuple[int | None, ...]
    lifts: tuple[bool, ...]

    @classmethod
    def of(cls, statuses: Sequence[str]) -> Combination:
        """Contacts each of which has a force of its own."""
        count = len(statuses)
        return cls(tuple(statuses), (None,) * count, (None,) * count, (False,) * count)

    def sticks(self, i: int) -> bool:
        """Whether a contact has a friction force of its own that keeps it from slipping."""
        return self.statuses[i] == STICKS and self.merged[i] is None and self.leans[i] is None

    def is_held(self, i: int) -> bool:
        """Whether a contact needs a normal force that equations tell."""
        return self.statuses[i] not in (OPEN, IDLE) and not self.lifts[i]

    def of_all(self, contacts: Sequence[int], count: int) -> Combination:
        """The same for all of ``count`` contacts, of which these are the closed ones."""
        made = Combination.of([OPEN] * count)
        statuses, merged, leans = [*made.statuses], [*made.merged], [*made.leans]
        for k, i in enumerate(contacts):
            other = self.merged[k]
            statuses[i], leans[i] = self.statuses[k], self.leans[k]
            merged[i] = None if other is None else contacts[other]
        return Combination(tuple(statuses), tuple(merged), tuple(leans), made.lifts)

    def of_closed(self, contacts: Sequence[int]) -> Combination:
        """The same for some of the contacts, which hold all that are closed."""
        merged = [self.merged[i] for i in contacts]
        return Combination(
            tuple(self.statuses[i] for i in contacts),
            tuple(None if each is None else contacts.index(each) for each in merged),
            tuple(self.leans[i] for i in contacts),
            tuple(self.lifts[i] for i in contacts),
        )


@attrs.frozen(eq=False)
class Level:
    """What a case is solved with: numbers, or expressions.

    Attributes
    ----------
    places
        By contact: where its normal and its tangential direction stand among the rows; None without friction.
    delassus
        The entries of ``G`` by rows.
    before
        The speeds, or the accelerations without forces, by rows.
    targets
        By contact: the least normal speed after an impact, or acceleration.
    stops
        By contact: the tangential speed, or acceleration, of one that sticks.
    noise
        What counts as zero, by rows.
    given
        By contact: a normal impulse that is there already.
    friction, static
        By contact.
    """

    places: Sequence[tuple[int, int | None]]
    delassus: Sequence[Sequence[Any]]
    before: Sequence[Any]
    targets: Sequence[Any]
    stops: Sequence[Any]
    noise: Sequence[Any]
    given: Sequence[Any]
    friction: Sequence[Any]
    static: Sequence[Any]

    def row(self, i: int) -> int:
        """The row of a normal direction."""
        return self.places[i][0]

    def across(self, i: int) -> int:
        """The row of a tangential direction."""
        row = self.places[i][1]
        assert row is not None, "only a contact with friction sticks or slips"
        return row


@attrs.frozen(eq=False)
class Outcome:
    """What a case leads to.

    Attributes
    ----------
    forces, after
        By rows: forces or impulses; speeds or accelerations.
    conditions
        Pairs ``(value, noise)``: the case is consistent if no value is negative by more than its noise.
    zeros
        Pairs ``(value, noise)``, no value of which may be more than its noise: contacts that lean slip
        unless what the others hold keeps them from it.
    """

    forces: list[Any]
    after: list[Any]
    conditions: list[tuple[Any, Any]]
    zeros: list[tuple[Any, Any]]


def outcome(
    level: Level, case: Combination, stuck: Sequence[int], numbers: np.ndarray | None = None
) -> Outcome | None:
    """What a case leads to; None if it does not determine its forces.

    Parameters
    ----------
    stuck
        Contacts that do not slip before: where they slip then, it is in the direction of their acceleration.
    numbers
        The matrix of the equations at a state, from `matrix`, if the level has expressions.
    """
    unknowns, start, wanted = equations_of_case(level, case)
    rows = [[dot(level.delassus[row], column) for column in unknowns] for row, _ in wanted]
    right = [target - level.before[row] - dot(level.delassus[row], start) for row, target in wanted]
    solution = solved_in_numbers(rows, right) if numbers is None else solved(rows, [right], numbers)[0]
    if solution is None:
        return None
    forces = [first + dot([column[row] for column in unknowns], solution) for row, first in enumerate(start)]
    after = [speed + dot(row, forces) for speed, row in zip(level.before, level.delassus, strict=True)]
    for row, target in wanted:
        after[row] = target
    leaning = [i for i, lean in enumerate(case.leans) if lean is not None]
    zeros = [(after[level.across(i)] - level.stops[i], level.noise[level.across(i)]) for i in leaning]
    return Outcome(forces, after, [*_conditions(level, case, stuck, forces, after)], zeros)


def matrix(level: Level, case: Combination) -> np.ndarray:
    """The matrix of the equations of a case, in numbers."""
    unknowns, _, wanted = equations_of_case(level, case)
    return np.array([[dot(level.delassus[row], column) for column in unknowns] for row, _ in wanted])


def solvability(level: Level, case: Combination, numbers: np.ndarray) -> Expression:
    """How far the equations of a case are from being singular, positive where they have these ``numbers``.

    With friction they may become so: Painleve's paradox begins there. It is 1 without friction at a contact.
    """
    unknowns, _, wanted = equations_of_case(level, case)
    rows = [[dot(level.delassus[row], column) for column in unknowns] for row, _ in wanted]
    scale = multiply(*(node(level.delassus[row][row]) for row, _ in wanted))
    return determinant(rows, numbers) / scale


def equations_of_case(
    level: Level, case: Combination
) -> tuple[list[list[Any]], list[Any], list[tuple[int, Any]]]:
    """Forces by rows for a unit of each unknown, and without any; the rows that have a target, with it."""
    size = len(level.before)
    unknowns, start, wanted = [], [0.0] * size, []
    for i in range(len(case.statuses)):
        across = _share(level, case, i)
        if case.is_held(i):
            column = [0.0] * size
            column[level.row(i)] = 1.0
            if across != 0:
                column[level.across(i)] = across
            unknowns.append(column)
            wanted.append((level.row(i), level.targets[i]))
        start[level.row(i)] = level.given[i]
        if across != 0:
            start[level.across(i)] = across * level.given[i]
        if case.sticks(i):
            column = [0.0] * size
            column[level.across(i)] = 1.0
            unknowns.append(column)
            wanted.append((level.across(i), level.stops[i]))
    return unknowns, start, wanted


def _share(level: Level, case: Combination, i: int) -> Any:
    """The friction of a contact for a unit of its normal force, where that is known."""
    if case.statuses[i] in SIGNS:
        return -SIGNS[case.statuses[i]] * level.friction[i]
    lean = case.leans[i]
    return 0.0 if not lean else lean * level.static[i]


def solved_in_numbers(rows: list[list[float]], right: list[float]) -> list[float] | None:
    """The solution of linear equations; None if they do not determine one."""
    if not rows:
        return []
    A = np.array(rows, dtype=float)
    sizes = np.sqrt(np.abs(np.diag(A)))
    scaled = A / np.outer(sizes, sizes) if sizes.all() else A
    singular = np.linalg.svd(scaled, compute_uv=False)
    if not singular[-1] > DEPENDENT * singular[0]:
        return None
    return [float(each) for each in np.linalg.solve(A, np.array(right, dtype=float))]


def _conditions(
    level: Level, case: Combination, stuck: Sequence[int], forces: list[Any], after: list[Any]
) -> Iterator[tuple[Any, Any]]:
    for i, status in enumerate(case.statuses):
        row = level.row(i)
        if status == IDLE:
            # It stays closed, and pushes no one.
            continue
        if not case.is_held(i):
            yield after[row] - level.targets[i], level.noise[row]
        else:
            yield (forces[row] - level.given[i]) * level.delassus[row][row], level.noise[row]
        if case.sticks(i):
            across = level.across(i)
            most = bound(level, case, i, forces)
            for side in (1, -1):
                yield (most - side * forces[across]) * level.delassus[across][across], level.noise[across]
        elif status in SIGNS and i in stuck:
            yield SIGNS[status] * after[level.across(i)], level.noise[level.across(i)]


def correlations(delassus: Sequence[Sequence[Any]], rows: Sequence[int]) -> np.ndarray:
    """How far directions act on each other, in numbers, each in its own unit: 1 on the diagonal."""
    G = np.array([[delassus[i][j] for j in rows] for i in rows], dtype=float)
    sizes = np.sqrt(np.diag(G))
    return np.asarray(G / np.outer(sizes, sizes))


def bound(level: Level, case: Combination, i: int, forces: Sequence[Any]) -> Any:
    """The largest friction of a contact that sticks, with that of the contacts whose friction it takes up.

    Theirs counts as it acts along its own direction, which may be longer.
    """
    own = level.across(i)
    most = level.static[i] * forces[level.row(i)]
    for j, by in enumerate(case.merged):
        if by == i:
            entry = level.delassus[own][level.across(j)]
            most = most + level.static[j] * forces[level.row(j)] * size_of(entry) / level.delassus[own][own]
    return most


def is_at_rest(level: Level, i: int, after: Sequence[float]) -> bool:
    """Whether a contact does not slip afterwards but for noise, in numbers."""
    return abs(after[level.across(i)]) <= NOISE * level.noise[level.across(i)]


def holds(reached: Outcome) -> bool:
    """Whether a case is consistent, in numbers."""
    positive = all(value >= -NOISE * noise for value, noise in reached.conditions)
    return positive and all(abs(value) <= NOISE * noise for value, noise in reached.zeros)
