"""Build the site: ``make docs``, or ``python docs/make_site.py``; ``--links`` asks the linked sites instead.

The pages of this folder, and those that are made from the sources (one per public name, one per model), go to
``build/site/source``; the table of published numbers is computed anew, which takes half a minute. Sphinx
makes ``build/site/html`` of them: in another folder, which takes this place when it is complete. A warning is
an error.
"""

from __future__ import annotations

import argparse
import enum
import importlib
import inspect
import json
import os
import posixpath
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import ModuleType

from make_gallery import Picture, pictures
from make_published import renew
from site_search import comment, indexed
from site_types import PACKAGES

import models

HERE = Path(__file__).parent
ROOT = HERE.parent
# Pages outside this folder, and their names on the site.
OUTSIDE = {
    "benchmarks/README.md": "measurements.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
# Pages whose blocks are executed when the site is built, with what a notebook shows below them.
EXECUTED = ("newcomer.md", "notebook.md", "plain-equations.md")
NOTEBOOK = """---
file_format: mystnb
kernelspec:
  name: site
---

"""
# Pages on which the names lead to the pages of the names.
INDICES = ("how-to.md", "i-want-to.md", "names.md", "reference.md")
STAGES = 3
# A name in code, alone or with arguments, and links, in which there is no room for another one.
NAME = re.compile(r"(?P<link>\[[^\]]*\]\([^)]*\))|`(?P<name>\w+)(?P<arguments>\([^`]*\))?`")
LINK = re.compile(r"\]\((?!https?://|#)([^)#\s]+)(#[^)\s]*)?\)")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=ROOT / "build" / "site", help="folder of the site")
    parser.add_argument("--links", action="store_true", help="ask every linked site, in place of building")
    given = parser.parse_args()
    output = given.output
    source = output / "source"
    kind = "linkcheck" if given.links else "html"
    shutil.rmtree(source, ignore_errors=True)
    tell(1, f"writing the pages into {source}")
    write_pages(source)
    tell(2, "computing the published numbers")
    renew(source / "published.md")
    tell(3, "asking the linked sites" if given.links else "executing the tutorials and writing the site")
    with whole(output / kind) as unfinished:
        code = build(kind, source, unfinished, output)
        if code:
            sys.exit(code)
    print("All links are answered." if given.links else f"Open {output / kind / 'index.html'}")


def tell(number: int, stage: str) -> None:
    print(f"Site, {number} of {STAGES}: {stage} ...", flush=True)


@contextmanager
def whole(folder: Path) -> Iterator[Path]:
    """A folder to write into, which takes the place of another one when the block ends without an error."""
    unfinished = folder.with_name(f"{folder.name}-unfinished")
    shutil.rmtree(unfinished, ignore_errors=True)
    yield unfinished
    shutil.rmtree(folder, ignore_errors=True)
    unfinished.rename(folder)


def build(kind: str, source: Path, into: Path, output: Path) -> int:
    """Run Sphinx, which tells in a terminal at which page it is; returns its exit status."""
    command = [sys.executable, "-m", "sphinx", "--fail-on-warning", "--keep-going", "--builder", kind]
    command += ["--doctree-dir", str(output / f"doctrees-{kind}")]
    if not sys.stdout.isatty():
        command += ["--quiet"]
    if kind == "linkcheck":
        # No page has to be executed for its links.
        command += ["--define", "nb_execution_mode=off"]
    # A notebook draws into its page, whatever this process draws into.
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    environment["JUPYTER_PATH"] = str(output / "jupyter")
    write_kernel(output / "jupyter")
    return subprocess.run([*command, str(source), str(into)], check=False, env=environment).returncode


