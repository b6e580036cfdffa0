"""A name of the kernels stands for one thing, wherever it is read."""

import ast
from collections import defaultdict
from pathlib import Path

import hybrid

KERNELS = Path(hybrid.__file__).parent / "kernels"


def names_of(tree):
    """The names that a module defines."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Assign):
            for target in node.targets:
                yield from (each.id for each in ast.walk(target) if isinstance(each, ast.Name))


def test_no_name_stands_for_two_things():
    places = defaultdict(list)
    # The door to numba speaks of numba's things.
    for path in sorted(each for each in KERNELS.rglob("*.py") if "numba_door" not in each.parts):
        for name in names_of(ast.parse(path.read_text(encoding="utf-8"))):
            if not name.startswith("_"):
                places[name].append(str(path.relative_to(KERNELS)))
    assert {name: where for name, where in places.items() if len(where) > 1} == {}
