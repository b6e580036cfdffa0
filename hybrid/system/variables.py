"""States and parameters by name: ``x.q``, ``p.e``, and an answer for a name that does not exist."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Iterable
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.errors import ModelError, unknown_name

if TYPE_CHECKING:
    from hybrid.system.graph import HybridSystem

STATE = "State components"
PARAMETERS = "Parameters"
# Classes of named values that are kept for the next model of the same names.
MOST_CLASSES = 256


class UnknownComponentError(ModelError, AttributeError):
    """A model function asked for a state or a parameter that the system does not have."""


@lru_cache(MOST_CLASSES)
def plain_class(kind: str, names: tuple[str, ...]) -> type[Any]:
    """A bare namedtuple class with the given fields, of the sort that compiled code understands."""
    return namedtuple(kind.title().replace(" ", ""), names)


@lru_cache(MOST_CLASSES)
def _explaining_class(kind: str, names: tuple[str, ...]) -> type[Any]:
    def __getattr__(self: Any, name: str) -> Any:
        raise UnknownComponentError(unknown_name(kind.removesuffix("s"), name, names, kind))

    plain = plain_class(kind, names)
    return type(plain.__name__, (plain,), {"__slots__": (), "__getattr__": __getattr__})


def named_values(kind: str, names: tuple[str, ...], values: Iterable[Any]) -> Any:
    """A named tuple of ``values``; an unknown field raises a ModelError that lists the known ones.

    Parameters
    ----------
    kind
        What the names are, in the plural; it heads the list in the error text.
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


def state_values(system: HybridSystem, values: Any) -> Any:
    """The state as model functions see it: by name, or read-only if the system only has a dimension."""
    if not isinstance(system.state, int):
        return named_values(STATE, system.state, values)
    view = np.asarray(values).view()
    view.flags.writeable = False
    return view


def parameter_view(system: HybridSystem, values: Iterable[Any]) -> Any:
    """The parameters as model functions see them, by name."""
    return named_values(PARAMETERS, tuple(system.parameters), values)
