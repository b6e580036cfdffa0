"""Branches of orbits and of equilibria over a parameter, and curves of bifurcations over two."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.bifurcation_curve import BifurcationCurve
from hybrid.orbits.continuation.branch import Branch
from hybrid.orbits.equilibria.bifurcation_curve import EquilibriumCurve
from hybrid.orbits.equilibria.branch import EquilibriumBranch
from hybrid.orbits.kinds import KINDS
from hybrid.orbits.labelled import table_at
from hybrid.plot.axes import (
    axes_for,
    dot_area,
    named_quantity,
)
from hybrid.plot.datasets import SECTION, column
from hybrid.plot.labels import is_text, label_of
from hybrid.plot.legends import small_legend
from hybrid.plot.picture import Look, picture
from hybrid.plot.styles import colour_of, dot_size, line_width

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

AnyBranch = Branch | EquilibriumBranch

# Markers of zeros of functions that callers name.
OTHERS = ("X", "H", "1", "2", "3", "4")
LINES = {"stable": "-", "unstable": "--"}
# Line width in points, the smallest area of a dot that is seen beside such a line, and the colour of what
# stands for all branches.
LINE = 1.4
# Opacity of equilibria that lie where their mode does not hold.
VIRTUAL = 0.35
SEEN = 2.6
NEUTRAL = "0.2"
# Marks the first line of each branch, so that the next one has the next colour.
OF_BRANCH = "branch"


@picture
def plot_branch(
    branch: AnyBranch | Sequence[AnyBranch],
    y: str | int = 0,
    *,
    over: xarray.Dataset | Axes | None = None,
    label: str | Sequence[str] | None = None,
    **look: Unpack[Look],
) -> Axes:
    """Draw what a branch is asked for by name over its parameter, with the bifurcations.

    Stable parts are full, unstable ones dashed, and each kind of bifurcation has its marker; the legend says
    so. Virtual equilibria are pale. Each further branch in the same axes has a colour of its own.

    Parameters
    ----------
    branch
        From :func:`hybrid.continue_orbit` or :func:`hybrid.continue_equilibrium`, or several over one
        parameter.
    y
        Name or index of a component or name of an output at the orbits' points, or name of a function in
        ``outputs=`` of :func:`hybrid.continue_orbit`; by default the first component.
    over
        What is drawn as dots below the branch: a dataset that holds ``y`` over the same parameter, such as
        one of :func:`hybrid.sweep`, or a chart with points of the section, from
        ``lyapunov.chart(section=...)``; or the axes of a picture of one.
    label
        What the legend says of the branch, or of each.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ArgumentError
        If a component does not exist, the dataset has no points over the parameter, or the branches are over
        different parameters.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.measures import maximum
    >>> from hybrid.plot import plot_branch
    >>> orbit = hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    >>> branch = hybrid.continue_orbit(orbit, "w", (0.9, 1.1), outputs={"peak": maximum("v")})
    >>> ax = plot_branch(branch, "peak")
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('w', 'peak')
    """
    branches = _branches_of(branch)
    labels = _labels_of(label, branches)
    names = [quantity_of(each, y) for each in branches]
    cloud = None
    if over is not None:
        if hasattr(over, "data_vars"):
            cloud = _points_of(over, branches[0].name, names[0])
        elif look.get("ax") is None and hasattr(over, "plot"):
            look["ax"] = over
        else:
            wanted = "be a sweep or a chart with points of its section, or axes in place of ax"
            raise arguments.refusal("over", wanted, over)
    (ax,) = axes_for(look, 1, (6.4, 4.2))
    if cloud is not None:
        draw_points(ax, *cloud)
    for each, name, text in zip(branches, names, labels, strict=True):
        _draw_branch(ax, each, name, text)
    ax.set_xlabel(label_of(branches[0].name, branches[0].system.units.get(branches[0].name)))
    ax.set_ylabel(label_with_unit(branches[0], names[0]))
    _legend(ax)
    return ax


def label_with_unit(branch: AnyBranch, name: str) -> str:
    """The name of what is drawn, with its unit."""
    if isinstance(branch, Branch) and name in branch.outputs:
        return label_of(name, branch.output_units.get(name))
    return label_of(name, branch.system.units.get(name))


def _branches_of(given: object) -> list[AnyBranch]:
    """One branch or several, over one parameter."""
    if not isinstance(given, list | tuple):
        return [_branch_of("branch", given)]
    if not given:
        raise arguments.refusal("branch", "be a branch, or several", given)
    found = [_branch_of(f"branch[{i}]", each) for i, each in enumerate(given)]
    over = list(dict.fromkeys(each.name for each in found))
    if len(over) > 1:
        raise ArgumentError(f"branch: all must be over one parameter to be drawn; got {', '.join(over)}.")
    return found


def _branch_of(name: str, given: object) -> AnyBranch:
    if isinstance(given, EquilibriumBranch):
        return given
    hint = "Make one with hybrid.continue_orbit or hybrid.continue_equilibrium."
    return arguments.instance(name, given, Branch, hint)


def _labels_of(given: object, branches: Sequence[AnyBranch]) -> list[str | None]:
    """What the legend says of each branch."""
    if given is None:
        return [None] * len(branches)
    found = [given] if isinstance(given, str) else arguments.items("label", given, "be a text per branch")
    if len(found) != len(branches) or not all(is_text(each) for each in found):
        wanted = f"be a text per branch, of which there are {len(branches)}, in printable letters"
        raise arguments.refusal("label", wanted, given)
    return found


def quantity_of(branch: AnyBranch, y: object) -> str:
    """The name of what a branch is asked for."""
    if isinstance(branch, Branch) and arguments.whole_number(y) is None:
        return branch._asked("y: ", y)
    return named_quantity("y", branch.system, y)


def _draw_branch(ax: Axes, branch: AnyBranch, name: str, label: str | None) -> None:
    """Lines of a branch in the next colour, its bifurcations, and what a legend needs."""
    colour = _next_colour(ax)
    if label is not None:
        ax.plot([], [], "-", color=colour, lw=line_width(LINE), label=label)
    across, values, stable, admissible = _with_bifurcations(branch, name)
    first = True
    kinds = [*zip(stable.tolist(), admissible.tolist(), strict=True)]
    for (is_stable, is_admissible), part in groupby(range(len(kinds)), key=kinds.__getitem__):
        inside = list(part)
        # The line reaches to the next part.
        shown = [*inside, *([inside[-1] + 1] if inside[-1] + 1 < len(stable) else [])]
        text, style = [*LINES.items()][0 if is_stable else 1]
        opacity = 1.0 if is_admissible else VIRTUAL
        (line,) = ax.plot(
            across[shown], values[shown], style, color=colour, lw=line_width(LINE), alpha=opacity
        )
        line.set_gid(OF_BRANCH if first else None)
        first = False
        if text not in _texts(ax):
            ax.plot([], [], style, color=NEUTRAL, lw=line_width(LINE), label=text)
    found: list[Any] = [*branch.bifurcations]
    there = _there(branch, name)
    _mark(ax, [(each.kind, each.value, up) for each, up in zip(found, there, strict=True)])


def _next_colour(ax: Axes) -> str:
    """The colour of the next branch or curve in the axes."""
    return colour_of(sum(each.get_gid() == OF_BRANCH for each in ax.lines))


def _there(branch: AnyBranch, name: str) -> np.ndarray:
    """What a branch is asked for, at its bifurcations."""
    if isinstance(branch, EquilibriumBranch):
        return np.array([each.equilibrium[name][0] for each in branch.bifurcations])
    found = branch.bifurcations
    if name in branch.outputs:
        return np.array([each.outputs[name] for each in found])
    return table_at(branch.system, [name], [each.orbit for each in found])[:, 0]


def _with_bifurcations(branch: AnyBranch, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Parameter, values, stability and admissibility along a branch, its bifurcations among them."""
    there = _there(branch, name)
    found: list[Any] = [*branch.bifurcations]
    shown = [(each, up) for each, up in zip(found, there, strict=True) if np.isfinite(up)]
    at = [each.position for each, _ in shown]
    stable = [each.stable[1] if each.stable[1] is not None else bool(each.stable[0]) for each, _ in shown]
    admissible = np.ones(len(branch), dtype=bool)
    if isinstance(branch, EquilibriumBranch):
        admissible = branch.admissible
    # A bifurcation belongs to what comes after it.
    onward = [bool(admissible[min(i, len(branch) - 1)]) for i in at]
    return (
        np.insert(branch.parameter, at, [each.value for each, _ in shown]),
        np.insert(branch[name], at, [up for _, up in shown]),
        np.insert(branch.stable, at, stable),
        np.insert(admissible, at, onward),
    )


