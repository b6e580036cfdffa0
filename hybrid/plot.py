"""Pictures of arcs, mode graphs, work and precision; matplotlib is imported when the first one is drawn."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid import arguments
from hybrid.arc import HybridArc
from hybrid.errors import ArgumentError
from hybrid.system import END, HybridSystem, Transition, as_system

if TYPE_CHECKING:
    import networkx as nx
    from matplotlib.axes import Axes

    from hybrid.work_precision import WorkPrecision

# Okabe and Ito's palette, told apart with any colour vision, the faintest hues last: a colour a mode.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
JUMP_COLOUR = "0.35"
# Points drawn within each step of the solver, from the dense output.
POINTS_A_STEP = 8
MARKERS = "osD^vP*"
# Height of a line of small text in points, to keep labels apart.
LABEL_HEIGHT = 9.0
# Arrows of a guard's direction.
DIRECTIONS = {-1: "↓", 0: "↕", 1: "↑"}
# Degrees between the loops of one mode.
FAN = 60.0
LABEL: dict[str, Any] = {"fontsize": 10, "bbox": {"boxstyle": "square,pad=0.15", "fc": "white", "ec": "none"}}


def plot_arc(
    arc: HybridArc, components: Iterable[str | int] | None = None, ax: Axes | Iterable[Axes] | None = None
) -> np.ndarray:
    """Draw an arc over time: a row a component, a colour a mode, a dotted line where the state is reset.

    Parameters
    ----------
    arc
        From :func:`hybrid.simulate`; between steps it is drawn from its dense output.
    components
        Names or indices of the state's components, all by default.
    ax
        Axes to draw into, one a component; by default those of a new figure.

    Returns
    -------
    numpy.ndarray
        The axes, one a component.

    Raises
    ------
    ArgumentError
        If a component does not exist, or the number of axes differs from that of components.
    """
    names = _as_arc(arc).system.state_names
    chosen = range(len(names)) if components is None else _components(arc.system, components)
    axes = _axes(ax, len(chosen))
    lines = _lines(arc)
    for row, i in zip(axes, chosen, strict=True):
        for mode, (t, x) in lines.items():
            row.plot(t, x[:, i], color=_colour(mode), linewidth=1.4, solid_capstyle="round")
        t = np.repeat(arc.jumps.t, 3)
        ends = _with_gaps(arc.jumps.x_minus[:, i], arc.jumps.x_plus[:, i])
        row.plot(t, ends, color=JUMP_COLOUR, linewidth=0.9, linestyle=":", zorder=1)
        _shade(row, lines)
        row.set_ylabel(names[i])
        row.margins(x=0)
        _plain(row)
    if len(axes):
        axes[-1].set_xlabel("t")
        _legend(axes[0], arc.system, lines)
    return axes


def plot_phase(arc: HybridArc, x: str | int, y: str | int, ax: Axes | None = None) -> Axes:
    """Draw one component of an arc over another: a colour a mode, jumps dashed, a dot at the start.

    Parameters
    ----------
    arc
        From :func:`hybrid.simulate`; between steps it is drawn from its dense output.
    x, y
        Names or indices of the state's components.
    ax
        Axes to draw into; by default those of a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ArgumentError
        If a component does not exist.
    """
    system = _as_arc(arc).system
    i, j = as_component("x", system, x), as_component("y", system, y)
    (ax,) = _axes(ax, 1, figsize=(5.0, 4.2))
    lines = _lines(arc)
    for mode, (_, states) in lines.items():
        ax.plot(states[:, i], states[:, j], color=_colour(mode), linewidth=1.4, solid_capstyle="round")
    before, after = arc.jumps.x_minus, arc.jumps.x_plus
    ax.plot(
        _with_gaps(before[:, i], after[:, i]),
        _with_gaps(before[:, j], after[:, j]),
        color=JUMP_COLOUR,
        linewidth=0.9,
        linestyle=(0, (4, 3)),
        zorder=1,
    )
    if len(arc.x):
        ax.plot(arc.x[0, i], arc.x[0, j], "o", color="black", markersize=4)
    ax.set_xlabel(arc.system.state_names[i])
    ax.set_ylabel(arc.system.state_names[j])
    _plain(ax)
    _legend(ax, arc.system, lines)
    return ax


def plot_graph(system: HybridSystem, ax: Axes | None = None) -> Axes:
    """Draw the mode graph: modes as boxes, transitions as arrows that say how their guard crosses zero.

    An upward arrow marks a guard that rises through zero, a downward one a guard that falls; dashed edges
    reset the state. Modes have the colours they have in the other pictures; a dot is the end of a run.

    Parameters
    ----------
    system
        The model.
    ax
        Axes to draw into; by default those of a new figure.

    Returns
    -------
    matplotlib.axes.Axes
    """
    graph = as_system("system", system).graph
    crowd = len(graph)
    (ax,) = _axes(ax, 1, figsize=((4.0, 2.6), (6.0, 2.8), (7.0, 6.0))[min(crowd, 3) - 1])
    where = _places(graph)
    boxes = {
        mode: _draw_mode(ax, mode, where[mode], _colour(system.mode_index(mode)))
        for mode in system.mode_names
    }
    if END in graph:
        boxes[END] = _draw_end(ax, where[END])
    parallel: Counter[tuple[str, str]] = Counter()
    loops: defaultdict[str, list[Transition]] = defaultdict(list)
    for transition in system.transitions:
        ends = (transition.source, END if transition.target is None else transition.target)
        if ends[0] == ends[1]:
            loops[ends[0]].append(transition)
            continue
        bend = 0.28 + 0.3 * parallel[ends]
        parallel[ends] += 1
        # Among many modes edges cross near their middles, so their labels stand before.
        _draw_edge(
            ax,
            transition,
            [where[end] for end in ends],
            bend,
            0.5 if crowd <= 2 else 0.38,
            [boxes[end] for end in ends],
        )
    for mode, around in loops.items():
        outward = where[mode] if crowd > 2 else np.array([0.0, 1.0])
        middle = np.degrees(np.arctan2(outward[1], outward[0]))
        for slot, transition in enumerate(around):
            angle = middle + FAN * (slot - (len(around) - 1) / 2)
            _draw_loop(ax, transition, where[mode], np.radians(angle))
    _frame(ax, np.array(list(where.values())), bool(loops))
    ax.text(0.5, 0.0, _key(system), transform=ax.transAxes, ha="center", va="top", fontsize=8, color="0.35")
    return ax


def plot_work_precision(result: WorkPrecision, ax: Axes | None = None, quantity: str = "state") -> Axes:
    """Draw error over time on logarithmic scales: a line a method, the reference's own error grey.

    Nearer to the lower left is better. Runs that failed are left out, and errors of exactly zero.

    Parameters
    ----------
    result
        From :func:`hybrid.work_precision`.
    ax
        Axes to draw into; by default those of a new figure.
    quantity
        Which error: ``"state"``, ``"times"``, ``"saltation"``, ``"fundamental"`` or ``"exponents"``.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ArgumentError
        If the quantity was not measured.
    """
    if not hasattr(result, "error_of"):
        raise arguments.refusal("result", "be a WorkPrecision, from hybrid.work_precision", result)
    error = result.error_of(quantity)
    (ax,) = _axes(ax, 1, figsize=(6.4, 4.6))
    ends = []
    for index, method in enumerate(result.methods):
        rows = result.rows_of(method) & np.isfinite(error) & (error > 0)
        if not np.any(rows):
            continue
        colour, marker = COLOURS[index % len(COLOURS)], MARKERS[index // len(COLOURS) % len(MARKERS)]
        ax.loglog(result.seconds[rows], error[rows], marker=marker, color=colour, markersize=4, linewidth=1.4)
        ends.append((float(result.seconds[rows][-1]), float(error[rows][-1]), method, colour))
    floor = result.reference_error[quantity]
    if ends and np.isfinite(floor) and floor > 0:
        low = ax.get_ylim()[0]
        ax.axhspan(min(floor, low) / 10, floor, color="0.88", linewidth=0, zorder=0)
        ax.set_ylim(bottom=min(low, floor / 3))
    ax.set_xlabel("seconds")
    ax.set_ylabel(f"error of the {quantity}")
    _plain(ax)
    _label_ends(ax, ends)
    return ax


def _label_ends(ax: Axes, ends: list[tuple[float, float, str, str]]) -> None:
    """Names to the right of their points, pushed apart where one would cover another."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    # Limits before the layout, or it would shift what the labels were placed by.
    low, high = ax.get_xlim()
    ax.set_xlim(low, high * (high / low) ** 0.45)
    figure.draw_without_rendering()
    point = figure.dpi / 72
    placed: list[tuple[float, float, float]] = []
    for seconds, error, method, colour in sorted(ends, key=lambda end: end[1]):
        x, y = ax.transData.transform((seconds, error)) / point
        width, height = 0.55 * LABEL_HEIGHT * len(method), y
        for left, right, other in sorted(placed, key=lambda label: label[2]):
            if left < x + width and x < right and abs(height - other) < LABEL_HEIGHT:
                height = other + LABEL_HEIGHT
        placed.append((x, x + width, height))
        ax.annotate(
            method,
            (seconds, error),
            (6.0, height - y),
            textcoords="offset points",
            va="center",
            fontsize=8,
            color=colour,
        )


