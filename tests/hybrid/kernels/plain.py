"""Kernels as plain Python, without compilation: for the arithmetic of the smallest ones."""

from types import FunctionType, SimpleNamespace

import numpy as np


def plain(module, **replaced):
    """The kernels of a module as Python functions that call each other.

    What they call in other modules is Python too. ``replaced`` are names in this module that mean something
    else here.
    """
    return SimpleNamespace(**_names(module.__name__, vars(module), {}, replaced))


def _names(name, values, known, replaced):
    if name not in known:
        known[name] = dict(values)
        for key, value in values.items():
            if hasattr(value, "py_func"):
                function = value.py_func
                others = _names(function.__module__, function.__globals__, known, {})
                known[name][key] = FunctionType(function.__code__, others, key, function.__defaults__)
        known[name] |= replaced
    return known[name]


def run_at_guards(y, sides, on_guard=None, fired=-1):
    """A run at ``y`` in the second of two modes, whose guards are all but the first and have these sides.

    What a search for crossings writes holds numbers that it does not write.
    """
    guards = len(sides)
    return SimpleNamespace(
        mode=1,
        y=y,
        side=np.array([9, *sides]),
        on_guard=np.array([9, *(on_guard or [0] * guards)]),
        rehearsal=np.full((4, 1 + guards), 88),
        passed=np.full(1 + guards, 88.0),
        last_fired=fired,
        since_entry=0.0,
        grazing_place=0.5,
        next_grazing=0.6,
    )
