"""The motion while ``z`` of some pairs may be positive and ``w`` of these is zero."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import attrs
import numpy as np

from hybrid.expression.derivatives import jacobian_of
from hybrid.expression.evaluation import Program
from hybrid.expression.graph import all_replaced
from hybrid.expression.linear import Vector, dot, solved
from hybrid.expression.nodes import ZERO, Expression, node
from hybrid.expression.polynomials import is_zero
from hybrid.system.growth import Place
from hybrid.transform.pairs.equations import Configuration, Numbers, rank_of, values_at
from hybrid.transform.pairs.noise import Manifold

# What is negative by this much is no candidate, whatever is known to be zero.
FAR = 1e-6
# The values and derivatives in time that a transition asks where those before are zero.
DEPTH = 3


@attrs.frozen(eq=False)
class Shape:
    """Which equations tell ``z`` of the active pairs.

    Attributes
    ----------
    active
        The pairs whose ``z`` may be positive.
    rows
        Those of them whose ``w`` tells ``z``.
    others
        Those whose ``w``, less multiples of the rows', is a function of the state: its rate tells ``z``.
    columns
        As many of the active pairs as there are rows, by which the multiples are found.
    matrix
        The equations in numbers.
    """

    active: tuple[int, ...]
    rows: tuple[int, ...]
    others: tuple[int, ...]
    columns: tuple[int, ...]
    matrix: np.ndarray


def shape_of(numbers: Numbers, active: tuple[int, ...]) -> Shape | None:
    """Which equations tell ``z`` at a state; None if neither ``w`` nor its rate does."""
    own = [*active]
    D = numbers.D[own][:, own]
    chosen = _independent(D)
    rows = [active[k] for k in chosen]
    others = [i for i in active if i not in rows]
    columns = [active[k] for k in _independent(D[chosen].T)]
    slopes = _reduced(numbers, numbers.slopes, rows, others, columns)
    matrix = np.vstack([numbers.D[rows][:, own], slopes[:, :-1] @ numbers.B[:, own]])
    if rank_of(matrix) < len(active):
        return None
    return Shape(active, tuple(rows), tuple(others), tuple(columns), matrix)


def is_far(numbers: Numbers, shape: Shape) -> bool:
    """Whether a quantity is so negative at a state that no closer look is needed."""
    own, rows = [*shape.active], [*shape.rows]
    slopes = _reduced(numbers, numbers.slopes, rows, shape.others, shape.columns)
    rates = slopes[:, :-1] @ numbers.a + slopes[:, -1]
    right = np.concatenate([-numbers.q[rows], -rates])
    terms = np.concatenate([np.abs(numbers.q[rows]), np.abs(slopes[:, :-1]) @ np.abs(numbers.a)])
    inverse = np.linalg.inv(shape.matrix)
    z, sizes = inverse @ right, np.abs(inverse) @ terms
    w = numbers.q + numbers.D[:, own] @ z
    w_sizes = np.abs(numbers.q) + np.abs(numbers.D[:, own]) @ sizes
    passive = [j for j in range(len(w)) if j not in shape.active]
    return bool((z < -FAR * (1.0 + sizes)).any() or (w < -FAR * (1.0 + w_sizes))[passive].any())


def _reduced(
    numbers: Numbers, of: np.ndarray, rows: Sequence[int], others: Sequence[int], columns: Sequence[int]
) -> np.ndarray:
    """The rows of others, less the multiples of rows that leave no ``z`` in ``w``."""
    if not rows or not others:
        return of[[*others]]
    D = numbers.D[:, [*columns]]
    factors = np.linalg.solve(D[[*rows]].T, D[[*others]].T).T
    return np.asarray(of[[*others]] - factors @ of[[*rows]])


def _independent(matrix: np.ndarray) -> list[int]:
    """The first rows that do not depend on rows before."""
    kept: list[int] = []
    for i in range(len(matrix)):
        if rank_of(matrix[[*kept, i]]) > len(kept):
            kept.append(i)
    return kept


@attrs.frozen(eq=False)
class Regime:
    """The motion while some pairs are active.

    Attributes
    ----------
    active, rows
        The pairs whose ``z`` may be positive; their ``w`` is zero. Those of them whose ``w`` tells ``z``.
    holds
        What has to be zero beside: the functions of the state that some of these ``w`` are.
    z, w
        By pair.
    impulses, kicks
        By pair: impulses of ``z`` that bring the state to where ``holds`` is zero, and those of ``w``.
    field
        The rates.
    drawn
        The rates, with what draws the state back if rounding has moved ``holds``.
    state
        The state after the impulses.
    place
        A state in this regime.
    """

    configuration: Configuration
    active: tuple[int, ...]
    rows: tuple[int, ...]
    holds: Vector
    z: Vector
    w: Vector
    impulses: Vector
    kicks: Vector
    field: Vector
    drawn: Vector
    state: Vector
    place: Place
    _levels: dict[int, Vector] = attrs.field(factory=dict, init=False)

    def levels(self, i: int, depth: int = DEPTH) -> Vector:
        """What must not be negative of a pair, ``z`` or ``w``, with its derivatives in time."""
        known = self._levels.setdefault(i, [self.z[i] if i in self.active else self.w[i]])
        while len(known) < depth:
            known += self.configuration.rates(known[-1:], self.field)
        return known[:depth]

    @cached_property
    def asked(self) -> list[int]:
        """The pairs of which something may become negative: not those that others keep at zero."""
        kept = Manifold(self.configuration.symbols, self.holds, self.place)
        return [i for i in range(len(self.z)) if not kept.has(self.levels(i)[0])]

    @cached_property
    def left(self) -> Vector:
        """What the impulses leave of ``holds``."""
        after = dict(zip(self.configuration.symbols.x, self.state, strict=True))
        return all_replaced(self.holds, after)

    @cached_property
    def speeds(self) -> Vector:
        """The rates, and the rates of these."""
        return [*self.field, *self.configuration.rates(self.field, self.field)]


def regime_of(configuration: Configuration, shape: Shape, place: Place) -> Regime:
    """The motion while some pairs are active, as expressions."""
    own, symbols = shape.active, configuration.symbols
    q, D, B = configuration.q, configuration.D, configuration.B
    holds = _functions_of_state(configuration, shape, configuration.at(place))
    slopes = jacobian_of(holds, symbols.variables)
    matrix = [[D[i][k] for k in own] for i in shape.rows]
    matrix += [[node(dot(row[:-1], B[k])) for k in own] for row in slopes]
    # The right-hand sides: what is there without z; and what the impulses have to undo.
    there = [-q[i] for i in shape.rows] + [
        -(node(dot(row[:-1], configuration.a)) + row[-1]) for row in slopes
    ]
    undone = [ZERO for _ in shape.rows] + [-each for each in holds]
    z_own, impulses_own = solved(matrix, [there, undone], shape.matrix) if own else ([], [])
    count, n = len(q), len(configuration.a)
    z, impulses = (_spread(each, own, count) for each in (z_own, impulses_own))

    def moved(start: Vector, by: Vector) -> Vector:
        return [_plain(start[r] + node(dot([B[k][r] for k in own], by))) for r in range(n)]

    field = moved(configuration.a, z_own)
    w = [ZERO if i in own else q[i] + node(dot(D[i], z)) for i in range(count)]
    kicks = [ZERO if i in own else node(dot(D[i], impulses)) for i in range(count)]
    drawn = field
    if holds:
        pace = node(_pace(configuration, field, place))
        drawn = moved(field, [pace * each for each in impulses_own])
    state = moved([*symbols.x], impulses_own)
    return Regime(configuration, own, shape.rows, holds, z, w, impulses, kicks, field, drawn, state, place)


def _functions_of_state(configuration: Configuration, shape: Shape, numbers: Numbers) -> Vector:
    """What ``w`` of the others are, less the multiples of the rows that leave no ``z``."""
    q, D = configuration.q, configuration.D
    if not shape.rows or not shape.others:
        return [q[i] for i in shape.others]
    square = [[D[i][k] for i in shape.rows] for k in shape.columns]
    columns = [[D[i][k] for k in shape.columns] for i in shape.others]
    factors = solved(square, columns, numbers.D[[*shape.rows]][:, [*shape.columns]].T)
    return [
        _plain(q[i] - node(dot(own, [q[k] for k in shape.rows])))
        for i, own in zip(shape.others, factors, strict=True)
    ]


def _spread(values: Vector, places: Sequence[int], count: int) -> Vector:
    found: Vector = [ZERO] * count
    for place, value in zip(places, values, strict=True):
        found[place] = value
    return found


def _plain(expression: Expression) -> Expression:
    """Zero in the place of what is zero once it is written out."""
    return ZERO if is_zero(expression) else expression


def _pace(configuration: Configuration, field: Vector, place: Place) -> float:
    """How fast a motion changes: the largest eigenvalue of its linearisation, as a power of two."""
    rows = jacobian_of(field, configuration.symbols.x)
    values = values_at(configuration.symbols, Program([each for row in rows for each in row]), place)
    if not np.isfinite(values).all():
        return 1.0
    size = np.abs(np.linalg.eigvals(values.reshape(len(field), -1))).max()
    return float(2.0 ** np.round(np.log2(size))) if size > 0.0 else 1.0
