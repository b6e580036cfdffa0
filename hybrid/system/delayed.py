"""A system whose author wrote delays becomes one whose state holds what is under way."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import count
from typing import Any

import attrs

from hybrid.errors import ModelError, unknown_name
from hybrid.system.clocks import Clock
from hybrid.system.delay import Delay
from hybrid.system.elements import Mode, Reset, Transition
from hybrid.system.functions import WholeReset
from hybrid.system.moving import moving_numbers
from hybrid.system.places import Places, UnderWay
from hybrid.system.variables import STATE, Variables, named_values
from hybrid.system.watched import Watched, is_of_library

PREFIX = "delay"


@attrs.frozen
class Seen:
    """A function of the author's, which sees the components of the author alone.

    ``names`` are these, and ``at`` their places in the whole state.
    """

    function: Callable[..., Any]
    names: tuple[str, ...]
    at: tuple[int, ...]

    def __call__(self, t: Any, x: Any, p: Any) -> Any:
        """The value."""
        return self.function(t, named_values(STATE, self.names, [x[i] for i in self.at]), p)


@attrs.frozen
class SeenField:
    """A field of the author's with the rates of the clocks of lists, which are components themselves."""

    field: Seen
    rates: tuple[str, ...]

    def __call__(self, t: Any, x: Any, p: Any) -> Any:
        """The rates, in order."""
        return (*self.field(t, x, p), *(getattr(x, name) for name in self.rates))


@attrs.frozen
class ListChange:
    """What a jump does to a list: it ``fires`` at a tick of it, or ``begins`` a wait, or both."""

    places: Places
    fires: bool
    begins: bool


@attrs.frozen
class SeenReset:
    """A reset of the author's, or none, with the changes of lists; ``components`` are all of the state."""

    reset: Seen | None
    own: tuple[str, ...]
    changes: tuple[ListChange, ...]
    components: tuple[str, ...]

    def __call__(self, t: Any, x: Any, p: Any) -> Any:
        """The values after the reset, in order."""
        found = {name: getattr(x, name) for name in self.components}
        if self.reset is not None:
            found |= zip(self.own, self.reset(t, x, p), strict=True)
        after = named_values(STATE, self.components, found.values())
        for each in self.changes:
            # The duration counts as the jump leaves it, the list is that before.
            found |= each.places.after(x, each.places.wait(after, p), each.fires, each.begins)
        return tuple(found[name] for name in self.components)


def marks_alone(transition: Transition) -> bool:
    """Whether a transition changes nothing but lists, so that its author wrote a marker."""
    reset = None if transition.reset is None else transition.reset.function
    alone = isinstance(reset, SeenReset) and reset.reset is None
    return alone and transition.source == transition.target


def has_delays(transitions: Sequence[Transition]) -> bool:
    """Whether any transition has a delay that no component of the state stands for yet."""
    return any(isinstance(getattr(each, "guard", None), Delay) for each in transitions)


def check_under_way(names: Sequence[str], state: Sequence[str], transitions: Sequence[Transition]) -> None:
    """ModelError if what is under way has no component, or a new transition should begin waits, and cannot.

    Resets begin waits. Those of the library do so: they are made of others that do.
    """
    unknown = [name for name in names if name not in state]
    if unknown:
        raise ModelError(unknown_name("HybridSystem: under_way: component", unknown[0], state, STATE))
    named = {each.name: each for each in transitions}
    for each in transitions:
        clock = each.guard
        triggers = clock.delay.trigger if isinstance(clock, UnderWay) else ()
        for trigger in filter(None, map(named.get, triggers)):
            if trigger.reset is None or not is_of_library(trigger.reset.function):
                raise ModelError(
                    f"Transition {trigger.name!r}: the Delay of {each.name!r} follows it, and it has been "
                    "put into a system that was made before. Make the system anew with all transitions."
                )


def written_out(system: Any, variables: Variables) -> dict[str, Any]:
    """The fields that change of a system with delays, whose state has the ``variables`` of its author.

    Raises
    ------
    ModelError
        If the state has no names, a trigger does not exist or ends the run, or a duration reads a component
        that has a field.
    """
    if isinstance(system.state, int):
        raise ModelError(
            f"HybridSystem: a Delay adds components to the state, and the {system.state} components of this "
            "state have no names. Name them with state=."
        )
    if system.under_way:
        raise ModelError(
            "HybridSystem: the state already holds what other delays have under way. Make the system anew "
            "with all of its transitions."
        )
    return _Writing(system, variables).fields()


