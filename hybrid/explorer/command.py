"""``python -m hybrid explore MODULE:MODEL``: the page of a model that a module has."""

from __future__ import annotations

import argparse
import importlib
import runpy
import sys
from collections.abc import Callable, Sequence
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from hybrid.errors import ArgumentError, HybridError, unknown_name
from hybrid.explorer.calls import OPENING
from hybrid.explorer.faults import place_in_users_code, told
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    from hybrid.explorer.subject import Subject

Value = TypeVar("Value")
WANTED = "MODULE:MODEL, such as models:vibroimpact or my_model.py:system"


def add_options(options: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    options.add_argument(
        "model", metavar="MODULE:MODEL", help="a module or a file, and a system or a factory in it"
    )
    options.add_argument("--start", nargs="+", default=[], metavar="NAME=VALUE", help="state at the start")
    options.add_argument("--mode", help="mode at the start (default: the one that the start allows)")
    options.add_argument("--set", nargs="+", default=[], metavar="NAME=VALUE", help="values of parameters")
    options.add_argument("--range", nargs="+", default=[], metavar="NAME=LOW:HIGH", help="ends of sliders")
    options.add_argument("--port", type=int, default=0, help="port to listen at (default: a free one)")
    options.add_argument("--address", default="localhost", help="address to listen at (default: %(default)s)")
    options.add_argument("--no-browser", action="store_true", help="do not open a browser")


def explore_model(given: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C; returns the exit status."""
    # The other commands run where the packages of the page are not installed, as when a wheel is built.
    from hybrid.explorer.explore import serve
    from hybrid.explorer.source import Source

    try:
        source = Source(_file_of(given.model), lambda: _subject_of(given))
        serve(source, port=given.port, address=given.address, block=True, show=not given.no_browser)
    except Exception as error:
        if not isinstance(error, HybridError) and place_in_users_code(error) is None:
            raise
        print(f"hybrid: {told(error)}", file=sys.stderr)
        return 1
    return 0


def _subject_of(given: argparse.Namespace) -> Subject:
    """The model, and what the options say of it."""
    from hybrid.explorer.subject import subject

    system, text = model_of(given.model)
    start = _named("--start", given.start, _number)
    unknown = [name for name in start if name not in system.state_names]
    if unknown:
        raise ArgumentError(
            unknown_name("--start: component", unknown[0], system.state_names, "State components")
        )
    if start:
        start = {**dict.fromkeys(system.state_names, 0.0), **start}
    return subject(
        system,
        text,
        start or None,
        mode=given.mode,
        parameters=_named("--set", given.set, _number),
        ranges=_named("--range", given.range, _range),
    )


def _file_of(given: str) -> Path | None:
    """The file that ``FILE:MODEL`` names; None for a module, which Python reads once."""
    name = given.rpartition(":")[0]
    return Path(name) if name.endswith(".py") else None


def model_of(given: str) -> tuple[HybridSystem, str]:
    """The system that ``MODULE:MODEL`` names, and the lines of Python that make it.

    Raises
    ------
    ArgumentError
        If there is no such module, or it has no such system.
    """
    module, colon, name = given.rpartition(":")
    if not (module and colon and name):
        raise ArgumentError(f"The model must be named as {WANTED}; got {given!r}.")
    found, opening = _from_file(module, name) if module.endswith(".py") else _from_module(module, name)
    if isinstance(found, HybridSystem):
        return found, opening if name == "system" else f"{opening}\nsystem = {name}\n"
    if not callable(found):
        raise ArgumentError(f"{given} must be a HybridSystem or a factory of one; got {found!r}.")
    try:
        signature(found).bind()
    except TypeError as error:
        raise ArgumentError(
            f"{given}() does not run without arguments: {error}. Make the system in a module, and name that."
        ) from error
    system = found()
    if not isinstance(system, HybridSystem):
        raise ArgumentError(f"{given}() must return a HybridSystem; got {type(system).__name__}.")
    return system, f"{opening}\nsystem = {name}()\n"


def _from_module(module: str, name: str) -> tuple[Any, str]:
    try:
        loaded = importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{module}.".startswith(f"{error.name}."):
            # The module is there, and one that it imports is not.
            raise
        raise ArgumentError(f"Module {module!r} was not found ({error}). Name {WANTED}.") from error
    return _member(module, name, vars(loaded)), f"{OPENING}\nfrom {module} import {name}\n"


def _from_file(file: str, name: str) -> tuple[Any, str]:
    path = Path(file)
    if not path.is_file():
        raise ArgumentError(f"File {file!r} was not found. Name {WANTED}.")
    members = runpy.run_path(str(path))
    return _member(
        file, name, members
    ), f'import runpy\n\n{OPENING}\n{name} = runpy.run_path({file!r})["{name}"]\n'


def _member(module: str, name: str, members: dict[str, Any]) -> Any:
    if name not in members:
        models = {
            each: value
            for each, value in members.items()
            if isinstance(value, HybridSystem) or (callable(value) and not isinstance(value, type))
        }
        public = [each for each in models if not each.startswith("_")]
        raise ArgumentError(unknown_name(f"{module}:", name, public, "Names"))
    return members[name]


def _named(option: str, given: Sequence[str], read: Callable[[str, str], Value]) -> dict[str, Value]:
    """Pairs ``NAME=VALUE`` of an option."""
    found: dict[str, Value] = {}
    for each in given:
        name, equals, text = each.partition("=")
        if not (name and equals):
            raise ArgumentError(f"{option} takes NAME=VALUE; got {each!r}.")
        found[name] = read(f"{option} {name}", text)
    return found


def _number(what: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise ArgumentError(f"{what} must be a number; got {text!r}.") from error


def _range(what: str, text: str) -> tuple[float, float]:
    low, _, high = text.partition(":")
    return _number(what, low), _number(what, high)
