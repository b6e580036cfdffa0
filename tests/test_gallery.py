"""Every model has its own short file, its tests, and its picture in the gallery."""

import importlib
from pathlib import Path

import pytest

import models

ROOT = Path(__file__).parents[1]
NAMES = [name for name in vars(models) if callable(getattr(models, name))]
# A model with what is known of it, and an example.
MAX_LINES = 185

every_model = pytest.mark.parametrize("name", NAMES)


@pytest.fixture
def gallery(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "docs")
    return importlib.import_module("make_gallery")


@every_model
def test_a_model_has_a_short_file(name):
    path = ROOT / f"{getattr(models, name).__module__.replace('.', '/')}.py"
    length = len(path.read_text(encoding="utf-8").splitlines())
    assert length <= MAX_LINES, f"{path.relative_to(ROOT)} has {length} lines; {MAX_LINES} are enough"


@every_model
def test_a_model_has_tests(name):
    module = getattr(models, name).__module__.removeprefix("models.")
    assert (ROOT / "tests" / "models" / f"test_{module}.py").exists()


@every_model
def test_a_model_has_a_picture(name, gallery):
    assert name in {picture.model for picture in gallery.pictures()}
    assert (ROOT / "docs" / "gallery" / f"{name}.png").stat().st_size > 0


def test_the_page_shows_the_gallery_as_it_is(gallery):
    """``python docs/make_gallery.py`` writes the page again."""
    found = gallery.pictures()
    page = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    assert page == gallery.page(found)
    drawn = {path.stem for path in (ROOT / "docs" / "gallery").glob("*.png")}
    assert drawn == {picture.model for picture in found}


def test_a_picture_of_no_model_is_refused(gallery, monkeypatch):
    part = importlib.import_module("gallery_contact")
    monkeypatch.setattr(part, "PICTURES", [("no_such_model", "Nothing.", lambda ax: None)])
    with pytest.raises(SystemExit, match="'no_such_model' is not a model"):
        gallery.pictures()


def test_two_pictures_of_one_model_are_refused(gallery, monkeypatch):
    part = importlib.import_module("gallery_contact")
    monkeypatch.setattr(part, "PICTURES", part.PICTURES[:1] * 2)
    with pytest.raises(SystemExit, match="'vibroimpact' has 2 pictures"):
        gallery.pictures()


def test_one_picture_is_drawn_where_it_is_asked_for(gallery, monkeypatch, tmp_path):
    monkeypatch.setattr("sys.argv", ["make_gallery.py", "--output", str(tmp_path), "bouncing_ball"])
    gallery.main()
    assert [path.name for path in (tmp_path / "gallery").iterdir()] == ["bouncing_ball.png"]
    assert (tmp_path / "gallery.md").read_text(encoding="utf-8") == gallery.page(gallery.pictures())
