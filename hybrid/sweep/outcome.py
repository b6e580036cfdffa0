"""What a task returned at a point, and many such results as columns."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import HybridError
from hybrid.status import Status, StatusCode
from hybrid.sweep.points import RESERVED

# Kinds of columns: real and complex numbers, and text.
DTYPES: dict[str, Any] = {"f": np.float64, "c": np.complex128, "s": object}
EMPTY: dict[str, Any] = {"f": np.nan, "c": complex(np.nan, np.nan), "s": ""}
# Failures of the machine, not of the point: another attempt may succeed.
PASSING = (MemoryError, OSError)
# Codes of points that are computed again by the next call with the same store.
UNFINISHED = (StatusCode.NOT_RUN, StatusCode.INTERRUPTED)
DONE = Status(StatusCode.SUCCESS, "")
RETURNS = "return a mapping of names to numbers or arrays, or an xarray.Dataset"


@attrs.frozen
class Schema:
    """Name, shape and kind of each value that a task returns, with its labels as JSON text.

    Results of another schema cannot stand in the same columns.
    """

    columns: tuple[tuple[str, tuple[int, ...], str], ...]
    labels: str = ""


class Outcome(NamedTuple):
    """The values of one point in the order of the schema; no schema if the task failed."""

    schema: Schema | None
    values: list[Any]
    status: Status


@attrs.frozen(eq=False)
class Part:
    """Results of several points of one schema.

    Attributes
    ----------
    rows
        Indices of the points ``(n,)``.
    schema, columns
        What the values are, and the values ``(n, *shape)`` of each.
    codes, messages
        Status code ``(n,)`` and text of each point.
    """

    rows: np.ndarray
    schema: Schema | None
    columns: list[np.ndarray]
    codes: np.ndarray
    messages: list[str]

    def at(self, rows: np.ndarray, places: np.ndarray) -> Part:
        """The results at some places of the part, as those of other rows."""
        columns = [column[places] for column in self.columns]
        messages = [self.messages[place] for place in places.tolist()]
        return Part(rows, self.schema, columns, self.codes[places], messages)


def text_of(status: Status) -> str:
    """Message and remedy of a status."""
    return f"{status.message} {status.remedy}" if status.remedy else status.message


def attempts(task: Any, points: Sequence[Any], states: Sequence[Any]) -> list[Outcome]:
    """The outcomes of several points of a task that computes them together."""
    return [attempt(_given, each) for each in task.together(points, states)]


def _given(result: Any) -> Any:
    if isinstance(result, Exception):
        raise result
    return result


def attempt(task: Callable[..., Any], *given: Any) -> Outcome:
    """Call a task; an error becomes a status."""
    try:
        return outcome_of(task(*given))
    except PASSING as failure:
        message = f"{type(failure).__name__}: {failure}. Call again: this point was not kept."
        return Outcome(None, [], Status(StatusCode.NOT_RUN, message))
    except HybridError as failure:
        return Outcome(None, [], Status(StatusCode.FAILED, str(failure)))
    except Exception as failure:
        return Outcome(None, [], Status(StatusCode.FAILED, f"{type(failure).__name__}: {failure}"))


def outcome_of(result: Any) -> Outcome:
    """The values of a task's result."""
    status = DONE
    # The check of the exact type is fast.
    if type(result) is not dict:
        if hasattr(result, "to_xarray") and not hasattr(result, "data_vars"):
            status, result = getattr(result, "status", DONE), result.to_xarray()
        if hasattr(result, "data_vars"):
            return _of_dataset(result, status)
        if not isinstance(result, Mapping):
            raise arguments.refusal("task", RETURNS, result)
    signature: list[tuple[str, tuple[int, ...], str]] = []
    values: list[Any] = []
    for name, value in result.items():
        if name == "status" and isinstance(value, Status):
            status = value
            continue
        if type(value) is float:
            signature.append((name, (), "f"))
            values.append(value)
            continue
        column, kind = _column(name, value)
        signature.append((name, getattr(column, "shape", ()), kind))
        values.append(column)
    return Outcome(_schema(tuple(signature)), values, status)


@lru_cache(1024)
def _schema(signature: tuple[tuple[str, tuple[int, ...], str], ...]) -> Schema:
    names = [name for name, _, _ in signature]
    for name in names:
        if not isinstance(name, str) or name in RESERVED:
            raise arguments.refusal(
                "task", f"name its results by texts other than {', '.join(RESERVED)}", name
            )
    return Schema(signature)


def _column(name: str, value: Any) -> tuple[Any, str]:
    """A value as floats, complex numbers or text, and which."""
    if isinstance(value, str):
        return value, "s"
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value, "f"
    try:
        found = np.asarray(value)
    except ValueError:
        raise arguments.refusal(f"task: {name}", "be a number, an array or a text", value) from None
    if found.dtype.kind in "fiub":
        return found.astype(float, copy=False), "f"
    if found.dtype.kind == "c":
        return found, "c"
    if found.dtype.kind in "UT":
        return found.astype(object), "s"
    raise arguments.refusal(f"task: {name}", "be a number, an array or a text", value)


def _of_dataset(result: Any, status: Status) -> Outcome:
    """The variables of an xarray.Dataset; coordinates must be the same at all points."""
    signature, values = [], []
    labels: dict[str, Any] = {"dims": {}, "coords": {}, "attrs": {}}
    for name, variable in result.data_vars.items():
        if name in RESERVED:
            continue
        column, kind = _column(str(name), variable.values)
        signature.append((str(name), np.shape(column), kind))
        values.append(column)
        labels["dims"][str(name)] = list(map(str, variable.dims))
        labels["attrs"][str(name)] = {key: str(each) for key, each in variable.attrs.items()}
    for name, variable in result.coords.items():
        if variable.dims:
            labels["coords"][str(name)] = [list(map(str, variable.dims)), variable.values.tolist()]
    return Outcome(Schema(tuple(signature), json.dumps(labels)), values, status)


class Batch:
    """Outcomes of points, collected until there are enough for a part."""

    def __init__(self) -> None:
        self.by_schema: dict[Schema | None, list[tuple[int, Outcome]]] = {}
        self.count = 0

    def add(self, row: int, outcome: Outcome) -> None:
        """Keep the outcome of a point."""
        self.by_schema.setdefault(outcome.schema, []).append((row, outcome))
        self.count += 1

    def taken(self) -> list[Part]:
        """The outcomes so far as parts; the batch is empty afterwards."""
        kept, self.by_schema, self.count = self.by_schema, {}, 0
        return [_part(schema, outcomes) for schema, outcomes in kept.items()]


def _part(schema: Schema | None, outcomes: list[tuple[int, Outcome]]) -> Part:
    columns = []
    for i, (_, shape, kind) in enumerate(() if schema is None else schema.columns):
        column = np.empty((len(outcomes), *shape), dtype=DTYPES[kind])
        for place, (_, outcome) in enumerate(outcomes):
            column[place] = outcome.values[i]
        columns.append(column)
    return Part(
        rows=np.array([row for row, _ in outcomes], dtype=np.int64),
        schema=schema,
        columns=columns,
        codes=np.array([outcome.status.code for _, outcome in outcomes], dtype=np.int16),
        messages=[text_of(outcome.status) for _, outcome in outcomes],
    )
