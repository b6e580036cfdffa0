"""Piecewise polynomials of one variable: what a table of points means.

Between two knots a piece is a polynomial in the distance from the knot on its left; the piece in front of
the first knot counts from the first knot. At a knot the piece on its right holds.
"""

from __future__ import annotations

import hashlib
import math
from functools import cached_property
from typing import Any, ClassVar
from weakref import WeakValueDictionary

import numpy as np

# Jumps below this share of the values at the knot are rounding: a piece ends where the next begins.
SMALL = 1e-9
FARTHEST = float(np.finfo(float).max)


class Pieces:
    """A piecewise polynomial; equal ones are one object.

    Attributes
    ----------
    knots
        Where pieces meet, ``(n,)``, increasing.
    coefficients
        Rows ``(n + 1, d + 1)`` of the coefficients of each piece, the constant first.
    name
        A word that tells it from others, the same in every process.
    """

    known: ClassVar[WeakValueDictionary[str, Pieces]] = WeakValueDictionary()
    knots: np.ndarray
    coefficients: np.ndarray
    name: str

    def __new__(cls, knots: Any, coefficients: Any) -> Pieces:
        """The object of this content."""
        knots, rows = (np.array(each, dtype=float) for each in (knots, coefficients))
        # No negative zeros: equal numbers are equal bytes.
        content = (knots + 0.0).tobytes() + (rows + 0.0).tobytes()
        name = f"T{hashlib.sha256(content).hexdigest()[:16]}"
        found = cls.known.get(name)
        if found is None:
            found = object.__new__(cls)
            found.knots, found.coefficients, found.name = knots, rows, name
            knots.flags.writeable = rows.flags.writeable = False
            found = cls.known.setdefault(name, found)
        return found

    def __reduce__(self) -> tuple[Any, ...]:
        return Pieces, (self.knots, self.coefficients)

    def __str__(self) -> str:
        return self.name

    @property
    def degree(self) -> int:
        """The highest degree of a piece."""
        return self.coefficients.shape[1] - 1

    @cached_property
    def numbers(self) -> np.ndarray:
        """Number of knots, degree, knots and coefficients in one row: what compiled code reads."""
        head = [float(len(self.knots)), float(self.degree)]
        return np.concatenate([head, self.knots, self.coefficients.ravel()])

    def derived(self, order: int) -> np.ndarray:
        """The coefficients of a derivative of each piece."""
        rows = self.coefficients
        for _ in range(order):
            rows = rows[:, 1:] * np.arange(1.0, rows.shape[1])
        return rows if rows.shape[1] else np.zeros((len(rows), 1))

    def at(self, u: Any, order: int = 0) -> Any:
        """The value, or a derivative, at numbers of any shape; nan at nan."""
        u = np.asarray(u, dtype=float)
        places = np.searchsorted(self.knots, u, side="right")
        away = np.clip(u - self.knots[np.maximum(places - 1, 0)], -FARTHEST, FARTHEST)
        rows = self.derived(order)[places]
        total = rows[..., -1]
        for k in range(rows.shape[-1] - 2, -1, -1):
            total = total * away + rows[..., k]
        return np.where(np.isnan(u), math.nan, total)[()]

    def jumps(self, order: int = 0) -> bool:
        """Whether it, or a derivative of it, jumps at a knot."""
        rows, widths = self.derived(order), np.diff(self.knots, prepend=self.knots[0])
        ends = rows[:-1, -1]
        for k in range(rows.shape[1] - 2, -1, -1):
            ends = ends * widths + rows[:-1, k]
        starts = rows[1:, 0]
        sizes = np.abs(rows).max(initial=0.0)
        return bool(np.any(np.abs(starts - ends) > SMALL * sizes))

    def ends(self, order: int = 0) -> tuple[float, float]:
        """Numbers between which all values of it, or of a derivative, lie."""
        rows = self.derived(order)
        if np.any(rows[[0, -1], 1:]):
            return -math.inf, math.inf
        widths = np.diff(self.knots, prepend=self.knots[0], append=self.knots[-1])
        # Values lie between the coefficients of Bernstein's polynomials.
        degree = rows.shape[1] - 1
        scaled = [rows[:, k] * widths**k / math.comb(degree, k) for k in range(degree + 1)]
        hull = [sum(math.comb(j, k) * scaled[k] for k in range(j + 1)) for j in range(degree + 1)]
        return float(np.min(hull)), float(np.max(hull))

    def places(self) -> Pieces:
        """The number of the piece, as a function that jumps at every knot."""
        return Pieces(self.knots, np.arange(len(self.knots) + 1.0)[:, None])


def steps(x: np.ndarray, y: np.ndarray) -> Pieces:
    """The value at the last point passed; in front of the first, that of the first."""
    return Pieces(x, np.concatenate([y[:1], y])[:, None])


def items(values: np.ndarray) -> Pieces:
    """One of several numbers, by its place from 0."""
    return Pieces(np.arange(1.0, len(values)) - 0.5, values[:, None])


def lines(x: np.ndarray, y: np.ndarray, left: float | None = None, right: float | None = None) -> Pieces:
    """Straight lines from point to point, constant outside: ``left`` and ``right``, or the values there."""
    values = np.concatenate([y[:1] if left is None else [left], y])
    slopes = np.concatenate([[0.0], np.diff(y) / np.diff(x), [0.0]])
    found = np.column_stack([values, slopes])
    if right is not None and right != y[-1]:
        # The last point itself is not beyond the last.
        x = np.append(x, np.nextafter(x[-1], math.inf))
        found = np.vstack([found, [right, 0.0]])
    return Pieces(x, found)


def spline(x: np.ndarray, c: np.ndarray) -> Pieces:
    """The pieces of SciPy's piecewise polynomials: ``c[:, i]`` are those of a piece, the constant last.

    The pieces at both ends go on.
    """
    rows = c[::-1].T
    degree, width = rows.shape[1] - 1, x[-1] - x[-2]
    # The last piece, counted from the last knot.
    beyond = [
        sum(math.comb(k, j) * rows[-1, k] * width ** (k - j) for k in range(j, degree + 1))
        for j in range(degree + 1)
    ]
    return Pieces(x, np.vstack([rows[:1], rows, [beyond]]))
