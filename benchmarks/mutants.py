"""``python -m benchmarks.mutants hybrid/status.py`` plants faults one at a time and runs the nearest tests.

A fault is one changed operator, comparison, constant or condition. It is noticed if a test fails. Tests that
do not end within the limit of processor time are counted by themselves: the fault may make them endless, or
the limit may be too low. The changed copy is in a temporary folder.

With ``--coverage FILE`` the nearest tests are those that run the changed line and little else. The file comes
from ``python -m pytest -n auto --cov=hybrid --cov=lyapunov --cov-context=test`` (package pytest-cov). Machine
code is not seen there, so the kernels keep the tests that names lead to.
"""

from __future__ import annotations

import argparse
import ast
import copy
import os
import random
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

from benchmarks.common import ROOT, heading, table
from benchmarks.forked_tests import ENDLESS, Copy
from benchmarks.nearest import NEAREST

OTHER_OPERATOR = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Mod: ast.Add}
OTHER_COMPARISON = {
    ast.Lt: ast.Gt,
    ast.LtE: ast.GtE,
    ast.Gt: ast.Lt,
    ast.GtE: ast.LtE,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
# Most test files to run per fault, and most tests if they are known by their coverage.
MOST_TESTS = 4
MOST_COVERING = 30
OTHER_NAME = {"min": "max", "max": "min", "any": "all", "all": "any"}


class Fault(NamedTuple):
    """One change of a source, and a description of the change."""

    path: Path
    line: int
    change: str
    # Number of the node in the order of ``ast.walk``.
    place: int

    def source(self) -> str:
        """Text of the file with the fault."""
        tree = ast.parse((ROOT / self.path).read_text(encoding="utf-8"))
        node = next(each for i, each in enumerate(ast.walk(tree)) if i == self.place)
        (change,) = _changes(node)
        change(node)
        return ast.unparse(tree)


def faults(path: Path) -> Iterator[Fault]:
    """Every fault that can be planted in a file, except in errors and texts."""
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    skipped = {id(each) for node in ast.walk(tree) if _is_silent(node) for each in ast.walk(node)}
    for place, node in enumerate(ast.walk(tree)):
        if id(node) in skipped:
            continue
        for change in _changes(node):
            changed = copy.copy(node)
            change(changed)
            before, after = ast.unparse(node), ast.unparse(changed)
            if after != before:
                told = f"{before[:60]} -> {after[:60]}"
                yield Fault(path, getattr(node, "lineno", 0), told, place)


def _is_silent(node: ast.AST) -> bool:
    """Whether a fault at the node changes no result: texts, annotations, imports, errors, constants."""
    if isinstance(node, ast.Raise | ast.JoinedStr | ast.Import | ast.ImportFrom | ast.AnnAssign):
        return True
    if isinstance(node, ast.FunctionDef) and node.name in ("__repr__", "__getattr__"):
        return True
    if isinstance(node, ast.Assign):
        [target, *_] = node.targets
        names = target.elts if isinstance(target, ast.Tuple) else [target]
        if all(isinstance(each, ast.Name) and each.id.isupper() for each in names):
            return True
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def _changes(node: ast.AST) -> list[Callable[[ast.AST], None]]:
    def set_field(name: str, value: object) -> Callable[[ast.AST], None]:
        return lambda target: setattr(target, name, value)

    if isinstance(node, ast.BinOp) and type(node.op) in OTHER_OPERATOR:
        return [set_field("op", OTHER_OPERATOR[type(node.op)]())]
    if isinstance(node, ast.Compare) and type(node.ops[0]) in OTHER_COMPARISON:
        return [set_field("ops", [OTHER_COMPARISON[type(node.ops[0])](), *node.ops[1:]])]
    if isinstance(node, ast.BoolOp):
        return [set_field("op", ast.Or() if isinstance(node.op, ast.And) else ast.And())]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return [set_field("op", ast.UAdd())]
    if isinstance(node, ast.If | ast.IfExp | ast.While):
        return [set_field("test", ast.UnaryOp(ast.Not(), node.test))]
    if isinstance(node, ast.Constant) and type(node.value) in (int, float, bool):
        other = not node.value if isinstance(node.value, bool) else node.value * 2 if node.value else 1
        return [set_field("value", other)]
    if isinstance(node, ast.Name) and node.id in OTHER_NAME:
        return [set_field("id", OTHER_NAME[node.id])]
    return []


def nearest_tests(path: Path) -> list[str]:
    """Test files with the name of the module, or that import it, or of modules that import it.

    The fastest come first, so that slow ones do not use up the limit of time before those are run.
    """
    if str(path) in NEAREST:
        own = [str(p.relative_to(ROOT)) for p in _of_the_same_name(path)]
        others = [(Path("tests/hybrid") / name).as_posix() for name in NEAREST[str(path)]]
        return sorted(dict.fromkeys([*own, *map(os.path.normpath, others)]), key=_compiled)
    tests = _own_tests(path)
    if not tests:
        module = re.compile(rf"\b{re.escape('.'.join(path.with_suffix('').parts))}\b")
        for folder in ("hybrid", "lyapunov"):
            for other in sorted((ROOT / folder).rglob("*.py")):
                if module.search(other.read_text(encoding="utf-8")):
                    tests += _own_tests(other.relative_to(ROOT))
    return sorted(list(dict.fromkeys(tests))[:MOST_TESTS], key=_compiled)


def _compiled(test: str) -> int:
    """How much machine code a test file needs: 0 if it runs no models."""
    text = (ROOT / test).read_text(encoding="utf-8")
    return 1 if re.search(r"^(from|import) hybrid\b(?!\.)", text, re.MULTILINE) else 0


def _of_the_same_name(path: Path) -> list[Path]:
    """Test files with the name of the module; if several have it, those in the same place of the tree."""
    found = sorted((ROOT / "tests").rglob(f"test_{path.stem}.py"))
    mirror = ROOT / "tests" / path.with_name(f"test_{path.stem}.py")
    return [mirror] if mirror in found else found


def _own_tests(path: Path) -> list[str]:
    folder, same = ROOT / "tests", _of_the_same_name(path)
    module = re.compile(rf"\b{re.escape('.'.join(path.with_suffix('').parts))}\b")
    importing = (p for p in sorted(folder.rglob("test_*.py")) if module.search(p.read_text(encoding="utf-8")))
    return [str(p.relative_to(ROOT)) for p in (same or importing)]


class Coverage:
    """Which tests run which lines, as pytest-cov has recorded it."""

    def __init__(self, path: Path) -> None:
        from coverage import CoverageData

        data = CoverageData(str(path))
        data.read()
        self.tests: dict[str, dict[int, set[str]]] = {}
        self.sizes: Counter[str] = Counter()
        for name in data.measured_files():
            lines = {
                line: {each for each in tests if each}
                for line, tests in data.contexts_by_lineno(name).items()
            }
            top = next(top for top in ("/hybrid/", "/lyapunov/") if top in name)
            self.tests[top[1:] + name.rsplit(top, 1)[1]] = lines
            self.sizes.update(each for tests in lines.values() for each in tests)

    def nearest(self, fault: Fault) -> list[str]:
        """Tests that run the line, or lines around it: of each file those first that run few other lines."""
        lines = self.tests.get(str(fault.path), {})
        for margin in (0, 2, 10, 50, 1000):
            found = set().union(*(tests for line, tests in lines.items() if abs(line - fault.line) <= margin))
            if found:
                ordered = sorted(found, key=lambda each: (self.sizes[each], each))
                rank: Counter[str] = Counter()
                turns = []
                for test in dict.fromkeys(each.split("|")[0] for each in ordered):
                    file = test.split("::")[0]
                    rank[file] += 1
                    turns.append((rank[file], len(turns), test))
                return [test for *_, test in sorted(turns)][:MOST_COVERING]
        return []


_COPY: list[Copy] = []


def first_failure(fault: Fault | None, tests: Sequence[str], seconds: int) -> str | None:
    """The first test that fails or does not end on a copy with the fault, or without one."""
    if not _COPY:
        _COPY.append(Copy())
    changed, source = (fault.path, fault.source()) if fault else (None, "")
    return _COPY[0].failing(tests, seconds, changed, source)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path, help="sources, relative to the top of the project")
    parser.add_argument("--each", type=int, default=8, help="number of random faults per file")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--seconds", type=int, default=200, help="limit of the processor time of the tests per fault"
    )
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--coverage", type=Path, help="coverage with one context per test")
    given = parser.parse_args(arguments)
    coverage = Coverage(given.coverage) if given.coverage else None
    files = sorted((ROOT / "tests").rglob("test_*.py"))

    def tests_of(fault: Fault) -> list[str]:
        if coverage is None:
            return nearest_tests(fault.path)
        # Tests of the same name may be newer than the coverage.
        own = [str(p.relative_to(ROOT)) for p in files if p.stem == f"test_{fault.path.stem}"]
        others = [test for test in coverage.nearest(fault) if test.split("::")[0] not in own]
        return own + others if own or others else nearest_tests(fault.path)

    heading("Faults planted one at a time, and the number that the nearest tests notice.")
    rows, planted, noticed, endless, failing = [], 0, 0, 0, set[str]()
    with ProcessPoolExecutor(given.processes) as pool:
        for path in given.files:
            found = list(faults(path))
            if not found or not tests_of(found[0]):
                rows.append([str(path), str(len(found)), "no tests" if found else "", "", ""])
                continue
            drawn = random.Random(f"{given.seed} {path}").sample(found, min(given.each, len(found)))
            runs = [pool.submit(first_failure, each, tests_of(each), given.seconds) for each in drawn]
            results = [run.result() for run in runs]
            for fault, test in zip(drawn, results, strict=True):
                seen = test if test == ENDLESS else f"noticed by {test}" if test else "not noticed"
                print(f"{seen}: {path}:{fault.line}: {fault.change}", flush=True)
            failing.update(test.split("[")[0] for test in results if test and "::" in test)
            long = results.count(ENDLESS)
            count = sum(map(bool, results)) - long
            planted, noticed, endless = planted + len(drawn), noticed + count, endless + long
            rows.append([str(path), str(len(found)), str(len(drawn)), str(count), str(long)])
        broken = set[str]()
        while test := pool.submit(first_failure, None, sorted(failing - broken), 3600).result():
            broken.add(test.split("[")[0])
            print(f"fails without a fault too: {test}", flush=True)
            if test == ENDLESS or test.split("[")[0] not in failing:
                break
    rows.append(["all", "", str(planted), str(noticed), str(endless)])
    print()
    table(["file", "possible faults", "planted", "noticed", ENDLESS], rows)


if __name__ == "__main__":
    main()
