"""The transitions that fire at one instant, in exact arithmetic, implemented independently of the library.

Fields are constant between events, guards and resets are affine, and all numbers are fractions. The rules
are those of ``docs/instant.md``. `Open` is raised if the rules leave a case open or a time is not dyadic.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

Vector = tuple[Fraction, ...]
ZERO = Fraction(0)
# A case is discarded after this many jumps before the last instant.
MOST_JUMPS = 200


class Open(Exception):
    """The rules do not decide the case, or its times are not exact as binary numbers."""


class Affine(NamedTuple):
    """``coefficients @ x + rate * t + constant``."""

    coefficients: Vector
    rate: Fraction
    constant: Fraction

    def __call__(self, t: Fraction, x: Vector) -> Fraction:
        return sum((a * b for a, b in zip(self.coefficients, x, strict=True)), self.rate * t + self.constant)

    def speed(self, velocity: Vector) -> Fraction:
        return sum((a * b for a, b in zip(self.coefficients, velocity, strict=True)), self.rate)

    def factor(self, other: Affine) -> Fraction | None:
        """The ratio of this function to another one if the ratio is constant and not zero, else None."""
        mine = (*self.coefficients, self.rate, self.constant)
        its = (*other.coefficients, other.rate, other.constant)
        place = next((i for i, b in enumerate(its) if b), None)
        if place is None:
            return None
        ratio = mine[place] / its[place]
        return ratio if ratio and all(a == ratio * b for a, b in zip(mine, its, strict=True)) else None


class Edge(NamedTuple):
    """A transition; modes are numbers, ``target`` is None if the run ends."""

    source: int
    target: int | None
    guard: Affine
    direction: int
    reset: tuple[Affine, ...] | None
    when: Affine | None

    @property
    def marks(self) -> bool:
        return self.reset is None and self.source == self.target


class Rules(NamedTuple):
    """A system: the velocity in each mode, affine in the state, and the transitions in listed order."""

    fields: tuple[tuple[Affine, ...], ...]
    edges: tuple[Edge, ...]


class Run(NamedTuple):
    """Times and transitions, the last state and mode, and how the run ended."""

    fired: list[tuple[Fraction, int]]
    x: Vector
    mode: int
    ending: str


class Watch:
    """State of one guard: the recorded side of the state, and whether the transition is due.

    The guard times ``way`` is negative on the near side. With direction 0 the near side is the side on which
    the state was; ``turned`` is set once ``way`` accounts for the crossing that has fired.
    """

    def __init__(self, edge: Edge, way: int) -> None:
        self.edge, self.way = edge, way
        self.beyond = self.due = self.fired = self.resting = self.turned = False

    def value(self, t: Fraction, x: Vector) -> Fraction:
        return self.way * self.edge.guard(t, x)

    def speed(self, velocity: Vector) -> Fraction:
        return self.way * self.edge.guard.speed(velocity)


def sign(a: Fraction) -> int:
    return (a > 0) - (a < 0)


def simulate_exactly(system: Rules, x: Vector, mode: int, end: Fraction, limit: int) -> Run:
    """Run from time zero; more than ``limit`` jumps at one instant count as endless."""
    return _Runner(system, x, mode, limit).run(end)


class _Runner:
    def __init__(self, system: Rules, x: Vector, mode: int, limit: int) -> None:
        self.system, self.t, self.x, self.mode, self.limit = system, ZERO, x, mode, limit
        self.fired: list[tuple[Fraction, int]] = []
        self.watches = self._started()

    @property
    def velocity(self) -> Vector:
        return tuple(part(ZERO, self.x) for part in self.system.fields[self.mode])

    def _edges(self, mode: int) -> dict[int, Edge]:
        return {i: edge for i, edge in enumerate(self.system.edges) if edge.source == mode}

    def _side(self, edge: Edge) -> int:
        """The side of the state, or the side to which it moves if the guard is zero."""
        side = sign(edge.guard(self.t, self.x)) or sign(edge.guard.speed(self.velocity))
        if not side:
            raise Open("a guard with direction 0 at rest at zero")
        return side

    def _fresh(self, edge: Edge) -> Watch:
        return Watch(edge, edge.direction or -self._side(edge))

    def _started(self) -> dict[int, Watch]:
        """Watches at the start: a state that starts on a guard and moves beyond it crosses it."""
        watches = {}
        for i, edge in self._edges(self.mode).items():
            watch = self._fresh(edge)
            value, speed = watch.value(self.t, self.x), watch.speed(self.velocity)
            watch.beyond = value > 0 or (value == 0 and speed > 0)
            watch.due = value == 0 and speed > 0 and not edge.marks
            watches[i] = watch
        return watches

    def run(self, end: Fraction) -> Run:
        while True:
            ending = self._instant()
            if ending:
                return Run(self.fired, self.x, self.mode, ending)
            velocity = self.velocity
            times = []
            for watch in self.watches.values():
                value, speed = watch.value(self.t, self.x), watch.speed(velocity)
                if value < 0 and speed > 0:
                    times.append(-value / speed)
            step = min(times, default=None)
            if step is None or self.t + step > end:
                return Run(self.fired, self._moved(velocity, end - self.t), self.mode, "end")
            if not dyadic(self.t + step):
                raise Open("a time that is not dyadic")
            self.x, self.t = self._moved(velocity, step), self.t + step
            for watch in self.watches.values():
                self._arrive(watch)

    def _moved(self, velocity: Vector, step: Fraction) -> Vector:
        return tuple(a + step * b for a, b in zip(self.x, velocity, strict=True))

    def _arrive(self, watch: Watch) -> None:
        """Update a watch after the flow has moved the state."""
        value, speed = watch.value(self.t, self.x), watch.speed(self.velocity)
        if value == 0 and speed > 0 and not watch.beyond:
            watch.due = watch.beyond = True
        elif value < 0 or (value == 0 and speed < 0):
            watch.beyond = False

    def _instant(self) -> str:
        """Fire the due transitions one after another; return how the run ended, or an empty text."""
        count = 0
        for watch in self.watches.values():
            watch.fired = watch.turned = False
        known: dict[object, int] = {}
        while True:
            ready = (i for i in sorted(self.watches) if self.watches[i].due and self._allowed(i))
            first = next(ready, None)
            if first is None:
                break
            everything = self._everything()
            if everything in known:
                # The sequence repeats from here on.
                rounds = self.fired[known[everything] :]
                self.fired += rounds * (self.limit // len(rounds) + 1)
                return "stuck"
            known[everything] = len(self.fired)
            count += 1
            self.fired.append((self.t, first))
            if len(self.fired) > MOST_JUMPS + count:
                raise Open("too many jumps at different times")
            if count > self.limit:
                return "stuck"
            edge = self.system.edges[first]
            if edge.target is None:
                return "terminal"
            self._jump(first, edge)
        for watch in self.watches.values():
            # A guard whose condition still refuses has been passed.
            watch.due = False
            if not watch.edge.direction and watch.beyond:
                watch.way, watch.beyond = -self._side(watch.edge), False
        return ""

    def _everything(self) -> object:
        watches = tuple((i, w.way, w.beyond, w.due, w.fired) for i, w in self.watches.items())
        return self.x, self.mode, watches

    def _allowed(self, i: int) -> bool:
        when = self.watches[i].edge.when
        if when is None:
            return True
        value = when(self.t, self.x)
        if not value:
            raise Open("a condition at its edge")
        return value > 0

    def _jump(self, first: int, edge: Edge) -> None:
        before = {i: watch.value(self.t, self.x) for i, watch in self.watches.items()}
        for i, watch in self.watches.items():
            watch.resting = before[i] == 0 and watch.speed(self.velocity) == 0
        old_x, old_mode = self.x, self.mode
        own = self.watches[first]
        own.due, own.fired = False, True
        if edge.reset is not None:
            self.x = tuple(part(self.t, old_x) for part in edge.reset)
        if edge.target != old_mode:
            self.mode = edge.target
            self.watches = self._entered(old_x)
            return
        for i, watch in self.watches.items():
            if i == first:
                self._own(watch, before[i])
            else:
                self._asked(watch, before[i])

    def _own(self, watch: Watch, before: Fraction) -> None:
        """After its own reset a transition is not due, unless the reset went from beyond onto the guard."""
        if not watch.edge.direction:
            watch.way, watch.beyond, watch.turned = -self._side(watch.edge), False, True
            return
        value, speed = watch.value(self.t, self.x), watch.speed(self.velocity)
        watch.beyond = value > 0 or (value == 0 and speed > 0)
        watch.due = before > 0 and value == 0 and speed > 0
        watch.fired = watch.beyond and not watch.due

    def _asked(self, watch: Watch, before: Fraction) -> None:
        """Update a watch after the reset of another transition."""
        value, speed = watch.value(self.t, self.x), watch.speed(self.velocity)
        if watch.edge.marks:
            # A marker records only crossings by the flow.
            watch.due = watch.due and value == 0 and speed > 0
            watch.beyond = value > 0 or (value == 0 and speed > 0)
            return
        if value > 0:
            crossed = not watch.beyond
        elif value == 0 and speed > 0:
            crossed = not watch.beyond or before != 0
        elif value == 0 and speed == 0 and before == 0:
            return
        else:
            # With direction 0 the near side is where the crossing has led: it stays the one that has fired.
            watch.due = watch.beyond = False
            watch.fired = watch.fired and watch.turned
            return
        watch.due, watch.beyond = watch.due or crossed, True
        watch.fired = watch.fired and not crossed

    def _entered(self, old_x: Vector) -> dict[int, Watch]:
        """Watches after entering another mode: a guard that was watched before keeps its side."""
        old, watches = self.watches, {}
        for i, edge in self._edges(self.mode).items():
            same = [
                (watch, sign(ratio))
                for watch in old.values()
                if (ratio := edge.guard.factor(watch.edge.guard)) is not None
            ]
            if same:
                watches[i] = self._kept(edge, same, old_x)
            else:
                watches[i] = self._new(edge)
        return watches

    def _new(self, edge: Edge) -> Watch:
        """A guard not watched before: a state beyond it must leave, unless the mode exists on both sides."""
        watch = self._fresh(edge)
        value, speed = watch.value(self.t, self.x), watch.speed(self.velocity)
        watch.beyond = value > 0 or (value == 0 and speed > 0)
        watch.due = watch.beyond and not edge.marks and not (value > 0 and self._both_sides(edge))
        return watch

    def _both_sides(self, edge: Edge) -> bool:
        for other in self._edges(self.mode).values():
            ratio = other.guard.factor(edge.guard)
            if ratio is not None and other.direction * sign(ratio) != edge.direction:
                return True
        return False

    def _kept(self, edge: Edge, same: list[tuple[Watch, int]], old_x: Vector) -> Watch:
        # A guard with the same direction on the same surface takes precedence.
        if edge.direction:
            alike = [watch for watch, turn in same if watch.way * turn == edge.direction]
            watch = Watch(edge, edge.direction)
        else:
            if any(watch.edge.direction for watch, _ in same):
                raise Open("direction 0 beside another direction")
            # A crossing that has fired is complete: the state is already on the other side.
            fired = [(watch, turn) for watch, turn in same if watch.fired]
            known, turn = (fired or same)[0]
            watch = Watch(edge, known.way * turn * (-1 if fired and not known.turned else 1))
            alike = [] if fired else [watch for watch, _ in same]
        before = watch.value(self.t, old_x)
        if alike:
            watch.beyond = any(other.beyond for other in alike)
            watch.due = any(other.due for other in alike) and not any(other.fired for other in alike)
            watch.fired = any(other.fired for other in alike)
        elif before == 0 and any(other.resting for other, _ in same):
            raise Open("at rest on a guard that was watched the other way")
        else:
            # Keep the side that the other watch recorded; an unwatched crossing is complete. What fired in
            # both directions has its near side where the state was to move.
            unwatched = edge.direction != 0 and not any(other.beyond for other, _ in same)
            watch.beyond = before > 0 or (before == 0 and unwatched)
        due = watch.due
        self._asked(watch, before)
        if edge.marks:
            watch.due = due and watch.due
        return watch


def dyadic(a: Fraction) -> bool:
    return a.denominator & (a.denominator - 1) == 0
