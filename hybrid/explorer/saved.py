"""A picture of the page as a file, drawn by the plots of the library as the script does."""

from __future__ import annotations

import re
from collections.abc import Mapping
from io import BytesIO
from typing import Any

from hybrid import plot
from hybrid.errors import ArgumentError
from hybrid.explorer.pictures import Live
from hybrid.explorer.scene import Scene
from hybrid.plot.styles import colour_of, current
from hybrid.simulation.labelled import Names
from lyapunov.plot import plot_chart

PICTURES = ("portrait", "section", "time series", "exponents", "diagram", "orbit", "branch", "basins")
# Those that are drawn of a result, which may not be there.
OF_RESULTS = PICTURES[3:]
FORMATS = ("png", "svg", "pdf")
# Width and height in inches where no style says how wide a figure is; a diagram is two pictures.
SIZE, OF_TWO = (6.4, 4.8), (6.4, 6.4)


def file_name(title: str, picture: str, suffix: str) -> str:
    """The name of the file of a picture, after the model: ``impact_oscillator_time_series.png``."""
    words = re.sub(r"[^\w-]+", "_", f"{title} {picture}".lower()).strip("_")
    return f"{words}.{suffix}"


def saved_figure(
    scene: Scene, picture: str, suffix: str, live: Live | None, results: Mapping[str, Any]
) -> BytesIO:
    """The picture as a file of the format ``suffix``, in the style for print.

    Raises
    ------
    ArgumentError
        If nothing of this picture has been computed.
    """
    from matplotlib.figure import Figure

    found = results.get(picture)
    if picture == "exponents" and found is not None and not found.intervals:
        # A run that ended before its first interval has no history to draw.
        found = None
    if live is None or (picture in OF_RESULTS and found is None):
        raise ArgumentError(f"Save: nothing has been drawn of {picture!r} yet. Switch it on, or wait.")
    with plot.style("paper"):
        made = Figure(figsize=current().size(OF_TWO if picture == "diagram" else SIZE))
        if picture == "diagram":
            _draw_diagram(made, scene, found, results.get("branch"))
        else:
            _draw(made.subplots(), scene, picture, live, found)
        file = BytesIO()
        made.savefig(file, format=suffix)
    file.seek(0)
    return file


def _draw_diagram(made: Any, scene: Scene, chart: Any, branch: Any) -> None:
    """Draw the diagram over the exponents, with the branch that the page shows on it."""
    axes = made.subplots(2, sharex=True)
    plot_chart(chart, scene.across, ax=axes)
    if branch is not None:
        plot.plot_branch(branch, scene.across, ax=axes[0]).set_xlabel("")


def _draw(ax: Any, scene: Scene, picture: str, live: Live, found: Any) -> None:
    """Draw a picture of one part, as the script of the page does."""
    across, up = scene.across, scene.up
    match picture:
        case "portrait":
            plot.plot_phase(live.arc, across, up, ax=ax)
        case "time series":
            plot.plot_arc(live.arc, [scene.over_time], ax=ax)
        case "section":
            names = Names(live.arc.system.state_names, live.arc.system.units)
            ax.plot(*live.points.table((across, up)).T, ".", markersize=2, color=colour_of(0))
            ax.set_xlabel(names.label(across))
            ax.set_ylabel(names.label(up))
        case "orbit":
            plot.plot_orbit(found, across, up, ax=ax)
        case "branch":
            plot.plot_branch(found, across, ax=ax)
        case _:
            plot.plot(found, ax=ax)
