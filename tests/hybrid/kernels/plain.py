"""Kernels as plain Python, without compilation."""

from types import FunctionType, SimpleNamespace


def plain(module):
    """The kernels of a module as Python functions. What they call, also in other modules, is Python too."""
    return SimpleNamespace(**_names(module.__name__, vars(module), {}))


def _names(name, values, known):
    if name not in known:
        known[name] = dict(values)
        for key, value in values.items():
            if hasattr(value, "py_func"):
                function = value.py_func
                others = _names(function.__module__, function.__globals__, known)
                known[name][key] = FunctionType(function.__code__, others, key, function.__defaults__)
    return known[name]
