"""The mode in which contacts are held: its field, and the forces at the contacts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from hybrid.expression.evaluation import Program, expressed
from hybrid.expression.graph import mentions
from hybrid.expression.linear import dot, solved
from hybrid.expression.nodes import ZERO, Expression, node
from hybrid.system.elements import Function
from hybrid.system.growth import Place
from hybrid.transform.contacts.equations import Space
from hybrid.transform.contacts.kinematics import Row
from hybrid.transform.contacts.problem import (
    DEPENDENT,
    Combination,
    Level,
    bound,
    correlations,
    equations_of_case,
    matrix,
    solvability,
)
from hybrid.transform.contacts.statuses import IDLE, OPEN, SIGNS, STICKS
from hybrid.transform.contacts.view import FORCES, Mechanics, View

# Of a difference that estimates a slope.
STEP = 1e-6


@attrs.frozen(eq=False)
class Held:
    """A mode by what holds at its contacts.

    Attributes
    ----------
    field
        ``f(t, x, p)``.
    holds
        What it keeps at zero: gaps, their rates, slips of what sticks; None without a closed contact.
    normal, tangential, bounds
        By contact: the forces, by one choice where several would do, and the largest friction of one that
        sticks.
    solvability
        How far the equations of the forces are from being singular, if friction may make them so; else None.
    undetermined
        Names ``(contact, "normal")`` of those.
    """

    field: Function
    holds: Function | None
    normal: list[Expression]
    tangential: list[Expression]
    bounds: list[Expression]
    solvability: Expression | None = None
    undetermined: frozenset[tuple[int, str]] = frozenset()


def held(
    mechanics: Mechanics,
    now: Combination,
    place: Place,
) -> Held:
    """The mode in which ``now`` holds; ``place`` is ``(t, x, parameters)`` where it is first entered.

    Forces keep the rates of gaps, and of slips of contacts that stick, at zero. Rounding and the errors of
    the solver would let these drift, so forces also pull them back at the pace ``k`` of the motion, which
    changes nothing where they are zero: ``g'' = -2 k g' - k^2 g`` (Baumgarte).
    """
    space, view, count = mechanics.space, mechanics.view, len(now.statuses)
    normal: list[Any] = [node(0.0)] * count
    tangential: list[Any] = [node(0.0)] * count
    bounds: list[Any] = [node(0.0)] * count
    closed = [i for i, each in enumerate(now.statuses) if each not in (OPEN, IDLE)]
    if not closed:
        return Held(expressed([*space.u, *map(node, view.free)]), None, normal, tangential, [])
    case = now.of_closed(closed)
    exact, rows = mechanics.forces(view, closed), mechanics.rows_of(closed)
    there = mechanics.at(*place)
    numbers = matrix(mechanics.forces(there, closed), case)
    pace = _pace(space, _moving(mechanics, exact, case, rows, place)[1], place)
    level = attrs.evolve(
        exact,
        targets=[_gap_drawn_back(mechanics, i, pace) for i in closed],
        stops=[_slip_drawn_back(mechanics, i, pace) for i in closed],
    )
    forces, accelerations = _moving(mechanics, level, case, rows, place)
    for k, i in enumerate(closed):
        normal[i] = node(forces[level.row(k)])
        if level.places[k][1] is not None:
            tangential[i] = node(forces[level.across(k)])
        if case.sticks(k):
            bounds[i] = node(bound(level, case, k, forces))
    unknown = _undetermined(mechanics, now, there)
    field = expressed([*space.u, *accelerations])
    kept = [each for i in closed for each in (view.gaps[i], view.speeds[mechanics.places[i][0]])]
    kept += [
        view.speeds[row]
        for k, i in enumerate(closed)
        if case.sticks(k)
        for row in mechanics.places[i][1:]
        if row
    ]
    room = None
    if any(each in SIGNS for each in case.statuses):
        found = solvability(level, case, numbers)
        room = found if mentions(found, (space.t, *space.q, *space.u)) else None
    return Held(field, expressed(kept), normal, tangential, bounds, room, unknown)


def _moving(
    mechanics: Mechanics, level: Level, case: Combination, rows: Sequence[int], place: Place
) -> tuple[list[Any], list[Expression]]:
    """The forces at the rows of a level, and the accelerations, in a case.

    Both solve one system of equations: ``M a - W^T f = h``, and ``W a`` is given where a case wants it.
    """
    space, own = mechanics.space, [mechanics.rows[row] for row in rows]
    unknowns, start, wanted = equations_of_case(level, case)
    equations, right = [], []
    for i, (masses, force) in enumerate(
        zip(mechanics.equations.mass, mechanics.equations.forces, strict=True)
    ):
        acting = [row.weights[i] for row in own]
        equations.append([*masses, *(-node(dot(acting, column)) for column in unknowns)])
        right.append(force + node(dot(acting, start)))
    for row, target in wanted:
        equations.append([*own[row].weights, *[ZERO] * len(unknowns)])
        right.append(target - own[row].bias)
    program = Program([each for row in equations for each in row])
    t, x, parameters = place
    values = np.array(program.run(space.values(t, x, parameters)), dtype=float)
    numbers = values.reshape(len(equations), len(equations))
    [found] = solved(equations, [right], numbers, definite=space.size)
    solution = found[space.size :]
    forces = [first + dot([column[row] for column in unknowns], solution) for row, first in enumerate(start)]
    told = _told([(own[row], target) for row, target in wanted])
    return forces, [told.get(j, each) for j, each in enumerate(found[: space.size])]


def _told(wanted: Sequence[tuple[Row, Any]]) -> dict[int, Expression]:
    """The accelerations that rows with targets tell one after another, each from those before it.

    The elimination gives the same with rounding, and a body at rest would be told to move by that.
    """
    found: dict[int, Expression] = {}
    waiting = [*wanted]
    while waiting:
        for row, target in waiting:
            free = [j for j, weight in enumerate(row.weights) if weight is not ZERO and j not in found]
            if len(free) == 1 and row.weights[free[0]].is_number:
                others = dot([row.weights[j] for j in found], [*found.values()])
                found[free[0]] = (node(target) - row.bias - others) / row.weights[free[0]]
                waiting.remove((row, target))
                break
        else:
            break
    return found


def _gap_drawn_back(mechanics: Mechanics, i: int, pace: float) -> Expression:
    row = mechanics.places[i][0]
    return -2.0 * pace * mechanics.view.speeds[row] - pace**2 * mechanics.view.gaps[i]


def _slip_drawn_back(mechanics: Mechanics, i: int, pace: float) -> Expression:
    row = mechanics.places[i][1]
    return ZERO if row is None else -pace * mechanics.view.speeds[row]


def _pace(space: Space, accelerations: Sequence[Any], place: Place) -> float:
    """How fast a motion changes: the largest eigenvalue of its linearisation, as a power of two."""
    t, x, parameters = place
    n = space.size
    steps = STEP * np.maximum(np.abs(x), 1.0)
    states = x + np.vstack([np.zeros(2 * n), np.diag(steps)])
    with np.errstate(all="ignore"):
        found = Program([*map(node, accelerations)]).run(space.values(t, states.T, parameters))
    values = np.array([np.broadcast_to(each, len(states)) for each in found], dtype=float)
    slopes = (values[:, 1:] - values[:, :1]) / steps
    matrix = np.vstack([np.eye(n, 2 * n, n), slopes])
    size = np.abs(np.linalg.eigvals(matrix)).max() if np.isfinite(matrix).all() else 0.0
    return float(2.0 ** np.round(np.log2(size))) if size > STEP else 1.0


def _undetermined(mechanics: Mechanics, now: Combination, view: View) -> frozenset[tuple[int, str]]:
    """The forces that are not determined, as others could take their place."""
    directions: list[tuple[int, str]] = []
    rows: list[int] = []
    for i, status in enumerate(now.statuses):
        normal, across = mechanics.places[i]
        for what, row in zip(FORCES, (normal, across), strict=True):
            if status != OPEN and row is not None and (row == normal or status == STICKS):
                directions.append((i, what))
                rows.append(row)
    values, vectors = np.linalg.eigh(correlations(view.delassus, rows))
    free = np.abs(vectors[:, values <= DEPENDENT])
    return frozenset(
        each for each, share in zip(directions, free, strict=True) if share.max(initial=0.0) > STEP
    )