def _places(graph: nx.MultiDiGraph) -> dict[str, np.ndarray]:
    """One mode or two in a row, more of them on a circle."""
    import networkx as nx

    if len(graph) <= 2:
        return {mode: np.array([2.2 * i, 0.0]) for i, mode in enumerate(graph)}
    return dict(nx.circular_layout(graph))


def _key(system: HybridSystem) -> str:
    key = "↑ guard rises through zero   ↓ falls"
    if any(transition.guard.direction == 0 for transition in system.transitions):
        key += "   ↕ either"
    if any(transition.reset is not None for transition in system.transitions):
        key += "   dashed: resets the state"
    return key


def _draw_mode(ax: Axes, mode: str, place: np.ndarray, colour: str) -> Any:
    style = {"boxstyle": "round,pad=0.6,rounding_size=0.9", "fc": "white", "ec": colour, "lw": 1.8}
    text = ax.text(place[0], place[1], mode, ha="center", va="center", fontsize=12, zorder=4, bbox=style)
    return text.get_bbox_patch()


def _draw_end(ax: Axes, place: np.ndarray) -> Any:
    style = {"boxstyle": "circle,pad=0.25", "fc": "black", "ec": "black"}
    return ax.text(place[0], place[1], " ", ha="center", va="center", zorder=4, bbox=style).get_bbox_patch()


