"""The model as a graph: modes are nodes with smooth fields, transitions are edges with guards and resets."""

from __future__ import annotations

import keyword
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError, ModelError, unknown_name
from hybrid.system.checks import probe_system
from hybrid.system.portable import Portable
from hybrid.system.variables import named_values

if TYPE_CHECKING:
    import networkx as nx

ModelFunction = Callable[..., Any]
# Node of the graph that stands for the end of a run.
END = "(end)"


def _callable(instance: Any, attribute: attrs.Attribute[Any], value: object) -> None:
    if not callable(value):
        raise ModelError(
            f"{type(instance).__name__}: {attribute.name} must be a function of (t, x, p); got {value!r}."
        )


def _optional_callable(instance: Any, attribute: attrs.Attribute[Any], value: object) -> None:
    if value is not None:
        _callable(instance, attribute, value)


def _optional_name(instance: Any, attribute: attrs.Attribute[Any], value: object) -> None:
    if value is not None:
        _nonempty_name(instance, attribute, value)


def _nonempty_name(instance: Any, attribute: attrs.Attribute[Any], value: object) -> None:
    if not isinstance(value, str) or not value:
        raise ModelError(
            f"{type(instance).__name__}: {attribute.name} must be a non-empty string; got {value!r}."
        )


def _name(instance: Any, attribute: attrs.Attribute[Any], value: object) -> None:
    arguments.instance(f"{type(instance).__name__}: {attribute.name}", value, str)


@attrs.frozen
class Guard(Portable):
    """A scalar function ``g(t, x, p)``; its transition fires when it crosses zero in its direction.

    Parameters
    ----------
    function
        ``g(t, x, p)``, one scalar.
    direction
        -1 fires from positive to negative, +1 from negative to positive, 0 both ways.
    gradient
        Optional ``(D_x g, D_t g)`` as a function of ``(t, x, p)`` that returns ``n + 1`` values, or
        ``n`` if the guard does not depend on time. Derived from ``function`` when left out.
    when
        Optional condition ``c(t, x, p)``, a scalar or a comparison: a crossing fires only if it is positive
        (or true) there, and is passed as if there were no guard if not. It is asked at crossings and at the
        entry of the mode only, and need not be continuous.
    at_start
        True for a guard whose crossings are not looked for: its transition fires only where a run starts in
        the mode, beyond the guard by more than rounding. ``direction`` says which side that is.

    Raises
    ------
    ModelError
        If a given function is not callable, ``direction`` is none of -1, 0, +1, or ``at_start`` is no bool or
        comes without a direction.
    """

    function: ModelFunction = attrs.field(validator=_callable)
    direction: int = attrs.field(default=0)
    gradient: ModelFunction | None = attrs.field(default=None, kw_only=True, validator=_optional_callable)
    when: ModelFunction | None = attrs.field(default=None, kw_only=True, validator=_optional_callable)
    at_start: bool = attrs.field(default=False, kw_only=True)

    @at_start.validator
    def _check_at_start(self, attribute: attrs.Attribute[bool], value: object) -> None:
        if not isinstance(value, bool):
            raise ModelError(f"Guard: at_start must be True or False; got {value!r}.")
        if value and self.direction == 0:
            raise ModelError(
                "Guard: at_start=True needs direction -1 or +1, the side that the mode excludes."
            )

    @direction.validator
    def _check_direction(self, attribute: attrs.Attribute[int], value: object) -> None:
        whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
        if not whole or value not in (-1, 0, 1):
            raise ModelError(
                f"Guard: direction must be -1 (falling), 0 (both) or +1 (rising); got {value!r}."
            )


@attrs.frozen
class Reset(Portable):
    """The map ``R(t, x, p)`` applied at the crossing; it returns one value per state.

    Parameters
    ----------
    function
        ``R(t, x, p)``, ``n`` values.
    jacobian
        Optional ``(t, x, p)`` function that returns the rows of ``D_x R``, each of ``n`` values, or of
        ``n + 1`` with ``D_t R`` last. Derived from ``function`` when left out.

    Raises
    ------
    ModelError
        If a given function is not callable.
    """

    function: ModelFunction = attrs.field(validator=_callable)
    jacobian: ModelFunction | None = attrs.field(default=None, kw_only=True, validator=_optional_callable)


