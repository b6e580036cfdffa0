"""What all classes of the library share: how objects compare, and which representation they show."""

import ast
import importlib
import inspect
import pkgutil
import re
from pathlib import Path

import attrs
import pytest

import hybrid
import lyapunov


def classes():
    """Every attrs class of the library, by name."""
    found = {}
    for package in (hybrid, lyapunov):
        for each in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if ".kernels" in each.name or each.name.endswith("__main__"):
                continue
            module = importlib.import_module(each.name)
            for name, value in vars(module).items():
                if isinstance(value, type) and attrs.has(value) and value.__module__ == each.name:
                    found[f"{each.name}.{name}"] = value
    return found


CLASSES = classes()


def hold_arrays():
    """Names of the classes with a field that holds an array or a system, itself or inside another object."""
    names = {"ndarray", "HybridSystem"}
    while True:
        found = {
            each.__name__
            for each in CLASSES.values()
            if any(names & set(re.findall(r"\w+", str(field.type))) for field in attrs.fields(each))
        }
        if found <= names:
            return names
        names |= found


def test_objects_with_arrays_or_systems_are_compared_by_identity():
    """Arrays have no truth value, so ``==`` and ``hash`` of such an object would fail.

    Systems are compared by identity too, since what is compiled belongs to one system.
    """
    names = hold_arrays()
    assert len(names) > 30
    for name, each in CLASSES.items():
        if each.__name__ in names:
            assert each.__eq__ is object.__eq__, name
            assert each.__hash__ is object.__hash__, name


@pytest.mark.parametrize("name", sorted(CLASSES))
def test_a_representation_that_is_written_is_shown(name):
    tree = ast.parse(Path(inspect.getfile(CLASSES[name])).read_text(encoding="utf-8"))
    [node] = [n for n in ast.walk(tree) if isinstance(n, ast.ClassDef) and n.name == CLASSES[name].__name__]
    methods = {each.name for each in node.body if isinstance(each, ast.FunctionDef)}
    for method in ("__repr__", "__str__", "__eq__", "__hash__"):
        if method in methods:
            code = getattr(CLASSES[name], method).__code__
            assert code.co_filename == inspect.getfile(CLASSES[name])
