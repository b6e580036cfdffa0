"""Listed times: a clock that ticks at each, with amounts that resets read if it is made of a table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ModelError, shown, unknown_name
from hybrid.system.clocks import Clock, Quantity, as_quantity, check_when, in_few_words
from hybrid.system.frozen import FrozenMapping
from hybrid.system.instants import in_unit
from hybrid.system.labels import named
from hybrid.system.rows import entry_that_fires, row_that_fires

# Times in the representation of a schedule.
MOST_SHOWN = 6


def _as_times(value: Any) -> tuple[Quantity, ...]:
    given = (value,) if isinstance(value, str) or callable(value) else value
    each_time = arguments.items("At: times", given, "be a list of times")
    numbers = arguments.floats(each_time)
    if numbers is not None and numbers.ndim == 1 and np.isfinite(numbers).all():
        found: tuple[Quantity, ...] = tuple(numbers.tolist())
    else:
        found = tuple(as_quantity("At", f"times[{i}]", each) for i, each in enumerate(each_time))
    if not found:
        raise ModelError("At: times must hold at least one time; got none.")
    return found


def _few(times: tuple[Quantity, ...]) -> str:
    """The first times, and how many there are."""
    shown = [repr(each) for each in times[:MOST_SHOWN]]
    more = [f"... {len(times)} in all"] if len(times) > MOST_SHOWN else []
    return f"[{', '.join([*shown, *more])}]"


def _as_columns(value: Any) -> Mapping[str, np.ndarray]:
    if isinstance(value, FrozenMapping):
        # Those of a schedule that this one is made from: they tell that both are the same table.
        return value
    found: dict[str, np.ndarray] = {}
    for name, each in named("At: columns", value, "map names to columns").items():
        if not isinstance(name, str):
            raise arguments.refusal("At: columns: each name", "be a text", name)
        column = np.array(each)
        numbers = column.astype(float) if column.dtype.kind == "b" else arguments.floats(column)
        found[name] = column.astype(object) if numbers is None else numbers
        found[name].flags.writeable = False
    return FrozenMapping(found)


@attrs.frozen(eq=False, init=False)
class At(Clock):
    """A clock that ticks at listed times, in the place of a guard; a tick is found by a search, however many.

    Equal times fire one after the other, in the order in which they are listed. A tick at the start of a run
    does not fire, one at its end does. For more, see `Every`.

    Parameters
    ----------
    times
        Times in any order, each a number, the name of a parameter or of what resets alone change (a held
        component, a counter), or a function of ``p``, which has both. Times that are parameters may pass
        each other: their order is found when a run begins. A time that a reset puts into the past is missed.
    when
        Optional condition ``c(t, x, p)``, as that of a `Guard`: a tick without it is passed over.
    unit
        For dates and durations, the unit of the model's time: ``"ns"``, ``"us"``, ``"ms"``, ``"s"``,
        ``"min"``, ``"h"``, ``"day"`` or ``"week"``.
    origin
        For dates, the date at which the model's time is 0.
    columns
        Columns by name, each with an entry for each time. `At.table` gives them.

    Raises
    ------
    ModelError
        If there is no time, one is not finite, dates lack their unit or origin, or ``when`` is no function.

    Examples
    --------
    >>> import hybrid
    >>> dose = hybrid.Transition(
    ...     "run", "run", hybrid.At([0.0, 24.0, 48.0]), hybrid.Reset(lambda t, x, p: {"A": x.A + p.dose})
    ... )
    >>> len(dose.guard.times)
    3
    >>> hybrid.At(["2024-03-01T08:00"], unit="h", origin="2024-03-01")
    Traceback (most recent call last):
    ...
    hybrid.errors.ArgumentError: unit must be left out, since At: times holds neither dates nor ...
    """

    times: tuple[Quantity, ...] = attrs.field(converter=_as_times, repr=_few)
    when: Callable[..., Any] | None = attrs.field(default=None, kw_only=True, validator=check_when)
    columns: Mapping[str, np.ndarray] = attrs.field(
        factory=dict, kw_only=True, converter=_as_columns, repr=False
    )
    number: ClassVar[int] = 2

    @columns.validator
    def _check_columns(self, attribute: attrs.Attribute[Any], value: Mapping[str, np.ndarray]) -> None:
        for name, column in value.items():
            _check_column(name, column, len(self.times))

    def __init__(
        self,
        times: Any,
        *,
        when: Callable[..., Any] | None = None,
        unit: str | None = None,
        origin: Any = None,
        columns: Mapping[str, Any] | None = None,
    ) -> None:
        numbers = in_unit("At: times", times, unit, origin)
        self.__attrs_init__(numbers, when=when, columns=columns)

    @classmethod
    def table(
        cls,
        frame: Any,
        time: str = "t",
        *,
        when: Callable[..., Any] | None = None,
        unit: str | None = None,
        origin: Any = None,
    ) -> At:
        """A schedule: a tick for each row of a table, whose other columns the resets of its transition read.

        In the reset, and in the condition, of a transition whose guard is the schedule ``doses``,
        ``doses["amount"]`` is the number in the column ``amount`` of the row that fires.

        Parameters
        ----------
        frame
            A data frame (pandas, polars), a mapping of columns, a structured array, or a list of records.
        time
            Name of the column, or of the frame's index, that holds the times: in any order, also equal ones.
        when, unit, origin
            As in `At`.

        Returns
        -------
        At
            With ``columns``, arrays ``(rows,)`` by name.

        Raises
        ------
        ModelError
            If there is no such column, the columns differ in length, or the times are no times.

        Examples
        --------
        >>> import hybrid
        >>> doses = hybrid.At.table({"t": [8.0, 0.0, 8.0], "amount": [20.0, 100.0, 5.0]})
        >>> body = hybrid.HybridSystem(
        ...     state=("A",),
        ...     modes=[hybrid.Mode("body", lambda t, x, p: (0.0,))],
        ...     transitions=[
        ...         hybrid.Transition(
        ...             "body", "body", doses, hybrid.Reset(lambda t, x, p: {"A": x.A + doses["amount"]})
        ...         )
        ...     ],
        ... )
        >>> arc = hybrid.simulate(body, (0.0,), (-1.0, 10.0))
        >>> arc.jumps.t.tolist(), arc.jumps.x_plus[:, 0].tolist()
        ([0.0, 8.0, 8.0], [100.0, 120.0, 125.0])
        """
        columns = _columns_of(frame, time)
        times = in_unit(f"At.table: column {time!r}", columns.pop(time), unit, origin)
        if np.shape(times) == (0,):
            raise ModelError("At.table: frame must have at least one row; got none.")
        return cls(times, when=when, columns=columns)

    def __getitem__(self, name: str) -> Any:
        """The entry of a column in the row that fires."""
        if name not in self.columns:
            raise ModelError(unknown_name("At.table: column", name, tuple(self.columns), "Columns"))
        column = self.columns[name]
        bad = None if column.dtype == object else np.flatnonzero(~np.isfinite(column))
        if bad is None or bad.size:
            at = 0 if bad is None else int(bad[0])
            raise ModelError(
                f"At.table: column {name!r} must hold finite numbers to be read in a model function; got "
                f"{shown(column.tolist()[at])} in row {at}. Fill it in, or leave the row out."
            )
        return entry_that_fires(self, name, column)

    @property
    def schedule(self) -> At | None:
        """The schedule itself, if it has columns."""
        return self if self.columns else None

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The times."""
        return self.times

    @property
    def told(self) -> str:
        """When the clock ticks, in few words."""
        count = len(self.times)
        return f"at {in_few_words(self.times[0])}" if count == 1 else f"at {count} times"

    @cached_property
    def _moving(self) -> tuple[int, ...]:
        """The rows whose times are not numbers."""
        return tuple(i for i, each in enumerate(self.times) if not isinstance(each, float))

    @cached_property
    def _known_ticks(self) -> tuple[Any, Any]:
        return self._in_order(self.times)

    def _ticks(self, x: Any, p: Any) -> tuple[Any, Any]:
        """The times in order, and the row of each."""
        return self._in_order(self._numbers(x, p)) if self._moving else self._known_ticks

    def _in_order(self, numbers: Sequence[Any]) -> tuple[Any, Any]:
        times = np.array(numbers, dtype=float)
        rows = np.argsort(times, kind="stable")
        return times[rows], rows

    def _since_tick(self, t: Any, numbers: Sequence[Any]) -> Any:
        """Time since that of the row that fires, if anything moves it; else since the first time."""
        if not self._moving:
            return t - numbers[0]
        # The time of a row that nothing moves has no derivative, so it need not be known.
        fixed = [i for i in range(len(numbers)) if i not in self._moving][:1]
        first, *others = (*fixed, *self._moving)
        row, found = row_that_fires(), numbers[first]
        for i in others:
            found = np.where(row == i, numbers[i], found)
        return t - found

    def _fault(self, numbers: Sequence[float], moving: bool = False) -> str:
        """What is wrong with the times."""
        finite = np.isfinite(np.asarray(numbers, dtype=float))
        if finite.all():
            return ""
        bad = np.flatnonzero(~finite)
        return f"times[{bad[0]}] must be finite; got {numbers[bad[0]]:.6g}"


