"""The basins of attraction over the plane of the section."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs
import numpy as np

from hybrid.errors import ArgumentError
from hybrid.explorer.calls import Call, Written
from hybrid.explorer.pictures import changed, key_of
from hybrid.explorer.scene import Scene
from hybrid.explorer.subject import Subject
from hybrid.explorer.worker import Job
from hybrid.sweep.attractors.basins import basins

# Starts along each side of the grid: first a coarse one.
GRIDS = (24, 96)
Ends = tuple[float, float]


def basins_call(subject: Subject, scene: Scene, across: Ends, up: Ends, count: int) -> Call:
    """The call that paints the basins over the plane of the section."""
    if scene.across == scene.up or not {scene.across, scene.up} <= scene.x0.keys():
        raise ArgumentError("across and up must be two components of the state; choose another one.")
    over: dict[str, Any] = dict(scene.x0)
    for name, (low, high) in ((scene.across, across), (scene.up, up)):
        text = f"np.linspace({low!r}, {high!r}, {count})"
        over[name] = Written(np.linspace(low, high, count), text)
    # The mode is left to the guards: starts are in all of them.
    parameters = {"parameters": changed(subject, scene.values)}
    return Call("painted", basins, (Written(subject.system, "system"), over), parameters)


def basins_job(subject: Subject, scene: Scene, mode: str, across: Ends, up: Ends) -> Job:
    """Basins on a coarse grid, then on a fine one.

    Where the guards allow a start in several modes, all starts are in ``mode``.
    """

    def part(count: int) -> Callable[[], Any]:
        def painted() -> Any:
            call = basins_call(subject, scene, across, up, count)
            try:
                return scene, call, call.result(progress=False), ""
            except ArgumentError:
                if not mode or len(subject.system.whole_modes) < 2:
                    raise
            call = attrs.evolve(call, keywords={**call.keywords, "mode": mode})
            return scene, call, call.result(progress=False), mode

        return painted

    key = (key_of(scene, only=("values", "x0", "mode", "across", "up")), mode, across, up)
    return Job("basins", key, tuple(map(part, GRIDS)))
