"""Every public name has an example in its docstring, and the examples run."""

import doctest
import importlib
import inspect
import pkgutil
from functools import cache

import matplotlib.pyplot as plt
import pytest

MODULES = [
    module.name
    for package in ("hybrid", "models", "lyapunov")
    for module in pkgutil.walk_packages(importlib.import_module(package).__path__, package + ".")
    if not module.name.endswith("__main__")
]
# The packages whose names have a page on the site.
PACKAGES = (
    *("hybrid", "lyapunov", "models"),
    *("hybrid.measures", "hybrid.testing", "hybrid.plot", "lyapunov.plot"),
)


def public_things(package):
    """The classes and functions that a package exports, by name."""
    module = importlib.import_module(package)
    named = {name: getattr(module, name) for name in module.__all__}
    return {name: each for name, each in named.items() if inspect.isclass(each) or inspect.isroutine(each)}


@cache
def pasted():
    """The docstrings whose examples are run where they are pasted."""
    return {inspect.getdoc(each) for package in PACKAGES for each in public_things(package).values()}


# An example that goes on from the end of a run begins at the very numbers with which that ended.
GOES_ON = "hybrid.simulation.end"


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.as_given if name == GOES_ON else ()) for name in MODULES],
)
def test_examples(name):
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    for test in doctest.DocTestFinder().find(importlib.import_module(name)):
        # Each run looks at all source files, also where a docstring has no example.
        if test.examples and inspect.cleandoc(test.docstring) not in pasted():
            runner.run(test)
            plt.close("all")
    assert runner.failures == 0


@pytest.mark.parametrize(
    "package",
    [pytest.param(each, marks=pytest.mark.as_given if each == "hybrid" else ()) for each in PACKAGES],
)
def test_every_public_name_has_an_example_that_runs_where_it_is_pasted(package):
    """With nothing but what the example itself imports."""
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    finder = doctest.DocTestFinder(recurse=False)
    without = []
    for name, thing in public_things(package).items():
        _, heading, example = (inspect.getdoc(thing) or "").partition("\nExamples\n--------\n")
        if not heading or ">>> " not in example:
            without.append(name)
        for test in finder.find(thing, f"{package}.{name}", module=False, globs={"__name__": "example"}):
            if test.examples:
                runner.run(test)
                plt.close("all")
    assert not without, f"Write an Examples section for: {', '.join(without)}."
    assert runner.failures == 0
