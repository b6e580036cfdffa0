"""What the author of a model knows of its runs: laws that the properties of `hybrid.testing` check."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ModelError
from hybrid.system.checks import trial
from hybrid.system.elements import Function
from hybrid.system.labels import named
from hybrid.system.members import groups_in
from hybrid.system.outputs import Component, Output, function_in
from hybrid.system.portable import Portable
from hybrid.system.rows import fires, plain_firing
from hybrid.system.variables import Variables

NOT_NAMED = "be a function of (t, minus, plus, p)"
# Names of components that change sign when time is reversed, or the involution of the state.
Elastic = Iterable[str] | Callable[[Any], Any]
BY_NAME = "map names to functions of (t, x, p) or to names of outputs"


@attrs.frozen
class Law(Portable):
    """A quantity with a name, which says something in one mode, at one transition, or everywhere.

    Attributes
    ----------
    name
        The law in the author's words.
    of
        Name of a mode or of a transition; None for everywhere.
    quantity
        A function of ``(t, x, p)``, or ``(t, minus, plus, p)`` at a transition; or the name of a component or
        of an output, in place of which `placed` puts the component or the output itself.
    flow
        Another quantity, that which its rate is compared with.
    """

    name: str
    of: str | None
    quantity: Any
    flow: Any = None

    def in_mode(self, *names: str | None) -> Function | None:
        """The function of a mode with one of these names; None if the law says nothing there."""
        return function_in(self.quantity, *names) if self.of is None or self.of in names else None

    def flow_in(self, *names: str | None) -> Function | None:
        """The function that the rate is compared with in a mode with one of these names, or None."""
        return None if self.flow is None else function_in(self.flow, *names)

    @property
    def formulas(self) -> list[Function]:
        """Every function of the law."""
        whole = [each for each in (self.quantity, self.flow) if each is not None]
        return [f for each in whole for f in (each.functions if isinstance(each, Output) else [each])]


def _by_name(argument: str, given: Any, *, pairs: bool = False, at: str = "mode") -> tuple[Law, ...]:
    """The laws of an argument; with ``pairs`` a value may be a function and its flow."""
    if isinstance(given, tuple) and all(isinstance(each, Law) for each in given):
        return given
    if isinstance(given, list | tuple) and at == "mode":
        given = {arguments.instance(f"{argument}: a name", name, str): name for name in given}
    found = []
    for name, value in named(argument, given, BY_NAME).items():
        arguments.instance(f"{argument}: a name", name, str)
        inside = isinstance(value, Mapping)
        each_one = named(f"{argument}[{name!r}]", value, BY_NAME) if inside else {name: value}
        for each, function in each_one.items():
            arguments.instance(f"{argument}: a name", each, str)
            of = name if inside or at == "transition" else None
            found.append(Law(each, of, *_functions(f"{argument}: {each!r}", function, pairs, at)))
    return tuple(found)


def _functions(title: str, value: Any, pairs: bool, at: str) -> tuple[Any, Any]:
    both = value if isinstance(value, tuple | list) and pairs else (value, None)
    named_too = at == "mode"
    if (
        len(both) == 2
        and _is_quantity(both[0], named_too)
        and (both[1] is None or _is_quantity(both[1], True))
    ):
        return both[0], both[1]
    wanted = "be a function of (t, x, p) or the name of an output" if named_too else NOT_NAMED
    raise arguments.refusal(title, wanted + (", or a pair of them" if pairs else ""), value)


def _is_quantity(value: Any, named_too: bool) -> bool:
    return callable(value) or (named_too and isinstance(value, str))


def _invariant(given: Any) -> tuple[Law, ...]:
    return _by_name("invariant", given)


def _equal(given: Any) -> tuple[Law, ...]:
    return _by_name("equal", given)


def _conserved(given: Any) -> tuple[Law, ...]:
    return _by_name("conserved", given)


def _dissipated(given: Any) -> tuple[Law, ...]:
    return _by_name("dissipated", given, pairs=True)


def _across(given: Any) -> tuple[Law, ...]:
    return _by_name("across", given, at="transition")


def _balance(given: Any) -> tuple[Law, ...]:
    laws = _by_name("balance", given, pairs=True)
    for law in laws:
        if law.flow is None:
            raise arguments.refusal(
                f"balance: {law.name!r}",
                "be a pair of functions of (t, x, p), or of names of outputs: a quantity and its rate",
                law.quantity,
            )
    return laws


def _continuous(given: Any) -> tuple[str, ...]:
    names = arguments.items("continuous", given, "be names of transitions")
    return tuple(arguments.instance(f"continuous[{i}]", name, str) for i, name in enumerate(names))


def _alike(given: Any) -> tuple[str, ...]:
    names = arguments.items("alike", given, "be names of repeats")
    return tuple(arguments.instance(f"alike[{i}]", name, str) for i, name in enumerate(names))


def _elastic(given: Any) -> Elastic | None:
    if given is None or callable(given):
        return given
    wanted = "be names of components of the state, or a function of it"
    names = arguments.items("elastic", given, wanted)
    return tuple(arguments.instance(f"elastic[{i}]", name, str) for i, name in enumerate(names))


@attrs.frozen(kw_only=True)
class Laws(Portable):
    """What the author of a model knows: each law is one line, and finds the mistakes that break it.

    A law is a function of ``(t, x, p)`` under a name, which holds in every mode, or in one mode:
    ``{"energy": f}`` or ``{"flight": {"energy": f}}``. In place of a function it takes the name of an output
    of the system, or of a component; it then holds in the modes in which the output has a value. A list of
    names, ``["force"]``, is short for laws of the same names. In a system that has been split, the names of
    modes and transitions are those from before.

    Parameters
    ----------
    invariant
        Quantities that are never negative. Starts of drawn runs are where they are not. They find a wall that
        lets the state through: a wrong sign or direction, a swapped threshold, a forgotten transition, a
        mode that is left too late.
    equal
        Quantities that are zero, such as the speed of a block relative to the belt that carries it. Starts
        of drawn runs lie there. They find a mode that drifts off its surface, and a reset that misses it.
    conserved
        Quantities that never change, such as an energy. They find a force with a wrong sign or factor, a
        component that a reset forgets, a loss where none is meant. `hybrid.periodic_orbit` holds them at
        their values at the guess, `hybrid.continue_orbit` at those of the first orbit.
    dissipated
        Quantities that never grow; or pairs ``(quantity, power)``: it grows by no more than the integral of
        the power put in. They find friction that drives, a restitution above one, an impulse of the wrong
        sign.
    balance
        Pairs ``(quantity, rate)``: between two jumps the quantity changes by the integral of its rate. They
        find a term of a field that is missing, doubled, or has the wrong sign.
    continuous
        Names of transitions at which neither state nor field jumps, as where a soft contact begins. They find
        thresholds that differ between guard and field.
    across
        By transition a rule for its jumps, ``f(t, minus, plus, p)`` of the states before and after, which
        returns zeros, or True: ``{"impact": lambda t, minus, plus, p: plus.v + p.e * minus.v}``. Several
        rules have names, ``{"impact": {"momentum": f, "restitution": g}}``. They find wrong resets.
    elastic
        For a system that conserves energy: names of the components that change sign when time is reversed,
        or the involution of the state. A run with time reversed must return to its start.
    alike
        Names of repeats whose members are alike: to exchange two of them, in the state and among the
        parameters, exchanges what functions give, and changes nothing else. They find an index that is
        one off, a neighbour that is forgotten, and a number of one member that should be a parameter.

    Raises
    ------
    ArgumentError
        If a law is neither a function nor a name, or no pair of them where a pair is needed.

    Examples
    --------
    >>> import attrs, hybrid, models
    >>> from hybrid.testing import check_system
    >>> energy = lambda t, x, p: x.v**2 / 2 + p.g * x.q
    >>> laws = hybrid.Laws(invariant={"height": lambda t, x, p: x.q}, dissipated={"energy": energy})
    >>> ball = attrs.evolve(models.bouncing_ball(), laws=laws)
    >>> check_system(ball, examples=5).never_seen
    ()
    """

    invariant: tuple[Law, ...] = attrs.field(default=(), converter=_invariant)
    equal: tuple[Law, ...] = attrs.field(default=(), converter=_equal)
    conserved: tuple[Law, ...] = attrs.field(default=(), converter=_conserved)
    dissipated: tuple[Law, ...] = attrs.field(default=(), converter=_dissipated)
    balance: tuple[Law, ...] = attrs.field(default=(), converter=_balance)
    continuous: tuple[str, ...] = attrs.field(default=(), converter=_continuous)
    across: tuple[Law, ...] = attrs.field(default=(), converter=_across)
    elastic: Elastic | None = attrs.field(default=None, converter=_elastic)
    alike: tuple[str, ...] = attrs.field(default=(), converter=_alike)

    @property
    def in_modes(self) -> dict[str, tuple[Law, ...]]:
        """The laws of states, by kind."""
        kinds = ("invariant", "equal", "conserved", "dissipated", "balance")
        return {kind: getattr(self, kind) for kind in kinds}

    def joined(self, other: Laws) -> Laws:
        """These laws and others; of two about ``elastic`` the other one holds."""
        arguments.instance("other", other, Laws)
        both = {kind: (*laws, *getattr(other, kind)) for kind, laws in self.in_modes.items()}
        return Laws(
            **both,
            continuous=(*self.continuous, *other.continuous),
            across=(*self.across, *other.across),
            elastic=self.elastic if other.elastic is None else other.elastic,
            alike=(*self.alike, *other.alike),
        )


def placed(
    laws: Laws,
    variables: Variables,
    outputs: Mapping[str, Output],
    modes: Iterable[str],
    transitions: Iterable[str],
) -> Laws:
    """The laws of a model with these names; a law under the name of a mode holds in that mode.

    Names of outputs and components become these themselves.

    Raises
    ------
    ArgumentError
        If a mode, a transition or an output does not exist.
    ModelError
        If a function asks for a name that does not exist, or does not return a number.
    """
    modes, transitions = [*modes], [*transitions]
    found: dict[str, Any] = {}
    for kind, some in laws.in_modes.items():
        in_modes = [
            attrs.evolve(law, of=law.name) if law.of is None and law.name in modes else law for law in some
        ]
        for law in in_modes:
            if law.of is not None:
                arguments.known(f"{kind}: Mode", law.of, modes, "Modes")
        found[kind] = tuple(_with_quantities(law, kind, variables, outputs) for law in in_modes)
    if isinstance(laws.elastic, tuple):
        for name in laws.elastic:
            arguments.known("elastic: State component", name, variables.state_names, "State components")
    for name in laws.continuous:
        arguments.known("continuous: Transition", name, transitions, "Transitions")
    for name in laws.alike:
        repeats = groups_in((*variables.state_names, *variables.parameter_names))
        arguments.known("alike: Repeat", name, repeats, "Repeats")
    for law in laws.across:
        arguments.known("across: Transition", law.of, transitions, "Transitions")
        with fires(plain_firing(0)):
            trial(variables, f"across: {law.name!r}", law.quantity, of_jump=True)
    return attrs.evolve(laws, **found)


def _with_quantities(law: Law, kind: str, variables: Variables, outputs: Mapping[str, Output]) -> Law:
    """The law with a component or an output in place of its name; functions are called once."""

    def meant(what: Any, title: str) -> Any:
        if isinstance(what, str):
            names = variables.state_names
            known = (*outputs, *names)
            arguments.known(
                f"{title}: Output or state component", what, known, "Outputs and state components"
            )
            return outputs[what] if what in outputs else Component(names.index(what))
        if what is not None and not isinstance(what, Output | Component):
            _try(variables, title, what)
        return what

    title = f"{kind}: {law.name!r}"
    return attrs.evolve(law, quantity=meant(law.quantity, title), flow=meant(law.flow, f"{title}, its rate"))


def _try(variables: Variables, title: str, function: Function) -> None:
    """Call a law of states once, so that a slip in it shows up where it is written."""
    value = trial(variables, title, function)
    if isinstance(value, bool | np.bool_):
        raise ModelError(
            f"{title} returned {value}; a comparison has no size. Return the quantity itself: "
            "x.q for x.q >= 0."
        )
    if value is not None and np.size(value) != 1:
        raise ModelError(f"{title} must return one number; got {arguments.shown(value)}.")
