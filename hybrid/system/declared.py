"""What a model declares of its variables: names with values, what is held, what turns, what counts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from hybrid import arguments
from hybrid.errors import ModelError
from hybrid.system.frozen import FrozenMapping
from hybrid.system.labels import named, plain_name
from hybrid.system.members import is_component_name
from hybrid.system.variables import MOST_COMPONENTS


def as_state(value: Any) -> tuple[str, ...] | int:
    """Names of the components of a state, or their number."""
    if isinstance(value, bool | str):
        raise ModelError(
            "HybridSystem: state must be a tuple of names or a number of components; got "
            f"{arguments.shown(value)}. Write state=({arguments.shown(value)},) for one component."
        )
    components = arguments.whole_number(value)
    if components is not None:
        if components < 1:
            shown = arguments.shown(components)
            raise ModelError(f"HybridSystem: state needs at least one component; got {shown}.")
        if components > MOST_COMPONENTS:
            raise ModelError(
                f"HybridSystem: state has at most {MOST_COMPONENTS} components; got "
                f"{arguments.shown(components)}."
            )
        return components
    # A set has no order.
    if not isinstance(value, Sequence) and not (isinstance(value, np.ndarray) and value.ndim == 1):
        raise arguments.refusal("HybridSystem: state", "be a tuple of names or a number of components", value)
    names = tuple(map(plain_name, value))
    _check_identifiers(names, "state")
    return names


def as_held(value: Any) -> tuple[str, ...]:
    """Names of held components."""
    return _as_names(value, "held")


def as_cyclic(value: Iterable[str]) -> tuple[str, ...]:
    """Names of cyclic components, which need not be attributes: ``cell[1].y``."""
    title, wanted = "HybridSystem: cyclic", "be names of components of the state, such as ('y',)"
    given = arguments.items(title, value, wanted)
    if not all(isinstance(each, str) for each in given):
        raise arguments.refusal(title, wanted, value)
    return tuple(given)


def as_counters(value: Any) -> tuple[str, ...]:
    """Names of counters."""
    return _as_names(value, "counters")


def _as_names(value: Any, what: str) -> tuple[str, ...]:
    if isinstance(value, str) or (
        not isinstance(value, Sequence) and not (isinstance(value, np.ndarray) and value.ndim == 1)
    ):
        raise arguments.refusal(f"HybridSystem: {what}", "be a tuple of names", value)
    names = tuple(map(plain_name, value))
    _check_identifiers(names, what)
    return names


def as_parameters(value: Any) -> Mapping[str, float]:
    """Default values of parameters by name, read-only."""
    given = named("HybridSystem: parameters", value)
    _check_identifiers(tuple(given), "parameter")
    return FrozenMapping(
        {name: arguments.number(f"HybridSystem: parameter {name!r}", each) for name, each in given.items()}
    )


def _check_identifiers(names: tuple[str, ...], kind: str) -> None:
    for name in names:
        if not is_component_name(name):
            raise ModelError(
                f"HybridSystem: {kind} name {arguments.shown(name)} cannot be written as an attribute. Use a "
                "Python identifier that is not a keyword and does not begin with an underscore."
            )
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ModelError(f"HybridSystem: {kind} names must differ; given twice: {', '.join(twice)}.")