@attrs.frozen
class Mode(Portable):
    """A smooth vector field ``f(t, x, p)``: a node of the graph.

    Parameters
    ----------
    name
        How transitions refer to it.
    field
        ``f(t, x, p)``, one value per state: the time derivative of the state.
    jacobian
        Optional ``(t, x, p)`` function that returns the rows of ``D_x f``, each of ``n`` values, or of
        ``n + 1`` with ``D_t f`` last. Derived from ``field`` when left out.

    Raises
    ------
    ModelError
        If the name is empty or a given function is not callable.
    """

    name: str = attrs.field(validator=_nonempty_name)
    field: ModelFunction = attrs.field(validator=_callable)
    jacobian: ModelFunction | None = attrs.field(default=None, kw_only=True, validator=_optional_callable)


def _as_guard(value: Any) -> Guard:
    if isinstance(value, Guard):
        return value
    raise ModelError(
        f"Transition: guard must be a Guard; got {value!r}. Write Guard(function, direction=...)."
    )


def _as_reset(value: Any) -> Reset | None:
    if value is None or isinstance(value, Reset):
        return value
    raise ModelError(
        f"Transition: reset must be a Reset or None (identity); got {value!r}. Write Reset(function)."
    )


@attrs.frozen
class Transition(Portable):
    """An edge of the graph: where it leaves from, where it leads, when it fires and what it does.

    A transition from a mode to itself without a reset changes nothing and only marks the crossing: a
    section.

    Parameters
    ----------
    source, target
        Names of modes; without a target (``None``) the run ends where the transition fires, with the status
        ``TERMINAL``.
    guard
        When it fires.
    reset
        What happens to the state there; ``None`` is the identity.
    accumulates_to
        Mode in which the state goes on after infinitely many jumps in finite time (chatter), of this
        transition alone or of several in turn. One of those in turn is enough to name the mode. Without it a
        run ends at the limit.
    name
        Defaults to ``"source->target"``, and to ``"source->(end)"`` without a target.

    Raises
    ------
    ModelError
        If guard or reset are of the wrong type, a name is empty, or there is a reset but no target.
    """

    source: str = attrs.field(validator=_nonempty_name)
    target: str | None = attrs.field(validator=_optional_name)
    guard: Guard = attrs.field(converter=_as_guard)
    reset: Reset | None = attrs.field(default=None, converter=_as_reset)
    accumulates_to: str | None = attrs.field(default=None, kw_only=True, validator=_optional_name)
    name: str = attrs.field(kw_only=True, validator=_nonempty_name)

    @reset.validator
    def _check_reset(self, attribute: attrs.Attribute[Reset | None], value: object) -> None:
        if value is not None and self.target is None:
            raise ModelError(
                f"Transition {self.source}->{END}: nothing follows a reset where there is no target. "
                "Leave the reset out, or name a target mode."
            )

    @accumulates_to.validator
    def _check_limit(self, attribute: attrs.Attribute[str | None], value: object) -> None:
        if value is not None and self.target is None:
            raise ModelError(
                f"Transition {self.source}->{END}: accumulates_to={value!r} is for transitions whose jumps "
                "may accumulate, and this one ends the run. Leave it out, or name a target mode."
            )

    @name.default
    def _default_name(self) -> str:
        return f"{self.source}->{END if self.target is None else self.target}"

    @property
    def is_marker(self) -> bool:
        """Whether it changes neither mode nor state, and so only marks a crossing."""
        return self.source == self.target and self.reset is None


def _check_identifiers(names: tuple[str, ...], kind: str) -> None:
    for name in names:
        if not isinstance(name, str) or not name.isidentifier() or keyword.iskeyword(name) or name[0] == "_":
            raise ModelError(
                f"HybridSystem: {kind} name {name!r} cannot be written as an attribute. Use a Python "
                "identifier that is no keyword and does not begin with an underscore."
            )
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ModelError(f"HybridSystem: {kind} names must differ; given twice: {', '.join(twice)}.")


def _as_modes(value: Iterable[Mode]) -> tuple[Mode, ...]:
    return tuple(arguments.items("HybridSystem: modes", value, "be a list of Mode objects"))


