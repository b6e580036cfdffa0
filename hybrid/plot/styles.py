"""Styles: the width of figures, sizes of texts, lines and dots, and colours, for the screen and for print."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from contextvars import ContextVar
from types import MappingProxyType
from typing import Any

import attrs

from hybrid import arguments
from hybrid.plot.labels import as_labels, labelled

# One colour per mode: the palette of Okabe and Ito, distinguishable with any colour vision, faint hues last.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
# The first colours of these differ most in lightness, so that they can be told apart in grey.
PRINTED = ("#08306B", "#D55E00", "#56B4E9", "#000000", "#B08A00", "#A3195B", "#8FCFB0")
INK = "#333333"
# Size in points of texts beside a picture, such as those of a legend, where the font is no smaller.
SMALL_TEXT = 8.0
# What Matplotlib takes by default for the width of lines, the diameter of markers and letters, in points.
USUAL_LINE, USUAL_MARKER, USUAL_FONT = 1.5, 6.0, 10.0
# Pictures that become narrower keep more of their height than of their width: texts do not shrink as they do.
KEPT_HEIGHT = 0.7


@attrs.frozen
class Style:
    """How pictures look: settings of Matplotlib, and what Matplotlib has no settings for."""

    settings: Any = MappingProxyType({})
    # The largest width of a new figure in inches; None where each plot has its own.
    width: float | None = None
    colours: tuple[str, ...] = COLOURS
    # Colours from the most negative to the most positive value.
    diverging: str = "RdBu_r"

    def size(self, default: tuple[float, float]) -> tuple[float, float]:
        """The size of a new figure that has the size ``default`` where no style is given."""
        width, height = default
        if self.width is None or width <= self.width:
            return default
        return self.width, height * (self.width / width) ** KEPT_HEIGHT


CHART = Style(
    {
        "figure.constrained_layout.use": True,
        "savefig.dpi": 160,
        "font.size": 9,
        "axes.titlesize": 9.5,
        "axes.titlelocation": "left",
        "axes.edgecolor": INK,
        "axes.labelcolor": INK,
        "axes.linewidth": 0.7,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "xtick.color": INK,
        "ytick.color": INK,
        "grid.color": "#E4E4E4",
        "grid.linewidth": 0.6,
        "legend.edgecolor": "none",
        "legend.framealpha": 0.85,
        "legend.fontsize": 8,
        "lines.linewidth": 1.3,
    }
)
PAPER = Style(
    {
        "figure.constrained_layout.use": True,
        "figure.constrained_layout.h_pad": 0.03,
        "figure.constrained_layout.w_pad": 0.03,
        # Letters stay letters that journals can embed, and dots have the resolution of print.
        "pdf.fonttype": 42,
        "ps.fonttype": 42,
        "savefig.dpi": 300,
        "font.size": 8,
        "axes.titlesize": 8,
        "axes.titlelocation": "left",
        "axes.labelsize": 8,
        "xtick.labelsize": 8,
        "ytick.labelsize": 8,
        "legend.fontsize": 8,
        "legend.frameon": False,
        "legend.handlelength": 1.6,
        "legend.handletextpad": 0.5,
        "legend.columnspacing": 1.2,
        "axes.linewidth": 0.6,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "xtick.major.width": 0.6,
        "ytick.major.width": 0.6,
        "xtick.minor.width": 0.4,
        "ytick.minor.width": 0.4,
        "xtick.major.size": 2.5,
        "ytick.major.size": 2.5,
        "xtick.minor.size": 1.5,
        "ytick.minor.size": 1.5,
        "grid.linewidth": 0.4,
        "hatch.linewidth": 0.5,
        "patch.linewidth": 0.5,
        "lines.linewidth": 1.0,
        "lines.markersize": 4.5,
        "errorbar.capsize": 2.0,
    },
    width=3.4,
    colours=PRINTED,
    diverging="cividis",
)
STYLES = {"paper": PAPER, "chart": CHART}
PLAIN = Style()
_current: ContextVar[Style] = ContextVar("style", default=PLAIN)


def style(
    name: str | None = None, *, labels: Mapping[str, str] | None = None
) -> AbstractContextManager[None]:
    r"""The style of all pictures that are made within, as ``with style("paper"): ...``, and symbols for them.

    ``"paper"`` is for print: new figures have the width of a column, 3.4 inches, and texts of 8 points, lines
    are thin, and colours differ in lightness. Saved figures have TrueType fonts and 300 dots per inch.
    ``"chart"`` is for pages and slides. Figures that a plot has made keep their style when they are saved
    later; those that the caller makes must be saved within.

    Parameters
    ----------
    name
        ``"paper"`` or ``"chart"``; by default the style is left as it is.
    labels
        Maps names of components, outputs or parameters, or ``"t"``, to what stands for them on axes, as the
        argument ``labels`` of all plots does. Names that a picture does not have are ignored.

    Raises
    ------
    ArgumentError
        If there is no such style, or the labels are no texts.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.plot import plot_phase, style
    >>> arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 2.0))
    >>> with style("paper", labels={"q": "$q$", "v": r"$\dot q$"}):
    ...     ax = plot_phase(arc, "q", "v")
    >>> ax.get_xlabel(), float(ax.figure.get_figwidth())
    ('$q$ (m)', 3.4)
    """
    if name is not None:
        arguments.one_of("name", name, tuple(STYLES))
    return _styled(name, None if labels is None else as_labels(labels))


@contextmanager
def _styled(name: str | None, labels: Mapping[str, str] | None) -> Iterator[None]:
    with ExitStack() as stack:
        if labels:
            stack.enter_context(labelled(labels))
        if name is not None:
            import matplotlib

            stack.enter_context(matplotlib.rc_context(dict(STYLES[name].settings)))
            token = _current.set(STYLES[name])
            stack.callback(_current.reset, token)
        yield


def current() -> Style:
    """The style in which pictures are drawn now."""
    return _current.get()


def colour_of(index: int) -> str:
    """The colour of the mode, the branch or the curve with this index."""
    colours = current().colours
    return colours[index % len(colours)]


def line_width(usual: float) -> float:
    """The width of a line, in points, that is ``usual`` with the usual settings of Matplotlib."""
    return usual * _setting("lines.linewidth") / USUAL_LINE


def dot_size(usual: float) -> float:
    """The diameter of a marker, in points, that is ``usual`` with the usual settings of Matplotlib."""
    return usual * _setting("lines.markersize") / USUAL_MARKER


def text_size(usual: float) -> float:
    """The size of a text in points that is ``usual`` with the usual font; with small fonts all are alike."""
    size = _setting("font.size")
    return usual * size / USUAL_FONT if size >= USUAL_FONT else min(usual, size)


def small_text() -> float:
    """The size in points of texts beside a picture."""
    return min(SMALL_TEXT, _setting("font.size"))


def _setting(name: str) -> float:
    import matplotlib

    found: Any = matplotlib.rcParams
    return float(found[name])
