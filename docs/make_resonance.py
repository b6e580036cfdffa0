"""Draws the pictures of docs/resonance-curves.md from its blocks: ``python docs/make_resonance.py``."""

from __future__ import annotations

import argparse
import contextlib
import io
import re
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
from make_pictures import STYLE, save

PAGE = Path(__file__).parent / "resonance-curves.md"
# Names of axes on the page, and of the pictures.
PICTURES = {"gear_axes": "gear", "bilinear_axes": "bilinear", "impact_axes": "impact"}
SIZE = (6.4, 3.6)
LABELS = {
    "gear_axes": ("mesh frequency $w$", "amplitude of $x$ (half backlashes)"),
    "bilinear_axes": ("forcing frequency $w$", "amplitude of $x$"),
    "impact_axes": ("forcing frequency $w$", "amplitude of $x$"),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("pictures"), help="folder of the pictures")
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    page: dict[str, Any] = {}
    with plt.rc_context(STYLE), contextlib.redirect_stdout(io.StringIO()):
        for block in blocks:
            exec(compile(block, str(PAGE), "exec"), page)
        figures = {name: page[name].figure for name in PICTURES}
    with plt.rc_context(STYLE):
        for name, figure in figures.items():
            figure.set_size_inches(SIZE)
            across, up = LABELS[name]
            page[name].set_xlabel(across)
            page[name].set_ylabel(up)
            page[name].spines[["top", "right"]].set_visible(False)
            save(figure, folder / f"resonance_{PICTURES[name]}.png")


if __name__ == "__main__":
    main()
