"""The points of a sweep: a grid, or a table with one point per row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from hashlib import blake2b
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError

# Names of results that every sweep has.
RESERVED = ("status", "message")
WANTED = "map names to values, or be a list of mappings of names to numbers, or an xarray.Dataset"
NUMBERS = "be a list of finite numbers, one or more"
# Dimension of a table that has no name of its own.
POINT = "point"


@attrs.frozen(eq=False)
class Points:
    """The points of a sweep in order; the last axis of a grid varies fastest.

    Attributes
    ----------
    names
        What varies.
    values
        ``(N, d)``: one row per point, one column per name.
    dims, shape
        Axes of the result, and their lengths.
    coords
        By name: dimension, values ``(length,)`` and attributes such as units.
    """

    names: tuple[str, ...]
    values: np.ndarray
    dims: tuple[str, ...]
    shape: tuple[int, ...]
    coords: dict[str, tuple[str, np.ndarray, dict[str, Any]]]

    def __len__(self) -> int:
        return len(self.values)

    def at(self, row: int) -> dict[str, float]:
        """The values at one point, by name."""
        return dict(zip(self.names, self.values[row].tolist(), strict=True))

    def lines(self, axis: str) -> np.ndarray:
        """Rows of the points ``(lines, length)`` along an axis."""
        rows = np.arange(len(self)).reshape(self.shape)
        return np.moveaxis(rows, self.dims.index(axis), -1).reshape(-1, self.shape[self.dims.index(axis)])

    def keys(self, lines: np.ndarray | None) -> list[bytes]:
        """One key per point: its numbers to the last bit.

        In a sweep with ``lines`` a point depends on the points before it on its line, and so does its key.
        """
        order = sorted(range(len(self.names)), key=self.names.__getitem__)
        raw, width = np.ascontiguousarray(self.values[:, order]).tobytes(), 8 * len(order)
        keys = [raw[i : i + width] for i in range(0, len(raw), width)]
        for line in () if lines is None else lines.tolist():
            before = b""
            for row in line:
                before = keys[row] = blake2b(before + keys[row], digest_size=16).digest()
        return keys


def as_points(over: object) -> Points:
    """The points of the argument ``over``."""
    if isinstance(over, Mapping) and not _is_dataset(over):
        return _grid(over)
    if _is_dataset(over):
        return _table_of_dataset(over)
    if isinstance(over, Sequence) and not isinstance(over, str | bytes):
        return _table_of_mappings(over)
    raise arguments.refusal("over", WANTED, over)


def _is_dataset(value: object) -> bool:
    return type(value).__module__.partition(".")[0] == "xarray" and hasattr(value, "data_vars")


def _grid(over: Mapping[Any, Any]) -> Points:
    if not over:
        raise arguments.refusal("over", WANTED, over)
    coords = {}
    for name, each in over.items():
        _check_name(name)
        coords[name] = (name, _numbers(f"over[{name!r}]", each), dict(getattr(each, "attrs", {})))
    axes = [values for _, values, _ in coords.values()]
    shape = tuple(map(len, axes))
    values = np.stack([each.ravel() for each in np.meshgrid(*axes, indexing="ij")], axis=1)
    return Points(tuple(coords), values, tuple(coords), shape, coords)


def _table_of_mappings(over: Sequence[Any]) -> Points:
    rows = [arguments.mapping(f"over[{i}]", each) for i, each in enumerate(over)]
    if not rows or not rows[0]:
        raise arguments.refusal("over", WANTED, over)
    names = tuple(rows[0])
    for i, row in enumerate(rows):
        if set(row) != set(names):
            raise ArgumentError(
                f"over[{i}] must have the names of over[0], {', '.join(map(str, names))}; "
                f"got {', '.join(map(str, row)) or 'none'}."
            )
    columns = {
        name: _numbers(f"over: {arguments.shown(name)}", [row[name] for row in rows]) for name in names
    }
    return _table(POINT, columns, {})


def _table_of_dataset(over: Any) -> Points:
    if len(over.dims) != 1:
        raise ArgumentError(
            f"over must have one dimension as a table of points; got {', '.join(map(str, over.dims))}. "
            "Give the values of each axis as a mapping for a grid."
        )
    (dim,) = map(str, over.dims)
    columns = {
        str(name): _numbers(f"over[{arguments.shown(name)}]", each) for name, each in over.data_vars.items()
    }
    if not columns:
        raise ArgumentError("over must have variables, which are what varies; this xarray.Dataset has none.")
    return _table(dim, columns, {str(name): dict(each.attrs) for name, each in over.data_vars.items()})


def _table(dim: str, columns: Mapping[str, np.ndarray], units: Mapping[str, dict[str, Any]]) -> Points:
    for name in (*columns, dim):
        _check_name(name)
    coords = {name: (dim, values, units.get(name, {})) for name, values in columns.items()}
    values = np.stack(list(columns.values()), axis=1)
    return Points(tuple(columns), values, (dim,), (len(values),), coords)


def _check_name(name: object) -> None:
    if not isinstance(name, str) or not name:
        raise arguments.refusal("over: each name", "be a text", name)
    if name in RESERVED:
        raise ArgumentError(
            f"over: {name!r} is the name of a result of every sweep. Use another name, and translate it in "
            "the task."
        )


def _numbers(name: str, value: object) -> np.ndarray:
    values = arguments.numbers(name, value, NUMBERS)
    if values.ndim != 1 or values.size == 0:
        raise ArgumentError(f"{name} must {NUMBERS}; got shape {values.shape}.")
    if not np.isfinite(values).all():
        raise arguments.refusal(name, NUMBERS, value)
    return values
