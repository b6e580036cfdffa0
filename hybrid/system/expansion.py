"""The members of repeats as ordinary components, parameters, transitions and outputs of a system."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import attrs

from hybrid import arguments
from hybrid.errors import ModelError, unknown_name
from hybrid.system.clocks import Clock
from hybrid.system.delay import Delay
from hybrid.system.elements import Guard, Mode, Reset, Transition
from hybrid.system.frozen import FrozenMapping
from hybrid.system.laws import Law, Laws
from hybrid.system.member_functions import JoinedField, MemberFunction, MemberReset, Part
from hybrid.system.members import full_name, member_name, shared_names
from hybrid.system.outputs import Output
from hybrid.system.repeat import Repeat


def as_repeats(value: Iterable[Repeat]) -> tuple[Repeat, ...]:
    """The repeats as a tuple."""
    found = arguments.items("HybridSystem: repeats", value, "be a list of what hybrid.repeat returns")
    for each in found:
        arguments.instance("HybridSystem: each repeat", each, Repeat, "Make one with hybrid.repeat.")
    return tuple(found)


def expanded(system: Any) -> dict[str, Any]:
    """The fields of a :class:`hybrid.HybridSystem` with the members of its repeats in them, by name.

    Raises
    ------
    ModelError
        If a name is taken, the state has no names, a field lacks a mode, or a mode gives its derivative.
    """
    repeats = system.repeats
    _check(system)
    members = [(each, i) for each in repeats for i in range(each.count)]

    def names(kind: str) -> tuple[str, ...]:
        own = getattr(system, kind)
        return (*own, *(full_name(r.name, i, name) for r, i in members for name in getattr(r, kind)))

    def mapping(kind: str) -> dict[str, Any]:
        own = dict(getattr(system, kind))
        return own | {
            full_name(r.name, i, name): each for r, i in members for name, each in getattr(r, kind).items()
        }

    parameters = dict(system.parameters)
    for each, i in members:
        parameters |= {full_name(each.name, i, name): v[i] for name, v in each.parameters.items()}
    return {
        "state": names("state"),
        "held": names("held"),
        "counters": names("counters"),
        "parameters": FrozenMapping(parameters),
        "modes": tuple(_mode(system, mode) for mode in system.modes),
        "transitions": _waiting_for_all(
            (*system.transitions, *(t for each, i in members for t in _transitions(each, i)))
        ),
        "units": mapping("units"),
        "angles": mapping("angles"),
        "outputs": FrozenMapping(dict(system.outputs) | _outputs(members)),
        "laws": _joined_laws(system.laws, members),
    }


def _check(system: Any) -> None:
    if isinstance(system.state, int):
        raise ModelError(
            f"HybridSystem: repeats= needs a state with names; got state={system.state}. Name its "
            "components, or leave them out: state=()."
        )
    own = (*system.state, *system.held, *system.counters)
    taken = {*own, *system.parameters, *system.outputs}
    taken |= {parts.group for name in [*taken] if (parts := member_name(name))}
    for repeated in system.repeats:
        if repeated.name in taken:
            raise ModelError(
                f"HybridSystem: repeat {repeated.name!r}: the name is taken by a component, a parameter, an "
                "output or another repeat. A name means one thing; rename one of the two."
            )
        taken.add(repeated.name)
        shared = [name for name in repeated.components if name in own]
        if shared:
            raise ModelError(
                f"HybridSystem: repeat {repeated.name!r}: {shared[0]!r} is a component of each member and of "
                "the system, so a reset of a member could not tell which one it changes. Rename one of them."
            )
    _check_modes(system)


def _check_modes(system: Any) -> None:
    modes = [mode.name for mode in system.modes if isinstance(mode, Mode)]
    for mode in system.modes:
        if isinstance(mode, Mode) and mode.jacobian is not None:
            raise ModelError(
                f"Mode {mode.name!r}: jacobian= cannot be given in a system with repeats, whose members "
                "it lacks. Omit it: the library derives it."
            )
    for repeated in system.repeats:
        if not isinstance(repeated.field, Mapping):
            continue
        title = f"repeat {repeated.name!r}: field"
        for name in repeated.field:
            if name not in modes:
                raise ModelError(unknown_name(f"{title}: mode", name, modes, "Modes"))
        missing = [name for name in modes if name not in repeated.field]
        if missing:
            raise ModelError(f"{title} lacks the mode {missing[0]!r}. Give a function for each mode.")


def _mode(system: Any, mode: Any) -> Any:
    """The mode with the rates of the members; what is no mode is refused later."""
    if not isinstance(mode, Mode):
        return mode
    parts = []
    for each in system.repeats:
        function = each.field[mode.name] if isinstance(each.field, Mapping) else each.field
        if function is not None:
            parts.append(Part(each.name, each.count, each.state, function))
    return attrs.evolve(mode, field=JoinedField(mode.field, system.state, tuple(parts)))


def _transitions(repeated: Repeat, i: int) -> Iterator[Transition]:
    """The transitions of a member."""
    for each in repeated.transitions:
        guard, reset = each.guard, each.reset
        if isinstance(guard, Guard):
            names = ("function", "gradient", "when")
            guard = attrs.evolve(guard, **{name: _own(repeated, i, getattr(guard, name)) for name in names})
        else:
            guard = _clock(repeated, i, guard)
        if reset is not None:
            function = MemberReset(reset.function, repeated.name, i, repeated.components)
            reset = Reset(function, jacobian=_own(repeated, i, reset.jacobian))
        name = full_name(repeated.name, i, each.name)
        yield attrs.evolve(each, guard=guard, reset=reset, name=name)


def _waiting_for_all(transitions: tuple[Transition, ...]) -> tuple[Transition, ...]:
    """Transitions whose delays wait for those of all members where they name them together."""
    shared = shared_names(tuple(each.name for each in transitions if isinstance(each, Transition)))
    found = []
    for each in transitions:
        if isinstance(each, Transition) and isinstance(each.guard, Delay):
            trigger = tuple(name for given in each.guard.trigger for name in shared.get(given, (given,)))
            each = attrs.evolve(each, guard=attrs.evolve(each.guard, trigger=trigger))
        found.append(each)
    return tuple(found)


def _clock(repeated: Repeat, i: int, clock: Clock) -> Clock:
    """A clock with the numbers of a member."""
    known = (*repeated.parameters, *repeated.components)

    def own(quantity: Any) -> Any:
        return _own(repeated, i, quantity, known)

    fields = [field.name for field in attrs.fields(type(clock)) if field.init]
    changed: dict[str, Any] = {}
    if isinstance(clock, Delay):
        # A member waits for its own transitions, unless another name is written in full.
        fields.remove("trigger")
        known_here = {each.name for each in repeated.transitions}
        changed["trigger"] = tuple(
            full_name(repeated.name, i, name) if name in known_here else name for name in clock.trigger
        )
    for name in fields:
        value = getattr(clock, name)
        changed[name] = tuple(map(own, value)) if isinstance(value, tuple) else own(value)
    return attrs.evolve(clock, **changed)


def _outputs(members: Iterable[tuple[Repeat, int]]) -> dict[str, Output]:
    found = {}
    for each, i in members:
        for name, output in each.outputs.items():
            own = output.changed(lambda function, i=i: MemberFunction(function, i))
            full = full_name(each.name, i, name)
            found[full] = attrs.evolve(own, name=full)
    return found


def _joined_laws(own: Laws, members: Iterable[tuple[Repeat, int]]) -> Laws:
    """The laws of a system with those of the members."""
    found, elastic = own, list[str]()
    for repeated, i in members:
        found = found.joined(_laws(repeated, i))
        elastic += _elastic(repeated, i)
    if not elastic:
        return found
    if callable(own.elastic):
        raise ModelError(
            "HybridSystem: laws: elastic is a function of the whole state, and the laws of members name "
            f"{elastic[0]!r} besides. Give it in one place."
        )
    return attrs.evolve(found, elastic=(*(own.elastic or ()), *elastic))


def _elastic(repeated: Repeat, i: int) -> list[str]:
    """The components of a member that change sign when time is reversed."""
    names = repeated.laws.elastic
    if callable(names):
        raise ModelError(
            f"repeat {repeated.name!r}: laws: elastic must be names of components of a member; got a "
            "function. An involution of the whole state belongs to the laws of the system."
        )
    return [_own_name(repeated, i, name, repeated.components) for name in names or ()]


def _laws(repeated: Repeat, i: int) -> Laws:
    """The laws of a member that are no involution, by full names."""
    known, transitions = (*repeated.components, *repeated.outputs), [t.name for t in repeated.transitions]
    laws = repeated.laws

    def law(each: Law) -> Law:
        name = full_name(repeated.name, i, each.name)
        quantity, flow = (_own(repeated, i, what, known) for what in (each.quantity, each.flow))
        return Law(name, each.of, quantity, flow)

    if laws.alike:
        raise ModelError(
            f"repeat {repeated.name!r}: laws: alike names repeats, which members do not have; got "
            f"{', '.join(laws.alike)}. Give it to the laws of the system."
        )
    return Laws(
        **{kind: tuple(map(law, some)) for kind, some in laws.in_modes.items()},
        continuous=tuple(_own_name(repeated, i, name, transitions) for name in laws.continuous),
        across=tuple(
            attrs.evolve(law(each), of=_own_name(repeated, i, str(each.of), transitions))
            for each in laws.across
        ),
    )


def _own(repeated: Repeat, i: int, what: Any, known: Iterable[str] = ()) -> Any:
    """A name or a function of a member as one of the system; another value as it is."""
    if isinstance(what, str):
        return _own_name(repeated, i, what, known)
    return MemberFunction(what, i) if callable(what) else what


def _own_name(repeated: Repeat, i: int, name: str, known: Iterable[str]) -> str:
    """The full name of what a member calls ``name``; that of the system otherwise."""
    return full_name(repeated.name, i, name) if name in known else name
