"""Charts of exponents and orbits: each function draws on the given axes or makes a new figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Unpack

import numpy as np
from numpy.typing import ArrayLike

from hybrid import ArgumentError, HybridArc, HybridSystem, Section, StatusCode, arguments
from hybrid.plot import DATASETS, drawn
from hybrid.plot.axes import (
    Rows,
    axes_for,
    diameter,
    dot_area,
    logarithmic,
    mark,
    named_quantity,
    told,
)
from hybrid.plot.datasets import SECTION, column, column_label, column_name
from hybrid.plot.labels import label_of
from hybrid.plot.legends import small_legend
from hybrid.plot.picture import Look, picture
from hybrid.plot.styles import INK, colour_of, line_width, style
from lyapunov.compare import ModelComparison
from lyapunov.convergence import (
    FIGURE,
    MINUS_INFINITY,
    numbers,
    plot_convergence,
    plot_spectrum,
    plot_two_orbits,
)
from lyapunov.maps import as_chart, axes_of, kinds, plot_kinds, plot_map, two_axes
from lyapunov.spectrum import LyapunovSpectrum
from lyapunov.two_orbit import TwoOrbitExponents

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

# Points of a section that spread less than this share of the orbit are drawn as one fixed point.
SAME_POINT = 1e-6
__all__ = [
    "kinds",
    "plot_bifurcation",
    "plot_chart",
    "plot_comparison",
    "plot_convergence",
    "plot_exponents",
    "plot_kinds",
    "plot_map",
    "plot_phase_portrait",
    "plot_spectrum",
    "plot_two_orbits",
    "style",
]

# Size of a mark of a failed row in points.
MARK = 8.0
WHERE = "chart.message"
POINTS_OF_A_PORTRAIT = 40_000


@picture
def plot_phase_portrait(
    arc: HybridArc,
    x: str,
    y: str,
    *,
    section: Section | ArrayLike | None = None,
    size: float | None = None,
    **look: Unpack[Look],
) -> Axes:
    """Orbit in the plane of two components or outputs, with jumps as straight lines and points of a section.

    Parameters
    ----------
    arc
        An arc with dense output, simulated without ``samples``.
    x, y
        Names or indices of the state's components, or names of outputs.
    section
        What to mark: a section of the model, or points ``(N, n)``, of which no outputs are known.
    size
        Diameter of the dots of the section in points.

    Examples
    --------
    >>> import hybrid, models
    >>> from lyapunov.plot import plot_phase_portrait
    >>> arc = hybrid.simulate(models.impact_oscillator(), (0.0, 0.0), (0.0, 50.0))
    >>> plot_phase_portrait(arc, "x", "v", labels={"x": "position"}).get_xlabel()
    'position'
    """
    system = arguments.instance("arc", arc, HybridArc, "Make one with hybrid.simulate.").system
    shown = named_quantity("x", system, x), named_quantity("y", system, y)
    marks = None if section is None else _marks(section, system, shown)
    large, small = (26.0, 2.0) if size is None else (diameter(size) ** 2,) * 2
    (ax,) = axes_for(look, 1, FIGURE)
    orbit = [_dense(arc, name) for name in shown]
    ax.plot(*orbit, color=colour_of(5), linewidth=line_width(0.5), alpha=0.8, rasterized=True)
    if marks is not None:
        # A large dot makes a fixed point visible; small dots keep a cloud of points readable.
        apart = any(_spread(m) > SAME_POINT * _spread(o) for m, o in zip(marks, orbit, strict=True))
        area = small if apart else large
        ax.scatter(marks[0], marks[1], s=area, color=colour_of(1), linewidths=0, zorder=3, rasterized=True)
    across, up = (label_of(name, system.units.get(name)) for name in shown)
    ax.set_xlabel(across)
    ax.set_ylabel(up)
    return ax


def _marks(section: object, system: HybridSystem, names: Sequence[str]) -> list[np.ndarray]:
    """What the points of a section have under these names."""
    if isinstance(section, Section):
        return [section[name] for name in names]
    points = numbers("section", section, 2)
    if points.shape[1] != system.dimension:
        raise arguments.refusal("section", f"hold points of {system.dimension} components", section)
    missing = [name for name in names if name in system.outputs]
    if missing:
        raise ArgumentError(
            f"section: Of points only the state is known, and {missing[0]!r} is an output. "
            "Give the section itself, as hybrid.poincare_section returns it."
        )
    return [points[:, system.state_names.index(name)] for name in names]


def _spread(values: np.ndarray) -> float:
    """How far numbers lie apart; those that are none do not count."""
    found = values[np.isfinite(values)]
    return float(np.ptp(found)) if len(found) else 0.0


def _dense(arc: HybridArc, name: str) -> np.ndarray:
    """Values along an arc in order, dense enough for a smooth line, with both sides of each jump."""
    times = np.linspace(arc.t[0], arc.t[-1], POINTS_OF_A_PORTRAIT)
    jumps = np.searchsorted(arc.jumps.t, times, side="right")
    order = np.lexsort((np.concatenate([arc.t, times]), np.concatenate([arc.j, jumps])))
    return np.concatenate([arc[name], arc(times, name)])[order]


@picture
def plot_exponents(chart: xarray.Dataset, *, size: float | None = None, **look: Unpack[Look]) -> Axes:
    """Exponents of a chart over one axis, with bands of two standard errors and a line at zero.

    Parameters
    ----------
    chart
        From :func:`lyapunov.chart`, over one axis; ``.sel`` takes a line of a grid.
    size
        Size in points of the marks of failed rows; those of minus infinity have half of it.

    Examples
    --------
    >>> import models
    >>> from lyapunov import chart
    >>> from lyapunov.plot import plot_exponents
    >>> swept = chart(models.impact_oscillator(), {"c": [0.1, 0.2, 0.4]}, (0.0, 0.0), intervals=100)
    >>> plot_exponents(swept).get_xlabel()
    'c'
    """
    name, values = _only_axis(as_chart(chart))
    exponents, errors = chart.exponents.values, chart.standard_error.values
    length = MARK if size is None else arguments.positive("size", size, "be a positive size in points")
    (ax,) = axes_for(look, 1, FIGURE)
    ax.axhline(0.0, color=INK, linewidth=line_width(0.8), linestyle=(0, (4, 3)), zorder=1)
    order = np.argsort(values)
    for i in range(exponents.shape[-1]):
        middle, error = exponents[order, i], 2 * errors[order, i]
        middle = np.where(np.isfinite(middle), middle, np.nan)
        colour = colour_of(i)
        ax.plot(
            values[order], middle, color=colour, linewidth=line_width(0.9), label=f"$\\lambda_{{{i + 1}}}$"
        )
        ax.fill_between(values[order], middle - error, middle + error, color=colour, alpha=0.25, linewidth=0)
        lost = values[order][np.isneginf(exponents[order, i])]
        if len(lost):
            mark(ax, lost, "v", colour, f"$\\lambda_{{{i + 1}}}$: {MINUS_INFINITY}", size=length / 2)
    failed = _mark_failures(ax, chart, values, length)
    ax.set_xlabel(label_of(name, chart[name].attrs.get("units")))
    ax.set_ylabel(label_of("Lyapunov exponents", chart.exponents.attrs.get("units")))
    ax.grid(True, axis="y")
    if exponents.shape[-1] > 1 or failed or np.isneginf(exponents).any():
        small_legend(ax)
    return ax


@picture
def plot_bifurcation(
    chart: xarray.Dataset, component: str | None = None, *, size: float | None = None, **look: Unpack[Look]
) -> Axes:
    """Bifurcation diagram: points of the section over the parameter.

    Parameters
    ----------
    chart
        From :func:`lyapunov.chart`, over one axis and with ``section=``.
    component
        Name of the component to show, or of an output that the chart has; by default the first component.

    Raises
    ------
    ArgumentError
        If the chart is over two axes or has no section.

    Examples
    --------
    >>> import models
    >>> from lyapunov import chart
    >>> from lyapunov.plot import plot_bifurcation
    >>> swept = chart(
    ...     models.impact_oscillator(), {"w": [0.9, 1.0]}, (0.0, 0.0), intervals=100, section=20
    ... )
    >>> ax = plot_bifurcation(swept, "x")
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('w', 'x')
    """
    name, values = _only_axis(as_chart(chart))
    points = chart.sizes.get("sample", 0)
    if points == 0:
        raise ArgumentError("chart must have section points; this one has none. Compute it with section=100.")
    shown, up = column("component", chart, 0 if component is None else component, SECTION)
    across, up = np.repeat(values, points), up.ravel()
    area = dot_area(across, up, size)
    (ax,) = axes_for(look, 1, FIGURE)
    ax.scatter(across, up, s=area, color=colour_of(0), linewidths=0, rasterized=True)
    ax.set_xlabel(label_of(name, chart[name].attrs.get("units")))
    if _mark_failures(ax, chart, values):
        small_legend(ax)
    ax.set_ylabel(column_label(chart, shown))
    return ax


@picture
def plot_chart(
    chart: xarray.Dataset, component: str | None = None, *, size: float | None = None, **look: Unpack[Look]
) -> Rows:
    """Draw a chart: exponents below a bifurcation diagram, or a map of the largest exponent.

    Parameters
    ----------
    chart
        From :func:`lyapunov.chart`. A chart over one axis with ``section=`` also gets the bifurcation
        diagram.
    component
        Name of the component in the diagram, or of an output that the chart has; by default the first
        component.
    ax
        Axes to draw into, two if the chart has a section and one axis, else one; by default those of a new
        figure.
    size
        Diameter of the dots of the diagram in points; by default smaller for more dots.

    Returns
    -------
    numpy.ndarray
        The axes from the top; ``.figure`` is their figure.

    Raises
    ------
    ArgumentError
        If the chart is over more than two axes; the text says how to take a plane.

    Examples
    --------
    >>> import models
    >>> from lyapunov import chart
    >>> from lyapunov.plot import plot_chart
    >>> swept = chart(models.impact_oscillator(), {"w": [0.9, 1.0]}, (0.0, 0.0), intervals=100)
    >>> (ax,) = plot_chart(swept)
    >>> ax.get_xlabel()
    'w'
    """
    if size is not None:
        diameter(size)
    if component is not None:
        column_name("component", as_chart(chart), component, SECTION[1])
    if len(axes_of(as_chart(chart))) > 1:
        two_axes(chart)
        axes = axes_for(look, 1, (5.6, 4.4))
        plot_map(chart, ax=axes[0])
    elif not chart.sizes.get("sample", 0):
        _only_axis(chart)
        axes = axes_for(look, 1, (7.2, 3.2))
        plot_exponents(chart, ax=axes[0])
    else:
        _only_axis(chart)
        axes = axes_for(look, 2, (7.2, 5.4))
        plot_bifurcation(chart, component, ax=axes[0], size=size).set_xlabel("")
        plot_exponents(chart, ax=axes[1])
    return axes


def _only_axis(chart: xarray.Dataset) -> tuple[str, np.ndarray]:
    names = axes_of(chart)
    if len(names) != 1:
        taken = ", ".join(f"{name}=0" for name in names[:-1])
        remedy = f"Use plot_map for two, or take a line: chart.isel({taken})." if names else "Print it."
        raise ArgumentError(
            f"chart must be over one parameter; this one is over {' and '.join(names) or 'none'}. {remedy}"
        )
    (name,) = names
    if name not in chart.coords:
        columns = [str(each) for each, values in chart.coords.items() if values.dims == (name,)]
        raise ArgumentError(
            f"chart must be over one parameter; this one is over a table of points of {', '.join(columns)}. "
            f"Name the one to draw over: chart.swap_dims({name}={columns[0]!r})."
        )
    return name, chart[name].values


def _mark_failures(ax: Axes, chart: xarray.Dataset, values: np.ndarray, length: float = MARK) -> bool:
    """Ticks at the bottom of the axes for the rows whose status is not ok; whether there are any."""
    bad = values[chart.status.values != StatusCode.SUCCESS]
    if len(bad):
        mark(ax, bad, "|", "#B2182B", told(chart.status.values, WHERE), size=length)
    return len(bad) > 0


@picture
def plot_comparison(result: ModelComparison, **look: Unpack[Look]) -> Axes:
    """Models by cost and by the largest distance of their exponents from the reference.

    Parameters
    ----------
    result
        From :func:`lyapunov.compare_models`.

    Examples
    --------
    >>> import models
    >>> from lyapunov import compare_models
    >>> from lyapunov.plot import plot_comparison
    >>> from models.contact import Hertz, Rigid, hertz_stiffness
    >>> laws = {"rigid": Rigid(e=1.0), "Hertz": Hertz(hertz_stiffness())}
    >>> systems = {name: models.vibroimpact(law) for name, law in laws.items()}
    >>> start = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
    >>> ax = plot_comparison(compare_models(systems, start, reference="Hertz", intervals=50))
    >>> ax.get_yscale()
    'log'
    """
    arguments.instance("result", result, ModelComparison, "Make one with lyapunov.compare_models.")
    (ax,) = axes_for(look, 1, FIGURE)
    unit = ""
    for i, name in enumerate(result.names):
        colour, cost = colour_of(i), result.cost(name)
        unit = result.spectra[name][0].names.rate.get("units", "")
        distance = result.distance(name)
        good = distance[np.isfinite(distance) & (distance > 0)]
        if name == result.reference:
            ax.axvline(
                cost,
                color=INK,
                linewidth=line_width(0.8),
                linestyle=(0, (4, 3)),
                label=f"{name}, the reference",
            )
        elif len(good):
            ax.plot(cost, good.max(), "o", color=colour, label=name)
        else:
            told = "the same exponents" if np.any(distance == 0) else "every run failed"
            mark(ax, [cost], "v", colour, f"{name}: {told}")
    logarithmic(ax, "y")
    ax.set_xlabel("steps per interval")
    ax.set_ylabel(label_of("largest distance of exponents", unit))
    ax.grid(True, axis="y")
    small_legend(ax)
    return ax


drawn.register(TwoOrbitExponents, plot_two_orbits)
drawn.register(ModelComparison, plot_comparison)
drawn.register(LyapunovSpectrum, plot_spectrum)
DATASETS["exponents"] = plot_chart
