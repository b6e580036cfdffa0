"""Tables of points as functions in models: a drive cycle, a road, a characteristic curve."""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.expression.pieces import Pieces, lines, spline, steps
from hybrid.expression.values import is_traced, looked_up
from hybrid.system.instants import in_unit

KINDS = ("linear", "step", "cubic")
# A polynomial of a higher degree between two points is no table.
HIGHEST_DEGREE = 3


@attrs.frozen(eq=False, init=False, repr=False)
class Table:
    """A function given by points, to be called in model functions: ``drive(t)``, ``curve(x.q)``.

    Call it with numbers or arrays, too. In a function of time the points end steps, so kinks and steps are
    exact and no pulse is passed over, however short.

    Parameters
    ----------
    x
        Where the points are, ``(n,)``, increasing; or a pandas Series, whose index is ``x``, an xarray
        DataArray of one dimension, whose coordinate is ``x``, or a spline of SciPy, such as
        ``PchipInterpolator``; then there is no ``y``.
    y
        The values there, ``(n,)``.
    kind
        ``"linear"``: straight lines from point to point, as ``np.interp``. ``"step"``: each value holds from
        its point up to the next. Both are constant outside of the points. ``"cubic"``: the spline of
        ``scipy.interpolate.CubicSpline``; outside, its first and its last piece go on.
    unit
        If ``x`` holds dates or durations, the unit of the model's time: ``"ns"``, ``"us"``, ``"ms"``,
        ``"s"``, ``"min"``, ``"h"``, ``"day"`` or ``"week"``.
    origin
        If ``x`` holds dates, the date at which the model's time is 0.

    Raises
    ------
    ArgumentError
        If the points do not increase, are not finite, are fewer than two, or differ in number; if dates lack
        their unit or origin.

    Examples
    --------
    >>> from hybrid import HybridSystem, Mode, Table, simulate
    >>> drive = Table([0.0, 1.0, 2.0], [0.0, 3.0, 1.0])
    >>> float(drive(0.5))
    1.5
    >>> pulse = Table([0.0, 1.0, 1.001], [0.0, 1000.0, 0.0], kind="step")
    >>> tank = HybridSystem(state=("q",), modes=[Mode("fill", lambda t, x, p: (pulse(t),))])
    >>> round(float(simulate(tank, (0.0,), (0.0, 100.0))["q"][-1]), 12)
    1.0
    """

    x: np.ndarray
    y: np.ndarray
    kind: str
    _pieces: Pieces

    def __init__(
        self, x: Any, y: Any = None, kind: str = "linear", *, unit: str | None = None, origin: Any = None
    ) -> None:
        kind = arguments.one_of("kind", kind, KINDS)
        if y is None and all(hasattr(x, name) for name in ("c", "x", "extrapolate")):
            kind, pieces = "cubic", _of_spline(x)
            points, values = pieces.knots, pieces.at(pieces.knots)
        else:
            points, values = _points(x, y, unit, origin)
            pieces = _pieces_of(points, values, kind)
        for each in (points, values):
            each.flags.writeable = False
        self.__attrs_init__(points, values, kind, pieces)

    def __call__(self, u: Any) -> Any:
        """The value at a number, or the values at an array of numbers."""
        if not is_traced(u):
            u = arguments.numbers("u", u, "be a number or an array of numbers")
        return looked_up(self._pieces, u)

    def __repr__(self) -> str:
        return f"Table of {len(self.x)} points from {self.x[0]:g} to {self.x[-1]:g}, kind {self.kind!r}"


def _points(x: Any, y: Any, unit: str | None, origin: Any) -> tuple[np.ndarray, np.ndarray]:
    """The points, checked."""
    if y is None:
        x, y = _taken_apart(x)
    x = in_unit("x", x, unit, origin)
    points = arguments.numbers("x", x, "be increasing numbers of shape (n,)")
    values = arguments.numbers("y", y, "be numbers of shape (n,)")
    for name, each in (("x", points), ("y", values)):
        if each.ndim != 1 or len(each) < 2:
            raise ArgumentError(
                f"{name} must be at least two numbers, of shape (n,); got shape {each.shape}."
            )
        if not np.isfinite(each).all():
            i = int(np.argmin(np.isfinite(each)))
            raise ArgumentError(f"{name} must be finite; got {name}[{i}] = {each[i]}. Leave such points out.")
    if len(points) != len(values):
        raise ArgumentError(f"y must have one value per point; got {len(values)} for {len(points)} in x.")
    falls = np.flatnonzero(np.diff(points) <= 0.0)
    if falls.size:
        i = int(falls[0])
        raise ArgumentError(
            f"x must increase; got x[{i}] = {points[i]} and x[{i + 1}] = {points[i + 1]}. Sort the points, "
            "and keep one of those at the same place (a jump is kind='step')."
        )
    return points, values


def _taken_apart(data: Any) -> tuple[Any, Any]:
    """Points of a pandas Series or an xarray DataArray."""
    if hasattr(data, "dims") and hasattr(data, "coords"):
        if len(data.dims) != 1 or data.dims[0] not in data.coords:
            raise ArgumentError(
                f"x must be an array of one dimension with a coordinate; got dimensions {tuple(data.dims)}."
            )
        return data.coords[data.dims[0]].to_numpy(), data.to_numpy()
    if hasattr(data, "index") and hasattr(data, "to_numpy") and np.ndim(data) == 1:
        return data.index.to_numpy(), data.to_numpy()
    raise arguments.refusal(
        "y", "be numbers of shape (n,), unless x is a Series, a DataArray or a spline", None
    )


def _pieces_of(x: np.ndarray, y: np.ndarray, kind: str) -> Pieces:
    if kind == "step":
        return steps(x, y)
    if kind == "linear":
        return lines(x, y)
    from scipy.interpolate import CubicSpline

    return spline(x, CubicSpline(x, y).c)


def _of_spline(given: Any) -> Pieces:
    """The pieces of a piecewise polynomial of SciPy."""
    knots, c = np.asarray(given.x), np.asarray(given.c)
    if c.ndim != 2 or len(c) > HIGHEST_DEGREE + 1 or given.extrapolate is not True:
        raise ArgumentError(
            f"x must be a spline of numbers of degree {HIGHEST_DEGREE} at most that goes on beyond its ends; "
            f"got {type(given).__name__} of degree {len(c) - 1}, extrapolate={given.extrapolate}."
        )
    return spline(*_points_of_spline(knots, c))


def _points_of_spline(knots: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    if not (np.isfinite(knots).all() and np.isfinite(c).all() and np.all(np.diff(knots) > 0.0)):
        raise ArgumentError("x must be a spline whose points increase and are finite.")
    return knots, c
