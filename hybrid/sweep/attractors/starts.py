"""The starts of a search: a grid of them, or a random sample of ranges."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.system.graph import HybridSystem, as_system
from hybrid.system.labels import plain_name

# Values along an axis that is given as a range.
RESOLUTION = 100
WANTED = 'map components of the state to numbers, ranges or values, as {"q": (0.0, 1.0), "v": 0.0}'
EACH = "be a number, a range (low, high), or an array of values"


@attrs.frozen(eq=False)
class Axis:
    """What ``over`` says of one component: one value, a range, or values."""

    name: str
    values: np.ndarray
    is_range: bool
    attrs: dict[str, Any]

    @property
    def varies(self) -> bool:
        """Whether it is an axis of the grid."""
        return self.is_range or self.values.ndim == 1

    def points(self) -> np.ndarray:
        """The values along the axis."""
        if self.is_range:
            return np.linspace(self.values[0], self.values[1], RESOLUTION)
        return np.atleast_1d(self.values)

    def drawn(self, random: np.random.Generator, count: int) -> np.ndarray:
        """Values drawn from a range or from among the values."""
        if self.is_range:
            return random.uniform(self.values[0], self.values[1], count)
        return random.choice(np.atleast_1d(self.values), count)


@attrs.frozen(eq=False)
class Grid:
    """Starts ``(N, n)``, in the order of a grid of the given shape; the last axis varies fastest."""

    origins: np.ndarray
    axes: tuple[Axis, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values along each axis."""
        return tuple(len(each.points()) for each in self.axes)

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the axes."""
        return tuple(each.name for each in self.axes)


def axes_of(system: HybridSystem, over: object, reserved: tuple[str, ...] = ()) -> list[Axis]:
    """What ``over`` says of each component, in the order in which it names them."""
    as_system("system", system)
    given = arguments.mapping("over", over, WANTED) if over is not None else None
    if not given:
        raise arguments.refusal("over", WANTED, over)
    names, found = system.state_names, []
    for key, value in given.items():
        name = plain_name(key) if isinstance(key, str) else key
        name = arguments.known("over: State component", name, names, "State components")
        found.append(_axis(name, key, value))
    named, moving = {each.name for each in found}, names[: system.variables.moving]
    missing = [name for name in moving if name not in named and name not in system.under_way]
    if missing:
        raise ArgumentError(
            f"over must name every component of the state; it lacks {', '.join(missing)}. "
            "Give a number to start all runs there."
        )
    for each in found:
        if each.varies and each.name in reserved:
            raise ArgumentError(
                f"over: {each.name!r} is also the name of a result. Rename the state of the model."
            )
    still = (name for name in names if name not in named)
    return [*found, *(Axis(name, np.array(0.0), False, {}) for name in still)]


def _axis(name: str, key: object, value: object) -> Axis:
    what = f"over[{key!r}]"
    values = arguments.numbers(what, value, EACH)
    if values.ndim > 1 or not values.size:
        raise ArgumentError(f"{what} must {EACH}; got shape {values.shape}.")
    if not np.isfinite(values).all():
        raise arguments.refusal(what, "be finite", value)
    is_range = isinstance(value, tuple)
    if is_range and (values.shape != (2,) or not values[0] < values[1]):
        raise ArgumentError(
            f"{what} must be a range (low, high) with low below high; got {arguments.shown(value)}. "
            "Write a list or an array for values."
        )
    return Axis(name, values, is_range, dict(getattr(value, "attrs", {})))


def grid_of(system: HybridSystem, axes: list[Axis]) -> Grid:
    """All starts of the grid that the axes span."""
    varied = tuple(each for each in axes if each.varies)
    shape = [len(each.points()) for each in varied]
    columns = {
        each.name: column.ravel()
        for each, column in zip(
            varied, np.meshgrid(*(each.points() for each in varied), indexing="ij"), strict=True
        )
    }
    origins = np.empty((int(np.prod(shape)), system.dimension))
    for each in axes:
        origins[:, system.state_names.index(each.name)] = columns.get(each.name, each.values)
    return Grid(origins, varied)


def sample_of(system: HybridSystem, axes: list[Axis], count: int, seed: int) -> np.ndarray:
    """Random starts ``(count, n)``, the same for the same seed whatever the order of the axes."""
    by_name: Mapping[str, Axis] = {each.name: each for each in axes}
    random, origins = np.random.default_rng(seed), np.empty((count, system.dimension))
    for i, name in enumerate(system.state_names):
        origins[:, i] = by_name[name].drawn(random, count)
    return origins
