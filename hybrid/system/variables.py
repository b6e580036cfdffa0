"""States and parameters: names, sizes, and the form in which model functions get them."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Iterable, Mapping
from functools import cached_property, lru_cache
from math import isfinite
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError, ModelError, unknown_name
from hybrid.system.frozen import FrozenMapping
from hybrid.system.grouped import UnknownComponentError, grouped_class
from hybrid.system.labels import by_label, named
from hybrid.system.members import member_name, shared_names, spread

STATE = "State components"
PARAMETERS = "Parameters"
PAIRS = "Pairs"
# What model functions call them.
LETTERS = {STATE: "x", PARAMETERS: "p", PAIRS: "z"}
MOST_COMPONENTS = 1_000_000
# Number of named-value classes kept for later models with the same names.
MOST_CLASSES = 256


@lru_cache(MOST_CLASSES)
def plain_class(kind: str, names: tuple[str, ...]) -> type[Any]:
    """A plain namedtuple class with the given fields, which compiled code supports."""
    return namedtuple(kind.title().replace(" ", ""), names)


@lru_cache(MOST_CLASSES)
def _explaining_class(kind: str, names: tuple[str, ...]) -> type[Any]:
    if any(map(member_name, names)):
        return grouped_class(kind, LETTERS.get(kind, "x"), names, _explaining_class)

    def __getattr__(self: Any, name: str) -> Any:
        raise UnknownComponentError(unknown_name(kind.removesuffix("s"), name, names, kind))

    plain = plain_class(kind, names)

    def __getitem__(self: Any, key: Any) -> Any:
        if isinstance(key, str):
            getattr(self, key)
            letter = LETTERS.get(kind, "x")
            raise ModelError(f"{letter}[{key!r}] is written {letter}.{key}: names are attributes here.")
        return plain.__getitem__(self, key)

    methods = {"__slots__": (), "__getattr__": __getattr__, "__getitem__": __getitem__}
    return type(plain.__name__, (plain,), methods)


def named_values(kind: str, names: tuple[str, ...], values: Iterable[Any]) -> Any:
    """A named tuple of ``values``; an unknown field raises a ModelError that lists the known ones.

    Parameters
    ----------
    kind
        Plural noun for the names; it heads the list in the error text.
    names
        Field names, in order.
    values
        One value per name.

    Examples
    --------
    >>> x = named_values("State components", ("q", "v"), (1.0, 2.0))
    >>> x.v, x[0]
    (2.0, 1.0)
    """
    return _explaining_class(kind, names)._make(values)


@attrs.frozen(eq=False)
class Variables:
    """The state and the parameters of a system.

    Attributes
    ----------
    state
        Names of the components that have a field, or their number.
    parameters
        Default values by name.
    held
        Names of the components that only resets change.
    counters
        Names of the whole numbers that only resets change.
    under_way
        Those of all these names that hold what delays have under way: a start may leave them out.
    """

    state: tuple[str, ...] | int
    parameters: Mapping[str, float]
    held: tuple[str, ...] = ()
    counters: tuple[str, ...] = ()
    under_way: tuple[str, ...] = ()

    def __attrs_post_init__(self) -> None:
        if isinstance(self.state, int) and (self.held or self.counters):
            raise ModelError(
                f"HybridSystem: held and counters are read by name, and the {self.state} components of this "
                "state have none. Name them with state=."
            )
        kinds = {
            "a state": self.state_names[: self.moving],
            "a held component": self.held,
            "a counter": self.counters,
            "a parameter": self.parameters,
        }
        owner: dict[str, str] = {}
        for kind, names in kinds.items():
            for name in names:
                self._check_owner(owner, name, kind)
        for name in [*owner]:
            member = member_name(name)
            if member is not None:
                self._check_owner(owner, member.group, "a repeat")

    @staticmethod
    def _check_owner(owner: dict[str, str], name: str, kind: str) -> None:
        """ModelError if a name is that of another kind already."""
        other = owner.setdefault(name, kind)
        if other != kind:
            raise ModelError(
                f"HybridSystem: {name!r} is the name of {other} and of {kind}. A name means one "
                "thing; rename one of the two."
            )

    @cached_property
    def moving(self) -> int:
        """Number of components that have a field, the first ones."""
        return self.state if isinstance(self.state, int) else len(self.state)

    @cached_property
    def tangent_dimension(self) -> int:
        """Number of components that tangent vectors have: all but the counters, which come last."""
        return self.moving + len(self.held)

    @cached_property
    def dimension(self) -> int:
        """Number of state components ``n``: those with a field, those held, counters."""
        return self.tangent_dimension + len(self.counters)

    @cached_property
    def components(self) -> tuple[str, ...] | int:
        """Names of all components in order, or their number: what ``x`` is made of."""
        return self.state if isinstance(self.state, int) else (*self.state, *self.held, *self.counters)

    @cached_property
    def state_names(self) -> tuple[str, ...]:
        """Names of all components; ``x0, x1, ...`` if only their number was given."""
        names = self.components
        return tuple(f"x{i}" for i in range(names)) if isinstance(names, int) else names

    @cached_property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of their values."""
        return tuple(self.parameters)

    @cached_property
    def _shared_components(self) -> Mapping[str, tuple[str, ...]]:
        """Names for the components of all members of a repeat, if there are any."""
        return shared_names(self.state_names)

    @cached_property
    def _shared_parameters(self) -> Mapping[str, tuple[str, ...]]:
        """Names for the parameters of all members of a repeat, if there are any."""
        return shared_names(self.parameter_names)

    @cached_property
    def defaults(self) -> np.ndarray:
        """Default parameter vector ``(m,)``, read-only."""
        values = np.array(list(self.parameters.values()), dtype=float)
        values.flags.writeable = False
        return values

    def overrides(self, parameters: Mapping[str, Any] | None) -> dict[str, Any]:
        """The argument ``parameters`` of a call by the names of single parameters, not yet checked."""
        return spread("parameters", named("parameters", parameters), self._shared_parameters)

    def parameter_values(self, overrides: Mapping[str, float] | None = None) -> np.ndarray:
        """Parameter vector ``(m,)`` with the overrides applied; unknown names raise an ArgumentError."""
        values, names = self.defaults.copy(), self.parameter_names
        for name, number in self.overrides(overrides).items():
            arguments.known("parameters: Parameter", name, names, "Parameters")
            values[names.index(name)] = arguments.number(f"parameters: Parameter {name!r}", number)
        return values

    def as_units(self, value: object, outputs: Iterable[str] = ()) -> Mapping[str, str]:
        """Units by name of a component, of a parameter, of an output or of the time ``t``, read-only."""
        title, names = "HybridSystem: units", (*self.state_names, *self.parameter_names, *outputs, "t")
        given = spread(title, named(title, value, "map names to texts"), shared_names(names))
        for name, unit in given.items():
            arguments.known("HybridSystem: units: Name", name, names, "Names")
            arguments.instance(f"HybridSystem: units[{name!r}]", unit, str)
        return FrozenMapping(given)

    def as_angles(self, value: object) -> Mapping[str, float]:
        """Lengths of a turn by name of a component, read-only."""
        title, names = "HybridSystem: angles", self.state_names
        given = spread(
            title, named(title, value, "map names of the state to lengths of a turn"), self._shared_components
        )
        for name, turn in given.items():
            arguments.known("HybridSystem: angles: State component", name, names, STATE)
            given[name] = arguments.positive(f"HybridSystem: angles[{name!r}]", turn)
        return FrozenMapping(given)

    def cyclic_names(self, given: Iterable[str], angles: Iterable[str]) -> tuple[str, ...]:
        """Names of cyclic components; one name of a repeat stands for the components of all members."""
        title, names = "HybridSystem: cyclic", self.state_names[: self.tangent_dimension]
        found = [each for name in given for each in self._shared_components.get(name, (name,))]
        for name in found:
            arguments.known(f"{title}: State component", name, names, STATE)
            if name in angles:
                raise ModelError(
                    f"{title}: {name!r} is in angles= too. Orbits close up to whole turns of an angle, and "
                    "up to any shift of a cyclic component: leave it out of one of the two."
                )
        return tuple(dict.fromkeys(found))

    def state_values(self, name: str, value: object) -> np.ndarray:
        """A finite state ``(n,)`` from the argument ``name``: numbers in order, or with names as labels.

        Labels have a mapping, a Series of pandas, and a DataArray of xarray with a coordinate of names. Held
        components and counters are 0 where labels leave them out, or numbers in order stop before them, and
        so is what delays have under way.

        Raises
        ------
        ArgumentError
            If the shape is wrong, a component is missing, unknown or not finite, or a counter is no whole
            number.
        """
        names = self.state_names
        by_name = self.by_component(name, value)
        if by_name is not None:
            value = [by_name[component] for component in names]
        found = arguments.floats(value)
        if found is None:
            raise ArgumentError(
                f"{name} must hold {self.dimension} numbers; got {arguments.shown(value)}. "
                f"The state is {', '.join(names)}.{arguments.without_units(value)}"
            )
        found = self.completed(found)
        if found.shape != (self.dimension,):
            raise ArgumentError(
                f"{name} has shape {found.shape}; the state needs shape ({self.dimension},): "
                f"{', '.join(names)}."
            )
        values = found.tolist()
        if not all(map(isfinite, values)):
            pairs = zip(names, values, strict=True)
            component, bad = next(pair for pair in pairs if not isfinite(pair[1]))
            raise ArgumentError(f"{name}: component {component!r} must be finite; got {bad}.")
        if self.counters:
            self.check_counts(name, found)
        return found

    def completed(self, states: np.ndarray) -> np.ndarray:
        """States ``(..., n)``, with 0 for what is held, counts or is under way if others alone are given."""
        if states.ndim == 0 or states.shape[-1] not in self._given:
            return states
        found = np.zeros((*states.shape[:-1], self.dimension))
        found[..., self._given[states.shape[-1]]] = states
        return found

    @cached_property
    def _given(self) -> dict[int, list[int]]:
        """The places of the components that a start gives, by how many it gives, where that is not all."""
        own = [i for i, name in enumerate(self.state_names) if name not in self.under_way]
        moving = [i for i in own if i < self.moving]
        return {len(each): each for each in (moving, own) if len(each) < self.dimension}

    def check_counts(self, name: str, states: np.ndarray) -> None:
        """ArgumentError unless the counters of the states ``(..., n)`` in the argument ``name`` are whole."""
        for component, values in zip(self.counters, states.T[self.tangent_dimension :], strict=True):
            if np.any(values % 1.0):
                number = np.extract(values % 1.0, values)[0]
                raise ArgumentError(f"{name}: counter {component!r} must be a whole number; got {number}.")

    def by_component(self, name: str, value: object) -> dict[str, Any] | None:
        """What the argument ``name`` gives for each component, if it has labels; else None.

        Raises
        ------
        ArgumentError
            If a component is missing or unknown.
        """
        given = by_label(name, value)
        if given is None:
            return None
        given = spread(name, given, self._shared_components)
        for component in given:
            arguments.known(f"{name}: State component", component, self.state_names, "State components")
        given = dict.fromkeys((*self.state_names[self.moving :], *self.under_way), 0.0) | given
        missing = [component for component in self.state_names if component not in given]
        if missing:
            own = [component for component in self.state_names if component not in self.under_way]
            raise ArgumentError(
                f"{name} lacks {', '.join(missing)}. The state is {', '.join(own)}; give each a number."
            )
        return given

    def state_view(self, values: Any) -> Any:
        """The state as model functions get it: by name, or a read-only array without names."""
        if not isinstance(self.components, int):
            return named_values(STATE, self.components, values)
        view = np.asarray(values).view()
        view.flags.writeable = False
        return view

    def parameter_view(self, values: Iterable[Any]) -> Any:
        """The parameters as model functions get them, by name."""
        return self._parameter_class._make(values)

    @cached_property
    def _parameter_class(self) -> type[Any]:
        return _explaining_class(PARAMETERS, self.parameter_names)

    def described(self, t: float, x: np.ndarray, values: np.ndarray) -> str:
        """Text for a point, with the parameters that differ from their defaults."""
        changed = "".join(
            f", {name} = {value:.10g}"
            for (name, declared), value in zip(self.parameters.items(), values, strict=True)
            if value != declared
        )
        return f"at t = {t:.6g}, x = ({', '.join(f'{value:.6g}' for value in x)}){changed}"
