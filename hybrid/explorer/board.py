"""What has been computed and is shown: figures, words, and the calls that gave them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from hybrid.display.tables import counted, measured
from hybrid.explorer.calls import Call, script
from hybrid.explorer.diagrams import diagram_call, joined, remark
from hybrid.explorer.figures.all import Figures
from hybrid.explorer.figures.base import extent_of
from hybrid.explorer.orbits import points_of_orbit
from hybrid.explorer.pictures import Live, start_row
from hybrid.explorer.scene import Scene
from hybrid.explorer.subject import Subject
from hybrid.explorer.worker import Outcome
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.simulation.arc import HybridArc
from hybrid.status import Status, StatusCode

if TYPE_CHECKING:
    import xarray

# Order of the pictures in the script.
PICTURES = ("live", "exponents", "orbit", "branch", "basins", "diagram")
# Attractors that are told one by one.
MOST_NAMED = 8
# What is said about pictures that are computed together.
TOGETHER: Mapping[str, tuple[str, ...]] = MappingProxyType({"live": ("portrait", "section")})


@attrs.define(eq=False)
class Board:
    """Shows outcomes.

    Attributes
    ----------
    live, orbit
        The last section and arc; the orbit that is shown, between the scene where it was looked for and its
        arc.
    results, calls
        By picture: what is shown, and the calls that gave it.
    words
        What is said, by the names of ``messages.ABOUT``.
    charts
        The columns of the diagram that have been computed, in parts.
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
    charts: list[xarray.Dataset] = attrs.field(factory=list)
    progress: float = 0.0

    def show(self, outcome: Outcome) -> None:
        """Draw a result, or say why there is none."""
        picture = outcome.job.picture
        for each in TOGETHER.get(picture, (picture,)):
            self.words[each] = outcome.problem
        if outcome.problem:
            # A section stays while a slider passes a value that cannot be; all else would be that of another.
            if picture != "live":
                self._take_away(picture)
            return
        draw: Callable[[Outcome], None] = getattr(self, f"_show_{picture}")
        draw(outcome)

    def clear(self, picture: str) -> None:
        """Take away what was switched off."""
        self.words.pop(picture, None)
        self._take_away(picture)

    def _take_away(self, picture: str) -> None:
        self.calls.pop(picture, None)
        self.results.pop(picture, None)
        match picture:
            case "orbit":
                self.orbit = None
                self.figures.arc.show_orbit(None)
                self.figures.section.show_orbit(())
                self.figures.multipliers.show(None)
            case "branch":
                self.figures.diagram.show_branch(None)
            case "basins":
                self.figures.section.clear_basins()
            case "exponents":
                self.figures.exponents.clear()
            case "diagram":
                self.charts.clear()
                self.figures.diagram.begin()

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
            "diagram": f"hybrid.plot(diagram, component={across!r})",
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
        for what, status in (("section", live.points.status), ("portrait", live.arc.status)):
            self.words[what] = str(status) if _is_told(status) else ""

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
        self.words["exponents"] = "" if spectrum.status.ok else str(spectrum.status)

    def _show_orbit(self, outcome: Outcome) -> None:
        scene, call, orbit, arc, told = outcome.result
        self.calls["orbit"], self.results["orbit"] = (call,), orbit
        self.orbit = scene, orbit, arc
        self._draw_orbit(scene, orbit, arc)
        self.words["orbit"] = f"{self._described(orbit, arc.jump_count)} {told}"

    def _described(self, orbit: PeriodicOrbit, jumps: int) -> str:
        period = measured(f"{orbit.period:.6g}", self.subject.system.units.get("t"))
        moduli = np.sort(np.abs(orbit.multipliers))[::-1]
        if not self.subject.is_forced:
            # An unforced orbit has the multiplier 1 of its phase; of one state there is no other.
            moduli = np.delete(moduli, _nearest_one(moduli))
        largest = float(moduli.max(initial=0.0))
        kind = "stable" if largest < 1.0 else "not stable"
        return f"period {period}, {counted(jumps, 'jump')}, largest multiplier {largest:.6g}, {kind}."

    def _draw_orbit(self, scene: Scene, orbit: PeriodicOrbit, arc: HybridArc) -> None:
        names = self.figures.states.shown
        self.figures.arc.show_orbit(arc)
        self.figures.section.show_orbit(points_of_orbit(self.subject, scene, orbit, arc, names))
        self.figures.multipliers.show(orbit)

    def _show_branch(self, outcome: Outcome) -> None:
        calls, branch = outcome.result
        self.calls["branch"], self.results["branch"] = calls, branch
        self.figures.diagram.show_branch(branch)
        found = ", ".join(f"{each.kind} at {each.value:.6g}" for each in branch.bifurcations)
        ended = "" if branch.status.ok else f" {branch.status}"
        self.words["branch"] = f"{counted(len(branch), 'orbit')}, {found or 'no bifurcation'}.{ended}"

    def _show_basins(self, outcome: Outcome) -> None:
        scene, call, found, mode = outcome.result
        self.calls["basins"], self.results["basins"] = (call,), found
        label = found.label.transpose(scene.up, scene.across).values
        self.figures.section.show_basins(label, found[scene.across].values, found[scene.up].values)
        said = [f"{_attractors(found.attractor.values.tolist(), found.kind.values.tolist())}."]
        if mode:
            said.append(
                f"Several modes allow some of these starts: all are in mode {mode!r}. Choose another one "
                "under 'Start'."
            )
        if not outcome.is_last:
            said.append("A finer grid is being computed.")
        self.words["basins"] = " ".join(said)

    def _show_diagram(self, outcome: Outcome) -> None:
        scene, chart = outcome.result
        if outcome.part == 0:
            self.charts.clear()
            self.figures.diagram.begin()
            self.calls["diagram"] = (diagram_call(self.subject, scene),)
        self.charts.append(chart)
        self.figures.diagram.add(scene.over, chart)
        self.progress = (outcome.part + 1) / len(outcome.job.parts)
        self.words["diagram"] = remark(scene, self.charts)

    def chart(self, scene: Scene) -> xarray.Dataset | None:
        """The diagram as far as it has been computed; None if it has not begun."""
        return joined(scene, self.charts) if self.charts else None


def _attractors(numbers: list[int], kinds: list[str]) -> str:
    """Each attractor with its kind, or how many there are of each kind."""
    if not numbers:
        return "no attractor was found"
    if len(numbers) <= MOST_NAMED:
        return ", ".join(f"{number} {kind}" for number, kind in zip(numbers, kinds, strict=True))
    counts = ", ".join(f"{count} {kind}" for kind, count in Counter(kinds).items())
    return f"{len(numbers)} attractors: {counts}"


def _is_told(status: Status) -> bool:
    """Whether a status is worth a word: not that a section at jumps ended with its last jump."""
    return not status.ok and status.code != StatusCode.MAX_JUMPS


def _nearest_one(moduli: np.ndarray) -> int:
    return int(np.argmin(np.abs(moduli - 1.0)))
