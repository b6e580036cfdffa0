"""Imports follow the order of docs/architecture.md without circles, and files stay small."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import NamedTuple

import networkx as nx
import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("hybrid", "models", "lyapunov")
KERNELS_MAY_IMPORT = (
    "__future__",
    "collections",
    "contextlib",
    "ctypes",
    "functools",
    "hybrid.kernels",
    "itertools",
    "llvmlite",
    "math",
    "operator",
    "numba",
    "numpy",
    "re",
    "struct",
    "typing",
)
# Packages from the lowest up: each may import itself and those before it.
ROOMS = (
    "hybrid.errors",
    "hybrid.display",
    "hybrid.arguments",
    "hybrid.shared",
    "hybrid.kernels",
    "hybrid.system",
    "hybrid.status",
    "hybrid.expression",
    "hybrid.solvers",
    "hybrid.transform",
    "hybrid.compiler",
    "hybrid.simulation",
    "hybrid.measures",
    "hybrid.orbits",
    "hybrid.accuracy",
    "hybrid.plot",
    "hybrid.sweep",
    "hybrid.testing",
    "hybrid",
    "models",
    "lyapunov",
    "hybrid.explorer",
    "hybrid.__main__",
)
KERNEL_ROOMS = tuple(
    f"hybrid.kernels.{name}"
    for name in (
        "types",
        "instructions",
        "arithmetic",
        "events",
        "guards",
        "steps",
        "jumps",
        "limit",
        "evaluate",
        "drive",
        "abreast",
        "runs",
    )
)
DOOR = "hybrid.kernels.types.numba_door"
INNER_PACKAGES = (("numba", "core"), ("numba", "np"))
PUBLIC_PARTS = ("numba", "numba.extending", "numba.types", "llvmlite", "llvmlite.binding", "llvmlite.ir")
HEAVY = (
    "bokeh",
    "dask",
    "hypothesis",
    "matplotlib",
    "networkx",
    "numba",
    "pandas",
    "panel",
    "pint",
    "scipy",
    "tqdm",
    "xarray",
    "zarr",
)
MAX_LINES = 500
DOTTED = re.compile(r"(hybrid|models|lyapunov)(\.[a-z_0-9]+)+")
COMPARED = "hybrid.kernels.types.numba_door.part_compiler"
# Names of modules in strings that may lead up or back: hybrid.explore, the only one that is imported so, and
# names of kernels with which the compiler compares the name of the one that it compiles.
KNOWN_WAYS = {("hybrid", "hybrid.explorer.explore")} | {
    (COMPARED, f"hybrid.kernels.{name}")
    for name in (
        "arithmetic.tangent",
        "steps.series",
        "guards.first_event",
        "steps.series_length",
        "guards.isolate",
        "guards.form",
        "guards.roots",
    )
}
# Where the name of an imported module is no literal: what is imported on demand, kernels by their names in
# the loader, the module of a user's model, and a package of an extra.
IMPORT_BY_NAME = {
    "hybrid",
    "hybrid.compiler.cache.loader",
    "hybrid.explorer.command",
    "hybrid.simulation.extra",
}


class Import(NamedTuple):
    """``from module import name``; ``name`` is empty for ``import module``."""

    path: Path
    line: int
    module: str
    name: str

    def __str__(self):
        statement = f"from {self.module} import {self.name}" if self.name else f"import {self.module}"
        return f"{self.path.relative_to(ROOT)}:{self.line}: {statement}"

    def is_of(self, *packages):
        return any(self.module == package or self.module.startswith(f"{package}.") for package in packages)


def sources(folder):
    return sorted((ROOT / folder).rglob("*.py"))


def imports_of(path):
    """Every import statement of a file, including those inside functions, with relative names resolved."""
    yield from imports_in_tree(ast.parse(path.read_text(encoding="utf-8"), filename=str(path)), path)


def imports_in_tree(tree, path):
    package = path.relative_to(ROOT).parent.parts
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (Import(path, node.lineno, alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            module = ".".join((*base, node.module) if node.module else base)
            yield from (Import(path, node.lineno, module, alias.name) for alias in node.names)


def named_in(path):
    """Modules named in strings as imports: ``"hybrid.kernels.drive"``, or a program with imports of its own.

    A dotted name that is no module of the library is no arrow, see ``arrows``.
    """
    tree = ast.parse(path.read_text(encoding="utf-8"), filename=str(path))
    inside = {id(part) for node in ast.walk(tree) for part in no_imports(node)}
    for node in ast.walk(tree):
        if not isinstance(node, ast.Constant) or not isinstance(node.value, str) or id(node) in inside:
            continue
        if DOTTED.fullmatch(node.value):
            yield Import(path, node.lineno, node.value, "")
        elif "import " in node.value:
            for found in imports_of_program(node.value, path):
                yield found._replace(line=node.lineno)


def no_imports(node):
    """Strings that import nothing: docstrings, and the literal parts of f-strings."""
    if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
        yield from (first.value for first in node.body[:1] if isinstance(first, ast.Expr))
    if isinstance(node, ast.JoinedStr):
        yield from node.values


def imports_of_program(text, path):
    """Import statements of a program in a string; none if it is no program."""
    try:
        return list(imports_in_tree(ast.parse(text), path))
    except SyntaxError:
        return []


def imports_in(folder):
    return [found for path in sources(folder) for found in imports_of(path)]


def imports_and_names_in(folder):
    """Also those in strings, but for the ways that are known."""
    named = [found for path in sources(folder) for found in named_in(path)]
    return imports_in(folder) + [found for found in named if way(found) not in KNOWN_WAYS]


def way(found):
    return module_of(found.path), found.module


def report(offences):
    return "\n" + "\n".join(map(str, offences))


def test_the_walk_finds_imports_of_every_form(tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path)
    path = tmp_path / "hybrid" / "kernels" / "step.py"
    path.parent.mkdir(parents=True)
    path.write_text("import attrs\ndef f():\n    from ..system import Mode\n    from . import codes\n")
    assert [str(found) for found in imports_in("hybrid")] == [
        "hybrid/kernels/step.py:1: import attrs",
        "hybrid/kernels/step.py:3: from hybrid.system import Mode",
        "hybrid/kernels/step.py:4: from hybrid.kernels import codes",
    ]


def module_of(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def arrows(*packages):
    """Pairs of modules in which the first imports the second, and the place of the import."""
    modules = {module_of(path) for package in packages for path in sources(package)}
    for package in packages:
        for found in imports_and_names_in(package):
            inner = f"{found.module}.{found.name}"
            target = inner if inner in modules else found.module
            if target in modules and target != module_of(found.path):
                yield module_of(found.path), target, found


def room_of(module, rooms):
    return max((room for room in rooms if module == room or module.startswith(f"{room}.")), key=len)


def upward(rooms, pairs):
    floors = {room: floor for floor, room in enumerate(rooms)}
    return [
        found for one, other, found in pairs if floors[room_of(one, rooms)] < floors[room_of(other, rooms)]
    ]


def test_imports_go_downwards():
    offences = upward(ROOMS, arrows("hybrid", "models", "lyapunov"))
    assert not offences, report(offences)


def test_kernels_go_downwards():
    inside = [
        arrow for arrow in arrows("hybrid/kernels") if all(module.count(".") > 1 for module in arrow[:2])
    ]
    assert len(inside) > 50
    offences = upward(KERNEL_ROOMS, inside)
    assert not offences, report(offences)


def test_an_upward_import_is_seen(tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path)
    for name, text in (("system", "def f():\n    from hybrid.compiler import emit\n"), ("compiler", "")):
        (tmp_path / "hybrid" / name).mkdir(parents=True)
        (tmp_path / "hybrid" / name / "emit.py").write_text(text)
    assert [str(found) for found in upward(ROOMS, arrows("hybrid"))] == [
        "hybrid/system/emit.py:2: from hybrid.compiler import emit"
    ]


def test_a_name_in_a_string_is_seen(tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path)
    program = '"import sys\\nfrom hybrid.compiler.emit import f\\n"'
    own = f'"""hybrid.compiler.emit"""\nA = "hybrid.compiler.emit"\nB = {program}\n'
    for name, text in (("system", own), ("compiler", "")):
        (tmp_path / "hybrid" / name).mkdir(parents=True)
        (tmp_path / "hybrid" / name / "emit.py").write_text(text)
    assert [str(found) for found in upward(ROOMS, arrows("hybrid"))] == [
        "hybrid/system/emit.py:2: import hybrid.compiler.emit",
        "hybrid/system/emit.py:3: from hybrid.compiler.emit import f",
    ]


def test_each_known_way_by_name_is_there():
    named = {way(found) for package in PACKAGES for path in sources(package) for found in named_in(path)}
    assert named >= KNOWN_WAYS


def test_modules_are_imported_by_computed_names_in_few_places():
    def imports_by_name(path):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        called = [node.func for node in ast.walk(tree) if isinstance(node, ast.Call)]
        names = {getattr(each, "attr", "") or getattr(each, "id", "") for each in called}
        return bool(names & {"import_module", "__import__"})

    paths = [path for package in PACKAGES for path in sources(package)]
    assert {module_of(path) for path in paths if imports_by_name(path)} == IMPORT_BY_NAME


def test_no_circle_of_imports():
    """Late imports and imports for types only also count, and names in strings."""
    graph = nx.DiGraph((one, other) for one, other, _ in arrows("hybrid", "models", "lyapunov"))
    circles = [sorted(each) for each in nx.strongly_connected_components(graph) if len(each) > 1]
    assert not circles, circles


def test_kernels_know_only_numpy_the_compiler_and_each_other():
    offences = [found for found in imports_in("hybrid/kernels") if not found.is_of(*KERNELS_MAY_IMPORT)]
    assert not offences, report(offences)


def test_only_the_door_knows_parts_of_the_compiler_that_may_change():
    def is_private(found):
        return found.is_of("numba", "llvmlite") and (
            found.module not in PUBLIC_PARTS or (found.module, found.name) in INNER_PACKAGES
        )

    private = [found for package in PACKAGES for found in imports_in(package) if is_private(found)]
    outside = [found for found in private if not module_of(found.path).startswith(DOOR)]
    assert len(private) > len(outside)
    assert not outside, report(outside)


def test_hybrid_knows_neither_its_models_nor_its_users():
    offences = [
        found
        for found in imports_in("hybrid")
        if found.is_of("models", "lyapunov") and found.path.parts[len(ROOT.parts) + 1] != "explorer"
    ]
    assert not offences, report(offences)


def test_models_use_only_what_hybrid_exports_and_its_checks_of_arguments():
    exported = __import__("hybrid").__all__

    def allowed(found):
        if found.module == "hybrid":
            return not found.name or found.name in (*exported, "arguments")
        return found.is_of("models", "numpy", *sys.stdlib_module_names)

    offences = [found for found in imports_in("models") if not allowed(found)]
    assert not offences, report(offences)


def test_only_the_study_of_lyapunov_knows_a_model():
    offences = [
        found
        for found in imports_in("lyapunov")
        if found.is_of("models") and found.path.name != "__main__.py" and found.path.parent.name != "study"
    ]
    assert not offences, report(offences)


@pytest.mark.parametrize("package", PACKAGES)
def test_files_are_small(package):
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in sources(package)}
    offences = [
        f"{path.relative_to(ROOT)}:{length}: longer than {MAX_LINES} lines"
        for path, length in lengths.items()
        if length > MAX_LINES
    ]
    assert not offences, report(offences)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_module_says_what_it_is_for(package):
    offences = [
        f"{path.relative_to(ROOT)}:1: no docstring"
        for path in sources(package)
        if not ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert not offences, report(offences)


# What a fresh process does, and which of the heavy packages it may load on the way, of those it must.
STEPS = {
    "import hybrid, models": ((), ()),
    "arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0))": ((), ()),
    "orbit = hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0))": (("scipy",), ()),
    "hybrid.testing": (("scipy", "hypothesis"), ("hypothesis",)),
    "arc.system.graph": (("scipy", "hypothesis", "networkx"), ("networkx",)),
}


def test_a_package_is_loaded_by_the_call_that_needs_it():
    """The first column of the table in docs/install.md; datasets load what xarray finds."""
    told = f"print(*sorted(sys.modules.keys() & {set(HEAVY)!r}))"
    program = "\n".join(["import sys", *(f"{step}\n{told}" for step in STEPS)])
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for (step, (allowed, needed)), line in zip(STEPS.items(), done.stdout.splitlines(), strict=True):
        loaded = set(line.split())
        assert set(needed) <= loaded <= set(allowed), f"{step} loads {line}"


def test_the_page_on_installing_names_each_heavy_package_of_the_library():
    """With what loads it; extras are named with their packages."""
    page = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = {re.match("[A-Za-z]+", each)[0] for each in project["dependencies"]}
    for package in needed & set(HEAVY) - {"tqdm"}:
        assert f"| `{package}` |" in page, package
    for extra in ("explore", "grid"):
        assert f"| `'.[{extra}]'` |" in page
    pages = [path.read_text(encoding="utf-8") for path in (ROOT / "docs").rglob("*.md")]
    assert not [text for text in pages if "hybrid-systems[" in text]


def test_every_name_of_the_package_can_be_asked_for():
    import hybrid

    assert [name for name in dir(hybrid) if not hasattr(hybrid, name)] == []
    with pytest.raises(AttributeError, match="no attribute 'plots'"):
        hybrid.plots  # noqa: B018
