"""Kernels as plain Python, without compilation: for the arithmetic of the smallest ones."""

from types import FunctionType, SimpleNamespace


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