def _as_transitions(value: Iterable[Transition]) -> tuple[Transition, ...]:
    return tuple(arguments.items("HybridSystem: transitions", value, "be a list of Transition objects"))


def as_state(value: Any) -> tuple[str, ...] | int:
    """Names of the components of a state, or their number."""
    if isinstance(value, bool | str):
        raise ModelError(
            f"HybridSystem: state must be a tuple of names or a number of components; got {value!r}. "
            f"Write state=({value!r},) for one component."
        )
    if isinstance(value, int | np.integer):
        if value < 1:
            raise ModelError(f"HybridSystem: state needs at least one component; got {value}.")
        return int(value)
    # A set has no order.
    if not isinstance(value, Sequence | np.ndarray) or np.ndim(value) != 1:
        raise arguments.refusal("HybridSystem: state", "be a tuple of names or a number of components", value)
    names = tuple(value)
    if not names:
        raise ModelError("HybridSystem: state needs at least one component; got an empty sequence.")
    _check_identifiers(names, "state")
    return names


def as_parameters(value: Any) -> Mapping[str, float]:
    """Default values of parameters by name, read-only."""
    given = arguments.mapping("HybridSystem: parameters", value)
    _check_identifiers(tuple(given), "parameter")
    return MappingProxyType(
        {name: arguments.number(f"HybridSystem: parameter {name!r}", each) for name, each in given.items()}
    )


def _as_period(value: Any) -> Any:
    if value is None or callable(value):
        return value
    return arguments.positive("HybridSystem: period", value, "be a positive time or a function of p")


