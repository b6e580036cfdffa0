"""A system of pairs that makes its modes and transitions as runs need them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import attrs
import numpy as np

from hybrid.errors import ArgumentError, ModelError
from hybrid.expression.evaluation import Program, expressed, scalar
from hybrid.expression.graph import mentions
from hybrid.expression.linear import Vector
from hybrid.expression.nodes import ZERO, Expression, Number
from hybrid.expression.operations import Less, LessEqual
from hybrid.system.elements import Function, Guard, Mode
from hybrid.system.graph import HybridSystem
from hybrid.system.growth import Place
from hybrid.system.outputs import Formula, Output
from hybrid.transform.deciding import Deciding, Origin, Watch, Written, decided_by
from hybrid.transform.pairs.equations import Sides, values_at
from hybrid.transform.pairs.judge import NO_SOLUTION, Decision, Judge, Undecided
from hybrid.transform.pairs.noise import Manifold
from hybrid.transform.pairs.pair import BEGINNING, active_name
from hybrid.transform.pairs.regime import Regime

# The sides of clocks, and the pairs that are active.
Holding = tuple[Sides, tuple[int, ...]]
QUANTITIES = "w", "z"
REACHES, TICKS, BEGINS = "reaches", "ticks", "begins"


@attrs.frozen
class PairEvent:
    """An event at which a mode ends.

    Attributes
    ----------
    kind
        ``reaches``: what has to be positive of a pair is zero. ``ticks``: a clock. ``begins``: a run begins
        where no mode goes on.
    which
        The number of the pair, or of the surface that a clock crosses.
    """

    kind: str
    which: int = -1


@attrs.frozen(eq=False)
class Made:
    """A mode that has been made."""

    mode: Mode
    regime: Regime
    watches: list[Watch]


class PairGrowth(Deciding):
    """Makes the modes of a system of pairs and the transitions between them."""

    def __init__(self, judge: Judge, original: HybridSystem, origin: Origin) -> None:
        super().__init__(original, origin)
        self.judge, self.equations = judge, judge.equations
        self.made: dict[Holding, Made] = {}
        self.unknown: dict[Holding, frozenset[tuple[int, str]]] = {}
        self.notes: dict[str, None] = {}
        self.begins = False
        self.certain = True
        self.checked: set[bytes] = set()
        always = Guard(scalar(Number(1)), +1, at_start=True)
        self.beginning = Watch(BEGINNING, None, PairEvent(BEGINS), always, "begin")
        variables = original.variables
        anywhere = 0.0, np.ones(variables.dimension), variables.defaults
        self.first = self._make((self.equations.sides_at(anywhere), ()), anywhere)

    @property
    def given(self) -> list[Expression]:
        """The rates and ``w``, with what they have of ``z``."""
        return self.equations.given

    def field_of(self, owner: str) -> Function:
        """The field of a mode, without what draws the state back; ``owner`` is the mode in error texts."""
        regimes = (each.regime for each in self.made.values() if owner == f"Mode {each.mode.name!r}")
        return expressed(next(regimes, self.first.regime).field)

    def _decided(self, watch: Watch, place: Place) -> Decision | Undecided:
        return self.judge.decide(self._sides_after(watch, place), place, self._manifold(watch, place))

    def _sides_after(self, watch: Watch, place: Place) -> Sides:
        """What the clocks have switched after an event."""
        if watch.event.kind == BEGINS:
            return self.equations.sides_at(place)
        sides, _ = watch.now
        if watch.event.kind == REACHES:
            return sides
        return _flipped(sides, watch.event.which)

    def _manifold(self, watch: Watch, place: Place) -> Manifold:
        """What is known to be zero at an event."""
        held = self._held(watch)
        if watch.event.kind != REACHES:
            return self.judge.manifold(held, place)
        value, rate = self.made[watch.now].regime.levels(watch.event.which, 2)
        return self.judge.manifold([*held, value], place, (value, rate))

    def _held(self, watch: Watch) -> Vector:
        return [] if watch.event.kind == BEGINS else self.made[watch.now].regime.holds

    def _follow(self, watch: Watch, decision: Decision, place: Place) -> None:
        watch.decisions.append(decision)
        manifold, held = self._manifold(watch, place), self._held(watch)
        written = self.judge.written(decision, place, manifold, held, self.certain)
        if watch.event.kind == BEGINS:
            written.conditions.extend(self._at_time(decision.sides))
        target = self._entered((decision.sides, decision.active), self._after(written, place))
        self._add(watch, written, target, watch.title)

    def _after(self, written: Written, place: Place) -> Place:
        """The state after a transition."""
        if written.state is None:
            return place
        t, _, parameters = place
        return t, values_at(self.equations.symbols, Program(written.state), place), parameters

    def _at_time(self, sides: Sides) -> Iterator[Expression]:
        """That clocks have switched to these sides."""
        for number, side in sides:
            height = self.equations.clocks[number].height
            yield Less(ZERO, height) if side > 0 else LessEqual(height, ZERO)

    def _why(self, watch: Watch, undecided: Undecided, place: Place) -> str:
        where = "where a run starts" if watch.event.kind == BEGINS else f"in mode {watch.source!r}"
        if undecided.name == NO_SOLUTION:
            return (
                f"No z >= 0 keeps w >= 0 from there on, {where}. Check the signs in w, and whether a branch "
                "without resistance and inductance is shorted or opened."
            )
        names = " or ".join(repr(self._name((undecided.sides, each))) for each in undecided.cases)
        return f"Several motions agree with all pairs {where}: {names}."

    def place(self, t: float, x: np.ndarray, parameters: np.ndarray, mode: str | None) -> bool:
        """Make the mode in which a run starts; whether it was to be made.

        Raises
        ------
        ArgumentError, ModelError
            If several motions are possible, or the named mode does not exist.
        """
        with self.lock:
            self._start((t, x, parameters), mode)
            return self.stage is None

    def mode_at(self, t: float, x: np.ndarray, parameters: np.ndarray, mode: str | None) -> str:
        """The mode in which a run starts."""
        with self.lock:
            return self._start((t, x, parameters), mode)

    def _start(self, place: Place, mode: str | None) -> str:
        if (key := place[2].tobytes()) not in self.checked:
            self.equations.check_factors(place[2])
            self._doubt(place)
            self.checked.add(key)
        if mode == BEGINNING or mode in {each.mode.name for each in self.made.values()}:
            assert mode is not None, "a mode has a name"
            return mode
        if mode is not None:
            return self._entered(self._named(mode), place)
        sides = self.equations.sides_at(place)
        kinds = self.judge.kinds(sides, place, self.judge.anywhere(place))
        if len(kinds) > 1:
            names = " or ".join(repr(self._name((sides, kind[0].active))) for kind in kinds)
            raise ArgumentError(
                f"x0 = {tuple(map(float, place[1]))} may go on in more than one mode: {names}. Choose one "
                "with mode=."
            )
        if kinds:
            return self._entered((sides, kinds[0][0].active), place)
        self.stage = self.stage if self.begins else None
        self.begins = True
        return BEGINNING

    def _doubt(self, place: Place) -> None:
        """Decide all transitions again if motions may not be unique at parameters, and were at others."""
        sides = self.equations.all_sides()
        certain = all(self.equations.configuration(each).is_monotone(place) for each in sides)
        if self.certain and not certain:
            for watch in self._all_watches():
                watch.cases.clear()
                watch.decisions.clear()
            self.stage = None
        self.certain = certain and self.certain

    def _named(self, mode: str) -> Holding:
        """What holds in the mode of a name."""
        known = {
            self._name((sides, active)): (sides, active)
            for sides in self.equations.all_sides()
            for active in self.judge.cases()
        }
        if mode not in known:
            some = ", ".join(map(repr, [*known][:6]))
            raise ModelError(f"Mode {mode!r} does not exist. Modes are named by the active pairs: {some} ...")
        return known[mode]

    def _name(self, holding: Holding) -> str:
        sides, active = holding
        switched, own = self.equations.named(sides), active_name(self.equations.pairs, active)
        return f"{switched}: {own}" if switched else own

    def _make(self, holding: Holding, place: Place) -> Made:
        """The mode in which some pairs are active."""
        if holding not in self.made:
            sides, active = holding
            name, regime = self._name(holding), self.judge.regime(sides, active, place)
            if regime is None:
                raise ArgumentError(
                    f"Mode {name!r}: neither w of these pairs nor its rate tells their z. Leave mode= out: "
                    "the state tells the mode."
                )
            holds = expressed(regime.holds) if regime.holds else None
            mode = Mode(name, expressed(regime.drawn), holds=holds)
            watches = [*self._watches(name, holding, regime)]
            self.made[holding] = Made(mode, regime, watches)
            self.stage = None
        return self.made[holding]

    def _entered(self, holding: Holding, place: Place) -> str:
        """The name of a mode that a run enters."""
        made = self._make(holding, place)
        if holding not in self.unknown:
            unknown = self.unknown[holding] = self._undetermined(made.regime, place)
            if unknown:
                names = ", ".join(self._output(*each) for each in sorted(unknown))
                self.notes[f"{made.mode.name}: {names} are not determined there; the motion is."] = None
                self.stage = None
        return made.mode.name

    def _undetermined(self, regime: Regime, place: Place) -> frozenset[tuple[int, str]]:
        """The ``w`` and ``z`` that nothing tells, such as voltages of a part without connection."""
        held = self.judge.manifold(regime.holds, place)
        kinds = self.judge.kinds(regime.configuration.sides, place, held)
        alike = next((kind for kind in kinds if regime in kind), [])
        return frozenset(
            (i, what)
            for other in alike
            for i in range(len(self.equations.pairs))
            for what in QUANTITIES
            if not held.has(getattr(regime, what)[i] - getattr(other, what)[i])
        )

    def _watches(self, source: str, holding: Holding, regime: Regime) -> Iterator[Watch]:
        """What a mode looks out for."""
        sides, active = holding
        for together in self._together(regime):
            names = (self._output(i, "z" if i in active else "w") for i in together)
            guard = Guard(scalar(regime.levels(together[0])[0]), -1)
            yield Watch(source, holding, PairEvent(REACHES, together[0]), guard, ", ".join(names))
        for number, side in sides:
            title = self.equations.named(_flipped(sides, number))
            clock = self.equations.clock(number, side)
            yield Watch(source, holding, PairEvent(TICKS, number), clock, title)
            # A tick at the start does not fire: a start that names the mode of the other side is put right.
            [beyond] = self._at_time(((number, -side),))
            wrong = Guard(scalar(Number(-side)), -side, at_start=True)
            yield Watch(source, holding, PairEvent(TICKS, number), wrong, f"{title} at start", beyond)

    def _together(self, regime: Regime) -> list[list[int]]:
        """The pairs of which something becomes zero in a mode, in lists of those that do so together."""
        symbols, found = self.equations.symbols, list[list[int]]()
        first = {i: regime.levels(i)[0] for i in regime.asked}
        moving = [i for i in regime.asked if mentions(first[i], symbols.variables)]
        zero = {i: self.judge.manifold([*regime.holds, first[i]], regime.place) for i in moving}
        for i in moving:
            for each in found:
                if zero[each[0]].has(first[i]) and zero[i].has(first[each[0]]):
                    each.append(i)
                    break
            else:
                found.append([i])
        return found

    def _all_watches(self) -> Iterator[Watch]:
        if self.begins:
            yield self.beginning
        for each in self.made.values():
            yield from each.watches

    def _assembled(self) -> HybridSystem:
        """The system of what has been made."""
        modes = [each.mode for each in self.made.values()]
        if self.begins:
            modes.append(Mode(BEGINNING, self.first.mode.field))
        return self._with_modes(modes, [*self.equations.names.notes, *self.notes])

    def _outputs(self) -> dict[str, Output]:
        """``w`` and ``z`` of each pair, in the modes that have been made."""
        found = {}
        for i, what in product(range(len(self.equations.pairs)), QUANTITIES):
            formulas = [
                Formula(each.mode.name, scalar(getattr(each.regime, what)[i]))
                for holding, each in self.made.items()
                if (i, what) not in self.unknown.get(holding, ())
            ]
            name = self._output(i, what)
            found[name] = Output(name, tuple(formulas))
        return found

    def _output(self, i: int, what: str) -> str:
        return f"{self.equations.pairs[i].name}.{what}"


def _flipped(sides: Sides, number: int) -> Sides:
    """The sides after a clock has ticked."""
    return tuple((each, -side if each == number else side) for each, side in sides)


def pairs_of(system: HybridSystem) -> PairGrowth | None:
    """What makes the modes of a system of pairs, or made those that it has; None for other systems."""
    found = decided_by(system)
    return found if isinstance(found, PairGrowth) else None