def write_pages(source: Path) -> None:
    """Everything that Sphinx reads."""
    source.mkdir(parents=True)
    for name in ("conf.py", "site_types.py", "search_scorer.js", "icon.svg"):
        shutil.copy(HERE / name, source)
    (source / "_static").mkdir()
    shutil.copy(HERE / "site.css", source / "_static")
    for page in [*HERE.rglob("*.md"), *map(ROOT.joinpath, OUTSIDE)]:
        text = with_links(page)
        if page.name in INDICES:
            text = with_names(text)
        if page.name in EXECUTED:
            file = f"notebooks/{page.stem}.ipynb"
            write(source / file, json.dumps(notebook(text), indent=1))
            text = f"{as_notebook(text)}\n{{download}}`This page as a notebook <{file}>`\n"
        write(source / place(page), text)
    for picture in [*HERE.rglob("*.png"), *HERE.rglob("*.gif"), *(ROOT / "benchmarks").glob("*.png")]:
        (source / place(picture)).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(picture, source / place(picture))
    write_models(source)
    write_names(source)


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(indexed(text) if path.suffix == ".md" else text, encoding="utf-8")


def place(path: Path) -> Path:
    """Where a page or a picture of the repository is on the site."""
    known = OUTSIDE.get(path.relative_to(ROOT).as_posix())
    if known:
        return Path(known)
    if path.parent == ROOT / "models":
        return Path("models", f"{path.stem}.md")
    return path.relative_to(HERE) if HERE in path.parents else Path(path.name)


def with_links(page: Path) -> str:
    """The text of a page, in which links to files of the repository lead to where these are on the site."""
    here = place(page).parent.as_posix()

    def moved(link: re.Match[str]) -> str:
        target = (page.parent / link[1]).resolve()
        if not target.is_file():
            # Sphinx says that the link leads nowhere, unless the page is one that this script makes.
            return link[0]
        return f"]({posixpath.relpath(place(target).as_posix(), here)}{link[2] or ''})"

    return LINK.sub(moved, page.read_text(encoding="utf-8"))


def with_names(text: str) -> str:
    """A page in which public names lead to their pages."""

    def led(found: re.Match[str]) -> str:
        page = page_of(found["name"]) if found["name"] else None
        return f"[{found[0]}]({page})" if page else found[0]

    return NAME.sub(led, text)


@cache
def page_of(name: str) -> str | None:
    """The page of a public name; None if there is no such name."""
    for package in PACKAGES:
        if name in public_names(package):
            # The gallery has the pages of the models.
            return f"models/{name}.md" if package == "models" else f"api/{package}.{name}.md"
    return None


def as_notebook(text: str) -> str:
    """A page whose Python blocks are cells, which the extension of the site executes."""
    return NOTEBOOK + re.sub(r"^```python$", "```{code-cell} python", text, flags=re.MULTILINE)