class _Writing:
    def __init__(self, system: Any, variables: Variables) -> None:
        self.system, self.own = system, variables
        self.transitions: tuple[Transition, ...] = system.transitions
        for each in self.transitions:
            if isinstance(each.guard, Delay):
                _check_trigger(each, self.transitions)
        self.lists = self._lists()
        every = list(dict.fromkeys(self.lists.values()))
        self.state = (*system.state, *(each.clock for each in every))
        self.held = (*system.held, *(name for each in every for name in each.due))
        counts = (name for each in every for name in (each.count, each.busy))
        self.counters = (*system.counters, *counts)
        self.names = (*self.state, *self.held, *self.counters)
        self.author = variables.state_names
        self.at = tuple(map(self.names.index, self.author))
        self.every = every

    def fields(self) -> dict[str, Any]:
        """The fields, by name."""
        system = self.system
        outputs = {name: each.changed(self._seen) for name, each in system.outputs.items()}
        return {
            "state": self.state,
            "held": self.held,
            "counters": self.counters,
            "modes": tuple(map(self._mode, system.modes)),
            "transitions": tuple(map(self._transition, self.transitions)),
            "outputs": type(system.outputs)(outputs),
            "units": {**system.units, **self._units()},
            "under_way": tuple(name for name in self.names if name not in self.author),
            "derived_from": Watched(self._read()).joined(system.derived_from),
        }

    def _units(self) -> dict[str, str]:
        """The units of clocks and due times, and of what counts, if that of time is known."""
        time, found = self.system.units.get("t"), dict[str, str]()
        for each in self.every if time is not None else ():
            found |= dict.fromkeys((each.clock, *each.due), str(time))
            found |= dict.fromkeys((each.count, each.busy), "1")
        return found

    def _read(self) -> Iterator[Any]:
        """What the author wrote, by which values from elsewhere may be read."""
        for mode in self.system.modes:
            yield mode.field
        for each in self.transitions:
            yield each.guard.function
            yield each.guard.when
            yield None if each.reset is None else each.reset.function
            if isinstance(each.guard, Clock):
                yield from filter(callable, each.guard.quantities)

    def _lists(self) -> dict[str, Places]:
        """The list of each transition with a delay, by its name.

        Of one mode, each transition has a list of its own. Those of several modes share theirs.
        """
        shared: dict[Any, list[Transition]] = {}
        for each in self.transitions:
            delay = each.guard
            if isinstance(delay, Delay):
                nth = sum(
                    other.source == each.source
                    for key, users in shared.items()
                    if key[:2] == (delay.trigger, delay.duration)
                    for other in users
                )
                shared.setdefault((delay.trigger, delay.duration, nth), []).append(each)
        free = self._free_prefixes()
        return {
            each.name: places
            for users in shared.values()
            for places in [self._places(users, next(free))]
            for each in users
        }

    def _places(self, users: Sequence[Transition], prefix: str) -> Places:
        delays = [each.guard for each in users if isinstance(each.guard, Delay)]
        always = {each.source for each in users if each.guard.when is None}
        most = max(each.places for each in delays)
        return Places(
            duration=delays[0].duration,
            is_held=bool(moving_numbers(users[0], self.own)),
            misses=len(always) < len(self.system.modes),
            clock=f"{prefix}_clock",
            due=tuple(f"{prefix}_due{i}" for i in range(most)),
            count=f"{prefix}_count",
            busy=f"{prefix}_busy",
        )

    def _free_prefixes(self) -> Iterator[str]:
        """Beginnings of names that no other name has."""
        taken = (*self.own.state_names, *self.own.parameters, *self.system.outputs)
        for k in count(1):
            prefix = PREFIX + (str(k) if k > 1 else "")
            if not any(name.startswith(f"{prefix}_") for name in taken):
                yield prefix

    def _seen(self, function: Callable[..., Any]) -> Seen:
        return Seen(function, self.author, self.at)

    def _mode(self, mode: Mode) -> Mode:
        rates = tuple(each.busy for each in self.every)
        return attrs.evolve(mode, field=SeenField(self._seen(mode.field), rates), jacobian=None)

    def _transition(self, transition: Transition) -> Transition:
        guard = transition.guard
        when = None if guard.when is None else self._seen(guard.when)
        new: Any
        if isinstance(guard, Delay):
            new = UnderWay(guard, self.lists[transition.name], when)
        elif isinstance(guard, Clock):
            written: Any = guard
            new = guard if when is None else attrs.evolve(written, when=when)
        else:
            new = attrs.evolve(guard, function=self._seen(guard.function), gradient=None, when=when)
        return attrs.evolve(transition, guard=new, reset=self._reset(transition))

    def _reset(self, transition: Transition) -> Reset | None:
        own = self.lists.get(transition.name)
        begins = {
            places
            for name, places in self.lists.items()
            for each in self.transitions
            if each.name == name and isinstance(each.guard, Delay) and transition.name in each.guard.trigger
        }
        changed = [each for each in self.every if each is own or each in begins]
        changes = tuple(ListChange(each, each is own, each in begins) for each in changed)
        if transition.target is None or (transition.reset is None and not changes):
            return None
        reset = None
        if transition.reset is not None:
            reset = self._seen(WholeReset(transition.reset.function, self.own.components))
        return Reset(SeenReset(reset, self.author, changes, self.names))


def _check_trigger(transition: Transition, transitions: Sequence[Transition]) -> None:
    """ModelError unless what a delay follows exists and leads on."""
    assert isinstance(transition.guard, Delay)
    known = {each.name: each for each in transitions}
    for name in transition.guard.trigger:
        if name not in known:
            what = f"Transition {transition.name!r}: Delay: trigger"
            raise ModelError(unknown_name(what, name, tuple(known), "Transitions"))
        if known[name].target is None:
            raise ModelError(
                f"Transition {transition.name!r}: Delay: trigger {name!r} has no target: it ends the run, "
                "and nothing follows. Name another transition."
            )