@picture
def plot_curve(curve: BifurcationCurve | EquilibriumCurve, **look: Unpack[Look]) -> Axes:
    """Draw a curve of bifurcations in the plane of its two parameters, with its points of codimension two.

    Parameters
    ----------
    curve
        From :func:`hybrid.continue_bifurcation`.
    ax
        Axes to draw into, such as those of other curves; by default those of a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.plot import plot_curve
    >>> orbit = hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    >>> fold = hybrid.continue_orbit(orbit, "w", (0.9, 1.8)).bifurcations[0]
    >>> ax = plot_curve(hybrid.continue_bifurcation(fold, {"w": (1.7, 1.8), "r": (0.75, 0.85)}))
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('w', 'r')
    """
    if not isinstance(curve, EquilibriumCurve):
        arguments.instance("curve", curve, BifurcationCurve, "Make one with hybrid.continue_bifurcation.")
    (ax,) = axes_for(look, 1, (5.4, 4.2))
    first, second = curve.names
    style: dict[str, Any] = {"color": _next_colour(ax), "lw": line_width(LINE)}
    (line,) = ax.plot(curve[first], curve[second], label=curve.kind, **style)
    line.set_gid(OF_BRANCH)
    _mark(ax, [(each.kind, each.values[first], each.values[second]) for each in curve.points])
    units = curve.system.units
    ax.set_xlabel(label_of(first, units.get(first)))
    ax.set_ylabel(label_of(second, units.get(second)))
    small_legend(ax)
    return ax