def notebook(text: str) -> dict[str, object]:
    """The same cells as a file that Jupyter opens, not executed."""
    cells: list[dict[str, object]] = []
    for i, part in enumerate(re.split(r"^```python\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL)):
        cell: dict[str, object] = {"id": f"cell-{i}", "metadata": {}, "source": part.strip()}
        if i % 2:
            cells.append({"cell_type": "code", **cell, "execution_count": None, "outputs": []})
        elif part.strip():
            cells.append({"cell_type": "markdown", **cell})
    python = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return {"nbformat": 4, "nbformat_minor": 5, "metadata": {"kernelspec": python}, "cells": cells}


def write_kernel(folder: Path) -> None:
    """Say which Python executes the pages: this one, and only errors are reported."""
    start = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
    kernel = {"argv": [*start, "--IPKernelApp.log_level=ERROR"], "display_name": "site", "language": "python"}
    write(folder / "kernels" / "site" / "kernel.json", json.dumps(kernel))


def write_models(source: Path) -> None:
    """The gallery: a card per model, and a page per model."""
    found = pictures()
    cards = "\n".join(card(picture) for picture in found)
    contents = "\n".join(f"models/{picture.model}" for picture in found)
    text = GALLERY.format(cards=cards, contents=contents)
    write(source / "gallery.md", text)
    for picture in found:
        write(source / "models" / f"{picture.model}.md", model_page(picture))


GALLERY = """# Gallery

<!-- keywords: gallery, model, models, example, examples, demo -->

One card per model. Its page has equations, parameters with units, known facts and the script of the picture.

::::{{grid}} 1 2 3 3
:gutter: 3

{cards}
::::

```{{toctree}}
:hidden:

{contents}
```
"""


def card(picture: Picture) -> str:
    return (
        f":::{{grid-item-card}} {picture.model}\n:link: models/{picture.model}\n:link-type: doc\n"
        f":img-top: gallery/{picture.model}.png\n:img-alt: {picture.caption}\n\n{picture.caption}\n:::\n"
    )


def model_page(picture: Picture) -> str:
    """The page of a model: picture, documentation, parameters, graph and script."""
    system = getattr(models, picture.model)()
    rows = [
        f"| `{name}` | {value:.6g} | {system.units.get(name, '') or '1'} |"
        for name, value in system.parameters.items()
    ]
    table = ["## Parameters", "", "| name | default | unit |", "|---|---|---|", *rows, ""] if rows else []
    return "\n".join(
        [
            f"# {picture.model}",
            "",
            comment(picture.keywords),
            picture.caption,
            "",
            f"![{picture.caption}](../gallery/{picture.model}.png)",
            "",
            *directive("autofunction", f"models.{picture.model}"),
            *table,
            "## The script of the picture",
            "",
            "The function draws on given axes; `python docs/make_gallery.py " + picture.model + "` runs it.",
            "",
            "```python",
            inspect.getsource(picture.draw).strip(),
            "```",
            "",
        ]
    )


def directive(kind: str, name: str, *options: str) -> list[str]:
    return ["```{eval-rst}", f".. {kind}:: {name}", *(f"   {option}" for option in options), "```", ""]


def write_names(source: Path) -> None:
    """The reference: a page per public name, and an index of them."""
    parts = []
    for package in PACKAGES:
        module = importlib.import_module(package)
        names = sorted(public_names(package), key=str.lower)
        pages: list[str] = []
        lines = [f"## {package}", "", first_sentence(module), "", "| name | |", "|---|---|"]
        for name in names:
            thing = getattr(module, name)
            # The gallery has the pages of the models.
            page = f"models/{name}" if module is models else f"api/{package}.{name}"
            lines.append(f"| [`{name}`]({page}.md) | {first_sentence(thing)} |")
            if module is not models:
                write(source / f"{page}.md", name_page(package, name, thing))
                pages.append(page)
        contents = "\n".join(pages)
        parts.append("\n".join(lines) + f"\n\n```{{toctree}}\n:hidden:\n\n{contents}\n```\n")
    write(source / "api.md", "# Every public name\n\n" + "\n".join(parts))


def public_names(package: str) -> list[str]:
    """The names of a package that have a page: what it exports, and functions that are imported on demand."""
    module = importlib.import_module(package)
    on_demand = getattr(module, "ON_DEMAND", {})
    return [*module.__all__, *(name for name in on_demand if inspect.isroutine(getattr(module, name)))]


def first_sentence(thing: object) -> str:
    """The first line of a documentation, for a table."""
    documented = inspect.ismodule(thing) or inspect.isclass(thing) or inspect.isroutine(thing)
    text = (inspect.getdoc(thing) or "") if documented else ""
    return text.partition("\n")[0].replace("|", r"\|")


def name_page(package: str, name: str, thing: object) -> str:
    full = f"{package}.{name}"
    if inspect.isclass(thing):
        options = [":members:"]
        if not issubclass(thing, (enum.Enum, Exception)):
            options.append(":inherited-members:")
        shown = directive("autoclass", full, *options)
    elif inspect.isroutine(thing):
        shown = directive("autofunction", full)
    else:
        shown = directive("py:data", full, "", comment_above(importlib.import_module(package), name))
    return "\n".join([f"# {full}", "", *shown])


def comment_above(module: ModuleType, name: str) -> str:
    """The comment above a value in the sources of its package."""
    for path in sorted(Path(str(module.__file__)).parent.glob("*.py")):
        found = re.search(rf"((?:^# .*\n)+){name}\b.* = ", path.read_text(encoding="utf-8"), re.MULTILINE)
        if found:
            return " ".join(line.removeprefix("# ") for line in found[1].splitlines())
    raise SystemExit(f"Site: {module.__name__}.{name} has no comment that says what it is.")


if __name__ == "__main__":
    main()
