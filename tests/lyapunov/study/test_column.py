"""The paper's column beside its method."""

import numpy as np
import pytest

import models
from lyapunov.study import report
from lyapunov.study.column import PaperColumn, paper_columns_by_its_method, printed, running, steady
from lyapunov.study.runs import Settings


def test_printed_values_are_those_of_the_paper():
    assert printed(7.46, "II") == (0.019, -0.0037, -0.0067, -0.0089, -0.0091)
    assert printed(7.46, "III") == printed(7.5, "I") == (None,) * 5


def test_growth_between_rows_does_not_depend_on_the_first_periods():
    growths = np.full(10_000, -0.067)
    growths[:50] += 1.0
    column = running(growths)
    assert column[0] == pytest.approx(0.433)
    assert steady(column) == pytest.approx((-0.067,) * 4)
    assert running(growths[:500])[2:] == (None, None, None)
    assert steady(running(growths[:500]))[1:] == (None, None, None)


def test_the_paper_s_growth_between_rows_is_the_same_from_row_to_row():
    """At 7.40 its first row differs by the start only; rounding of the print allows 0.002."""
    assert steady(printed(7.40, "I")) == pytest.approx((-0.067,) * 4, abs=0.002)
    for label in ("I", "II"):
        assert steady(printed(7.46, label))[1:] == pytest.approx((-0.0093,) * 3, abs=7e-4)


def test_runs_from_two_starts_and_their_table():
    columns = paper_columns_by_its_method(models.vibroimpact(), [7.40], Settings(intervals=120))
    (column,) = columns
    assert [len(growths) for growths in column.growths.values()] == [120, 120]
    table = report.column_text(columns)
    assert "-0.0380" in table
    assert len([line for line in table.splitlines() if line.startswith("7.40")]) == 1


def test_rows_and_growth_between_them_are_in_the_table():
    columns = [PaperColumn(7.46, {"I": np.full(1000, -0.008), "II": np.full(1000, -0.008)})]
    table = report.column_text(columns)
    assert "500 to 1000" in table
    assert "-0.0088" in table
    assert "-0.0080" in table


def test_too_few_periods_for_a_row():
    short = report.column_text([PaperColumn(7.40, {"I": np.zeros(5), "II": np.zeros(5)})])
    assert short.endswith("needs at least 100 periods.")