def _mark(ax: Axes, found: list[tuple[str, float, float]]) -> None:
    """Signs for what has a kind and a place, named once for a legend."""
    for kind in dict.fromkeys(each[0] for each in found):
        at = np.array([each[1:] for each in found if each[0] == kind])
        marker = KINDS[kind].marker if kind in KINDS else _other_marker(ax, kind)
        label = None if kind in _texts(ax) else kind
        ax.plot(
            *at.T,
            marker,
            color=NEUTRAL,
            mfc="white",
            ms=dot_size(5.5),
            mew=line_width(1.1),
            label=label,
            zorder=3,
        )


def _other_marker(ax: Axes, kind: str) -> str:
    """The marker that a kind has in the axes, or one that no other kind has there."""
    handles, texts = ax.get_legend_handles_labels()
    if kind in texts:
        known: Any = handles[texts.index(kind)]
        return str(known.get_marker())
    taken = [each.get_marker() for each in ax.lines]
    return next((each for each in OTHERS if each not in taken), OTHERS[0])


def _legend(ax: Axes) -> None:
    """What the branches are, then what kinds of lines mean, then the markers."""
    handles, texts = ax.get_legend_handles_labels()

    def rank(i: int) -> int:
        if texts[i] in LINES:
            return 1
        handle: Any = handles[i]
        return 2 if handle in ax.lines and handle.get_linestyle() == "None" else 0

    small_legend(ax, [handles[i] for i in sorted(range(len(handles)), key=rank)])


def _texts(ax: Axes) -> list[str]:
    """What a legend of the axes would say."""
    return ax.get_legend_handles_labels()[1]


def draw_points(ax: Axes, kind: str, across: np.ndarray, up: np.ndarray) -> None:
    """Dots below the branches, wide enough to be seen beside a line through them."""
    area = max(dot_area(across, up), SEEN)
    ax.scatter(across, up, s=area, color="0.55", linewidths=0, rasterized=True, zorder=0, label=kind)


def _points_of(dataset: Any, name: str, asked: str) -> tuple[str, np.ndarray, np.ndarray]:
    """What a legend says of a dataset's points, and their parameter and values ``(N,)``."""
    if asked in dataset.data_vars and name in dataset[asked].dims:
        values = dataset[asked].transpose(name, ...).values.reshape(dataset.sizes[name], -1)
        at = np.repeat(np.asarray(dataset[name], dtype=float), values.shape[1])
        return "sweep", at, values.ravel()
    points = dataset.get("section")
    if points is None or name not in points.dims or points.sizes.get("sample", 0) == 0:
        wanted = f"be a chart over {name!r} alone, computed with section=100, or hold {asked!r} over {name!r}"
        raise arguments.refusal("over", wanted, dataset)
    values = column("y", dataset.transpose(name, "sample", ...), asked, SECTION)[1]
    return "section", np.repeat(np.asarray(points[name], dtype=float), values.shape[1]), values.ravel()
