"""Build the site: ``make docs``, or ``python docs/make_site.py``.

The pages of this folder, and those that are made from the sources (one per public name, one per model), go to
``build/site/source``; the table of published numbers is computed anew, which takes half a minute. Sphinx
makes ``build/site/html`` of them. A warning is an error.
"""

from __future__ import annotations

import argparse
import enum
import importlib
import inspect
import posixpath
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

from make_gallery import Picture, pictures
from make_published import renew

import models

HERE = Path(__file__).parent
ROOT = HERE.parent
PACKAGES = ("hybrid", "lyapunov", "models", "hybrid.testing", "hybrid.plot", "lyapunov.plot")
# Pages outside this folder, and their names on the site.
OUTSIDE = {
    "benchmarks/README.md": "measurements.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
LINK = re.compile(r"\]\((?!https?://|#)([^)#\s]+)(#[^)\s]*)?\)")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=ROOT / "build" / "site", help="folder of the site")
    output = parser.parse_args().output
    source = output / "source"
    shutil.rmtree(source, ignore_errors=True)
    write_pages(source)
    renew(source / "published.md")
    command = [sys.executable, "-m", "sphinx", "--fail-on-warning", "--keep-going", "--quiet"]
    command += ["--builder", "html", "--doctree-dir", str(output / "doctrees")]
    done = subprocess.run([*command, str(source), str(output / "html")], check=False)
    if done.returncode:
        sys.exit(done.returncode)
    print(f"Open {output / 'html' / 'index.html'}")


def write_pages(source: Path) -> None:
    """Everything that Sphinx reads."""
    source.mkdir(parents=True)
    shutil.copy(HERE / "conf.py", source)
    for page in [*HERE.rglob("*.md"), *map(ROOT.joinpath, OUTSIDE)]:
        write(source / place(page), with_links(page))
    for picture in [*HERE.rglob("*.png"), *(ROOT / "benchmarks").glob("*.png")]:
        (source / place(picture)).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(picture, source / place(picture))
    write_models(source)
    write_names(source)


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def place(path: Path) -> Path:
    """Where a page or a picture of the repository is on the site."""
    known = OUTSIDE.get(path.relative_to(ROOT).as_posix())
    if known:
        return Path(known)
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
        names = sorted(module.__all__, key=str.lower) if hasattr(module, "__all__") else []
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
