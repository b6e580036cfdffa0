"""``pytest --alone``: no run takes its steps together with others.

Runs abreast are only faster: what they find, each finds alone. So the tests pass without them, but for those
that ask how many steps were taken together; these are marked ``abreast``.
"""

from functools import wraps

import pytest

from hybrid.compiler.compiled import CompiledSystem
from hybrid.compiler.parts import ABREAST_SERIES, ABREAST_TANGENT_SERIES
from hybrid.compiler.statements.code import LoweringError


def pytest_addoption(parser):
    parser.addoption("--alone", action="store_true", help="no run takes its steps together with others")


def pytest_configure(config):
    if config.getoption("alone"):
        functions = CompiledSystem.functions

        @wraps(functions)
        def without_series_abreast(self, part):
            if part in (ABREAST_SERIES, ABREAST_TANGENT_SERIES):
                raise LoweringError("These tests run with --alone.")
            return functions(self, part)

        CompiledSystem.functions = without_series_abreast


def pytest_collection_modifyitems(config, items):
    if config.getoption("alone"):
        for item in items:
            if item.get_closest_marker("abreast"):
                item.add_marker(pytest.mark.skip(reason="no runs abreast with --alone"))
