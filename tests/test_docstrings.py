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
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    for test in doctest.DocTestFinder().find(importlib.import_module(name)):
        # Each run looks at all source files, also where a docstring has no example.
        if test.examples:
            runner.run(test)
    assert runner.failures == 0