def _columns_of(frame: Any, time: str) -> dict[str, Any]:
    """The columns of a table by name; that of the times is among them."""
    names = getattr(getattr(frame, "dtype", None), "names", None)
    if names is None and not isinstance(frame, Mapping):
        names = getattr(frame, "columns", None)
    if names is not None:
        found = {name: frame[name] for name in names}
        index = getattr(frame, "index", None)
        if time not in found and index is not None and getattr(index, "name", None) == time:
            found[time] = index
    else:
        found = dict(frame) if isinstance(frame, Mapping) else _of_records(frame)
    # A column whose name is no text cannot be asked for.
    found = {name: column for name, column in found.items() if isinstance(name, str)}
    if time not in found:
        index = " The index has no name: give it one, such as frame.index.name = 't'."
        unnamed = names is not None and getattr(getattr(frame, "index", 0), "name", 0) is None
        text = unknown_name("At.table: time: column", time, tuple(found), "Columns")
        raise ModelError(text + (index if unnamed else ""))
    return found


def _check_column(name: str, column: np.ndarray, rows: int) -> None:
    if column.shape != (rows,):
        raise ModelError(
            f"At.table: column {name!r} must hold one entry for each of the {rows} rows; got shape "
            f"{column.shape}."
        )


def _of_records(frame: Any) -> dict[str, Any]:
    wanted = "be a data frame, a mapping of columns, or a list of records"
    records = arguments.items("At.table: frame", frame, wanted)
    for i, record in enumerate(records):
        if not isinstance(record, Mapping):
            raise arguments.refusal(f"At.table: frame[{i}]", "be a record, a mapping by column", record)
        if record.keys() != records[0].keys():
            different = ", ".join(map(repr, sorted(record.keys() ^ records[0].keys(), key=str)))
            raise ModelError(
                f"At.table: frame[{i}] must have the columns of the first record; they differ in {different}."
            )
    if not records:
        raise ModelError("At.table: frame must have at least one row; got none.")
    return {name: [record[name] for record in records] for name in records[0]}
