"""Everything on the page that can be moved, chosen or pressed."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Mapping
from functools import partial
from html import escape
from io import BytesIO, StringIO
from math import isfinite
from typing import Any, Protocol

import panel as pn
from bokeh.models import CustomJS, Div, NumericInput, Slider

from hybrid.display.tables import with_unit
from hybrid.explorer.messages import PLACES, placed
from hybrid.explorer.saved import FORMATS, PICTURES, file_name
from hybrid.explorer.scene import BEGIN, SETTLED, Scene, section_names
from hybrid.explorer.subject import Subject

WIDE = {"sizing_mode": "stretch_width"}
# What stands in the bar of buttons, which leaves the room of the page to the pictures.
SMALL = {"margin": (2, 4)}
# Milliseconds between two frames of the moving point.
FRAME = 50
SAID = "p { margin: 2px 0; color: #7a2e00; font-size: 14px; overflow-wrap: anywhere; }"
DOWNLOAD = """
    const link = document.createElement("a");
    [link.download, link.href] = sent.tags;
    link.click();
"""


class Acts(Protocol):
    """What the widgets can have done."""

    def move(self, name: str, value: float) -> None:
        """Give a parameter a value."""

    def place(self, name: str, value: float) -> None:
        """Give a component of the start a value."""

    def change(self, **changed: Any) -> None:
        """Change the scene."""

    def switched(self, picture: str, on: bool) -> None:
        """Have something shown, or no more."""

    def hold(self, held: bool) -> None:
        """Keep the pictures to compare with."""

    def step(self, by: int) -> None:
        """Go to another jump."""

    def tick(self) -> None:
        """Move the point on."""

    def reset(self) -> None:
        """Return to the first scene."""

    def shared(self) -> dict[str, str]:
        """The parts of an address that lead here."""
        ...

    def script(self) -> str:
        """The script of what is shown."""
        ...

    def saved(self, picture: str, suffix: str) -> BytesIO | None:
        """A picture as a file; None if there is none."""


class Widgets:
    """The widgets of a page; each tells its change, and follows the scene.

    Attributes
    ----------
    sliders, fields, starts
        By name: sliders of parameters, fields to type their values, fields of the start.
    choices
        What else a scene has, by the names of its fields.
    switches
        Orbit, branch and basins, which are on or off.
    messages
        What is said, by place.
    sent
        Carries files to the browser, which saves them.
    """

    def __init__(self, subject: Subject, scene: Scene, acts: Acts) -> None:
        self.subject, self.acts = subject, acts
        self.following, self.files = False, 0
        units, names = subject.system.units, list(subject.system.quantity_names)
        self.sliders: dict[str, Any] = {}
        self.fields: dict[str, Any] = {}
        # The parameter that the diagram is over comes first.
        for name in sorted(scene.values, key=lambda each: each != scene.over):
            self._parameter(name, with_unit(name, units.get(name)), scene.values[name])
        self.starts = {
            name: pn.widgets.FloatInput(label=with_unit(name, units.get(name)), value=value, width=130)
            for name, value in scene.x0.items()
        }
        for name, each in self.starts.items():
            self._when(each, partial(acts.place, name))
        self.choices = self._choices(names, scene)
        for name, each in self.choices.items():
            self._when(each, partial(self._change, name))
        labels = {"orbit": "Orbit near here", "branch": "Its branch", "basins": "Basins"}
        self.switches = {name: pn.widgets.Toggle(label=label, **SMALL) for name, label in labels.items()}
        for name, each in self.switches.items():
            self._when(each, partial(acts.switched, name))
        self.held = pn.widgets.Toggle(label="Hold to compare", **SMALL)
        self._when(self.held, acts.hold)
        self.back = self._button("Previous jump", lambda: acts.step(-1))
        self.next = self._button("Next jump", lambda: acts.step(1))
        self.play = pn.widgets.Toggle(label="Play", **SMALL)
        self._when(self.play, self._play)
        self._ticks: Any = None
        self.start_again = self._button("Reset", acts.reset)
        self.share = self._button("Share", self._share)
        self.messages = {place: _message(place) for place in PLACES}
        self.event = pn.pane.HTML("", **WIDE)
        self.script = pn.pane.HTML("", **WIDE)
        self.progress = pn.indicators.Progress(value=0, max=100, height=6, **WIDE)
        self.save_script = pn.widgets.FileDownload(
            callback=lambda: StringIO(acts.script()), filename="explored.py", label="Save the script", **SMALL
        )
        self.picture = pn.widgets.Select(label="picture", options=list(PICTURES), **{**SMALL, "width": 120})
        self.format = pn.widgets.Select(label="format", options=list(FORMATS), **{**SMALL, "width": 75})
        self.save_picture = self._button("Save the picture", self._save)
        self.sent = Div(visible=False, name="sent")
        self.sent.js_on_change("tags", CustomJS(args={"sent": self.sent}, code=DOWNLOAD))

    @property
    def switched_on(self) -> list[str]:
        """Which of orbit, branch and basins are wanted."""
        return [name for name, each in self.switches.items() if each.value]

    def follow(self, scene: Scene) -> None:
        """Show the values of a scene, without changing it again."""
        self.following = True
        try:
            for name, value in scene.values.items():
                self._reach(name, value)
            both = ((scene.values, self.sliders), (scene.values, self.fields), (scene.x0, self.starts))
            for given, widgets in both:
                for name, value in given.items():
                    _put(widgets[name], value)
            for name, each in self.choices.items():
                _put(each, getattr(scene, name))
        finally:
            self.following = False

    def say(self, words: Mapping[str, str]) -> None:
        """Show what is said, each sentence in its place."""
        for place, sentences in placed(words).items():
            told = "".join(f"<p>{escape(each)}</p>" for each in sentences)
            # A reader of the screen reads it when it changes.
            text = f'<div role="status" aria-live="polite">{told}</div>'
            if self.messages[place].text != text:
                self.messages[place].text = text

    def show_script(self, text: str) -> None:
        """Show the script."""
        _show(self.script, f"<pre>{escape(text)}</pre>")

    def _when(self, widget: Any, act: Callable[[Any], Any]) -> None:
        def told(event: Any) -> None:
            if not self.following and event.new is not None:
                act(event.new)

        widget.param.watch(told, "value")

    def _change(self, field: str, value: Any) -> None:
        self.acts.change(**{field: value})

    def _parameter(self, name: str, label: str, value: float) -> None:
        """A slider for a parameter, and a field beside it to type its value.

        They are Bokeh's own: those of Panel wait 50 ms before they tell a change.
        """
        low, high = self.subject.ranges[name]
        low, high = min(low, value), max(high, value)
        step = (high - low) / 1000
        slider = Slider(title=label, start=low, end=high, value=value, step=step, show_value=False, **WIDE)
        field = NumericInput(value=value, mode="float", width=110, title=f"{name} =")

        def moved(attribute: str, old: float, new: float | None) -> None:
            if not self.following and new is not None:
                self._reach(name, new)
                self.acts.move(name, new)

        slider.on_change("value", moved)
        field.on_change("value", moved)
        self.sliders[name], self.fields[name] = slider, field

    def _reach(self, name: str, value: float) -> None:
        """Move an end of a slider to a value beyond it: one that is typed, or clicked at."""
        slider = self.sliders[name]
        if not slider.start <= value <= slider.end and isfinite(value):
            slider.start, slider.end = min(slider.start, value), max(slider.end, value)

    def _choices(self, names: list[str], scene: Scene) -> dict[str, Any]:
        modes = dict.fromkeys(each.part_of or each.name for each in self.subject.system.modes)
        sections = {
            f"where {each} passes the level" if each in self.subject.system.state_names else each: each
            for each in section_names(self.subject)
        }
        span = "periods shown" if self.subject.is_forced else "typical times shown"
        kinds: dict[str, Any] = {
            "mode": ("mode at the start", {"by the guards": "", **{each: each for each in modes}}),
            "across": ("across", names),
            "up": ("up", names),
            "over_time": ("over time", names),
            "section": ("section", sections),
            "part": ("portrait of the run", [SETTLED, BEGIN]),
            "over": ("diagram over", list(scene.values)),
            "level": ("level of the section", None),
            "points": ("points of the section", 1),
            "transient": ("points before", 0),
            "window": (span, None),
            "low": ("from", None),
            "high": ("to", None),
            "columns": ("columns", 2),
            "periods": ("periods (0: by dots)", 0),
        }
        made = {}
        for field, (label, kind) in kinds.items():
            value = getattr(scene, field)
            if isinstance(kind, list | dict):
                if kind:
                    made[field] = pn.widgets.Select(label=label, options=kind, value=value, width=190)
            elif isinstance(kind, int):
                made[field] = pn.widgets.IntInput(label=label, start=kind, value=value, width=130)
            else:
                made[field] = pn.widgets.FloatInput(label=label, value=value, width=130)
        return made

    def _button(self, label: str, act: Callable[[], None]) -> Any:
        return pn.widgets.Button(label=label, on_click=lambda _: act(), **SMALL)

    def _play(self, on: bool) -> None:
        if on:
            self._ticks = pn.state.add_periodic_callback(self.acts.tick, period=FRAME)
        elif self._ticks is not None:
            self._ticks.stop()

    def _save(self) -> None:
        picture, suffix = self.picture.value, self.format.value
        file = self.acts.saved(picture, suffix)
        if file is not None:
            data = b64encode(file.read()).decode()
            # The number tells a file from the same file, saved again.
            self.files += 1
            name = file_name(self.subject.title, picture, suffix)
            self.sent.tags = [name, f"data:application/octet-stream;base64,{data}", self.files]

    def _share(self) -> None:
        location = pn.state.location
        if location is not None:
            location.search = ""
            location.update_query(**self.acts.shared())


def _message(place: str) -> Div:
    """An empty message; a text of it is never read as mathematics."""
    return Div(name=f"said {place}", stylesheets=[SAID], margin=(0, 5), disable_math=True, **WIDE)


def _put(widget: Any, value: Any) -> None:
    if widget.value != value:
        widget.value = value


def _show(pane: Any, text: str) -> None:
    if pane.object != text:
        pane.object = text
