"""Names of a model in arguments: normalised as in Python's source, and read from labelled values."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any
from unicodedata import normalize

import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError

# Values of these types are read by position.
UNLABELLED = {tuple, list, np.ndarray}


def plain_name(name: Any) -> Any:
    """A name as Python reads it in source text (NFKC); anything else as it is."""
    return normalize("NFKC", name) if isinstance(name, str) else name


def named(name: str, value: object, wanted: str = "map names to numbers") -> dict[Any, Any]:
    """The argument ``name``, a mapping by names of the model, as a dictionary; empty for None."""
    return _once(name, list(arguments.mapping(name, value, wanted).items()))


def by_label(name: str, value: Any) -> dict[Any, Any] | None:
    """The values of the argument ``name`` by their labels; None if it has none and is read by position.

    Labels have mappings, a Series or a DataFrame of pandas with texts as index or columns, and a DataArray of
    xarray with a coordinate of texts.

    Raises
    ------
    ArgumentError
        If a label is given twice, or labels are neither texts nor the positions in order.
    """
    if type(value) in UNLABELLED:
        return None
    if arguments.has_units(value):
        raise arguments.refusal(name, "hold numbers without units", value)
    if isinstance(value, Mapping):
        inner = named(name, value).items()
        return {label: each if _labels_of(each) is None else np.asarray(each) for label, each in inner}
    axes = _labels_of(value) or []
    with_names = [i for i, labels in enumerate(axes) if labels and all(isinstance(e, str) for e in labels)]
    if not with_names:
        if axes and axes[-1] is not None and axes[-1] != list(range(len(axes[-1]))):
            raise ArgumentError(
                f"{name} has the labels {arguments.shown(axes[-1])}, which are not names. Label its values "
                "with the names of the state, or give an array without labels, such as .to_numpy()."
            )
        return None
    axis = with_names[-1]
    columns = np.moveaxis(np.asarray(value), axis, 0)
    return _once(name, list(zip(axes[axis] or (), columns, strict=True)))


def _once(name: str, pairs: list[tuple[Any, Any]]) -> dict[Any, Any]:
    found: dict[Any, Any] = {}
    for given, value in pairs:
        label = plain_name(given)
        if label in found:
            raise ArgumentError(f"{name}: {label!r} is given twice. Give each name one value.")
        found[label] = value
    return found


def _labels_of(value: Any) -> list[list[Any] | None] | None:
    """The labels along each axis of an object of pandas or xarray, if it has any there; None for others."""
    # An object of theirs exists only if they have been imported.
    pandas, xarray = sys.modules.get("pandas"), sys.modules.get("xarray")
    if pandas is not None and isinstance(value, (pandas.Series, pandas.DataFrame)):
        return [axis.tolist() for axis in value.axes]
    if xarray is not None and isinstance(value, xarray.DataArray):
        return [value.coords[dim].values.tolist() if dim in value.coords else None for dim in value.dims]
    return None
