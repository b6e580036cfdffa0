"""All figures of a page."""

from __future__ import annotations

from hybrid.explorer.figures.arc import ArcFigures
from hybrid.explorer.figures.base import States
from hybrid.explorer.figures.diagram import DiagramFigures
from hybrid.explorer.figures.exponents import ExponentsFigure, MultipliersFigure
from hybrid.explorer.figures.section import SectionFigure
from hybrid.explorer.scene import Scene
from hybrid.system.graph import HybridSystem


class Figures:
    """All figures of a page, by what they show."""

    def __init__(self, system: HybridSystem) -> None:
        states = self.states = States(system)
        self.arc = ArcFigures(system, states)
        self.section = SectionFigure(system, states)
        self.exponents = ExponentsFigure(system)
        self.diagram = DiagramFigures(system, states)
        self.multipliers = MultipliersFigure()

    def choose(self, scene: Scene) -> bool:
        """Draw the components and outputs of a scene; whether results have to be shown anew for that."""
        anew = self.states.choose(scene.across, scene.up, scene.over_time)
        self.arc.choose(scene.across, scene.up, scene.over_time)
        self.section.choose(scene.across, scene.up)
        self.diagram.choose(scene.across, scene.over)
        return anew

    def hold(self, held: bool) -> None:
        """Keep portrait and section, in grey, to compare with; or let them go."""
        self.arc.hold(held)
        self.section.hold(held)
