"""The results of a sweep in memory, and the dataset that they become."""

from __future__ import annotations

import json
import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from hybrid.errors import ArgumentError
from hybrid.status import StatusCode
from hybrid.sweep.outcome import DTYPES, EMPTY, UNFINISHED, Part, Schema
from hybrid.sweep.points import Points

if TYPE_CHECKING:
    import xarray

UNTOUCHED = "The sweep ended before this point was complete. Call again to compute it."


@attrs.frozen
class Labels:
    """Names of the inner axes of results.

    Attributes
    ----------
    dims
        Axes of each result, by name; ``name_0, name_1, ...`` if not given.
    coords
        By name: axes, and values.
    attrs
        Attributes of results and of coordinates, such as units.
    """

    dims: Mapping[str, tuple[str, ...]] = attrs.field(factory=dict)
    coords: Mapping[str, tuple[tuple[str, ...], Any]] = attrs.field(factory=dict)
    attrs: Mapping[str, Mapping[str, str]] = attrs.field(factory=dict)

    @classmethod
    def read(cls, text: str) -> Labels:
        """Labels from the JSON text of a schema."""
        found = json.loads(text)
        coords = {name: (tuple(dims), values) for name, (dims, values) in found["coords"].items()}
        return cls({name: tuple(dims) for name, dims in found["dims"].items()}, coords, found["attrs"])


class Sheet:
    """Results of all points, filled in any order and from any thread."""

    def __init__(self, points: Points) -> None:
        self.points = points
        count = len(points)
        self.codes = np.full(count, StatusCode.NOT_RUN, dtype=np.int16)
        self.messages = np.full(count, UNTOUCHED, dtype=object)
        # Which table holds the values of a point; -1 for none.
        self.which = np.full(count, -1, dtype=np.int16)
        self.tables: dict[Schema, list[np.ndarray]] = {}
        self.lock = threading.Lock()

    def put(self, part: Part) -> None:
        """Store the results of a part."""
        if part.schema is not None:
            with self.lock:
                table = self.tables.get(part.schema)
                if table is None:
                    self._check_names(part.schema)
                    table = self.tables[part.schema] = [
                        np.full((len(self.points), *shape), EMPTY[kind], dtype=DTYPES[kind])
                        for _, shape, kind in part.schema.columns
                    ]
                index = list(self.tables).index(part.schema)
            for column, values in zip(table, part.columns, strict=True):
                column[part.rows] = values
            self.which[part.rows] = index
        self.messages[part.rows] = part.messages
        self.codes[part.rows] = part.codes

    def _check_names(self, schema: Schema) -> None:
        """Refuse results with the name of an axis as soon as there is one, not when all are there."""
        for name, _, _ in schema.columns:
            if name in self.points.coords or name in self.points.dims:
                raise ArgumentError(
                    f"task: the result {name!r} has the name of an axis of over. Rename one of them."
                )

    def untouched(self) -> np.ndarray:
        """Whether each point still has to be computed."""
        return np.isin(self.codes, UNFINISHED)

    def dataset(self, labels: Labels, made_by: Mapping[str, str]) -> xarray.Dataset:
        """All results with their coordinates."""
        import xarray

        self._refuse_other_schemas()
        points = self.points
        coords: dict[str, Any] = {
            name: (dim, values, {**labels.attrs.get(name, {}), **given})
            for name, (dim, values, given) in points.coords.items()
        }
        variables: dict[str, Any] = {}
        schema = self._schema()
        if schema is not None:
            if schema.labels:
                labels = Labels.read(schema.labels)
            for (name, shape, _), column in zip(schema.columns, self.tables[schema], strict=True):
                inner = labels.dims.get(name) or tuple(f"{name}_{i}" for i in range(len(shape)))
                values = column.reshape(*points.shape, *shape)
                variables[name] = ((*points.dims, *inner), values, dict(labels.attrs.get(name, {})))
            inside = {dim for dims, *_ in variables.values() for dim in dims}
            coords |= {
                name: (dims, np.asarray(values))
                for name, (dims, values) in labels.coords.items()
                if set(dims) <= inside
            }
        variables["status"] = (points.dims, self.codes.reshape(points.shape), flags())
        variables["message"] = (points.dims, self.messages.reshape(points.shape))
        return xarray.Dataset(variables, coords, attrs=dict(made_by))

    def _schema(self) -> Schema | None:
        """The schema of the first point that has values."""
        places = np.flatnonzero(self.which >= 0)
        return list(self.tables)[self.which[places[0]]] if places.size else None

    def _refuse_other_schemas(self) -> None:
        """Points whose results differ in names or shapes from those of the first point count as failed."""
        first = self._schema()
        for index, schema in enumerate(list(self.tables)):
            rows = np.flatnonzero(self.which == index)
            if schema == first or not rows.size or first is None:
                continue
            self.codes[rows] = StatusCode.FAILED
            self.messages[rows] = (
                f"The task returned {_described(schema)}, and at the first point {_described(first)}. "
                "Return the same names, shapes and kinds of numbers at all points, filled up with nan."
            )
            self.which[rows] = -1


def _described(schema: Schema) -> str:
    kinds = {"f": "real", "c": "complex", "s": "text"}
    listed = ", ".join(f"{name} {shape} {kinds[kind]}" for name, shape, kind in schema.columns)
    return (listed or "nothing") + (" with other labels" if schema.labels else "")


def flags() -> dict[str, Any]:
    """Attributes of a status, after the CF conventions."""
    return {
        "flag_values": [int(code) for code in StatusCode],
        "flag_meanings": " ".join(code.name for code in StatusCode),
    }
