"""Where everything stands: controls beside the pictures on a wide screen, above them on a narrow one."""

from __future__ import annotations

from html import escape
from typing import Any

import panel as pn
from bokeh.layouts import column, row

from hybrid.explorer.figures.all import Figures
from hybrid.explorer.widgets import Widgets

WIDE: dict[str, Any] = {"sizing_mode": "stretch_width"}
CARD = {"flex": "1 1 340px", "min-width": "min(340px, 92vw)", "margin": "4px"}
CONTROLS = {"flex": "1 1 280px", "max-width": "min(420px, 96vw)", "min-width": "min(280px, 92vw)"}
PICTURES = {"flex": "3 1 640px", "min-width": "min(640px, 96vw)"}
SCRIPT_STYLE = "pre { overflow-x: auto; background: #f5f5f5; padding: 8px; font-size: 12px; margin: 0; }"
WORDS_STYLE = "p { margin: 2px 0; color: #7a2e00; font-size: 14px; }"
EVENT_STYLE = "td, th { padding: 0 10px 0 0; text-align: right; } div { overflow-x: auto; }"
COPY = """
    const page = new DOMParser().parseFromString(script.text, "text/html");
    const inside = new DOMParser().parseFromString(page.documentElement.textContent, "text/html");
    navigator.clipboard.writeText(inside.documentElement.textContent);
"""


def arranged(title: str, widgets: Widgets, figures: Figures) -> Any:
    """The whole page."""
    return pn.FlexBox(
        _controls(title, widgets), _pictures(widgets, figures), align_items="start", gap="8px", margin=8
    )


def _controls(title: str, widgets: Widgets) -> Any:
    sliders = [row(each, widgets.fields[name], **WIDE) for name, each in widgets.sliders.items()]
    choice = widgets.choices
    section = ("section", "level", "points", "transient", "part", "window", "over_time")
    diagram = [choice[name] for name in ("over", "low", "high", "columns", "periods") if name in choice]
    return pn.Column(
        pn.pane.HTML(f"<h2 style='margin: 0'>{escape(title)}</h2>"),
        pn.pane.Bokeh(column(*sliders, **WIDE), **WIDE),
        _folded("Start", *widgets.starts.values(), choice["mode"]),
        _folded("Section and portrait", *(choice[name] for name in section)),
        _folded("Diagram and orbit", *diagram),
        styles=CONTROLS,
    )


def _pictures(widgets: Widgets, figures: Figures) -> Any:
    widgets.words.stylesheets = [WORDS_STYLE]
    widgets.script.stylesheets = [SCRIPT_STYLE]
    widgets.event.stylesheets = [EVENT_STYLE]
    choice, diagram = widgets.choices, figures.diagram
    return pn.Column(
        _line(
            choice["across"],
            choice["up"],
            *widgets.switches.values(),
            widgets.held,
            widgets.start_again,
            widgets.share,
            widgets.speed,
        ),
        widgets.words,
        pn.FlexBox(
            _card(figures.arc.portrait),
            _card(figures.section.made),
            _card(figures.arc.series),
            _card(figures.exponents.made),
            _card(diagram.above, diagram.pointer, widgets.progress, diagram.below),
            _card(figures.multipliers.made),
        ),
        _line(widgets.back, widgets.play, widgets.next),
        widgets.event,
        _line(widgets.picture, widgets.format, widgets.save_picture),
        pn.pane.HTML("<h3 style='margin: 0'>The same in Python</h3>"),
        _line(_copy_button(widgets.script), widgets.save_script),
        widgets.script,
        styles=PICTURES,
    )


def _line(*inside: Any) -> Any:
    return pn.FlexBox(*inside, align_items="end", gap="4px")


def _card(*inside: Any) -> Any:
    return pn.Column(*inside, styles=CARD)


def _folded(title: str, *inside: Any) -> Any:
    return pn.Card(pn.FlexBox(*inside), title=title, collapsed=True, **WIDE)


def _copy_button(script: Any) -> Any:
    made = pn.widgets.Button(label="Copy the script")
    made.js_on_click(args={"script": script}, code=COPY)
    return made
