"""All branches of a diagram in one picture, above what a sweep has reached."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from hybrid import arguments
from hybrid.orbits.continuation.branch import Branch
from hybrid.orbits.diagrams.diagram import Diagram
from hybrid.orbits.equilibria.branch import EquilibriumBranch
from hybrid.plot.axes import (
    axes_for,
    named_quantity,
)
from hybrid.plot.branches import AnyBranch, draw_points, label_with_unit, plot_branch, quantity_of
from hybrid.plot.picture import Look, picture
from hybrid.simulation.quantities import mode_indices, table_of

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes


@picture
def plot_diagram(
    diagram: Diagram, y: str | int = 0, *, over: xarray.Dataset | Axes | None = None, **look: Unpack[Look]
) -> Axes:
    """Draw all branches of a diagram into one picture, each in a colour of its own; as :func:`plot_branch`.

    Below them are dots for what the sweep of the diagram has reached, if it has one: of a component or an
    output the points of the attractors; of a function in ``outputs=`` its value once around each orbit, and
    over single forcing periods of other motion.

    Parameters
    ----------
    diagram
        From :func:`hybrid.continue_all`.
    y
        Name or index of a component, name of an output, or name of a function in ``outputs=`` of
        :func:`hybrid.continue_all`. Where that is a maximum, a minimum or a mean of ``hybrid.measures``, an
        equilibrium is drawn at the value itself; at other functions only orbits are drawn.
    over
        As for :func:`plot_branch`.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.measures import maximum
    >>> from hybrid.plot import plot_diagram
    >>> rest = hybrid.equilibrium(models.relief_valve(), (2.5, 0.0, 12.5))
    >>> diagram = hybrid.continue_all(rest, "q", (7.0, 10.0), outputs={"top": maximum("y")})
    >>> ax = plot_diagram(diagram, "top")
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('q', 'top')
    """
    arguments.instance("diagram", diagram, Diagram, "Make one with hybrid.continue_all.")
    shown: list[tuple[AnyBranch, Any]] = []
    for each in diagram:
        name: Any = y
        if isinstance(each, EquilibriumBranch) and isinstance(y, str) and y in diagram.outputs:
            measure = diagram.outputs[y]
            if getattr(measure, "kind", None) not in ("maximum", "minimum", "mean"):
                continue
            name = measure.name
        shown.append((each, name))
    (ax,) = axes_for(look, 1, (6.4, 4.2))
    if diagram.sweep is not None:
        draw_points(ax, "sweep", *_reached(diagram, y))
    for i, (branch, name) in enumerate(shown):
        plot_branch(branch, name, over=None if i else over, ax=ax)
    for branch, _ in shown:
        if isinstance(branch, Branch):
            ax.set_ylabel(label_with_unit(branch, quantity_of(branch, y)))
    return ax


def _reached(diagram: Diagram, y: str | int) -> tuple[np.ndarray, np.ndarray]:
    """Parameter and values ``(N,)`` of what the sweep of a diagram has reached."""
    sweep, system, name = diagram.sweep, diagram.system, diagram.name
    assert sweep is not None
    if isinstance(y, str) and y in diagram.outputs:
        values = sweep["reached"].sel(measured=y).values
        at = np.broadcast_to(sweep[name].values[:, None, None], values.shape)
    else:
        asked = named_quantity("y", system, y)
        states = sweep["points"].sel(state=[*system.state_names]).values
        there = np.isfinite(states).all(axis=-1)
        at = np.broadcast_to(sweep[name].values[:, None, None], there.shape)[there]
        known = system.parameter_values(json.loads(sweep.attrs["model_parameters"]))
        table = np.tile(known, (len(at), 1))
        table[:, [*system.parameters].index(name)] = at
        modes = mode_indices(system, sweep["mode_of_point"].values[there])
        times = np.full(len(at), float(sweep.attrs["t0"]))
        values = table_of(system, [asked], times, states[there], modes, table)[:, 0]
    good = np.isfinite(values)
    return at[good], values[good]
