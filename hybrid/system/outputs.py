"""Outputs: named quantities that follow from time, state and parameters, in some modes or in all."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import attrs

from hybrid import arguments
from hybrid.errors import ModelError, unknown_name
from hybrid.system.checks import check_number
from hybrid.system.elements import Function
from hybrid.system.frozen import FrozenMapping
from hybrid.system.labels import named
from hybrid.system.portable import Portable
from hybrid.system.variables import Variables

BY_NAME = "map names to functions of (t, x, p), or to mappings of modes to such functions"


@attrs.frozen
class Formula(Portable):
    """What an output is in one mode, or in every mode.

    Attributes
    ----------
    of
        Name of the mode; None for every mode.
    function
        ``h(t, x, p)``, one number.
    """

    of: str | None
    function: Function


@attrs.frozen
class Component(Portable):
    """A component of the state as a function of ``(t, x, p)``."""

    place: int

    def __call__(self, t: Any, x: Any, p: Any) -> Any:
        """The component."""
        return x[self.place]


@attrs.frozen
class Output(Portable):
    """A named quantity that is no state.

    Attributes
    ----------
    name
        The name that results are asked for.
    formulas
        One for every mode, or one for each mode in which the output has a value.
    """

    name: str
    formulas: tuple[Formula, ...]

    def in_mode(self, *names: str | None) -> Function | None:
        """The function of a mode that has one of these names; None if the output has no value there."""
        return next((each.function for each in self.formulas if each.of is None or each.of in names), None)

    @property
    def functions(self) -> list[Function]:
        """The functions of all formulas."""
        return [each.function for each in self.formulas]

    def changed(self, change: Any) -> Output:
        """The output with other functions, ``change(function)``."""
        return Output(self.name, tuple(Formula(each.of, change(each.function)) for each in self.formulas))

    def title(self, formula: Formula) -> str:
        """Beginning of error texts about a formula."""
        return f"Output {self.name!r}" + ("" if formula.of is None else f" in mode {formula.of!r}")

    def check_modes(self, modes: Iterable[str]) -> None:
        """ModelError if a mode of a formula does not exist."""
        known = [*modes]
        for each in self.formulas:
            if each.of is not None and each.of not in known:
                raise ModelError(unknown_name(f"Output {self.name!r}: mode", each.of, known, "Modes"))


def function_in(what: Function | Output, *names: str | None) -> Function | None:
    """A function, or that of an output in a mode with one of these names; None if there is none."""
    return what.in_mode(*names) if isinstance(what, Output) else what


def as_outputs(value: Any, owner: str = "HybridSystem") -> Mapping[str, Output]:
    """Outputs by name, read-only, from functions of ``(t, x, p)`` or mappings of modes to such functions.

    ``owner`` begins error texts.

    Raises
    ------
    ModelError
        If a name is no text, or an output has no function.
    """
    found = {}
    for name, given in named(f"{owner}: outputs", value, BY_NAME).items():
        if not isinstance(name, str) or not name:
            raise arguments.refusal(f"{owner}: outputs: a name", "be a non-empty text", name)
        formulas = (
            given.formulas if isinstance(given, Output) else _formulas(f"{owner}: outputs[{name!r}]", given)
        )
        found[name] = Output(name, formulas)
    return FrozenMapping(found)


def _formulas(title: str, given: Any) -> tuple[Formula, ...]:
    if callable(given):
        return (Formula(None, given),)
    if not isinstance(given, Mapping):
        raise arguments.refusal(title, "be a function of (t, x, p), or map modes to such functions", given)
    if not given:
        raise ModelError(
            f"{title} names no mode, so the output has no value anywhere. Give it a function of (t, x, p) "
            "for every mode, or for each mode in which it has a value."
        )
    for mode, function in given.items():
        if not isinstance(mode, str):
            raise arguments.refusal(f"{title}: a mode", "be a name", mode)
        if not callable(function):
            raise arguments.refusal(f"{title}[{mode!r}]", "be a function of (t, x, p)", function)
    return tuple(Formula(mode, function) for mode, function in named(title, given, BY_NAME).items())


def check_outputs(outputs: Mapping[str, Output], variables: Variables) -> None:
    """Call every function of the outputs once, and check that their names are new.

    Raises
    ------
    ModelError
        If a name is that of a component, of a parameter or of the time; if a function has the wrong arity,
        asks for a name that does not exist, fails, is not pure, or does not return one number.
    """
    kinds = {
        "a state": variables.state_names[: variables.moving],
        "a held component": variables.held,
        "a counter": variables.counters,
        "a parameter": variables.parameter_names,
        "the time": ("t",),
    }
    for name, output in outputs.items():
        for kind, names in kinds.items():
            if name in names:
                raise ModelError(
                    f"HybridSystem: {name!r} is the name of {kind} and of an output. A name means one thing; "
                    "rename one of the two."
                )
        for formula in output.formulas:
            check_number(variables, output.title(formula), formula.function)
