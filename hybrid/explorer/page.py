"""The page of one visitor: what is pressed changes the scene, and the pictures follow the scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from io import BytesIO
from threading import Event
from typing import Any

import numpy as np
import panel as pn

from hybrid.errors import ArgumentError, HybridError
from hybrid.explorer.board import Board
from hybrid.explorer.diagrams import NO_PARAMETER, diagram_job
from hybrid.explorer.events import described_jump
from hybrid.explorer.figures.all import Figures
from hybrid.explorer.layout import arranged
from hybrid.explorer.messages import COMING
from hybrid.explorer.orbits import Finder, branch_job, orbit_job
from hybrid.explorer.painted import basins_job
from hybrid.explorer.pictures import Live, changed, exponents_job, live_job
from hybrid.explorer.saved import saved_figure
from hybrid.explorer.scene import checks_of, from_query, over_parameter, to_query
from hybrid.explorer.subject import Subject
from hybrid.explorer.widgets import Widgets
from hybrid.explorer.worker import Outcome, Worker
from hybrid.simulation.simulate import simulate

# Frames in which the moving point runs along the arc.
FRAMES = 240
# Seconds to wait for a picture to be shown, for the case that the page is being closed.
LONGEST_SHOW = 2.0


class Page:
    """One visitor's page.

    Parameters
    ----------
    subject
        The system and its start.
    query
        Parts of the address that the page was opened with.
    execute
        Runs a function in the thread of the page; called from the thread of the worker.
    problem
        Why the page does not show what the user's file holds now; empty if it does.
    """

    def __init__(
        self,
        subject: Subject,
        query: dict[str, str],
        execute: Callable[[Callable[[], None]], Any],
        problem: str = "",
    ) -> None:
        self.subject, self.execute = subject, execute
        self.scene, refused = from_query(subject, query)
        self.board = Board(subject, Figures(subject.system))
        self.board.words |= {"file": problem, "address": " ".join(refused)}
        self.finder = Finder(subject)
        self.jump, self.frame, self.seconds = -1, 0, 0.0
        figures = self.board.figures
        self.board.choose(self.scene)
        self.widgets = Widgets(subject, self.scene, self)
        for made in (figures.arc.portrait, figures.section.made):
            made.on_event("tap", lambda event: self.start_here(event.x, event.y))
        for made in (figures.diagram.above, figures.diagram.below):
            made.on_event("tap", lambda event: self.move(self.scene.over, event.x))
        self.worker = Worker(self._have_shown)
        self.view = arranged(subject.title, self.widgets, figures)
        self.refresh()

    def close(self, *, wait: bool = True) -> None:
        """End the work of the page; ``wait`` until it has ended."""
        self.worker.close(wait=wait)

    # What a visitor does.

    def move(self, name: str, value: float) -> None:
        """Give a parameter a value."""
        if name:
            self.change(values={**self.scene.values, name: float(value)})

    def place(self, name: str, value: float) -> None:
        """Give a component of the start a value."""
        self.change(x0={**self.scene.x0, name: float(value)})

    def change(self, **changed: Any) -> None:
        """Change the scene, and have what depends on it computed."""
        checks = checks_of(self.subject)
        self.say("address", "")
        try:
            for name in checks.keys() & changed.keys():
                changed[name] = checks[name](name, str(changed[name]))
        except ArgumentError as error:
            self.say("address", str(error))
            self.widgets.follow(self.scene)
            return
        scene = self.scene.with_(**changed)
        if "over" in changed:
            scene = over_parameter(self.subject, scene, scene.over)
        self.scene = scene
        # One end is typed before the other: the diagram waits until both are there.
        waits = not scene.low < scene.high
        ends = f"it needs from < to; got {scene.low:g} and {scene.high:g}."
        self.board.words["range"] = ends if waits else ""
        self.board.choose(scene)
        self.refresh()

    def start_here(self, x: float, y: float) -> None:
        """Start at a point of the plane.

        If the guards leave a choice of modes, the mode is that of the nearest point that is drawn.
        """
        scene = self.scene
        if not {scene.across, scene.up} <= scene.x0.keys():
            self.say(
                "address", "Start: an output is no coordinate of a start. Choose components across and up."
            )
            return
        x0 = {**scene.x0, scene.across: float(x), scene.up: float(y)}
        mode = ""
        try:
            simulate(
                self.subject.system,
                tuple(x0.values()),
                (0.0, 0.0),
                parameters=changed(self.subject, scene.values),
            )
        except HybridError:
            mode = self._mode_near(x, y)
        self.change(x0=x0, mode=mode)

    def _mode_near(self, x: float, y: float) -> str:
        live = self.board.live
        if live is None or not len(live.arc.x):
            return self.scene.mode
        plane = np.column_stack([live.arc[self.scene.across], live.arc[self.scene.up]])
        size = np.ptp(plane, axis=0)
        away = np.linalg.norm((plane - [x, y]) / np.where(size > 0.0, size, 1.0), axis=1)
        return str(live.arc.part_of[int(np.argmin(away))])

    def reset(self) -> None:
        """Return to the first scene."""
        self.scene, _ = from_query(self.subject, {})
        self.board.words |= {"address": "", "range": ""}
        self.board.choose(self.scene)
        self.refresh()

    def shared(self) -> dict[str, str]:
        """The parts of an address that lead to this scene."""
        return to_query(self.subject, self.scene)

    def hold(self, held: bool) -> None:
        """Keep the pictures, in grey, to compare with; or let them go."""
        self.board.figures.hold(held)

    def switched(self, picture: str, on: bool) -> None:
        """Orbit, branch or basins are wanted, or no more."""
        if not on:
            self.board.clear(picture)
            self.worker.forget(picture)
        self.refresh()

    def step(self, by: int) -> None:
        """Go to the next jump of the arc, or to one before."""
        live = self.board.live
        if live is None or not live.arc.jump_count:
            self.say("jumps", "The arc has no jumps.")
            return
        self.say("jumps", "")
        self.jump = int(np.clip(self.jump + by, 0, live.arc.jump_count - 1))
        jump = live.arc.jumps[self.jump]
        names = self.board.figures.states.shown
        self.board.figures.arc.show_at(jump.t, [live.arc.jumps.before(name)[self.jump] for name in names])
        self._tell_jump(live)

    def tick(self) -> None:
        """Move the point on along the arc; it tells each jump as it passes it."""
        live = self.board.live
        if live is None or not live.arc.t[-1] > live.arc.t[0]:
            return
        arc = live.arc
        times = np.linspace(arc.t[0], arc.t[-1], FRAMES)
        before, self.frame = times[self.frame], (self.frame + 1) % FRAMES
        now = times[self.frame]
        self.board.figures.arc.show_at(now, [arc(now, name) for name in self.board.figures.states.shown])
        passed = np.flatnonzero((arc.jumps.t > before) & (arc.jumps.t <= now))
        if len(passed):
            self.jump = int(passed[-1])
            self._tell_jump(live)

    def _tell_jump(self, live: Live) -> None:
        count = live.arc.jump_count
        self.widgets.event.object = described_jump(live.arc.jumps[self.jump], self.subject.system, count)

    # What is computed, and shown.

    def refresh(self) -> None:
        """Have everything computed that the scene shows and that is not there yet."""
        subject, scene, on = self.subject, self.scene, self.widgets.switched_on
        jobs = [live_job(subject, scene, self.finder.keep)]
        if "orbit" in on:
            jobs.append(orbit_job(self.finder, scene))
        jobs.append(exponents_job(subject, scene))
        has_range = bool(scene.over) and scene.low < scene.high
        if has_range and "branch" in on:
            jobs.append(branch_job(self.finder, scene))
        if "basins" in on and self.board.live is not None:
            # Before the diagram, which takes longest; a drag does not wait for either.
            mode = scene.mode or str(self.board.live.arc.part_of[0])
            jobs.append(basins_job(subject, scene, mode, *self.board.figures.section.plane))
        if has_range:
            jobs.append(diagram_job(subject, scene))
        self._announce([each.picture for each in jobs])
        self.widgets.say(self.board.words)
        self.worker.want(jobs)

    def _announce(self, pictures: Sequence[str]) -> None:
        """Say of the diagram, and of what is switched on, that it is not there yet or cannot be."""
        words = self.board.words
        for picture in (*self.widgets.switches, "diagram"):
            if picture in pictures and picture not in self.board.calls and not words.get(picture):
                words[picture] = COMING
        if not self.scene.over:
            words["diagram"] = NO_PARAMETER

    def _have_shown(self, outcome: Outcome) -> None:
        """Have a result shown, and wait until it is: further work would only slow down what is looked at."""
        done = Event()

        def show() -> None:
            try:
                # All changes travel in one message, so that the browser draws once.
                with pn.io.unlocked():
                    self.show(outcome)
            finally:
                done.set()

        self.execute(show)
        done.wait(LONGEST_SHOW)

    def show(self, outcome: Outcome) -> None:
        """Show a result that has come."""
        picture = outcome.job.picture
        if picture in self.widgets.switches and picture not in self.widgets.switched_on:
            return
        self.board.show(outcome)
        if picture == "live":
            self.board.words["jumps"] = ""
        self.widgets.say(self.board.words)
        self.widgets.follow(self.scene)
        if self.scene.over:
            self.board.figures.diagram.show_here(self.scene.values[self.scene.over])
        if picture == "live":
            self.jump, self.frame, self.seconds = -1, 0, outcome.seconds
            return
        # What follows can wait until the drag is over.
        if self.board.live is not None:
            self.board.figures.section.tell_speed(self.seconds)
        self.widgets.show_script(self.script())
        self.widgets.progress.value = round(100 * self.board.progress)

    def say(self, picture: str, text: str) -> None:
        """Say something about a picture, or nothing more."""
        self.board.words[picture] = text
        self.widgets.say(self.board.words)

    def script(self) -> str:
        """Python that computes and draws what the page shows."""
        return self.board.script(self.scene)

    def saved(self, picture: str, suffix: str) -> BytesIO | None:
        """A picture as a file, drawn by the functions that the script names; None if there is none yet."""
        results = {**self.board.results, "diagram": self.board.chart(self.scene)}
        try:
            file = saved_figure(self.scene, picture, suffix, self.board.live, results)
        except HybridError as error:
            self.say("saved", str(error))
            return None
        self.say("saved", "")
        return file
