"""What has been computed and is shown: figures, words, and the calls that gave them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs
import numpy as np

from hybrid.display.tables import counted, with_unit
from hybrid.explorer.calls import Call, script
from hybrid.explorer.figures.all import Figures
from hybrid.explorer.figures.base import extent_of
from hybrid.explorer.pictures import Live, diagram_call, points_of_orbit, start_row
from hybrid.explorer.scene import Scene
from hybrid.explorer.subject import Subject
from hybrid.explorer.worker import Outcome
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.simulation.arc import HybridArc
from hybrid.status import Status, StatusCode

# Order of the pictures in the script.
PICTURES = ("live", "exponents", "orbit", "branch", "basins", "diagram")


@attrs.define(eq=False)
class Board:
    """Shows outcomes.

    Attributes
    ----------
    live, orbit
        The last section and arc; the orbit that is shown, between the scene where it was looked for and its
        arc.
    results, calls, words
        By picture: what is shown, the calls that gave it, and what is said about it.
    progress
        Share of the diagram that is drawn, 0 to 1.
    """

    subject: Subject
    figures: Figures
    live: Live | None = None
    orbit: tuple[Scene, PeriodicOrbit, HybridArc] | None = None
    results: dict[str, Any] = attrs.field(factory=dict)
    calls: dict[str, tuple[Call, ...]] = attrs.field(factory=dict)
    words: dict[str, str] = attrs.field(factory=dict)
    progress: float = 0.0

    def show(self, outcome: Outcome) -> None:
        """Draw a result, or say why there is none."""
        picture = outcome.job.picture
        self.words[picture] = outcome.problem
        if not outcome.problem:
            draw: Callable[[Outcome], None] = getattr(self, f"_show_{picture}")
            draw(outcome)

    def clear(self, picture: str) -> None:
        """Take away what was switched off."""
        self.calls.pop(picture, None)
        self.results.pop(picture, None)
        self.words.pop(picture, None)
        if picture == "orbit":
            self._clear_orbit()
        elif picture == "branch":
            self.figures.diagram.show_branch(None)
        elif picture == "basins":
            self.figures.section.clear_basins()

    def script(self, scene: Scene) -> str:
        """Python that computes and draws what is shown."""
        calls = [each for picture in PICTURES for each in self.calls.get(picture, ())]
        return script(self.subject.text, [*calls, "", *self._drawing(scene, [each.name for each in calls])])

    def _drawing(self, scene: Scene, named: list[str]) -> list[str]:
        """Lines that draw the results of these names."""
        across, up = scene.across, scene.up
        draw = {
            "section": f"hybrid.plot.plot_section(section, {across!r}, {up!r})",
            "arc": f"hybrid.plot.plot_phase(arc, {across!r}, {up!r})",
            "spectrum": "hybrid.plot(spectrum)",
            "orbit": f"hybrid.plot.plot_orbit(orbit, {across!r}, {up!r})",
            "branch": f"hybrid.plot.plot_branch(branch, {across!r})",
            "painted": "hybrid.plot(painted)",
            "diagram": "hybrid.plot(diagram)",
        }
        spectrum = self.results.get("exponents")
        if spectrum is not None and not spectrum.intervals:
            # A run that ended before its first interval has no history to draw.
            del draw["spectrum"]
        drawn = [text for name, text in draw.items() if name in named]
        return [*drawn, "plt.show()"] if drawn else []

    def _show_live(self, outcome: Outcome) -> None:
        live = self.live = outcome.result
        self.calls["live"] = live.calls
        self._draw_live(live)
        ends = {"Section": live.points.status, "Arc": live.arc.status}
        self.words["live"] = " ".join(
            f"{what}: {status}" for what, status in ends.items() if _is_told(status)
        )

    def _draw_live(self, live: Live) -> None:
        names = self.figures.states.shown
        start = start_row(self.subject, live.scene, names)
        self.figures.arc.show(live.arc, start)
        low, high = extent_of(np.column_stack([live.arc[name] for name in names]))
        self.figures.section.show(live.points.table(names), live.points.mode, start, high - low)

    def choose(self, scene: Scene) -> None:
        """Draw the components and outputs of a scene."""
        if not self.figures.choose(scene):
            return
        # What an output is at the points of results is computed once it is shown.
        if self.live is not None:
            self._draw_live(self.live)
        if self.orbit is not None:
            self._draw_orbit(*self.orbit)
        if self.results.get("branch") is not None:
            self.figures.diagram.show_branch(self.results["branch"])

    def _show_exponents(self, outcome: Outcome) -> None:
        call, spectrum = outcome.result
        self.calls["exponents"], self.results["exponents"] = (call,), spectrum
        self.figures.exponents.show(spectrum)
        self.words["exponents"] = "" if spectrum.status.ok else f"Exponents: {spectrum.status}"

    def _show_orbit(self, outcome: Outcome) -> None:
        scene, call, orbit, arc = outcome.result
        self.calls["orbit"], self.results["orbit"] = (call,), orbit
        if arc is None:
            self._clear_orbit()
            self.words["orbit"] = f"Orbit: {orbit.status}"
            return
        self.orbit = scene, orbit, arc
        self._draw_orbit(scene, orbit, arc)
        period = with_unit(f"{orbit.period:.6g}", self.subject.system.units.get("t"))
        moduli = np.sort(np.abs(orbit.multipliers))[::-1]
        if not self.subject.is_forced:
            # An unforced orbit has the multiplier 1 of its phase; of one state there is no other.
            moduli = np.delete(moduli, _nearest_one(moduli))
        largest = float(moduli.max(initial=0.0))
        kind = "stable" if largest < 1.0 else "not stable"
        self.words["orbit"] = (
            f"Orbit of period {period} with {counted(len(orbit.signature), 'jump')}: "
            f"largest multiplier {largest:.6g}, {kind}."
        )

    def _draw_orbit(self, scene: Scene, orbit: PeriodicOrbit, arc: HybridArc) -> None:
        names = self.figures.states.shown
        self.figures.arc.show_orbit(arc)
        self.figures.section.show_orbit(points_of_orbit(self.subject, scene, orbit, arc, names))
        self.figures.multipliers.show(orbit)

    def _clear_orbit(self) -> None:
        self.orbit = None
        self.figures.arc.show_orbit(None)
        self.figures.section.show_orbit(())
        self.figures.multipliers.show(None)

    def _show_branch(self, outcome: Outcome) -> None:
        calls, status, branch = outcome.result
        self.calls["branch"], self.results["branch"] = calls, branch
        self.figures.diagram.show_branch(branch)
        if branch is None:
            self.words["branch"] = f"Branch: there is no orbit to follow. {status}"
            return
        found = ", ".join(f"{each.kind} at {each.value:.6g}" for each in branch.bifurcations)
        ended = "" if branch.status.ok else f" {branch.status}"
        self.words["branch"] = (
            f"Branch of {counted(len(branch), 'orbit')}: {found or 'no bifurcation'}.{ended}"
        )

    def _show_basins(self, outcome: Outcome) -> None:
        scene, call, found = outcome.result
        self.calls["basins"], self.results["basins"] = (call,), found
        label = found.label.transpose(scene.up, scene.across).values
        self.figures.section.show_basins(label, found[scene.across].values, found[scene.up].values)
        numbers, kinds = found.attractor.values.tolist(), found.kind.values.tolist()
        told = ", ".join(f"{number} {kind}" for number, kind in zip(numbers, kinds, strict=True))
        coming = "" if outcome.is_last else " A finer grid is being computed."
        self.words["basins"] = f"Basins: {told or 'no attractor was found'}.{coming}"

    def _show_diagram(self, outcome: Outcome) -> None:
        scene, chart = outcome.result
        if outcome.part == 0:
            self.figures.diagram.begin()
            self.calls["diagram"] = (diagram_call(self.subject, scene),)
        self.figures.diagram.add(scene.over, chart)
        self.progress = (outcome.part + 1) / len(outcome.job.parts)
        # A column from beyond a guard reaches its end; what is said of it goes with the others.
        early = chart.status.values != StatusCode.SUCCESS
        failed = int(early.sum())
        before = 0 if outcome.part == 0 else self.results.get("failed columns", 0)
        self.results["failed columns"] = before + failed
        if before + failed:
            message = next((str(each) for each in chart.message.values[early] if str(each)), "")
            self.results["why"] = message or self.results.get("why", "")
            beyond = bool((chart.status.values[early] == StatusCode.START_BEYOND).any())
            what = "ended early or began beyond a guard" if beyond else "ended early"
            self.words["diagram"] = (
                f"Diagram: {counted(before + failed, 'column')} {what}. {self.results['why']}"
            )


def _is_told(status: Status) -> bool:
    """Whether a status is worth a word: not that a section at jumps ended with its last jump."""
    return not status.ok and status.code != StatusCode.MAX_JUMPS


def _nearest_one(moduli: np.ndarray) -> int:
    return int(np.argmin(np.abs(moduli - 1.0)))
