"""Calls of public functions, which the page makes and its script shows: one source for both."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from textwrap import indent
from typing import Any

import attrs
import numpy as np

# How a script begins.
OPENING = "import hybrid\nimport lyapunov\nimport matplotlib.pyplot as plt\nimport numpy as np\n"
# A call that is longer is written with one argument per line.
LINE = 100


@attrs.frozen(eq=False)
class Written:
    """A value, and the text that stands for it in the script."""

    value: Any
    text: str


@attrs.frozen(eq=False)
class Call:
    """A call of a public function.

    Attributes
    ----------
    name
        What the script calls the result.
    function
        A function that ``hybrid`` or ``lyapunov`` exports.
    arguments, keywords
        Plain values, mappings of them, or :class:`Written` ones.
    """

    name: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...] = ()
    keywords: Mapping[str, Any] = attrs.field(factory=dict)

    def result(self, **changed: Any) -> Any:
        """Make the call; ``changed`` keywords are for the page alone, such as a part of the values."""
        given = {name: _value(each) for name, each in self.keywords.items() if each is not None}
        return self.function(*map(_value, self.arguments), **{**given, **changed})

    def __str__(self) -> str:
        words = [text_of(each) for each in self.arguments]
        words += [f"{name}={text_of(each)}" for name, each in self.keywords.items() if each is not None]
        opening = f"{self.name} = {self.function.__module__.partition('.')[0]}.{self.function.__name__}("
        line = f"{opening}{', '.join(words)})"
        if len(line) <= LINE:
            return line
        return opening + "\n" + indent(",\n".join(words) + ",", "    ") + "\n)"


def text_of(value: Any) -> str:
    """A value as it is written in Python; numbers keep all their digits."""
    if isinstance(value, Written):
        return value.text
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{name!r}: {text_of(each)}" for name, each in value.items()) + "}"
    if isinstance(value, np.ndarray | tuple | list):
        inside = ", ".join(text_of(each) for each in value)
        return f"[{inside}]" if isinstance(value, list) else f"({inside}{',' if len(value) == 1 else ''})"
    return repr(value.item() if isinstance(value, np.generic) else value)


def _value(given: Any) -> Any:
    if isinstance(given, Written):
        return given.value
    if isinstance(given, Mapping):
        return {name: _value(each) for name, each in given.items()}
    return given


def script(opening: str, lines: Iterable[str | Call]) -> str:
    """A script that makes the calls, after the lines that make the model."""
    return "\n".join([opening.rstrip(), "", *map(str, lines)]) + "\n"
