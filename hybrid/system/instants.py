"""Dates and durations as numbers in a named unit."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta
from typing import Any

import numpy as np

from hybrid.errors import ArgumentError, shown

UNITS = {"ns": "ns", "us": "us", "ms": "ms", "s": "s", "min": "m", "h": "h", "day": "D", "week": "W"}
DATES, DURATIONS = "M", "m"


def in_unit(what: str, values: Any, unit: str | None, origin: Any) -> Any:
    """Dates and durations as floats ``(n,)`` in ``unit``, dates since ``origin``; other values as they are.

    Dates with a time zone count in UTC, and so does an origin with one.

    Raises
    ------
    ArgumentError
        If the unit or the origin is missing, unknown or not needed, or an entry is missing.
    """
    found = _as_array(values)
    kind = None if found is None else found.dtype.kind
    if found is None or kind not in (DATES, DURATIONS):
        _refuse_needless(what, unit, origin)
        return values
    if not isinstance(unit, str) or unit not in UNITS:
        held = f"{what} holds {'dates' if kind == DATES else 'durations'}"
        wanted = f"the unit of the model's time, one of {', '.join(UNITS)}"
        if unit is None:
            raise ArgumentError(f"{held}: give unit=, {wanted}; got None.")
        raise ArgumentError(f"unit must be {wanted}; got {shown(unit)}.")
    if np.isnat(found).any():
        i = int(np.argmax(np.isnat(found)))
        raise ArgumentError(f"{what} must have no missing entry; got entry {i} = NaT. Leave such rows out.")
    if kind == DATES:
        found = found - _as_origin(what, origin, values, found)
    elif origin is not None:
        raise ArgumentError(f"origin must be left out, since {what} holds durations; got {shown(origin)}.")
    return found / np.array(1, dtype=f"timedelta64[{UNITS[unit]}]")


def _refuse_needless(what: str, unit: Any, origin: Any) -> None:
    for name, value in (("unit", unit), ("origin", origin)):
        if value is not None:
            raise ArgumentError(
                f"{name} must be left out, since {what} holds neither dates nor durations; got "
                f"{shown(value)}. Read texts as dates first, such as with pandas.to_datetime."
            )


def _as_origin(what: str, origin: Any, values: Any, dates: np.ndarray) -> np.ndarray:
    example = dates.ravel()[0].astype("datetime64[s]") if dates.size else "2024-01-31"
    if origin is None:
        raise ArgumentError(
            f"{what} holds dates: give origin=, the date at which the model's time is 0, for instance "
            f"origin={str(example)!r}; got None."
        )
    given = _as_array([origin])
    if given is None or given.dtype.kind != DATES:
        try:
            given = np.array([origin if isinstance(origin, str) else "NaT"], dtype="datetime64[ns]")
        except ValueError:
            given = np.array(["NaT"], dtype="datetime64[ns]")
    if np.isnat(given[0]):
        raise ArgumentError(
            f"origin must be a date, such as {str(example)!r}; got {shown(origin)}. {what} holds dates."
        )
    if _has_zone(values) != _has_zone([origin]):
        found = "the entries have a time zone and origin has none"
        if not _has_zone(values):
            found = "origin has a time zone and the entries have none"
        raise ArgumentError(f"{what}: {found}. Give both one, such as with pandas.Timestamp(..., tz='UTC').")
    return given[0]


def _as_array(values: Any) -> np.ndarray | None:
    """Dates and durations as an array of NumPy; None if the values make no array."""
    try:
        found = np.asarray(values)
    except Exception:  # whatever an object of the caller raises when it is converted
        return None
    if found.dtype != object or not found.size:
        return found
    if all(isinstance(each, timedelta) for each in found.flat):
        return np.array([*found.flat], dtype="timedelta64[us]")
    if all(isinstance(each, date) for each in found.flat):
        return np.array([_without_zone(each) for each in found.flat], dtype="datetime64[us]")
    return found


def _without_zone(instant: Any) -> Any:
    """A date of Python, in UTC if it has a time zone."""
    if isinstance(instant, datetime) and instant.tzinfo is not None:
        return instant.astimezone(UTC).replace(tzinfo=None)
    return instant


def _has_zone(values: Any) -> bool:
    first = next(iter(np.asarray(values, dtype=object).flat), None)
    return getattr(first, "tzinfo", None) is not None or getattr(values, "tz", None) is not None