def _draw_edge(
    ax: Axes,
    transition: Transition,
    places: Sequence[np.ndarray],
    bend: float,
    along: float,
    boxes: Sequence[Any],
) -> None:
    """A bent arrow between two boxes, with its label at the part ``along`` of its Bezier curve."""
    start, end = places
    style = {
        **_arrow(transition),
        "connectionstyle": f"arc3,rad={bend}",
        "patchA": boxes[0],
        "patchB": boxes[1],
        "shrinkA": 1,
        "shrinkB": 1,
    }
    ax.annotate("", xy=tuple(end), xytext=tuple(start), arrowprops=style, zorder=2)
    across = end - start
    control = (start + end) / 2 + bend * np.array([across[1], -across[0]])
    middle = (1 - along) ** 2 * start + 2 * along * (1 - along) * control + along**2 * end
    ax.text(middle[0], middle[1], _label(transition), ha="center", va="center", zorder=3, **LABEL)


def _draw_loop(ax: Axes, transition: Transition, place: np.ndarray, angle: float) -> None:
    """A loop of fixed size, in points, that leaves and enters the box on the side of ``angle``."""
    from matplotlib.patches import FancyArrowPatch
    from matplotlib.path import Path
    from matplotlib.transforms import Affine2D, ScaledTranslation

    out, side = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    # Where a ray meets the box, half as wide as the name and its margins.
    foot = min((3.6 * len(transition.source) + 9) / max(abs(out[0]), 1e-9), 15 / max(abs(out[1]), 1e-9)) + 2
    far = foot + 46
    vertices = [
        (foot - 4) * out - 8 * side,
        far * out - 34 * side,
        far * out + 34 * side,
        foot * out + 8 * side,
    ]
    path = Path(vertices, [Path.MOVETO, Path.CURVE4, Path.CURVE4, Path.CURVE4])
    figure = ax.get_figure(root=True)
    assert figure is not None
    points = Affine2D().scale(1 / 72) + figure.dpi_scale_trans
    patch = FancyArrowPatch(path=path, **_arrow(transition), zorder=2, clip_on=False)
    patch.set_transform(points + ScaledTranslation(place[0], place[1], ax.transData))  # type: ignore[arg-type]
    ax.add_patch(patch)
    ax.annotate(
        _label(transition),
        xy=tuple(place),
        xytext=tuple((far - 6) * out),
        textcoords="offset points",
        ha="center" if abs(out[0]) < 0.4 else ("left" if out[0] > 0 else "right"),
        va="center" if abs(out[1]) < 0.4 else ("bottom" if out[1] > 0 else "top"),
        zorder=3,
        **LABEL,
    )


def _arrow(transition: Transition) -> dict[str, Any]:
    return {
        "arrowstyle": "-|>",
        "mutation_scale": 13,
        "linewidth": 1.2,
        "color": "0.25",
        "linestyle": "-" if transition.reset is None else (0, (4, 2.5)),
    }


def _label(transition: Transition) -> str:
    return f"{transition.name} {DIRECTIONS[transition.guard.direction]}"


def _frame(ax: Axes, places: np.ndarray, loops: bool) -> None:
    """Limits with room for labels and loops, and nothing else to see."""
    low, high = places.min(axis=0), places.max(axis=0)
    row = high[1] - low[1] < 1e-9
    ax.set_xlim(low[0] - 0.7, high[0] + 0.7)
    ax.set_ylim(low[1] - (0.65 if row else 0.6), high[1] + (1.0 if loops and row else 0.65))
    ax.set_aspect("equal", adjustable="box")
    ax.set_axis_off()


