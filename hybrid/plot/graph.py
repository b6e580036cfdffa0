"""The graph of a system: modes as boxes, transitions as arrows."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Unpack

import attrs
import numpy as np

from hybrid.plot.apart import CurveLabel, keep_apart, keep_inside, lay_out, point_on
from hybrid.plot.axes import axes_for
from hybrid.plot.legends import room, wrapped
from hybrid.plot.picture import Look, picture
from hybrid.plot.styles import colour_of, line_width, small_text, text_size
from hybrid.system.elements import END, Transition
from hybrid.system.graph import HybridSystem, as_system
from hybrid.system.members import about_all, shared_name

if TYPE_CHECKING:
    import networkx as nx
    from matplotlib.axes import Axes
    from matplotlib.text import Annotation

# Arrows for the direction of a guard.
DIRECTIONS = {-1: "↓", 0: "↕", 1: "↑"}
# Angle between the loops of one mode, in degrees.
FAN = 60.0
# Sizes of a figure, by the number of modes, in inches.
SIZES = ((4.0, 2.6), (6.0, 2.8), (7.0, 6.0), (7.0, 6.0), (8.5, 7.0))
# Height of the key below a graph, in the units of the places of modes.
FOR_KEY = 0.5
# A graph of so many modes is drawn with less detail.
CROWD = 5
Ends = tuple[str, str]
# Sizes of the letters of modes and of transitions, in points.
OF_MODES, OF_EDGES = 12.0, 10.0
LABEL_BOX = {"boxstyle": "square,pad=0.15", "fc": "white", "ec": "none"}


@picture
def plot_graph(system: HybridSystem, **look: Unpack[Look]) -> Axes:
    """Draw the mode graph: modes as boxes, transitions as arrows, with the directions of their guards.

    A label's upward arrow means that the guard rises through zero, a downward arrow that it falls. The label
    of a clock says when it ticks. Dashed edges reset the state; grey edges of dashes and dots lead to the
    limit of a chatter. Those of all members of a repeat share an arrow, with their number. Modes have the
    same colours as in the other plots. A dot is the end of a run. Transitions that only fire at the start of
    a run are left out. In a graph of more than a few modes, the transitions between the same two modes share
    an arrow, and names such as ``a->b`` are not repeated on it.

    Parameters
    ----------
    system
        The model.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import models
    >>> from hybrid.plot import plot_graph
    >>> ax = plot_graph(models.stick_slip())
    >>> [text.get_text() for text in ax.texts[:3]]
    ['below', 'above', 'sliding']
    """
    from matplotlib.text import Annotation

    graph = as_system("system", system).graph
    crowd = len(graph)
    edges, loops = _edges_and_loops(system)
    (ax,) = axes_for(look, 1, _size(crowd, loops))
    where = _places(graph)
    boxes = {
        mode: _draw_mode(ax, mode, where[mode], colour_of(system.mode_index(mode)))
        for mode in system.mode_names
    }
    if END in graph:
        boxes[END] = _draw_end(ax, where[END])
    parallel: Counter[tuple[str, str]] = Counter()
    labels: list[CurveLabel] = []
    for ends, bundle in _bundles(edges, crowd):
        bend = (0.28 if crowd < CROWD else 0.12) + 0.3 * parallel[ends]
        parallel[ends] += 1
        # With many modes the edges cross near their middles, so the labels are placed nearer the source.
        along = 0.5 if crowd <= 2 else 0.38
        label = "\n".join(dict.fromkeys(each.label(short=crowd >= CROWD) for each in bundle))
        curve = _draw_arrow(
            ax, bundle[0].style, [where[end] for end in ends], bend, [boxes[end] for end in ends]
        )
        middle = point_on(curve, along)
        text = ax.text(middle[0], middle[1], label, ha="center", va="center", zorder=3, **_label_style())
        labels.append(CurveLabel(text, curve, along))
    for mode, around in loops.items():
        outward = where[mode] if crowd > 2 else np.array([0.0, 1.0])
        middle = np.degrees(np.arctan2(outward[1], outward[0]))
        for slot, edge in enumerate(around):
            angle = middle + FAN * (slot - (len(around) - 1) / 2)
            note = _draw_loop(ax, edge, where[mode], np.radians(angle))
            # A single mode stays in the middle, where the key has room: long labels do not push it aside.
            note.set_in_layout(crowd > 1)
    _frame(ax, np.array(list(where.values())), bool(loops))
    _write_key(ax, system)
    moved = [label.text for label in labels]
    # Arrows are texts without letters.
    fixed = [each for each in ax.texts if each.get_text() and each not in moved]
    lay_out(ax)
    keep_inside(ax, [each for each in fixed if isinstance(each, Annotation)])
    keep_apart(ax, labels, fixed)
    return ax


def _size(crowd: int, loops: Mapping[str, Sequence[_Edge]]) -> tuple[float, float]:
    """The size of a figure, in inches: a single mode with many loops has labels on both sides."""
    about_one = crowd == 1 and any(len(around) > 2 for around in loops.values())
    return SIZES[1] if about_one else SIZES[min(crowd, len(SIZES)) - 1]


@attrs.frozen
class _Edge:
    """A transition as an arrow, or the way to the limit of its chatter.

    The transitions of ``count`` members of a repeat share an arrow.
    """

    transition: Transition
    is_limit: bool = False
    count: int = 1

    @property
    def ends(self) -> Ends:
        """The modes that the arrow joins."""
        target = self.transition.accumulates_to if self.is_limit else self.transition.target
        return self.transition.source, END if target is None else target

    def label(self, *, short: bool = False) -> str:
        """The name, and the direction of the guard or when the clock ticks; short without names of modes."""
        transition, clock = self.transition, self.transition.clock
        name = shared_name(transition.name)
        if name != transition.name:
            name = f"{name} ×{self.count}"
        if self.is_limit:
            return f"limit of {name}"
        fires = (
            DIRECTIONS[transition.guard.direction]
            if clock is None
            else about_all(clock.told, transition.name)
        )
        if short and name.startswith(f"{transition.source}->{transition.target}"):
            return fires
        name = name.removeprefix(f"{transition.source}: ")
        if clock is None:
            return f"{name} {fires}"
        # When a clock ticks may be a long text, and loops leave little room beside them.
        return f"{name}\n({fires})" if self.ends[0] == self.ends[1] else f"{name} ({fires})"

    @property
    def style(self) -> dict[str, Any]:
        """Properties of the arrow."""
        found: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 13, "linewidth": line_width(1.2)}
        if self.is_limit:
            return {**found, "color": "0.5", "linestyle": (0, (6, 2, 1, 2))}
        plain = self.transition.reset is None
        return {**found, "color": "0.25", "linestyle": "-" if plain else (0, (4, 2.5))}


def _edges_and_loops(system: HybridSystem) -> tuple[dict[Ends, list[_Edge]], dict[str, list[_Edge]]]:
    """The arrows between each two modes, and those from each mode to itself."""
    edges: defaultdict[Ends, list[_Edge]] = defaultdict(list)
    loops: defaultdict[str, list[_Edge]] = defaultdict(list)
    drawn = [_Edge(each) for each in system.transitions if not each.guard.at_start]
    limits = [_Edge(each, is_limit=True) for each in system.transitions if each.accumulates_to is not None]
    for edge in _shared(drawn + limits):
        if edge.ends[0] == edge.ends[1]:
            loops[edge.ends[0]].append(edge)
        else:
            edges[edge.ends].append(edge)
    return edges, loops


def _shared(edges: Sequence[_Edge]) -> list[_Edge]:
    """The edges with one for those of all members of a repeat between two modes."""
    found: dict[Any, list[_Edge]] = {}
    for edge in edges:
        found.setdefault((shared_name(edge.transition.name), edge.ends, edge.is_limit), []).append(edge)
    return [attrs.evolve(same[0], count=len(same)) for same in found.values()]


def _bundles(edges: Mapping[Ends, list[_Edge]], crowd: int) -> Iterator[tuple[Ends, list[_Edge]]]:
    """The edges that share an arrow: in a crowd all of one kind between two modes."""
    for ends, between in edges.items():
        if crowd < CROWD:
            yield from ((ends, [edge]) for edge in between)
            continue
        for is_limit in (False, True):
            same = [edge for edge in between if edge.is_limit is is_limit]
            if same:
                yield ends, same


def _places(graph: nx.MultiDiGraph) -> dict[str, np.ndarray]:
    """Places of the nodes: one or two in a row, a few on a circle, of more the neighbours near each other."""
    import networkx as nx

    if len(graph) <= 2:
        return {mode: np.array([2.2 * i, 0.0]) for i, mode in enumerate(graph)}
    if len(graph) < CROWD:
        return dict(nx.circular_layout(graph))
    return dict(nx.kamada_kawai_layout(nx.Graph(graph)))


def _key(system: HybridSystem) -> str:
    guarded = [transition for transition in system.transitions if transition.clock is None]
    key = "↑ guard rises through zero   ↓ falls" if guarded or not system.transitions else ""
    if any(transition.guard.direction == 0 for transition in system.transitions):
        key += "   ↕ either"
    if any(transition.reset is not None for transition in system.transitions):
        key += "   dashed: resets the state"
    if any(transition.accumulates_to is not None for transition in system.transitions):
        key += "   dashes and dots: limit of chatter"
    return key.lstrip()


def _draw_mode(ax: Axes, mode: str, place: np.ndarray, colour: str) -> Any:
    style = {
        "boxstyle": "round,pad=0.6,rounding_size=0.9",
        "fc": "white",
        "ec": colour,
        "lw": line_width(1.8),
    }
    size = text_size(OF_MODES)
    text = ax.text(place[0], place[1], mode, ha="center", va="center", fontsize=size, zorder=4, bbox=style)
    return text.get_bbox_patch()


def _draw_end(ax: Axes, place: np.ndarray) -> Any:
    style = {"boxstyle": "circle,pad=0.25", "fc": "black", "ec": "black"}
    return ax.text(place[0], place[1], " ", ha="center", va="center", zorder=4, bbox=style).get_bbox_patch()


def _draw_arrow(
    ax: Axes, arrow: dict[str, Any], places: Sequence[np.ndarray], bend: float, boxes: Sequence[Any]
) -> np.ndarray:
    """A bent arrow between two boxes; return its Bezier curve ``(3, 2)``."""
    start, end = places
    style = {
        **arrow,
        "connectionstyle": f"arc3,rad={bend}",
        "patchA": boxes[0],
        "patchB": boxes[1],
        "shrinkA": 1,
        "shrinkB": 1,
    }
    ax.annotate("", xy=tuple(end), xytext=tuple(start), arrowprops=style, zorder=2)
    across = end - start
    control = (start + end) / 2 + bend * np.array([across[1], -across[0]])
    return np.array([start, control, end])


def _label_style() -> dict[str, Any]:
    return {"fontsize": text_size(OF_EDGES), "bbox": LABEL_BOX}


def _write_key(ax: Axes, system: HybridSystem) -> None:
    """Say below the graph what its signs mean, in as many lines as it takes."""
    style: dict[str, Any] = {"ha": "center", "va": "bottom", "fontsize": small_text(), "color": "0.35"}
    text = ax.text(0.5, 0.0, _key(system), transform=ax.transAxes, **style)
    text.set_text(wrapped(text.get_text(), text.get_window_extent().width, room(ax)))


def _draw_loop(ax: Axes, edge: _Edge, place: np.ndarray, angle: float) -> Annotation:
    """A loop of fixed size, in points, that leaves and enters the box on the side at ``angle``; its label."""
    from matplotlib.patches import FancyArrowPatch
    from matplotlib.path import Path
    from matplotlib.transforms import Affine2D, ScaledTranslation

    out, side = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    # Distance at which a ray leaves the box, whose width follows from the name and its margins.
    scale = text_size(OF_MODES) / OF_MODES
    beside, above = 3.6 * len(edge.transition.source) + 9, 15
    foot = scale * (min(beside / max(abs(out[0]), 1e-9), above / max(abs(out[1]), 1e-9)) + 2)
    far = foot + scale * 46
    vertices = [
        (foot - 4) * out - scale * 8 * side,
        far * out - scale * 34 * side,
        far * out + scale * 34 * side,
        foot * out + scale * 8 * side,
    ]
    path = Path(vertices, [Path.MOVETO, Path.CURVE4, Path.CURVE4, Path.CURVE4])
    figure = ax.get_figure(root=True)
    assert figure is not None
    points = Affine2D().scale(1 / 72) + figure.dpi_scale_trans
    patch = FancyArrowPatch(path=path, **edge.style, zorder=2, clip_on=False)
    patch.set_transform(points + ScaledTranslation(place[0], place[1], ax.transData))  # type: ignore[arg-type]
    ax.add_patch(patch)
    return ax.annotate(
        edge.label(),
        xy=tuple(place),
        xytext=tuple((far - 6) * out),
        textcoords="offset points",
        ha="center" if abs(out[0]) < 0.4 else ("left" if out[0] > 0 else "right"),
        va="center" if abs(out[1]) < 0.4 else ("bottom" if out[1] > 0 else "top"),
        zorder=3,
        **_label_style(),
    )


def _frame(ax: Axes, places: np.ndarray, loops: bool) -> None:
    """Set limits with room for labels and loops, and hide the axes."""
    low, high = places.min(axis=0), places.max(axis=0)
    row = high[1] - low[1] < 1e-9
    beside = 0.7 if len(places) <= 2 or (loops and len(places) < CROWD) else 0.4
    ax.set_xlim(low[0] - beside, high[0] + beside)
    margin = 0.65 if loops or len(places) <= 2 else 0.25
    # The key is below the graph.
    ax.set_ylim(low[1] - max(margin, FOR_KEY), high[1] + margin + (0.35 if loops and row else 0.0))
    ax.set_aspect("equal", adjustable="box")
    ax.set_axis_off()
