"""What docstrings and pages list is what branches find: kinds and ends."""

import re
from pathlib import Path

import pytest

import hybrid
from hybrid.orbits.continuation import continue_orbit, curve
from hybrid.orbits.equilibria import curves
from hybrid.orbits.kinds import KINDS, OF_EQUILIBRIA, OF_ORBITS, plural
from hybrid.plot.branches import OTHERS

DOCS = Path(__file__).parents[3] / "docs"
OF_TWO_PARAMETERS = {"cusp", "fold-flip", *curve.RESONANCES, *curve.STRONG}


def table(page, title):
    """The first cells of the rows below the title row of a table."""
    text = (DOCS / page).read_text(encoding="utf-8")
    found = re.search(rf"^\| {re.escape(title)} \|.*\n\|[-|]+\n((?:\|.*\n)+)", text, re.MULTILINE)
    assert found, f"{page} has no table with the title {title}"
    return [row.split("|")[1].strip() for row in found[1].splitlines()]


def named(page, title):
    """The names in backquotes in the first cells of the rows, but those of cells that give examples."""
    cells = (cell for cell in table(page, title) if not cell.startswith("such as"))
    return [name.strip('"') for cell in cells for name in re.findall(r"`([^`]+)`", cell)]


def quoted(thing):
    """The kinds in the entry ``kind`` of the docstring of a class, but those that stand for others."""
    entry = re.search(r"\n    kind\n((?:        .*\n)+)", thing.__doc__)[1]
    return re.findall(r'``"([^"`.]+)"``', entry.replace('such as ``"grazing-fold"``', ""))


@pytest.mark.parametrize(
    ("kinds", "thing", "page", "title"),
    [
        (OF_ORBITS, hybrid.Bifurcation, "branches.md", "kind"),
        (OF_EQUILIBRIA, hybrid.EquilibriumBifurcation, "equilibria.md", "kind"),
        (OF_TWO_PARAMETERS, hybrid.CodimensionTwo, "branches.md", "kind of point"),
        (curves.MESSAGES, hybrid.SpecialEquilibrium, "equilibria.md", "kind of point"),
    ],
    ids=["orbits", "equilibria", "curves of orbits", "curves of equilibria"],
)
def test_docstring_and_page_list_the_kinds_that_are_found(kinds, thing, page, title):
    assert sorted(set(quoted(thing))) == sorted(kinds)
    assert sorted(named(page, title)) == sorted(kinds)


def test_the_page_lists_each_end_of_a_branch_in_the_words_of_the_status():
    assert sorted(table("branches.md", "... at")) == sorted(continue_orbit.ENDS.values())


def test_each_kind_has_a_marker_of_its_own():
    markers = [each.marker for each in KINDS.values()]
    assert len({*markers, *OTHERS}) == len(markers) + len(OTHERS)


def test_a_kind_is_of_orbits_or_of_equilibria_and_has_a_plural():
    assert all(each.of_orbits or each.of_equilibria for each in KINDS.values())
    assert plural("torus") == "tori"
    assert plural("grazing") == "grazings"
    assert plural("peak") == "peaks"
