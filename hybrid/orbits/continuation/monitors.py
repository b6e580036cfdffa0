"""Functions of orbits whose zeros along a branch are located, besides those of bifurcations."""

from __future__ import annotations

from collections.abc import Iterator

import attrs
import numpy as np

from hybrid.orbits.continuation.event import Event
from hybrid.orbits.continuation.place import Place, distance, interpolated_zero, zero_between
from hybrid.orbits.continuation.watch import Watch

# A value this small beside the largest one along the branch, or beside 1, may be rounding: it has no sign.
NOTHING = 1e-11
# A function has jumped where its sign changes and its size does not fall to this share.
JUMPED = 1e-3
# The place where a route changes is looked for at so many times the distance of the parameters.
FARTHER = (2.0, 8.0, 32.0)


@attrs.define(eq=False)
class Monitors:
    """The functions that ``events=`` gives, along one walk after the other from one place.

    A function that becomes zero and stays so has no zero to be located; it has one where it leaves with the
    other sign.

    Attributes
    ----------
    watch
        Their values at orbits.
    sides
        The last sign of each that was certain.
    """

    watch: Watch
    sides: dict[str, float] = attrs.field(factory=dict)
    _first: dict[str, float] = attrs.field(factory=dict)
    _sizes: dict[str, float] = attrs.field(factory=dict)

    def start(self, place: Place) -> None:
        """Take the signs of the place where all walks begin, or the first that a walk before has found."""
        for name in self.watch.events:
            self._first.setdefault(name, self._side(name, place))
        self.sides = dict(self._first)

    def between(self, place: Place, after: Place) -> Iterator[Event]:
        """Zeros between two places that follow each other."""
        for name in self.watch.events:
            before, new = self.sides[name], self._side(name, after)
            if new == 0.0:
                continue
            self.sides[name] = new
            self._first[name] = self._first[name] or new
            if before * new < 0.0:
                yield self._located(name, place, after)

    def _value(self, name: str, place: Place) -> float:
        return self.watch.value(name, place.orbit)

    def _side(self, name: str, place: Place) -> float:
        value = self._value(name, place)
        self._sizes[name] = max(self._sizes.get(name, 1.0), abs(value))
        return float(np.sign(value)) if abs(value) > NOTHING * self._sizes[name] else 0.0

    def _located(self, name: str, place: Place, after: Place) -> Event:
        if self._side(name, place) == 0.0:
            return Event(name, place, f"events[{name!r}] is zero")
        begin = place if place.family.route == after.family.route else _at_change(place, after)
        found = None if begin is None else self._zero(name, begin, after)
        if found is None:
            return Event(
                name, place, f"events[{name!r}] changes its sign where the transitions change or beside it"
            )
        sizes = [abs(self._value(name, each)) for each in (found, place, after)]
        told = "jumps to the other sign" if sizes[0] > JUMPED * min(sizes[1:]) else "is zero"
        return Event(name, found, f"events[{name!r}] {told}")

    def _zero(self, name: str, place: Place, after: Place) -> Place | None:
        def value(each: Place) -> float:
            return self._value(name, each)

        if not value(place) * value(after) < 0.0:
            return None
        reach = distance(place, after)
        return zero_between(place, after, value) or interpolated_zero(place, value, (0.0, reach))


def _at_change(place: Place, beyond: Place) -> Place | None:
    """An orbit of the route beyond a change, at the parameter of the change; None if none is found."""
    back = attrs.evolve(beyond, tangents=-beyond.tangents)
    apart = abs(beyond.value - place.value) / float(beyond.sizes[0])
    for length in apart * np.array(FARTHER):
        made = back.step(np.array([length]))
        if made is not None:
            found = zero_between(back, made[0], lambda each: each.value - place.value)
            if found is not None:
                return attrs.evolve(found, tangents=-found.tangents)
    return None
