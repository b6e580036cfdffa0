"""Make the gallery with one picture per model: ``python docs/make_gallery.py``.

Each part ``gallery_*.py`` in this folder holds a list ``PICTURES`` of entries: name of a model, caption, a
function that draws on given axes, and the words with which the search of the site finds the model.
"""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
from make_pictures import STYLE, save
from matplotlib.axes import Axes

import models

HERE = Path(__file__).parent
SIZE = (4.0, 3.0)
COLUMNS = 3
HEAD = """# Gallery

One picture per model, drawn by [make_gallery.py](make_gallery.py). The names link to the models.

"""


class Picture(NamedTuple):
    """Name of a model in `models`, caption, drawing function, and keywords."""

    model: str
    caption: str
    draw: Callable[[Axes], None]
    keywords: str = ""

    @property
    def source(self) -> str:
        """Path of the model's file, relative to this folder."""
        return f"../{getattr(models, self.model).__module__.replace('.', '/')}.py"


def pictures() -> list[Picture]:
    """The pictures of all parts, sorted by the name of the model."""
    parts = [importlib.import_module(path.stem) for path in sorted(HERE.glob("gallery_*.py"))]
    found = sorted((Picture(*entry) for part in parts for entry in part.PICTURES), key=lambda p: p.model)
    names = [picture.model for picture in found]
    for name in names:
        if names.count(name) > 1:
            raise SystemExit(f"Gallery: {name!r} has {names.count(name)} pictures. Keep one.")
        if not callable(getattr(models, name, None)):
            raise SystemExit(f"Gallery: {name!r} is not a model. Use a name that `models` exports.")
    return found


def page(found: list[Picture]) -> str:
    """The page ``gallery.md``: a table of pictures with captions and links."""
    cells = [
        f"![{picture.model}](gallery/{picture.model}.png)<br>"
        f"[`{picture.model}`]({picture.source}) {picture.caption}"
        for picture in found
    ]
    cells += [""] * (-len(cells) % COLUMNS)
    rows = [f"|{'   |' * COLUMNS}", f"|{'---|' * COLUMNS}"]
    rows += [f"| {' | '.join(cells[i : i + COLUMNS])} |" for i in range(0, len(cells), COLUMNS)]
    return HEAD + "\n".join(rows) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--output", type=Path, default=Path("pictures"), help="folder of the page and of gallery/"
    )
    parser.add_argument("models", nargs="*", help="names of models to draw, by default all")
    arguments = parser.parse_args()
    found = pictures()
    unknown = set(arguments.models) - {picture.model for picture in found}
    if unknown:
        parser.error(f"no picture of {', '.join(sorted(unknown))}")
    folder = arguments.output / "gallery"
    folder.mkdir(parents=True, exist_ok=True)
    with plt.rc_context(STYLE):
        for picture in found:
            if not arguments.models or picture.model in arguments.models:
                figure, axes = plt.subplots(figsize=SIZE, layout="constrained")
                picture.draw(axes)
                axes.spines[["top", "right"]].set_visible(False)
                save(figure, folder / f"{picture.model}.png")
    (arguments.output / "gallery.md").write_text(page(found), encoding="utf-8")


if __name__ == "__main__":
    main()
