"""A picture of the page as a file, drawn with hybrid.plot as the script does."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from typing import Any

from hybrid import plot
from hybrid.errors import ArgumentError
from hybrid.explorer.pictures import Live
from hybrid.explorer.scene import Scene
from hybrid.simulation.labelled import Names

PICTURES = ("portrait", "section", "time series", "exponents", "orbit", "branch", "basins")
FORMATS = ("png", "svg", "pdf")


def saved_figure(
    scene: Scene, picture: str, suffix: str, live: Live | None, results: Mapping[str, Any]
) -> BytesIO:
    """The picture as a file of the format ``suffix``.

    Raises
    ------
    ArgumentError
        If nothing of this picture has been computed.
    """
    from matplotlib.figure import Figure

    made = Figure(figsize=(6.4, 4.8), layout="constrained")
    ax, across, up = made.subplots(), scene.across, scene.up
    found: Any = results.get(picture)
    if picture == "exponents" and found is not None and not found.intervals:
        # A run that ended before its first interval has no history to draw.
        found = None
    if live is None or (picture in ("exponents", "orbit", "branch", "basins") and found is None):
        raise ArgumentError(f"Save: nothing has been drawn of {picture!r} yet. Switch it on, or wait.")
    match picture:
        case "portrait":
            plot.plot_phase(live.arc, across, up, ax=ax)
        case "time series":
            plot.plot_arc(live.arc, [scene.over_time], ax=ax)
        case "section":
            names = Names(live.arc.system.state_names, live.arc.system.units)
            ax.plot(*live.points.table((across, up)).T, ".", markersize=2, color=plot.COLOURS[0])
            ax.set_xlabel(names.label(across))
            ax.set_ylabel(names.label(up))
        case "orbit":
            plot.plot_orbit(found, across, up, ax=ax)
        case "branch":
            plot.plot_branch(found, across, ax=ax)
        case _:
            plot.plot(found, ax=ax)
    file = BytesIO()
    made.savefig(file, format=suffix, dpi=200)
    file.seek(0)
    return file
