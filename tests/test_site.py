"""What the site is made of: a page per public name and per model, and links that lead somewhere."""

import importlib
import json
import re
from contextlib import suppress
from pathlib import Path

import pytest

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
def site(maker, tmp_path_factory):
    folder = tmp_path_factory.mktemp("site") / "source"
    maker.write_pages(folder)
    return folder


def test_every_public_name_has_a_page(maker, site):
    index = (site / "api.md").read_text(encoding="utf-8")
    for package in maker.PACKAGES:
        for name in importlib.import_module(package).__all__:
            page = f"models/{name}.md" if package == "models" else f"api/{package}.{name}.md"
            assert f"[`{name}`]({page})" in index
            assert f"{package}.{name}" in (site / page).read_text(encoding="utf-8")


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
