"""What the site is made of: a page per public name and per model, and links that lead somewhere."""

import importlib
import inspect
import json
import re
from contextlib import suppress
from pathlib import Path

import pytest
from matplotlib.axes import Axes

ROOT = Path(__file__).parents[1]
LINK = re.compile(r"\]\((?!https?://|#)([^)#\s]+)(?:#[^)\s]*)?\)")
# The entries of a list of pages.
LISTED = re.compile(r"^```\{toctree\}\n(.*?)^```", re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def maker():
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.syspath_prepend(ROOT / "docs")
        yield importlib.import_module("make_site")


@pytest.fixture(scope="module")
def types(maker):
    return importlib.import_module("site_types")


@pytest.fixture(scope="module")
def search(maker):
    return importlib.import_module("site_search")


@pytest.fixture(scope="module")
def site(maker, tmp_path_factory):
    folder = tmp_path_factory.mktemp("site") / "source"
    maker.write_pages(folder)
    return folder


def test_every_public_name_has_a_page(maker, site):
    index = (site / "api.md").read_text(encoding="utf-8")
    for package in maker.PACKAGES:
        for name in maker.public_names(package):
            page = f"models/{name}.md" if package == "models" else f"api/{package}.{name}.md"
            assert f"[`{name}`]({page})" in index
            assert f"{package}.{name}" in (site / page).read_text(encoding="utf-8")


def test_what_is_imported_on_demand_has_a_page(maker, site):
    assert "explore" in maker.public_names("hybrid")
    assert ".. autofunction:: hybrid.explore" in (site / "api" / "hybrid.explore.md").read_text("utf-8")


def documented(package):
    """The classes and functions of a package, and their methods and properties."""
    module = importlib.import_module(package)
    for name in module.__all__:
        thing = getattr(module, name)
        if inspect.isclass(thing) or inspect.isroutine(thing):
            yield f"{package}.{name}", thing
        for inner, each in inspect.getmembers(thing) if inspect.isclass(thing) else ():
            if not inner.startswith("_") and (inspect.isroutine(each) or isinstance(each, property)):
                yield f"{package}.{name}.{inner}", each


def test_every_parameter_has_a_type(types):
    untyped = {}
    for package in types.PACKAGES:
        for name, thing in documented(package):
            lines = types.typed(thing, (inspect.getdoc(thing) or "").splitlines())
            untyped |= {name: types.untyped(lines)} if types.untyped(lines) else {}
    assert untyped == {}


def test_types_are_those_of_the_annotations(types):
    def call(a: float | None = None, b: int = 1, c: dict[str, Axes] | None = None, *rest: float) -> None:
        """Do it.

        Parameters
        ----------
        a
            A number.
        b, c
            Others.
        d : str
            Has one.
        *rest
            More.

        Notes
        -----
        b
        """

    assert types.typed(call, inspect.getdoc(call).splitlines())[2:] == [
        *("Parameters", "----------", "a : float, optional", "    A number."),
        *("b : int, optional", "c : dict[str, matplotlib.axes.Axes], optional", "    Others."),
        *("d : str", "    Has one.", "*rest : float", "    More.", "", "Notes", "-----", "b"),
    ]
    simulate = types.annotations_of(importlib.import_module("hybrid").simulate)
    assert simulate["x0"] == "ArrayLike | ArcEnd"
    assert simulate["max_jumps"] == "int, optional"
    system = types.annotations_of(importlib.import_module("hybrid").HybridSystem)
    assert system["parameters"] == "Mapping[str, float], optional"


def test_what_readers_look_for_is_a_keyword_of_its_page(search, site):
    """The search ranks keywords first; those of equal rank are as many as may come first."""
    pages = {
        page.relative_to(site).with_suffix("").as_posix(): main_entries(page.read_text("utf-8"))
        for page in site.rglob("*.md")
    }
    for word, wanted in search.QUESTIONS.items():
        answering = [page for page, words in pages.items() if word.lower() in words]
        assert wanted in answering, word
        assert len(answering) <= search.FIRST, (word, answering)


def main_entries(text):
    """The words that the index of the site has of a page, in front of all other results of a search."""
    return [
        word.strip().lower()
        for line in re.findall(r"^```\{index\} (.*)$", text, re.MULTILINE)
        for word in re.findall(r"! ([^,]+)", line)
    ]


def test_every_page_of_the_documentation_has_keywords(search):
    without = [
        page.relative_to(ROOT).as_posix()
        for page in (ROOT / "docs").rglob("*.md")
        if page.name != "gallery.md" and not search.keywords(page.read_text("utf-8"))
    ]
    assert without == []


def test_the_index_of_tasks_leads_to_every_how_to_page_and_to_names(maker, site):
    text = (site / "i-want-to.md").read_text("utf-8")
    listed = LISTED.findall((ROOT / "docs" / "how-to.md").read_text("utf-8"))
    pages = [line for block in listed for line in block.splitlines() if line and not line.startswith(":")]
    assert len(pages) > 20
    assert [page for page in pages if f"]({page}.md" not in text] == []
    assert "[`simulate_many`](api/hybrid.simulate_many.md)" in text
    assert "[`HybridSystem(outputs=)`](api/hybrid.HybridSystem.md)" in text
    # A name in the text of a link stays as it is.
    assert maker.with_names("[`simulate`](x.md) `no_such_name`") == "[`simulate`](x.md) `no_such_name`"


def test_the_page_of_a_model_has_its_parameters_with_units_and_its_script(site):
    text = (site / "models" / "bouncing_ball.md").read_text(encoding="utf-8")
    assert "| `g` | 9.81 | m/s^2 |" in text
    assert "```python\ndef bouncing_ball(ax: Axes) -> None:" in text
    assert "![" in text
    assert ".. autofunction:: models.bouncing_ball" in text


def test_links_lead_somewhere(site):
    for page in site.rglob("*.md"):
        for target in LINK.findall(page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), (page.name, target)


def test_every_page_is_listed_once(site):
    listed = []
    for page in site.rglob("*.md"):
        for block in LISTED.findall(page.read_text(encoding="utf-8")):
            entries = [line for line in block.splitlines() if line and not line.startswith(":")]
            listed += [(page.parent / entry).relative_to(site).as_posix() for entry in entries]
    pages = {page.relative_to(site).with_suffix("").as_posix() for page in site.rglob("*.md")}
    assert sorted(listed) == sorted(pages - {"index"})


def test_tutorials_are_notebooks_on_the_site(maker, site):
    for name in maker.EXECUTED:
        page = (ROOT / "docs" / name).read_text(encoding="utf-8")
        text = (site / name).read_text(encoding="utf-8")
        assert text.startswith("---\nfile_format: mystnb\n")
        assert text.count("```{code-cell} python\n") == page.count("```python\n") > 0
        assert "```python" not in text
        cells = json.loads((site / "notebooks" / name).with_suffix(".ipynb").read_text(encoding="utf-8"))[
            "cells"
        ]
        assert [cell["cell_type"] for cell in cells].count("code") == page.count("```python\n")


def test_a_site_takes_its_place_when_it_is_complete(maker, tmp_path):
    place = tmp_path / "html"
    for text in ("old", "new"):
        with maker.whole(place) as unfinished:
            unfinished.mkdir()
            (unfinished / "index.html").write_text(text)
        assert [path.name for path in tmp_path.iterdir()] == ["html"]
    with suppress(SystemExit), maker.whole(place) as unfinished:
        unfinished.mkdir()
        (unfinished / "index.html").write_text("half")
        raise SystemExit(1)
    assert (place / "index.html").read_text() == "new"


def test_a_value_without_a_comment_is_refused(maker):
    with pytest.raises(SystemExit, match=r"hybrid\.nothing has no comment that says what it is"):
        maker.comment_above(importlib.import_module("hybrid"), "nothing")
