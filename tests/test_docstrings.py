"""The examples in the docstrings run."""

import doctest
import importlib
import pkgutil

import pytest

MODULES = [
    module.name
    for package in ("hybrid", "models", "lyapunov")
    for module in pkgutil.walk_packages(importlib.import_module(package).__path__, package + ".")
    if not module.name.endswith("__main__")
]


@pytest.mark.parametrize("name", MODULES)
def test_examples(name):
    options = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    assert doctest.testmod(importlib.import_module(name), optionflags=options).failed == 0
