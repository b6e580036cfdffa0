"""Dates and durations in a named unit, for schedules and tables."""

from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pandas as pd
import pytest

from hybrid import ArgumentError, At, Table

TEXTS = ["2024-03-01 08:00", "2024-03-02 20:30"]
ZONE = timezone(timedelta(hours=2))
IN_ZONE = [datetime(2024, 3, 1, 10, tzinfo=ZONE), datetime(2024, 3, 2, 22, 30, tzinfo=ZONE)]


@pytest.mark.parametrize(
    "dates",
    [
        pd.to_datetime(TEXTS),
        pd.Series(pd.to_datetime(TEXTS)),
        np.array(TEXTS, dtype="datetime64[s]"),
        [datetime.fromisoformat(text) for text in TEXTS],
    ],
)
@pytest.mark.parametrize("origin", ["2024-03-01", pd.Timestamp("2024-03-01"), np.datetime64("2024-03-01")])
def test_dates_count_from_the_origin(dates, origin):
    assert At(dates, unit="h", origin=origin).times == (8.0, 44.5)
    assert At.table({"t": dates}, unit="day", origin=origin).times == (8 / 24, 44.5 / 24)
    assert Table(dates, [1.0, 2.0], unit="min", origin=origin).x.tolist() == [480.0, 2670.0]


@pytest.mark.parametrize("dates", [IN_ZONE, pd.DatetimeIndex(IN_ZONE), pd.Series(IN_ZONE)])
def test_dates_with_a_time_zone_count_in_utc(dates):
    assert At(dates, unit="h", origin=datetime(2024, 3, 1, tzinfo=UTC)).times == (8.0, 44.5)
    with pytest.raises(ArgumentError, match="the entries have a time zone and origin has none"):
        At(dates, unit="h", origin="2024-03-01")
    with pytest.raises(ArgumentError, match="origin has a time zone and the entries have none"):
        At(pd.to_datetime(TEXTS), unit="h", origin=pd.Timestamp("2024-03-01", tz="UTC"))


@pytest.mark.parametrize(
    "durations",
    [
        pd.to_timedelta(["90 s", "1 h"]),
        np.array([90, 3600], dtype="timedelta64[s]"),
        [timedelta(seconds=90), timedelta(hours=1)],
    ],
)
def test_durations_need_a_unit_alone(durations):
    assert At(durations, unit="min").times == (1.5, 60.0)
    assert Table(pd.Series([0.0, 1.0], index=durations), unit="s").x.tolist() == [90.0, 3600.0]
    with pytest.raises(ArgumentError, match="origin must be left out, since At: times holds durations"):
        At(durations, unit="min", origin="2024-03-01")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "holds dates: give unit=, the unit of the model's time, one of ns, us.*; got None"),
        ({"unit": "hours", "origin": "2024-03-01"}, "got 'hours'"),
        ({"unit": "h"}, "give origin=, the date at which.*for instance origin='2024-03-01T08:00:00'"),
        ({"unit": "h", "origin": "soon"}, "origin must be a date"),
        ({"unit": "h", "origin": 3}, "origin must be a date"),
    ],
)
def test_dates_without_what_they_need_are_refused(options, message):
    dates = pd.to_datetime(TEXTS)
    for make in (lambda: At(dates, **options), lambda: Table(dates, [1.0, 2.0], **options)):
        with pytest.raises(ArgumentError, match=message):
            make()


def test_a_missing_date_is_refused():
    dates = pd.Series(pd.to_datetime([TEXTS[0], None]))
    with pytest.raises(ArgumentError, match="entry 1 = NaT"):
        At(dates, unit="h", origin="2024-03-01")


def test_a_unit_of_plain_numbers_is_refused():
    with pytest.raises(ArgumentError, match="unit must be left out, since At: times holds neither dates"):
        At([1.0], unit="h")
    with pytest.raises(ArgumentError, match=r"origin must be left out.*pandas.to_datetime"):
        Table(TEXTS, [1.0, 2.0], origin="2024-03-01")
