"""The consistent cases of a problem in numbers: all are tried, so that none and several are seen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations, product

import attrs
import numpy as np

from hybrid.transform.contacts.problem import (
    DEPENDENT,
    Combination,
    Level,
    Outcome,
    correlations,
    holds,
    is_at_rest,
    outcome,
)
from hybrid.transform.contacts.statuses import HELD, IDLE, OPEN, SIGNS, STICKS, Statuses

# Solutions whose speeds differ by more than this share of their terms are several.
SEVERAL = 1e-6


@attrs.frozen(eq=False)
class Found:
    """A consistent case and what it leads to."""

    case: Combination
    outcome: Outcome

    @property
    def margin(self) -> float:
        """By how much the case is consistent, in units of the noise."""
        return min((value / noise for value, noise in self.outcome.conditions if noise > 0.0), default=0.0)


def consistent(level: Level, options: Sequence[Sequence[str]], stuck: Sequence[int]) -> list[Found]:
    """The consistent cases of a problem in numbers, those with fewest forces first.

    Parameters
    ----------
    options
        What may hold, by contact.
    stuck
        As for `outcome`.
    """
    found = []
    for case in sorted(_cases(level, options), key=_forces):
        reached = outcome(level, case, stuck)
        if reached is None or not holds(reached):
            continue
        slipping = [i for i in stuck if case.statuses[i] in SIGNS]
        if not any(is_at_rest(level, i, reached.after) and _cannot_slip(level, case, i) for i in slipping):
            found.append(Found(case, reached))
    return found


def _cases(level: Level, options: Sequence[Sequence[str]]) -> Iterator[Combination]:
    """All cases: a contact with an impulse that it is given pushes, and opens or needs more."""
    ways = [
        [(status, lifts) for status in each if status != OPEN for lifts in (True, False)]
        if given > 0
        else [(status, False) for status in each]
        for each, given in zip(options, level.given, strict=True)
    ]
    for chosen in product(*ways):
        statuses = tuple(status for status, _ in chosen)
        lifts = tuple(each for _, each in chosen)
        yield from borne(level, attrs.evolve(Combination.of(statuses), lifts=lifts))


def borne(level: Level, case: Combination) -> Iterator[Combination]:
    """A case by all ways in which contacts that stick may share what they bear, often one."""
    case = attrs.evolve(case, merged=merged_in(level, case.statuses))
    rows = [level.row(i) for i in range(len(case.statuses)) if case.is_held(i)]
    sticking = [i for i in range(len(case.statuses)) if case.sticks(i)]
    surplus = len(rows) + len(sticking) - _rank(level, [*rows, *map(level.across, sticking)])
    for chosen in combinations(sticking, surplus):
        others = [level.across(i) for i in sticking if i not in chosen]
        if _rank(level, [*rows, *others]) < len(rows) + len(others):
            continue
        for shares in product((0, 1, -1), repeat=surplus):
            leans = dict(zip(chosen, shares, strict=True))
            yield attrs.evolve(case, leans=tuple(leans.get(i) for i in range(len(case.statuses))))


def _cannot_slip(level: Level, case: Combination, i: int) -> bool:
    """Whether what the other contacts hold keeps a contact from slipping: it sticks with them then."""
    held = [level.row(k) for k in range(len(case.statuses)) if case.is_held(k)]
    held += [level.across(k) for k in range(len(case.statuses)) if case.sticks(k)]
    return _rank(level, [*held, level.across(i)]) == _rank(level, held)


def _rank(level: Level, rows: Sequence[int]) -> int:
    """How many directions of rows do not depend on each other."""
    if not rows:
        return 0
    values = np.linalg.eigvalsh(correlations(level.delassus, rows))
    return int(np.count_nonzero(values > DEPENDENT))


def _forces(case: Combination) -> tuple[int, int, int]:
    """How many normal forces are to be found; then those come first that stick, without leaning."""
    held = sum(case.is_held(i) for i in range(len(case.statuses)))
    return (
        held,
        -sum(each == STICKS for each in case.statuses),
        sum(each not in (None, 0) for each in case.leans),
    )


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


def is_shared(case: Combination, before: Combination) -> bool:
    """Whether two cases differ at most in how contacts share what they bear."""
    return case.statuses == before.statuses


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


def stopped(level: Level, still: Sequence[int]) -> Combination:
    """The case that stops all contacts, and the slips of those that are ``still``.

    It has impulses in directions that do not depend on others.
    """
    statuses: list[str] = []
    pushing: list[int] = []
    for i, (row, _) in enumerate(level.places):
        statuses.append(IDLE if is_implied(level, row, pushing) else HELD)
        pushing += [row] if statuses[i] == HELD else []
    for i in still:
        if statuses[i] == HELD and not is_implied(level, level.across(i), pushing):
            statuses[i] = STICKS
            pushing.append(level.across(i))
    return Combination.of(statuses)


def is_implied(level: Level, row: int, others: Sequence[int]) -> bool:
    """Whether the direction of a row is a combination of those of other rows, which are independent."""
    return _rank(level, [*others, row]) == len(others)