def _as_arc(arc: object) -> HybridArc:
    return arguments.instance("arc", arc, HybridArc, "Make one with hybrid.simulate.")


def _components(system: HybridSystem, components: object) -> list[int]:
    given = arguments.items("components", components, "be names or indices of components of the state")
    return [as_component("components", system, each) for each in given]


def as_component(name: str, system: HybridSystem, component: object) -> int:
    """Index of a component of the state, given by name or index in the argument ``name``."""
    names = system.state_names
    if isinstance(component, int | np.integer) and not isinstance(component, bool):
        if not -len(names) <= component < len(names):
            raise ArgumentError(
                f"{name}: State component {component} does not exist; the state has {len(names)}."
            )
        return int(component) % len(names)
    return names.index(arguments.known(f"{name}: State component", component, names, "State components"))


def as_axes(name: str, value: object) -> Axes:
    """Axes of matplotlib, or an ArgumentError."""
    from matplotlib.axes import Axes

    return arguments.instance(name, value, Axes, "Make them with matplotlib.pyplot.subplots.")


def _axes(ax: Any, count: int, figsize: tuple[float, float] | None = None) -> np.ndarray:
    """The axes given, or a new figure's, as an array of ``count``."""
    if ax is None:
        import matplotlib.pyplot as plt

        size = figsize or (7.0, 0.8 + 1.5 * count)
        return plt.subplots(count, 1, sharex=True, squeeze=False, figsize=size, layout="constrained")[1][:, 0]
    axes = np.atleast_1d(np.array(ax, dtype=object)).ravel()
    for each in axes:
        as_axes("ax", each)
    if len(axes) != count:
        raise ArgumentError(f"ax must hold {count} axes, one per component; got {len(axes)}.")
    return axes


def _lines(arc: HybridArc) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Times and states of each mode visited, its stays separated by a row of nan."""
    parts: defaultdict[int, list[tuple[np.ndarray, np.ndarray]]] = defaultdict(list)
    cuts = np.flatnonzero(np.diff(arc.j)) + 1
    gap = (np.array([np.nan]), np.full((1, arc.system.dimension), np.nan))
    bounds = [0, *cuts.tolist(), len(arc.t)] if len(arc.t) else [0]
    for first, last in pairwise(bounds):
        stay = _refined(arc, arc.t[first:last], arc.x[first:last])
        parts[arc.system.mode_index(str(arc.mode[first]))] += [stay, gap]
    return {
        mode: (np.concatenate([t for t, _ in parts[mode]]), np.concatenate([x for _, x in parts[mode]]))
        for mode in sorted(parts)
    }


def _refined(arc: HybridArc, t: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same points, with more between them where the arc has dense output."""
    if arc._pieces is None or len(t) < 2:
        return t, x
    part = np.linspace(0, 1, POINTS_A_STEP + 1)[:-1]
    times = (t[:-1, None] + np.diff(t)[:, None] * part).ravel()
    states = arc(times)
    states[::POINTS_A_STEP] = x[:-1]
    return np.append(times, t[-1]), np.vstack([states, x[-1]])


def _with_gaps(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """``before, after, nan`` for each jump, so that one line draws them all."""
    return np.column_stack([before, after, np.full(len(before), np.nan)]).ravel()


def _shade(ax: Axes, lines: dict[int, tuple[np.ndarray, np.ndarray]]) -> None:
    """Tint the background wherever the mode is not the first."""
    for mode, (t, _) in lines.items():
        if mode == 0:
            continue
        ends = np.flatnonzero(np.isnan(t))
        starts = np.concatenate([[0], ends[:-1] + 1])
        spans = list(zip(t[starts], t[ends - 1] - t[starts], strict=True))
        ax.broken_barh(
            spans,
            (0, 1),
            transform=ax.get_xaxis_transform(),
            facecolor=_colour(mode),
            alpha=0.12,
            linewidth=0,
            zorder=0,
        )


def _colour(mode: int) -> str:
    return COLOURS[mode % len(COLOURS)]


def _plain(ax: Axes) -> None:
    ax.spines[["top", "right"]].set_visible(False)


def _legend(ax: Axes, system: HybridSystem, modes: Iterable[int]) -> None:
    """Name the modes above the axes, if the system has more than one."""
    if len(system.modes) < 2:
        return
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=_colour(mode), label=system.mode_names[mode]) for mode in modes]
    ax.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0, 1),
        ncols=len(handles),
        frameon=False,
        borderaxespad=0.2,
    )
