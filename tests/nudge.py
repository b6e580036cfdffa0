"""``pytest --nudge``: every start, parameter and time span of a run is moved by one unit in the last place.

Processors differ in the last bits of what they compute, so no result may hang on them. What a nudge
changes, another processor may change, too. The direction follows from the name of the test, so that each run
of the tests is the same. A number that is 0 stays 0: nobody computes 5e-324 in place of 0.

A test is marked ``as_given`` if its statement is about the very numbers that it gives: it makes no run and
reads them, it compares with what another process finds, or it starts at the last bit of an event. Rooms that
ask for words and not for numbers are left out.
"""

import zlib
from functools import wraps
from pathlib import Path

import numpy as np
import pytest

from hybrid import arguments
from hybrid.compiler.compiled import CompiledSystem
from hybrid.simulation import memory
from hybrid.sweep.rows import Rows
from hybrid.system.variables import Variables

HERE = Path(__file__).parent
# What a call refuses, what a page says, how the sources are written.
OF_WORDS = {HERE / "hybrid" / name for name in ("arguments", "display", "explorer")} | {
    HERE / f"test_{name}.py"
    for name in (
        "architecture",
        "defaults",
        "gallery",
        "links",
        "names",
        "objects",
        "representations",
        "site",
    )
}
# Where numbers are moved to: -inf, +inf, or nowhere outside of tests.
towards = 0.0


def pytest_addoption(parser):
    told = "move all numbers of runs by one unit in the last place, up in some tests and down in others"
    parser.addoption("--nudge", action="store_true", help=told)
    parser.addoption("--nudge-back", action="store_true", help="the same the other way in each test")


def _nudges(config):
    return config.getoption("nudge_back") or config.getoption("nudge")


def pytest_ignore_collect(collection_path, config):
    return True if _nudges(config) and collection_path in OF_WORDS else None


def pytest_configure(config):
    back = config.getoption("nudge_back")
    if _nudges(config):
        _install()
        config.pluginmanager.register(_Direction(back))


class _Direction:
    """Each test, with the fixtures that it makes, has one direction."""

    def __init__(self, back):
        self.back = back

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        global towards
        if item.get_closest_marker("as_given") is None:
            towards = np.inf if zlib.crc32(item.name.encode()) % 2 != self.back else -np.inf
        try:
            return (yield)
        finally:
            towards = 0.0


def moved(values):
    """The next numbers in the direction of the test, as an array."""
    values = np.asarray(values, dtype=float)
    return np.where(values == 0, values, np.nextafter(values, towards)) if towards else values


def _install():
    begin, replace = memory.Memory.begin, memory.Starts.replace
    find, values = Variables.parameter_values, Rows.values
    time_span, increasing_times = arguments.time_span, arguments.increasing_times

    def start_of(model, states):
        """States ``(..., n)``, moved but for counters, which are whole numbers."""
        return np.concatenate(
            [moved(states[..., : model.controlled]), states[..., model.controlled :]], axis=-1
        )

    @wraps(begin)
    def nudged_begin(self, model, state, *others):
        return begin(self, model, start_of(model, state), *others)

    memory.Memory.begin = nudged_begin
    # A model with the default parameters is kept from test to test, with the numbers of the first one.
    CompiledSystem.given = CompiledSystem.at
    Rows.values = wraps(values)(
        lambda self, point: values(self, {name: float(moved(number)) for name, number in point.items()})
    )
    memory.Starts.replace = lambda self, *, origins, **others: replace(self, origins=moved(origins), **others)
    Variables.parameter_values = wraps(find)(lambda self, overrides=None: moved(find(self, overrides)))
    arguments.time_span = wraps(time_span)(lambda name, value: tuple(moved(time_span(name, value)).tolist()))
    arguments.increasing_times = wraps(increasing_times)(
        lambda name, value, t0, t1: np.clip(moved(increasing_times(name, value, t0, t1)), t0, t1)
    )
