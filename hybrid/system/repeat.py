"""Many of a kind: what each member has, written once."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import attrs

from hybrid import arguments
from hybrid.errors import ModelError
from hybrid.system.clocks import Clock
from hybrid.system.elements import Function, Guard, Reset, Transition
from hybrid.system.frozen import FrozenMapping
from hybrid.system.labels import named, plain_name
from hybrid.system.laws import Laws
from hybrid.system.members import RESERVED, entries, full_name, is_identifier, member_name
from hybrid.system.outputs import Output, as_outputs
from hybrid.system.portable import Portable

OF_MEMBER = "t, x, p, i"
NESTED = (
    "A repeat inside of a repeat is not supported: write one repeat of all, and find its place with "
    "divmod(i, length)."
)


@attrs.frozen(eq=False)
class Repeat(Portable):
    """What `repeat` returns: the argument ``repeats`` of `HybridSystem` makes ordinary components of it.

    Attributes
    ----------
    name, count
        Name of the members, and their number.
    state, held, counters
        Names of the components of each member.
    parameters
        Default values by name, one for each member.
    field
        A function of ``(t, x, p, i)``, or functions by mode.
    transitions
        Those of each member.
    units, angles, outputs, laws
        As those of a `HybridSystem`, by names of a member.
    """

    name: str
    count: int
    state: tuple[str, ...]
    held: tuple[str, ...]
    counters: tuple[str, ...]
    parameters: Mapping[str, tuple[float, ...]]
    field: Function | Mapping[str, Function] | None
    transitions: tuple[Transition, ...]
    units: Mapping[str, str]
    angles: Mapping[str, float]
    outputs: Mapping[str, Output]
    laws: Laws

    @property
    def components(self) -> tuple[str, ...]:
        """Names of all components of a member, in order."""
        return (*self.state, *self.held, *self.counters)


def repeat(
    name: str,
    count: int,
    *,
    state: Iterable[str] = (),
    held: Iterable[str] = (),
    counters: Iterable[str] = (),
    parameters: Mapping[str, float | Sequence[float]] | None = None,
    field: Function | Mapping[str, Function] | None = None,
    transitions: Iterable[Transition] = (),
    units: Mapping[str, str] | None = None,
    angles: Mapping[str, float] | None = None,
    outputs: Mapping[str, Any] | None = None,
    laws: Laws | None = None,
) -> Repeat:
    """Many of a kind, such as the cells of a battery: what each has is written once, with an index ``i``.

    ``HybridSystem(repeats=[...])`` makes ordinary components, parameters and transitions of it. Those of
    member 3 of the repeat ``cell`` have names such as ``cell[3].soc``, and ``cell.soc`` stands for that of
    all members, wherever the library takes a name. Model functions, also those of the system itself, read
    ``x.cell[3].soc``, ``p.cell[3].R``, ``len(x.cell)``, ``sum(each.soc for each in x.cell)``, and
    ``x.cell.soc`` as an array; ``x.cell[-1]`` is the last member, as in any sequence.

    Parameters
    ----------
    name
        Name of the members, a Python identifier.
    count
        Their number, 1 or more.
    state, held, counters
        Names of the components of each member, as in `HybridSystem`.
    parameters
        Default values by name: one number for all members, or a list with one for each. What has one value
        for the system is better a parameter of the system.
    field
        ``f(t, x, p, i)`` returns the rates of the ``state`` of member ``i``: a dict by name, or all in order.
        ``i`` is a plain whole number. One function for all modes, or a dict with one for each mode.
    transitions
        Each is made for each member. All its functions, and those of its clock, have the index ``i`` as last
        argument. A reset returns what changes, by name: the names of a member are its own components;
        others are written in full, ``"cell[4].u"``, ``"cell.u"`` or ``"v"`` of the system. A clock
        reads the member's parameters and held components by their short names, ``Every("period")``; the
        time of an `After` is that since the entry of the mode, which all members share.
        The transition ``empty`` of member 3 has the name ``cell[3].empty``. Of transitions that fire at one
        instant those of member 0 come first, in listed order, then those of member 1, behind those of
        the system itself.
    units, angles, outputs, laws
        As in `HybridSystem`, for each member: names are those of a member, functions have the index ``i``
        as last argument.

    Returns
    -------
    Repeat
        For ``HybridSystem(repeats=[...])``.

    Raises
    ------
    ModelError
        If a name cannot be written as an attribute, the number of members or of values of a parameter is
        wrong, a function does not take the index, or a name is not that of a member.

    Examples
    --------
    >>> import hybrid
    >>> cells = hybrid.repeat(
    ...     "cell",
    ...     3,
    ...     state=("soc",),
    ...     held=("on",),
    ...     parameters={"capacity": [3600.0, 3000.0, 3600.0]},
    ...     field=lambda t, x, p, i: {"soc": -x.cell[i].on * p.current / p.cell[i].capacity},
    ...     transitions=[
    ...         hybrid.Transition(
    ...             "run",
    ...             "run",
    ...             hybrid.Guard(lambda t, x, p, i: x.cell[i].soc - p.low, -1),
    ...             hybrid.Reset(lambda t, x, p, i: {"on": 0.0}),
    ...             name="empty",
    ...         )
    ...     ],
    ... )
    >>> pack = hybrid.HybridSystem(
    ...     parameters={"current": 1.0, "low": 0.1},
    ...     repeats=[cells],
    ...     modes=[hybrid.Mode("run", lambda t, x, p: ())],
    ... )
    >>> arc = hybrid.simulate(pack, {"cell.soc": 1.0, "cell.on": 1.0}, (0.0, 3000.0))
    >>> arc.jumps[0].transition, arc["cell.soc"][-1].round(3)
    ('cell[1].empty', array([0.167, 0.1  , 0.167]))
    """
    if not is_identifier(name):
        nested = f" {NESTED}" if isinstance(name, str) and "[" in name else ""
        raise ModelError(
            "repeat: name must be a Python identifier that is not a keyword and does not begin with an "
            f"underscore; got {arguments.shown(name)}.{nested}"
        )
    name, title = plain_name(name), f"repeat {name!r}"
    number = arguments.count(f"{title}: count", count, 1)
    components = {
        kind: _names(f"{title}: {kind}", value)
        for kind, value in (("state", state), ("held", held), ("counters", counters))
    }
    found = Repeat(
        name,
        number,
        **components,
        parameters=_parameters(title, parameters, number),
        field=_field(title, field, components["state"]),
        transitions=_transitions(title, transitions),
        units=FrozenMapping(named(f"{title}: units", units, "map names to texts")),
        angles=FrozenMapping(named(f"{title}: angles", angles)),
        outputs=as_outputs({} if outputs is None else outputs, title),
        laws=arguments.instance(f"{title}: laws", Laws() if laws is None else laws, Laws),
    )
    _check_names(title, found)
    _check_functions(title, found)
    return found


def _names(title: str, value: Iterable[str]) -> tuple[str, ...]:
    names = tuple(map(plain_name, arguments.items(title, value, "be a tuple of names")))
    for name in names:
        if not is_identifier(name):
            raise ModelError(
                f"{title}: {arguments.shown(name)} cannot be written as an attribute. Use a Python "
                "identifier that is not a keyword and does not begin with an underscore."
            )
    return names


def _parameters(title: str, value: Any, count: int) -> Mapping[str, tuple[float, ...]]:
    given = named(f"{title}: parameters", value, "map names to a number for all members or one for each")
    _names(f"{title}: parameters", given)
    found: dict[str, tuple[float, ...]] = {}
    for name, each in given.items():
        what = f"{title}: parameter {name!r}"
        found[name] = tuple(arguments.number(what, number) for number in entries(what, each, count))
    return FrozenMapping(found)


def _field(title: str, value: Any, state: tuple[str, ...]) -> Any:
    wanted = f"be a function of ({OF_MEMBER}), or map modes to such functions"
    if value is None:
        if state:
            raise ModelError(
                f"{title}: field is missing: the components {', '.join(state)} need rates. Give field=, or "
                "declare what resets alone change with held=."
            )
        return None
    functions = named(f"{title}: field", value, wanted) if isinstance(value, Mapping) else {"": value}
    for each in functions.values():
        if not callable(each):
            raise arguments.refusal(f"{title}: field", wanted, each)
    return FrozenMapping(functions) if isinstance(value, Mapping) else value


def _transitions(title: str, value: Any) -> tuple[Transition, ...]:
    found = tuple(arguments.items(f"{title}: transitions", value, "be a list of Transition objects"))
    for each in found:
        if isinstance(each, Repeat):
            raise ModelError(f"{title}: transitions holds {each.name!r}, which is a repeat. {NESTED}")
        arguments.instance(f"{title}: each transition", each, Transition)
    return found


def _check_names(title: str, repeated: Repeat) -> None:
    """ModelError if two things of a member have one name."""
    kinds = {
        "state": repeated.state,
        "held": repeated.held,
        "counters": repeated.counters,
        "parameters": tuple(repeated.parameters),
        "outputs": tuple(repeated.outputs),
    }
    owner: dict[str, str] = {}
    for kind, names in kinds.items():
        for name in names:
            if name in owner:
                raise ModelError(
                    f"{title}: {name!r} stands in {owner[name]} and in {kind}. A name means one thing; "
                    "rename one of the two."
                )
            owner[name] = kind
    for what, given in (("units", repeated.units), ("angles", repeated.angles)):
        known = owner if what == "units" else repeated.components
        for name in given:
            arguments.known(f"{title}: {what}: Name", name, known, "Names of a member")
    transitions = [each.name for each in repeated.transitions]
    for each in (*transitions, *repeated.outputs):
        if member_name(full_name(repeated.name, 0, each)) is None:
            raise ModelError(
                f"{title}: {each!r} cannot be the name of a transition or an output of a member. "
                f"Leave out the signs {' '.join(RESERVED)}; a transition has the argument name=."
            )
    twice = sorted({name for name in transitions if transitions.count(name) > 1})
    if twice:
        raise ModelError(
            f"{title}: transition names must differ; given twice: {', '.join(twice)}. Give each transition "
            "its own name."
        )


def _check_functions(title: str, repeated: Repeat) -> None:
    """ModelError if a function does not take the index of a member."""
    field = repeated.field
    for each in field.values() if isinstance(field, Mapping) else [field]:
        _check_arguments(f"{title}: field", each, OF_MEMBER)
    for transition in repeated.transitions:
        owner, guard = f"{title}: transition {transition.name!r}", transition.guard
        functions = {"condition": guard.when}
        if isinstance(guard, Guard):
            functions |= {"guard": guard.function, "gradient": guard.gradient}
        if isinstance(transition.reset, Reset):
            functions |= {"reset": transition.reset.function, "jacobian": transition.reset.jacobian}
        for what, function in functions.items():
            _check_arguments(f"{owner}: {what}", function, OF_MEMBER)
        for quantity in guard.quantities if isinstance(guard, Clock) else ():
            if callable(quantity):
                _check_arguments(f"{owner}: number of the clock", quantity, "p, i")
    for output in repeated.outputs.values():
        for formula in output.formulas:
            _check_arguments(f"{title}: {output.title(formula)}", formula.function, OF_MEMBER)


def _check_arguments(title: str, function: Callable[..., Any] | None, signature: str) -> None:
    if function is None:
        return
    try:
        expected = inspect.signature(function)
    except (TypeError, ValueError):  # some builtins and ufuncs have no signature
        return
    try:
        expected.bind(*signature.split(", "))
    except TypeError as error:
        raise ModelError(
            f"{title} must take ({signature}), the last one the index of the member; got a function of "
            f"{expected}: {error}."
        ) from None
