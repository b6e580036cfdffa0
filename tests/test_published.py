"""The page of published numbers shows what its script finds."""

import importlib
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module")
def maker():
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.syspath_prepend(DOCS)
        yield importlib.import_module("make_published")


@pytest.fixture(scope="module")
def shown(maker):
    """The lines of the table as cells, by the quantity, one after another where it comes twice."""
    text = (DOCS / "published.md").read_text(encoding="utf-8")
    table = text.split(maker.BEGIN)[1].split(maker.END)[0]
    lines = [line.strip("|\n ").split(" | ") for line in table.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line] for line in lines[1:]]


def test_every_row_is_on_the_page(maker, shown):
    sources = [line[0] for line in shown if line[0].startswith("[")]
    assert sources == [f"[{row.source}]" for row in maker.ROWS]


@pytest.mark.parametrize("i", range(9))
def test_the_page_shows_what_the_script_finds(maker, shown, i):
    row = maker.ROWS[i]
    assert row.quick
    begins = [k for k, line in enumerate(shown) if line[0].startswith("[")]
    for number, line in zip(row.find(), shown[begins[i] :], strict=False):
        quantity, printed, library = line[-len(line) + 1 : 4] if line[0].startswith("[") else line[:3]
        assert (quantity, printed) == (number.quantity, number.printed)
        digits = len(library.partition(".")[2])
        assert float(number.library) == pytest.approx(float(library), abs=3.0 * 10.0**-digits)
        if number.error:
            assert float(number.error) < 1e-8


def test_the_slow_rows_are_the_last(maker):
    assert [row.quick for row in maker.ROWS] == [True] * 9 + [False] * 2


def test_the_table_is_written_between_its_marks(maker, monkeypatch, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{maker.BEGIN}old\n{maker.END}after\n", encoding="utf-8")
    found = [maker.Number("q", "1.0", "1.01", "1e-2", "1.0")]
    monkeypatch.setattr(maker, "ROWS", [maker.Row(3, lambda: found)])
    maker.renew(page)
    text = page.read_text(encoding="utf-8")
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "old" not in text
    assert "| [3] | q | 1.0 | 1.01 | 1e-2 | 1.0 | " in text
