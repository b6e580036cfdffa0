"""Where everything stands: controls beside the pictures on a wide screen, above them on a narrow one."""

from __future__ import annotations

from html import escape
from typing import Any

import panel as pn
from bokeh.layouts import column, row

from hybrid.explorer.figures.all import Figures
from hybrid.explorer.messages import DIAGRAM, EXPONENTS, JUMPS, MULTIPLIERS, PORTRAIT, SECTION, TOP
from hybrid.explorer.widgets import SMALL, Widgets

WIDE: dict[str, Any] = {"sizing_mode": "stretch_width"}
# Two columns of pictures beside the controls fit into 900 pixels; on a telephone all is one column.
CARD = {"flex": "1 1 calc(50% - 10px)", "min-width": "min(280px, 92vw)", "margin": "4px"}
CONTROLS = {"flex": "1 1 250px", "max-width": "min(420px, 96vw)", "min-width": "min(250px, 92vw)"}
PICTURES = {"flex": "4 1 590px", "min-width": "min(590px, 96vw)"}
# Where there is room for it the bar stays in view.
BAR_STYLE = """
@media (min-width: 700px) {
    :host { position: sticky; top: 0; z-index: 5; background: white; border-bottom: 1px solid #ddd; }
}
"""
SCRIPT_STYLE = "pre { overflow-x: auto; background: #f5f5f5; padding: 8px; font-size: 12px; margin: 0; }"
EVENT_STYLE = "td, th { padding: 0 10px 0 0; text-align: right; } div { overflow-x: auto; }"
COPY = """
    const page = new DOMParser().parseFromString(script.text, "text/html");
    const inside = new DOMParser().parseFromString(page.documentElement.textContent, "text/html");
    navigator.clipboard.writeText(inside.documentElement.textContent);
"""


def arranged(title: str, widgets: Widgets, figures: Figures) -> Any:
    """The whole page."""
    return pn.Column(
        _bar(title, widgets),
        widgets.messages[TOP],
        pn.FlexBox(_controls(widgets), _pictures(widgets, figures), align_items="start", gap="8px"),
        widgets.sent,
        margin=8,
        **WIDE,
    )


def _bar(title: str, widgets: Widgets) -> Any:
    """All buttons."""
    return pn.FlexBox(
        pn.pane.HTML(f"<h2 style='margin: 0'>{escape(title)}</h2>", margin=(2, 8)),
        *widgets.switches.values(),
        widgets.held,
        widgets.start_again,
        widgets.share,
        widgets.back,
        widgets.play,
        widgets.next,
        widgets.picture,
        widgets.format,
        widgets.save_picture,
        _copy_button(widgets.script),
        widgets.save_script,
        align_items="end",
        stylesheets=[BAR_STYLE],
        **WIDE,
    )


def _controls(widgets: Widgets) -> Any:
    sliders = [row(each, widgets.fields[name], **WIDE) for name, each in widgets.sliders.items()]
    choice = widgets.choices
    section = ("section", "level", "points", "transient", "part", "window", "over_time")
    diagram = [choice[name] for name in ("over", "low", "high", "columns", "periods") if name in choice]
    return pn.Column(
        pn.pane.Bokeh(column(*sliders, **WIDE), **WIDE),
        _folded("Start", *widgets.starts.values(), choice["mode"]),
        _folded("Section and portrait", *(choice[name] for name in section)),
        _folded("Diagram and orbit", *diagram),
        styles=CONTROLS,
    )


def _pictures(widgets: Widgets, figures: Figures) -> Any:
    widgets.script.stylesheets = [SCRIPT_STYLE]
    widgets.event.stylesheets = [EVENT_STYLE]
    choice, diagram, said = widgets.choices, figures.diagram, widgets.messages
    return pn.Column(
        pn.FlexBox(choice["across"], choice["up"], align_items="end", gap="4px"),
        pn.FlexBox(
            _card(figures.arc.portrait, said[PORTRAIT]),
            _card(figures.section.made, said[SECTION]),
            _card(figures.arc.series),
            _card(figures.exponents.made, said[EXPONENTS]),
            _card(diagram.above, diagram.pointer, widgets.progress, diagram.below, said[DIAGRAM]),
            _card(figures.multipliers.made, said[MULTIPLIERS]),
        ),
        said[JUMPS],
        widgets.event,
        pn.pane.HTML("<h3 style='margin: 0'>The same in Python</h3>"),
        widgets.script,
        styles=PICTURES,
    )


def _card(*inside: Any) -> Any:
    return pn.Column(*inside, styles=CARD)


def _folded(title: str, *inside: Any) -> Any:
    return pn.Card(pn.FlexBox(*inside), title=title, collapsed=True, **WIDE)


def _copy_button(script: Any) -> Any:
    made = pn.widgets.Button(label="Copy the script", **SMALL)
    made.js_on_click(args={"script": script}, code=COPY)
    return made