@attrs.frozen(eq=False)
class HybridSystem(Portable):
    """A hybrid (piecewise-smooth) dynamical system: modes joined by transitions.

    Model functions are plain Python on scalars, ``f(t, x, p)``, with ``x.q`` and ``p.e`` by name and
    NumPy functions for mathematics. They must be pure: they are traced once, not called in the loop. A field
    should be smooth: tangent vectors are not valid beyond a jump of it inside its mode.

    Parameters
    ----------
    state
        Names of the components, or their number ``n`` (then model functions get a plain array).
    parameters
        Default values by name; any call may override them.
    modes, transitions
        Nodes and edges. Among simultaneous crossings the transition listed first fires.
    period
        Forcing period, a number or a function of ``p``. Every model function must have this period in
        ``t``, which is checked; time is then kept as whole periods and a phase.
    name
        For reports and figures.

    Raises
    ------
    ModelError
        If names clash or do not exist, a mode cannot be reached, a function has the wrong arity or the
        wrong number of values, is not pure, or does not have the declared period.
    """

    state: tuple[str, ...] | int = attrs.field(kw_only=True, converter=as_state)
    parameters: Mapping[str, float] = attrs.field(factory=dict, kw_only=True, converter=as_parameters)
    modes: tuple[Mode, ...] = attrs.field(kw_only=True, converter=_as_modes)
    transitions: tuple[Transition, ...] = attrs.field(default=(), kw_only=True, converter=_as_transitions)
    period: float | ModelFunction | None = attrs.field(default=None, kw_only=True, converter=_as_period)
    name: str = attrs.field(default="", kw_only=True, validator=_name)
    # What compile_system makes of the system: it lives as long as the system, and is not part of it.
    _compiled: Any = attrs.field(default=None, init=False, repr=False)

    def __attrs_post_init__(self) -> None:
        self._check_graph()
        probe_system(self)

    @property
    def dimension(self) -> int:
        """Number of state components ``n``."""
        return self.state if isinstance(self.state, int) else len(self.state)

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the components; ``x0, x1, ...`` if only their number was given."""
        return tuple(f"x{i}" for i in range(self.state)) if isinstance(self.state, int) else self.state

    @cached_property
    def mode_names(self) -> tuple[str, ...]:
        """Names of the modes in the order of their indices."""
        return tuple(mode.name for mode in self.modes)

    @cached_property
    def transition_names(self) -> tuple[str, ...]:
        """Names of the transitions in the order of their indices."""
        return tuple(transition.name for transition in self.transitions)

    @cached_property
    def graph(self) -> nx.MultiDiGraph:
        """The modes and transitions as a networkx graph, for looking at, checking and drawing.

        Nodes carry ``mode``, edges are keyed by the transition's name and carry ``transition``. Transitions
        that end the run lead to the node ``"(end)"``, which carries no mode.
        """
        import networkx as nx

        graph = nx.MultiDiGraph(name=self.name)
        for mode in self.modes:
            graph.add_node(mode.name, mode=mode)
        for transition in self.transitions:
            target = END if transition.target is None else transition.target
            graph.add_edge(transition.source, target, key=transition.name, transition=transition)
            if transition.accumulates_to is not None:
                limit = f"limit of {transition.name}"
                graph.add_edge(transition.source, transition.accumulates_to, key=limit, transition=transition)
        return graph

    def mode_index(self, name: str) -> int:
        """Index of a mode; ModelError with the available names if there is none."""
        if not isinstance(name, str) or name not in self.mode_names:
            raise ModelError(unknown_name("Mode", name, self.mode_names, "Modes"))
        return self.mode_names.index(name)

    def transition_index(self, name: str | Transition) -> int:
        """Index of a transition given by name or object; ModelError with the available names if none."""
        key = name.name if isinstance(name, Transition) else name
        if not isinstance(key, str) or key not in self.transition_names:
            raise ModelError(unknown_name("Transition", key, self.transition_names, "Transitions"))
        return self.transition_names.index(key)

    def parameter_values(self, overrides: Mapping[str, float] | None = None) -> np.ndarray:
        """Parameter vector ``(m,)`` with the given overrides; ArgumentError for unknown names."""
        values = dict(self.parameters)
        for name, number in arguments.mapping("parameters", overrides).items():
            arguments.known("parameters: Parameter", name, values, "Parameters")
            values[name] = arguments.number(f"parameters: Parameter {name!r}", number)
        return np.array(list(values.values()), dtype=float)

    def forcing_period(self, overrides: Mapping[str, float] | None = None) -> float | None:
        """Forcing period at the given parameters, or None if the system declares none."""
        return None if self.period is None else period_at(self, self.parameter_values(overrides))

    def _check_graph(self) -> None:
        if not self.modes:
            raise ModelError("HybridSystem: at least one mode is needed; got none.")
        for what, items, kind in (("mode", self.modes, Mode), ("transition", self.transitions, Transition)):
            for item in items:
                if not isinstance(item, kind):
                    raise ModelError(f"HybridSystem: each {what} must be a {kind.__name__}; got {item!r}.")
            names = [item.name for item in items]
            if END in names:
                raise ModelError(
                    f"HybridSystem: {what} name {END!r} stands for the end of a run. Choose another name."
                )
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise ModelError(
                    f"HybridSystem: {what} names must differ; given twice: {', '.join(twice)}. "
                    f"Give each {what} a name of its own."
                )
        for transition in self.transitions:
            for end in ("source", "target", "accumulates_to"):
                name = getattr(transition, end)
                if name is not None and name not in self.mode_names:
                    what = f"Transition {transition.name!r}: {end} mode"
                    raise ModelError(unknown_name(what, name, self.mode_names, "Modes"))
        self._check_reachable()

    def _check_reachable(self) -> None:
        """A mode that no transition enters or leaves, in a system of several, is a slip of the pen."""
        linked = set()
        for transition in self.transitions:
            ends = {transition.source, transition.target, transition.accumulates_to} - {None}
            linked |= ends if len(ends) > 1 else set()
        lonely = [name for name in self.mode_names if name not in linked]
        if len(self.modes) > 1 and lonely:
            raise ModelError(
                f"HybridSystem: no transition joins mode {lonely[0]!r} to the others. Modes: "
                f"{', '.join(self.mode_names)}. Add a transition, or make it a system of its own."
            )


def period_at(system: HybridSystem, values: np.ndarray) -> float | None:
    """Forcing period of a system at a parameter vector ``(m,)``, or None if it declares none."""
    value: Any = system.period
    if value is None:
        return None
    if callable(value):
        value = value(named_values("Parameters", tuple(system.parameters), values))
    period = arguments.number("HybridSystem: period", value)
    if period <= 0:
        raise ArgumentError(f"HybridSystem: period must be positive; got {period}. Check the parameters.")
    return period


def as_system(name: str, value: object) -> HybridSystem:
    """A system, or an ArgumentError that begins with the name of the argument."""
    return arguments.instance(name, value, HybridSystem, "Call the model's factory first.")
