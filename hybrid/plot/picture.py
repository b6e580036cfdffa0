"""What all plots take, described once: axes, the size of the figure, labels, the style."""

import functools
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated, Any, ParamSpec, TypedDict, TypeVar

import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.plot.labels import as_labels, labelled
from hybrid.plot.styles import STYLES, style
from hybrid.shared import Shared, sign

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Given = ParamSpec("Given")
Drawn = TypeVar("Drawn")


class Look(TypedDict, total=False):
    """The arguments that all plots share."""

    ax: Annotated[
        "Axes | Iterable[Axes] | None", Shared(None, "Axes to draw into; by default those of a new figure.")
    ]
    figsize: Annotated[
        tuple[float, float] | None, Shared(None, "Width and height of a new figure in inches.")
    ]
    labels: Annotated[
        Mapping[str, str] | None,
        Shared(
            None,
            'Maps names of components, outputs or parameters on the axes, or ``"t"``, to what stands for '
            'them, such as ``{"x": "$x_1$"}``. Units follow. An ArgumentError names what is on no axis.',
        ),
    ]
    style: Annotated[
        str | None,
        Shared(
            None,
            'Style of a new figure: ``"paper"`` or ``"chart"``; see :func:`hybrid.plot.style`. Given axes '
            "have one already: make them and draw within ``with hybrid.plot.style(...)``.",
        ),
    ]


# Of an argument that plots with dots have themselves.
SIZE = {"size": "Diameter of the dots in points; by default smaller for more dots."}


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

    sign(draw, function, Look, texts=SIZE)
    return draw


def _close(drawn: Any) -> None:
    """Forget the figure of a picture that is refused."""
    import matplotlib.pyplot as plt

    plt.close(np.atleast_1d(np.asarray(drawn, dtype=object)).ravel()[0].get_figure(root=True))
