"""What all plots take, described once: axes, the size of the figure, labels, the style."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, ParamSpec, TypedDict, TypeVar

import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.plot.labels import as_labels, labelled
from hybrid.plot.styles import STYLES, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Given = ParamSpec("Given")
Drawn = TypeVar("Drawn")

# The head of the section behind the parameters of a docstring.
NEXT_SECTION = re.compile(r"\n\n(?=[A-Z][^\n]*\n-+\n)")
PARAMETERS = "Parameters\n----------\n"


class Look(TypedDict, total=False):
    """The arguments that all plots share, ``DESCRIBED`` in their docstrings."""

    ax: Axes | Iterable[Axes] | None
    figsize: tuple[float, float] | None
    labels: Mapping[str, str] | None
    style: str | None


DESCRIBED = {
    "size": "Diameter of the dots in points; by default smaller for more dots.",
    "ax": "Axes to draw into; by default those of a new figure.",
    "figsize": "Width and height of a new figure in inches.",
    "labels": (
        'Maps names of components, outputs or parameters on the axes, or ``"t"``, to what stands for them,\n'
        'such as ``{"x": "$x_1$"}``. Units follow. An ArgumentError names what is on no axis.'
    ),
    "style": (
        'Style of a new figure: ``"paper"`` or ``"chart"``; see :func:`hybrid.plot.style`. Given axes have\n'
        "one already: make them and draw within ``with hybrid.plot.style(...)``."
    ),
}


def picture(function: Callable[Given, Drawn]) -> Callable[Given, Drawn]:
    """A plot with the arguments of `Look`: the labels and the style hold while it draws.

    Its signature lists these arguments, and its docstring describes those that it does not describe itself.
    """

    @functools.wraps(function)
    def draw(*args: Given.args, **kwargs: Given.kwargs) -> Drawn:
        options: dict[str, Any] = kwargs
        name, labels = options.pop("style", None), options.pop("labels", None)
        if name is None and labels is None:
            return function(*args, **kwargs)
        if name is not None:
            arguments.one_of("style", name, tuple(STYLES))
        if name is not None and options.get("ax") is not None:
            raise ArgumentError(
                f"style must be left out where ax is given; got {name!r}. Make the axes and draw within "
                f"'with hybrid.plot.style({name!r}):'."
            )
        with ExitStack() as stack:
            stack.enter_context(style(name))
            record = None if labels is None else stack.enter_context(labelled(as_labels(labels)))
            drawn = function(*args, **kwargs)
        try:
            if record is not None:
                record.check()
        except ArgumentError:
            if options.get("ax") is None:
                _close(drawn)
            raise
        return drawn

    signature = inspect.signature(function)
    own = [each for each in signature.parameters.values() if each.kind is not each.VAR_KEYWORD]
    shared = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=kind.__forward_arg__)
        for name, kind in Look.__annotations__.items()
    ]
    draw.__signature__ = signature.replace(parameters=[*own, *shared])  # type: ignore[attr-defined]
    draw.__doc__ = described(function.__doc__ or "", [each.name for each in (*own, *shared)])
    return draw


def described(text: str, names: list[str]) -> str:
    """A docstring with the descriptions of shared arguments behind those of its own."""
    text = inspect.cleandoc(text)
    head, found, rest = text.partition(PARAMETERS)
    assert found, "a plot describes its parameters"
    section, *others = NEXT_SECTION.split(rest, maxsplit=1)
    for name in names:
        if name in DESCRIBED and not re.search(rf"^{name}$", section, re.MULTILINE):
            section += f"\n{name}\n" + "\n".join(f"    {line}" for line in DESCRIBED[name].splitlines())
    return "\n\n".join([f"{head}{found}{section}", *others])


def _close(drawn: Any) -> None:
    """Forget the figure of a picture that is refused."""
    import matplotlib.pyplot as plt

    plt.close(np.atleast_1d(np.asarray(drawn, dtype=object)).ravel()[0].get_figure(root=True))
