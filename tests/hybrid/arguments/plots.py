"""Figures: valid calls, and what each argument must refuse."""

import numpy as np

import hybrid
import hybrid.plot
import lyapunov
import lyapunov.plot
import lyapunov.study.regimes
from tests.hybrid.arguments.values import (
    AXES,
    BALL,
    COMPONENT,
    COUNT,
    LABELS,
    NAME,
    OPTIONAL_NUMBER,
    POSITIVE,
    SYSTEM,
    TEXT,
    call,
)

SIZE = [value for value in POSITIVE if value is not None]
SYMBOLS = [3, "a", ["a"], {1: "a"}, {"q": 1}]
STYLES = ["nope", 3, True, "Paper"]
FIGSIZE = [3, "a", (1.0,), (1.0, -2.0), (1.0, np.inf), ("a", "b")]

LOOK = {"ax": AXES, "figsize": FIGSIZE, "labels": SYMBOLS, "style": STYLES}


def plots(made):
    arc, chart = made["arc"], made["chart"]
    ground = hybrid.Contact("ground", lambda t, x, p: x.q)
    ball = hybrid.mechanics(
        coordinates=("q",), velocities=("v",), contacts=[ground], mass=lambda t, x, p: (1.0,)
    )
    touching = hybrid.simulate(ball, (1.0, -1.0), (0.0, 2.0))
    return [
        (
            call(hybrid.plot.plot_arc, arc),
            {
                "arc": [None, "a", 3, BALL],
                "components": [["nope"], "nope", 3, [2], [1.5], [None], [True]],
                **LOOK,
            },
        ),
        (
            call(hybrid.plot.plot_phase, arc, "q", "v"),
            {
                "arc": [None, "a", 3, BALL],
                "x": COMPONENT,
                "y": COMPONENT,
                **LOOK,
            },
        ),
        (
            call(hybrid.plot.plot_contacts, touching),
            {"arc": [None, "a", 3, BALL], **LOOK},
        ),
        (call(hybrid.plot.plot_graph, BALL), {"system": SYSTEM, **LOOK}),
        (call(hybrid.plot.plot, BALL), {"result": [None, "a", 3]}),
        (
            call(hybrid.plot.plot_section, made["section"]),
            {
                "size": SIZE,
                "section": [None, "a", 3, arc],
                "x": COMPONENT,
                "y": COMPONENT,
                **LOOK,
            },
        ),
        (
            call(hybrid.plot.plot_orbit, made["orbit"]),
            {"orbit": [None, "a", 3, arc], "x": COMPONENT, "y": COMPONENT, **LOOK},
        ),
        (
            call(hybrid.plot.plot_branch, made["branch"]),
            {
                "branch": [None, "a", 3, arc],
                "y": COMPONENT,
                "over": AXES[1:],
                "label": [3, True, [3], ["a", "b"], {}],
                **LOOK,
            },
        ),
        (
            call(hybrid.plot.plot_curve, made["curve"]),
            {"curve": [None, "a", 3, arc], **LOOK},
        ),
        (
            call(hybrid.plot.plot_diagram, made["diagram"]),
            {
                "diagram": [None, "a", 3, arc],
                # The model has three components.
                "y": [each for each in COMPONENT if type(each) is not int or not -4 < each < 3],
                "over": AXES[1:],
                **LOOK,
            },
        ),
        (
            call(hybrid.plot.plot_work_precision, made["work"]),
            {
                "result": [None, "a", 3, BALL],
                **LOOK,
                "quantity": [None, *NAME],
            },
        ),
        (
            call(lyapunov.plot.plot_convergence, {"a": [1.0, 2.0]}),
            {
                **LOOK,
                "estimates": [[1], "a", {"a": "b"}, {"a": 1.0}, {"a": [[1.0]]}, {"a": [True]}],
                "points": [[1], "a", {"a": 1.0}, {"a": ([1.0], [1.0, 2.0])}, {"a": ("a", "b")}],
                "points_label": TEXT,
                "truth": OPTIONAL_NUMBER,
                "truth_label": TEXT,
                "unit": TEXT,
            },
        ),
        (
            call(lyapunov.plot.plot_phase_portrait, arc, "q", "v"),
            {
                **LOOK,
                "arc": [None, "a", 3, BALL],
                "x": COMPONENT,
                "y": COMPONENT,
                "size": SIZE,
                "section": ["a", [1.0], [[True, False]], [["a", "b"]], 3.0],
            },
        ),
        (
            call(
                lyapunov.study.regimes.plot_regimes,
                [lyapunov.study.regimes.Panel("a", arc, arc.x, np.ones(3), 1.0)],
                "q",
                "v",
            ),
            {
                "panels": [None, "a", 3, [1], [arc]],
                "x": COMPONENT,
                "y": COMPONENT,
                "labels": LABELS,
            },
        ),
        (
            call(lyapunov.plot.plot_exponents, chart),
            {"size": SIZE, **LOOK, "chart": [None, "a", 3, arc]},
        ),
        (
            call(lyapunov.plot.plot_bifurcation, chart),
            {
                "size": SIZE,
                **LOOK,
                "chart": [None, "a", 3, arc],
                "component": COMPONENT,
            },
        ),
        (
            call(lyapunov.plot.plot_kinds, chart),
            {**LOOK, "chart": [None, "a", 3, arc, chart]},
        ),
        (
            call(lyapunov.plot.plot_map, chart),
            {
                **LOOK,
                "chart": [None, "a", 3, arc],
                "exponent": [1, *COUNT],
            },
        ),
        (
            call(lyapunov.plot.plot_chart, chart),
            {
                "size": SIZE,
                **LOOK,
                "chart": [None, "a", 3, arc],
                "component": COMPONENT,
            },
        ),
        (
            call(lyapunov.plot.plot_spectrum, made["spectrum"]),
            {"spectrum": [None, "a", 3, arc], **LOOK},
        ),
        (call(hybrid.plot.style), {"name": STYLES, "labels": SYMBOLS}),
        (
            call(hybrid.plot.plot_ends, made["ends"]),
            {
                "ends": [None, "a", 3, arc],
                "x": COMPONENT,
                "y": COMPONENT,
                **LOOK,
                "size": SIZE,
            },
        ),
        (
            call(hybrid.plot.plot_basins, made["basins"]),
            {"basins": [None, "a", 3, arc], **LOOK, "size": SIZE},
        ),
        (
            call(hybrid.plot.plot_fractions, made["fractions"]),
            {"fractions": [None, "a", 3, arc], **LOOK},
        ),
        (
            call(hybrid.plot.plot_sweep, made["swept"]),
            {"swept": [None, "a", 3, arc], **LOOK, "size": SIZE},
        ),
        (
            call(hybrid.plot.plot_jumps, arc.jumps),
            {"jumps": [None, "a", 3, arc], **LOOK},
        ),
        (
            call(hybrid.plot.plot_global_error, made["error"]),
            {"result": [None, "a", 3, arc], **LOOK},
        ),
        (
            call(lyapunov.plot.plot_two_orbits, made["two"]),
            {"result": [None, "a", 3, arc], **LOOK},
        ),
        (
            call(lyapunov.plot.plot_comparison, made["comparison"]),
            {"result": [None, "a", 3, arc], **LOOK},
        ),
    ]
