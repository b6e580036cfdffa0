"""A figure that keeps its style when it is drawn and saved later."""

from __future__ import annotations

from typing import Any

import matplotlib
from matplotlib.figure import Figure


class StyledFigure(Figure):
    """A figure with the settings of the style in which it was made.

    Matplotlib reads the sizes of ticks when they are first drawn, and the kind of fonts and the resolution
    when a figure is saved: both may be long after the style has ended.
    """

    def __init__(self, *args: Any, settings: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._settings: Any = dict(settings)

    def draw(self, renderer: Any) -> None:
        """Draw the figure in its style."""
        with matplotlib.rc_context(self._settings):
            super().draw(renderer)

    def savefig(self, *args: Any, **options: Any) -> None:
        """Save the figure in its style."""
        with matplotlib.rc_context(self._settings):
            super().savefig(*args, **options)
