"""Families of random systems: all systems of a family are one hybrid system with other parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cached_property
from typing import Any

import attrs
import numpy as np

import hybrid
from hybrid import HybridSystem
from tests.reference.piecewise_affine import Mode, System, random_system

KINDS = ("additive", "general")
# The distance of the first two surfaces where they are parallel.
GAP = 0.4
# Surfaces that meet at a smaller angle are drawn again: in their coordinates rounding grows by its inverse.
STEEPEST = 20.0


@attrs.frozen
class Family:
    """Systems with ``n`` states and ``m`` switches; if ``parallel``, the first two surfaces are.

    The coordinates are the distances from the surfaces, as far as there are enough of them. So the normals of
    the first surfaces are unit vectors; any system with independent normals has this form.
    """

    n: int
    m: int
    kind: str
    parallel: bool = False

    def __str__(self) -> str:
        return f"n = {self.n}, m = {self.m}, {self.kind}{', parallel' if self.parallel else ''}"

    def draw(self, rng: np.random.Generator) -> System:
        """A random system."""
        while True:
            system = random_system(rng, self.n, self.m, self.kind, rng.choice([0.3, 0.6, 0.9]))
            if self.parallel:
                system = _with_parallel(system)
            axes = _completed(system.normals[self._own])
            if np.linalg.cond(axes) < STEEPEST:
                return _transformed(system, axes)

    @property
    def _own(self) -> list[int]:
        """The switches whose distances are coordinates."""
        different = [k for k in range(self.m) if not (self.parallel and k == 1)]
        return different[: self.n]

    def parameters(self, system: System) -> dict[str, float]:
        """The parameters of the hybrid system that make it this one."""
        tables = {"c": system.offsets}
        if system.additive:
            tables |= dict(zip("AbC", system.additive, strict=True))
        else:
            tables |= {"A": system.matrices, "b": system.constants}
        values = {
            _name(letter, *place): float(table[place])
            for letter, table in tables.items()
            for place in np.ndindex(table.shape)
            if (letter, self.parallel, place) != ("c", True, (1,))
        }
        for k in range(self.m):
            if k not in self._own and not (self.parallel and k == 1):
                values |= {_name("a", k, j): float(system.normals[k, j]) for j in range(self.n)}
        return values

    def field(self) -> Callable:
        """The right-hand side as one plain function of time, state and parameters."""

        def height(k: int, x: Any, p: Any) -> Any:
            if self.parallel and k == 1:
                return height(0, x, p) - GAP
            level = getattr(p, _name("c", k))
            if k in self._own:
                return x[self._own.index(k)] - level
            return sum(getattr(p, _name("a", k, j)) * x[j] for j in range(self.n)) - level

        def affine(x: Any, p: Any, i: int, *cell: int) -> Any:
            linear = sum(getattr(p, _name("A", *cell, i, j)) * x[j] for j in range(self.n))
            return linear + getattr(p, _name("b", *cell, i))

        def nested(h: list[Any], x: Any, p: Any, i: int, *cell: int) -> Any:
            if len(cell) == self.m:
                return affine(x, p, i, *cell)
            low, high = (nested(h, x, p, i, *cell, side) for side in (0, 1))
            return np.where(h[len(cell)] > 0, high, low)

        def additive(t: Any, x: Any, p: Any) -> list[Any]:
            s = [np.sign(height(k, x, p)) for k in range(self.m)]
            return [
                affine(x, p, i) + sum(getattr(p, _name("C", i, k)) * s[k] for k in range(self.m))
                for i in range(self.n)
            ]

        def general(t: Any, x: Any, p: Any) -> list[Any]:
            h = [height(k, x, p) for k in range(self.m)]
            return [nested(h, x, p, i) for i in range(self.n)]

        return additive if self.kind == "additive" else general

    @cached_property
    def system(self) -> HybridSystem:
        """The hybrid system of the whole family."""
        example = self.parameters(self.draw(np.random.default_rng(0)))
        return hybrid.from_equations(self.field(), state=self.n, parameters=example)

    def sides(self, mode: str, notes: Iterable[str]) -> Mode:
        """The sides in a mode of the hybrid system, 0 on a surface; None for a switch without a side."""
        meant = dict(note.split(" = ") for note in notes)
        sides: dict[int, int] = {}
        for part in mode.split(", "):
            sign = next(each for each in "<=>" if each in part)
            left, right = part.split(sign)
            sides[self._switch(meant.get(left, f"{left}-{right}"))] = "<=>".index(sign) - 1
        if self.parallel and sides.get(0, 1) <= 0:
            sides[1] = -1
        if self.parallel and sides.get(1, -1) >= 0:
            sides[0] = 1
        return tuple(sides.get(k) for k in range(self.m))

    def _switch(self, height: str) -> int:
        """The switch that a height belongs to."""
        own = next(k for k in range(self.m) if _name("c", k) in height)
        return 1 if self.parallel and str(GAP) in height else own


def _with_parallel(system: System) -> System:
    """The system with its second surface moved beside the first; it attracts as before."""
    normals, offsets = system.normals.copy(), system.offsets.copy()
    turn = normals[0] - normals[1]
    normals[1], offsets[1] = normals[0], offsets[0] + GAP
    constants, additive = system.constants, system.additive
    if additive:
        A, b, C = additive
        # The jump is turned with the normal, so that its part along the normal stays.
        C = C.copy()
        C[:, 1] += normals[1] * (-turn @ C[:, 1])
        shift = C[:, 1] - additive[2][:, 1]
        constants = constants + np.multiply.outer(_signs(constants, 1), shift)
        additive = A, b, C
    return System(normals, offsets, system.matrices, constants, additive)


def _signs(constants: np.ndarray, switch: int) -> np.ndarray:
    """The sign of one switch in each cell."""
    return 2.0 * np.indices(constants.shape[:-1])[switch] - 1.0


def _completed(rows: np.ndarray) -> np.ndarray:
    """A square matrix that begins with these rows; the others are at right angles to them."""
    return np.vstack([rows, np.linalg.svd(rows)[2][len(rows) :]])


def _transformed(system: System, axes: np.ndarray) -> System:
    """The system in the coordinates ``axes @ x``."""
    back = np.linalg.inv(axes)
    normals = system.normals @ back
    whole = np.round(normals)
    normals = np.where(np.abs(normals - whole) < 1e-12, whole, normals)
    matrices, constants = axes @ system.matrices @ back, system.constants @ axes.T
    if not system.additive:
        return System(normals, system.offsets, matrices, constants)
    A, b, C = system.additive
    return System(normals, system.offsets, matrices, constants, (axes @ A @ back, axes @ b, axes @ C))


def _name(letter: str, *place: int) -> str:
    return letter + "_".join(map(str, place))
