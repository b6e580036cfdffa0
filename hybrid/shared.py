"""Arguments that several public calls share, written down once: name, type, default and description."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Mapping
from textwrap import wrap
from typing import Any, NamedTuple, ParamSpec, TypeVar, get_args

Given = ParamSpec("Given")
Result = TypeVar("Result")

MODULE = re.compile(r"\b(?:[a-z_]+\.)+(?=\w)")
# Of a description, in characters.
WIDTH = 102

PARAMETERS = "Parameters\n----------\n"
# The head of the section behind the parameters of a docstring, and of the next parameter within it.
NEXT_SECTION = re.compile(r"\n\n(?=[A-Z][^\n]*\n-+\n)")
NEXT_PARAMETER = re.compile(r"\n(?=\S)")


class Shared(NamedTuple):
    """What calls say of an argument that they share, in the annotation of a typed dictionary.

    The dictionary's key is the name of the argument; ``Annotated[float, Shared(0.0, "Time.")]`` has its type,
    its default and its description.
    """

    default: Any
    text: str


def shares(record: Any, **defaults: Any) -> Callable[[Callable[Given, Result]], Callable[Given, Result]]:
    """A decorator for a call that ends in ``**asked: Unpack[record]``, of a typed dictionary of `Shared`.

    The call receives every argument of the record, by default its default, or the one in ``defaults``. Its
    signature lists the arguments, and its docstring describes those that it does not describe itself.
    """

    def decorate(function: Callable[Given, Result]) -> Callable[Given, Result]:
        shared = {name: each.default for name, (_, each) in fields_of(record).items()} | defaults

        @functools.wraps(function)
        def call(*args: Given.args, **kwargs: Given.kwargs) -> Result:
            for name in kwargs:
                if name not in known:
                    message = f"{function.__name__}() got an unexpected keyword argument {name!r}"
                    raise TypeError(message)
            return function(*args, **{**shared, **kwargs})

        sign(call, function, record, defaults)
        known = inspect.signature(call).parameters.keys()
        return call

    return decorate


def sign(
    call: Callable[..., Any],
    function: Callable[..., Any],
    record: Any,
    defaults: Mapping[str, Any] | None = None,
    texts: Mapping[str, str] | None = None,
) -> None:
    """Give a call the signature and the docstring of a function, with the shared arguments in both.

    ``texts`` describes further arguments, of the function's own.
    """
    fields, keyword = fields_of(record), inspect.Parameter.KEYWORD_ONLY
    shared = [
        inspect.Parameter(
            name, keyword, default=(defaults or {}).get(name, each.default), annotation=annotation
        )
        for name, (annotation, each) in fields.items()
    ]
    signature = inspect.signature(function)
    own = [each for each in signature.parameters.values() if each.kind is not each.VAR_KEYWORD]
    listed = [*own, *shared]
    call.__signature__ = signature.replace(parameters=listed)  # type: ignore[attr-defined]
    told = {**(texts or {}), **{name: each.text for name, (_, each) in fields.items()}}
    call.__doc__ = described(function.__doc__ or "", [each.name for each in listed], told)


def fields_of(record: Any) -> dict[str, tuple[str, Shared]]:
    """The type and the rest of each argument of a typed dictionary, by name.

    The module of the dictionary has no ``from __future__ import annotations``. A type of a package that is
    imported on demand stands in quotes. Types are given as text, without the names of their modules.
    """
    found = {name: get_args(each) for name, each in record.__annotations__.items()}
    return {name: (_shown(kind), shared) for name, (kind, shared) in found.items()}


def _shown(kind: Any) -> str:
    quoted: str | None = getattr(kind, "__forward_arg__", None)
    return quoted or MODULE.sub("", inspect.formatannotation(kind))


def described(text: str, names: list[str], texts: Mapping[str, str]) -> str:
    """A docstring with the descriptions of shared arguments between those of its own, in the order of names.

    Neighbours with one description have it once.
    """
    text = inspect.cleandoc(text)
    head, found, rest = text.partition(PARAMETERS)
    assert found, "a call with shared arguments describes its own parameters"
    section, *others = NEXT_SECTION.split(rest, maxsplit=1)
    blocks = {block.partition("\n")[0]: block for block in NEXT_PARAMETER.split(section.rstrip("\n"))}
    own = {name: heading for heading in blocks for name in heading.partition(" : ")[0].split(", ")}
    groups: list[tuple[list[str], str]] = []
    for name in names:
        if name in own:
            block = blocks.pop(own[name], None)
            groups += [] if block is None else [([], block)]
        elif name in texts:
            if groups and groups[-1][0] and groups[-1][1] == texts[name]:
                groups[-1][0].append(name)
            else:
                groups.append(([name], texts[name]))
    written = [_entry(*group) for group in groups] + list(blocks.values())
    return "\n\n".join([head + found + "\n".join(written), *others])


def _entry(names: list[str], text: str) -> str:
    """A description under the names of its arguments; without names it is an entry already."""
    if not names:
        return text
    return "\n".join([", ".join(names), *(f"    {line}" for line in wrap(text, WIDTH))])
