"""Which pairs are active at a state: all cases are tried, so that none and several are seen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import combinations

import attrs
import numpy as np

from hybrid.errors import ArgumentError
from hybrid.expression.evaluation import Program
from hybrid.expression.graph import all_replaced
from hybrid.expression.linear import Vector
from hybrid.expression.nodes import ONE, ZERO, Expression
from hybrid.expression.operations import And, LessEqual, Not
from hybrid.system.growth import Place
from hybrid.transform.deciding import NothingDecided, Written
from hybrid.transform.pairs.equations import Equations, Sides, values_at
from hybrid.transform.pairs.noise import NOISE, Manifold, at_first, not_negative, size_of, vanishing
from hybrid.transform.pairs.regime import Regime, is_far, regime_of, shape_of

NO_SOLUTION, NOT_UNIQUE = "no solution", "not unique"
# Cases whose rates differ by more than this share of their terms are several.
SEVERAL = 1e-6
# Of something that is zero so many derivatives in time are asked; if all are zero it stays so.
DEEPEST = 8


@attrs.frozen
class Decision:
    """What follows an event.

    Attributes
    ----------
    sides
        What clocks have switched.
    kicked
        The pairs that have impulses, and others whose ``w`` these keep at zero; None without impulses.
    active
        The pairs whose ``z`` may be positive afterwards.
    """

    sides: Sides
    kicked: tuple[int, ...] | None
    active: tuple[int, ...]


@attrs.frozen
class Undecided(NothingDecided):
    """Why nothing is decided: ``no solution``, or ``not unique`` with the active pairs of each solution."""

    sides: Sides
    cases: tuple[tuple[int, ...], ...] = ()


class Judge:
    """Decides which pairs are active."""

    def __init__(self, equations: Equations) -> None:
        self.equations = equations
        self._regimes: dict[tuple[Sides, tuple[int, ...]], Regime] = {}
        self._programs: dict[Expression, Program] = {}

    def cases(self) -> Iterator[tuple[int, ...]]:
        """All sets of pairs, small ones first."""
        count = len(self.equations.pairs)
        for size in range(count + 1):
            yield from combinations(range(count), size)

    def regime(self, sides: Sides, active: tuple[int, ...], place: Place) -> Regime | None:
        """The motion with these pairs active; None if neither their ``w`` nor its rate tells ``z``.

        Raises
        ------
        ArgumentError
            If other equations tell ``z`` at parameters beside these.
        """
        configuration = self.equations.configuration(sides)
        shape = shape_of(configuration.at(place), active)
        if shape is None:
            return None
        known = self._regimes.get((sides, active))
        if known is None:
            t, x, parameters = place
            beside = t, x, parameters * np.linspace(0.9, 1.1, len(parameters))
            other = shape_of(configuration.at(beside), active)
            if other is None or other.rows == shape.rows:
                known = self._regimes[sides, active] = regime_of(configuration, shape, place)
        if known is None or known.rows != shape.rows:
            names = ", ".join(self.equations.pairs[i].name for i in active)
            raise ArgumentError(
                f"parameters: factors of z in w of {names} cancel at these values, which makes other "
                "equations of the model than values beside. Give the parameters other values."
            )
        return known

    def anywhere(self, place: Place) -> Manifold:
        """What is known to be zero at a start: nothing but zero itself, and no further look is taken."""
        found = self.manifold([], place)
        found.points = []
        return found

    def manifold(
        self, zero: Sequence[Expression], place: Place, falls: tuple[Expression, Expression] | None = None
    ) -> Manifold:
        """The points around a state at which expressions are zero; ``falls`` as for `Manifold`."""
        return Manifold(self.equations.symbols, zero, place, falls)

    def kinds(self, sides: Sides, place: Place, manifold: Manifold) -> list[list[Regime]]:
        """The motions that may go on from a state; those of one kind differ in ``z`` and ``w`` alone."""
        found: list[list[Regime]] = []
        numbers = self.equations.configuration(sides).at(place)
        for active in self.cases():
            shape = shape_of(numbers, active)
            if shape is None or is_far(numbers, shape):
                continue
            regime = self.regime(sides, active, place)
            if regime is None or not self._goes_on(regime, place, manifold):
                continue
            alike = next((kind for kind in found if self._is_alike(kind[0], regime, place)), None)
            if alike is None:
                found.append([regime])
            else:
                alike.append(regime)
        return found

    def _goes_on(self, regime: Regime, place: Place, manifold: Manifold) -> bool:
        for each in regime.holds:
            value, size = (0.0, 0.0) if manifold.has(each) else self._valued(each, place)
            if not abs(value) <= NOISE * size:
                return False
        if manifold.falls is not None and _is_left(regime, manifold.falls):
            rate, _ = self._valued(manifold.falls[1], place)
            if rate < 0.0:
                return False
        return all(self._stays(regime, i, place, manifold) for i in regime.asked)

    def _stays(self, regime: Regime, i: int, place: Place, manifold: Manifold) -> bool:
        """Whether something of a pair is not negative from now on."""
        for depth in range(1, DEEPEST + 1):
            each = regime.levels(i, depth)[-1]
            if manifold.has(each):
                continue
            value, size = self._valued(each, place)
            if not abs(value) <= NOISE * size:
                return value > 0.0
        return True

    def _valued(self, expression: Expression, place: Place) -> tuple[float, float]:
        """A value, and the size of its terms."""
        if expression not in self._programs:
            self._programs[expression] = Program([expression, size_of(expression)])
        value, size = values_at(self.equations.symbols, self._programs[expression], place)
        return float(value), float(size)

    def _is_alike(self, one: Regime, other: Regime, place: Place) -> bool:
        """Whether two motions are the same, by their rates and the rates of these."""
        return all(self._agree(a, b, place) for a, b in zip(one.speeds, other.speeds, strict=True))

    def _agree(self, one: Expression, other: Expression, place: Place) -> bool:
        (a, a_size), (b, b_size) = (self._valued(each, place) for each in (one, other))
        return abs(a - b) <= SEVERAL * (a_size + b_size)

    def decide(self, sides: Sides, place: Place, manifold: Manifold) -> Decision | Undecided:
        """What follows at a state."""
        kinds = self.kinds(sides, place, manifold)
        if len(kinds) == 1:
            return Decision(sides, None, kinds[0][0].active)
        if kinds:
            return Undecided(NOT_UNIQUE, sides, tuple(kind[0].active for kind in kinds))
        jumps = [*self._jumps(sides, place, manifold)]
        if not jumps:
            return Undecided(NO_SOLUTION, sides)
        kick, kinds = jumps[0]
        several = [kind[0].active for kind in kinds]
        for other, further in jumps[1:]:
            if not all(self._agree(a, b, place) for a, b in zip(kick.state, other.state, strict=True)):
                several.append(further[0][0].active)
        if len(several) > 1:
            return Undecided(NOT_UNIQUE, sides, tuple(several))
        return Decision(sides, kick.active, several[0])

    def _jumps(
        self, sides: Sides, place: Place, before: Manifold
    ) -> Iterator[tuple[Regime, list[list[Regime]]]]:
        """The impulses that bring the state to where motions go on, with these motions."""
        t, _, parameters = place
        for kicked in self.cases():
            kick = self.regime(sides, kicked, place) if kicked else None
            if kick is None or not kick.holds:
                continue
            asked = (self._valued(each, place) for each in (*kick.impulses, *kick.kicks))
            if not all(value >= -NOISE * size for value, size in asked):
                continue
            # If w is not affine in the state, the impulses do not bring it to zero.
            left = (self._valued(each, place) for each in kick.left)
            after = values_at(self.equations.symbols, Program(kick.state), place)
            if not np.isfinite(after).all() or not all(abs(value) <= SEVERAL * size for value, size in left):
                continue
            there = t, after, parameters
            kinds = self.kinds(sides, there, self.manifold(kick.holds, there, before.falls))
            if kinds:
                yield kick, kinds

    def written(
        self, decision: Decision, place: Place, manifold: Manifold, held: Vector, unique: bool
    ) -> Written:
        """A decision as expressions.

        Parameters
        ----------
        manifold, held
            What is zero before with what the event says, and without.
        unique
            Whether no other motion can go on where one does.
        """
        x = self.equations.symbols.x
        state: Vector = [*x]
        conditions: list[Expression] = []
        if decision.kicked is not None:
            kick = self._regime(decision.sides, decision.kicked, place)
            wanted = (each for each in (*kick.impulses, *kick.kicks) if each is not ZERO)
            conditions += map(not_negative, wanted)
            state, t, parameters = kick.state, place[0], place[2]
            place = t, values_at(self.equations.symbols, Program(state), place), parameters
            manifold = self.manifold(kick.holds, place, manifold.falls)
        regime = self._regime(decision.sides, decision.active, place)
        after = dict(zip(x, state, strict=True))
        going_on = _going_on(regime, manifold)
        if not unique:
            others = (_going_on(each, manifold) for each in self._others(regime, place, manifold))
            going_on += [Not(reduce(And, each, ONE)) for each in others]
        conditions += all_replaced(going_on, after)
        is_held = self.manifold(held, place).has if decision.kicked is None else manifold.has
        if decision.kicked is not None or not all(map(is_held, regime.holds)):
            drawn = regime.state if not all(map(is_held, regime.holds)) else [*x]
            return Written(conditions, all_replaced(drawn, after))
        return Written(conditions, None)

    def _others(self, regime: Regime, place: Place, manifold: Manifold) -> Iterator[Regime]:
        """The other motions that might go on where one does."""
        sides = regime.configuration.sides
        for active in self.cases():
            other = self.regime(sides, active, place)
            if other is not None and other is not regime:
                pairs = zip(regime.speeds, other.speeds, strict=True)
                if not all(manifold.has(a - b) for a, b in pairs):
                    yield other

    def _regime(self, sides: Sides, active: tuple[int, ...], place: Place) -> Regime:
        found = self.regime(sides, active, place)
        assert found is not None, "the decision has been made with it"
        return found


def _is_left(regime: Regime, falls: tuple[Expression, Expression]) -> bool:
    """Whether a motion is the one that has come to an event: rounding does not tell that it goes on."""
    return any(regime.levels(i, 2) == [*falls] for i in regime.asked)


def _going_on(regime: Regime, manifold: Manifold) -> list[Expression]:
    """The conditions that a motion goes on from a state of a manifold."""
    found = [vanishing(each) for each in regime.holds if not manifold.has(each)]
    for i in regime.asked:
        levels = [each for each in regime.levels(i) if not manifold.has(each)]
        found += [at_first(levels)] if levels else []
    if manifold.falls is not None and _is_left(regime, manifold.falls):
        found.append(LessEqual(ZERO, manifold.falls[1]))
    return found
