"""Draws docs/architecture.png: the rooms of the library, each above those that it imports."""

from __future__ import annotations

import argparse
import ast
from pathlib import Path

import matplotlib as mpl
import networkx as nx

mpl.use("Agg")

import matplotlib.pyplot as plt

HERE = Path(__file__).parent
ROOT = HERE.parent
PACKAGES = ("hybrid", "models", "lyapunov")
# What a user calls, the way from a model to machine code, the way from a start to an arc, and the rest.
COLOURS = {"call": "#0072B2", "compile": "#D55E00", "run": "#009E73", "base": "#777777"}
PATHS = {
    "call": (
        "hybrid",
        "models",
        "lyapunov",
        "hybrid.testing",
        "hybrid.plot",
        "hybrid.measures",
        "hybrid.orbits",
        "hybrid.accuracy",
        "hybrid.sweep",
        "hybrid.explorer",
    ),
    "compile": ("hybrid.system", "hybrid.expression", "hybrid.transform", "hybrid.compiler"),
    "run": ("hybrid.simulation", "hybrid.kernels", "hybrid.solvers"),
}
LEGEND = {
    "call": "called by users",
    "compile": "from a model to machine code",
    "run": "from a start to an arc",
    "base": "used everywhere",
}


def room_of(path: Path) -> str:
    """The room of a file: its folder in hybrid, or the package; a command is a room of its own."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    if parts[-1] == "__main__":
        return ".".join(parts)
    if parts[0] != "hybrid":
        return parts[0]
    return "hybrid" if parts[1] == "__init__" else f"hybrid.{parts[1]}"


def rooms() -> nx.DiGraph:
    """The rooms, with an arrow from each to those that its files import."""
    graph = nx.DiGraph()
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            graph.add_node(room_of(path))
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                whole = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                for each in {name for name in whole if name in PACKAGES} - {room_of(path)}:
                    graph.add_edge(room_of(path), each)
                module = getattr(node, "module", None) or ""
                if isinstance(node, ast.ImportFrom) and module.partition(".")[0] in PACKAGES:
                    parts = module.split(".")
                    inner = [alias.name for alias in node.names] if module == "hybrid" else []
                    target = ".".join(parts[:2]) if parts[0] == "hybrid" else parts[0]
                    targets = {
                        f"hybrid.{name}" for name in inner if (ROOT / "hybrid" / f"{name}.py").exists()
                    }
                    for each in targets or {target}:
                        if each != room_of(path):
                            graph.add_edge(room_of(path), each)
    return graph


def floors(graph: nx.DiGraph) -> list[list[str]]:
    """Rooms by height, those that import nothing first."""
    return [sorted(each) for each in nx.topological_generations(graph.reverse())]


def draw(graph: nx.DiGraph, path: Path) -> None:
    """Boxes on floors, and the arrows that no other arrows imply."""
    kinds = {room: kind for kind, names in PATHS.items() for room in names}
    levels = floors(graph)
    figure, ax = plt.subplots(figsize=(8.4, 7.4), layout="constrained")
    places = {
        room: ((i + 0.5) / len(level) * 10, height)
        for height, level in enumerate(levels)
        for i, room in enumerate(level)
    }
    boxes = {}
    for room, (x, y) in places.items():
        colour = COLOURS[kinds.get(room, "base")]
        package, _, inner = room.partition(".")
        name = f"python -m {package}" if inner == "__main__" else inner or package
        style = {"boxstyle": "round,pad=0.45", "facecolor": "white", "edgecolor": colour, "linewidth": 1.6}
        text = ax.text(x, y, name, ha="center", va="center", fontsize=10, bbox=style, zorder=3)
        boxes[room] = text.get_bbox_patch()
    for one, other in nx.transitive_reduction(graph).edges:
        arrow = {
            "arrowstyle": "-|>",
            "color": "0.6",
            "linewidth": 0.9,
            "patchA": boxes[one],
            "patchB": boxes[other],
        }
        ax.annotate("", places[other], places[one], arrowprops=arrow, zorder=1)
    handles = [
        mpl.lines.Line2D([], [], color=COLOURS[kind], linewidth=2, label=text)
        for kind, text in LEGEND.items()
    ]
    ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.0, 1.0), frameon=False, fontsize=9)
    ax.set_xlim(-0.3, 10.3)
    ax.set_ylim(-0.6, len(levels) - 0.4)
    ax.set_axis_off()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    """Draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("pictures"), help="folder of the picture")
    path = parser.parse_args().output / "architecture.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    draw(rooms(), path)
    print(path)


if __name__ == "__main__":
    main()
