"""The coefficients of a Runge-Kutta method, in the layout that its kernel needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import comb

import attrs
import numpy as np

Row = Mapping[int, float]

# Places in a step where a series is compared with its field, and the weights of an integral over the step.
SERIES_NODES = (1 - np.cos(np.pi * np.arange(6) / 5)) / 2
SERIES_WEIGHTS = np.linalg.solve(np.vander(SERIES_NODES, increasing=True).T, 1 / np.arange(1.0, 7.0))


@attrs.frozen(eq=False)
class Tableau:
    """Butcher tableau of a method with an error estimate and an interpolant.

    There are ``s`` stages for the step, ``S >= s + 1`` stages in all (row ``s`` is the derivative at the new
    point) and an interpolant of degree ``d``. The step's stages are 0 to ``s - 1`` for an explicit pair, and
    1 to ``s`` for an implicit method, whose row 0 is the derivative at the start.

    Parameters
    ----------
    order
        Order of the step.
    error_order
        Order of the error estimate: the step length varies as the estimate to the power ``-1 / error_order``.
    a, b, c
        ``(S, S)``, ``(s,)``, ``(S,)``.
    error, second_error
        ``(s + 1,)`` each; the second is zero for methods with one estimate.
    interpolant
        ``(d + 1, S)``: Bernstein coefficients over the step are ``y0 + h interpolant @ stages``.
    implicit
        Whether the stages are coupled; then ``error[0]`` is also the coefficient ``gamma_0`` of the filter
        ``(I - h gamma_0 J)^-1`` of the estimate.
    """

    order: int
    error_order: int
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    error: np.ndarray
    second_error: np.ndarray
    interpolant: np.ndarray
    implicit: bool = False

    @property
    def quadrature(self) -> np.ndarray:
        """``(s + 1,)`` weights of all stages in an integral over the step."""
        return np.concatenate([[0.0], self.b] if self.implicit else [self.b, [0.0]])

    @property
    def nodes(self) -> np.ndarray:
        """Places in the step, from 0 to 1, at which the method evaluates a function of time only."""
        counts = (self.quadrature != 0) | (self.error != 0) | (self.second_error != 0)
        return np.unique([0.0, 1.0, *self.c[: len(counts)][counts]])

    @property
    def powers(self) -> np.ndarray:
        """``(d + 1, S)``: the interpolant is ``y0`` plus ``h`` times these with the powers of ``theta``."""
        degree = len(self.interpolant) - 1
        differences = [
            [comb(degree, k) * comb(k, j) * (-1) ** (k - j) for j in range(degree + 1)]
            for k in range(degree + 1)
        ]
        return np.array(differences, dtype=float) @ self.interpolant


def dense(rows: Sequence[Row], width: int) -> np.ndarray:
    """Matrix ``(len(rows), width)`` from rows given as ``{column: value}``."""
    matrix = np.zeros((len(rows), width))
    for i, row in enumerate(rows):
        for j, value in row.items():
            matrix[i, j] = value
    return matrix


def times_theta(coefficients: np.ndarray) -> np.ndarray:
    """Bernstein coefficients (rows) of a polynomial multiplied by its variable, one degree higher."""
    degree = len(coefficients)
    factor = np.arange(1, degree + 1)[:, None] / degree
    return np.vstack([np.zeros_like(coefficients[:1]), factor * coefficients])


def times_one_minus_theta(coefficients: np.ndarray) -> np.ndarray:
    """Bernstein coefficients (rows) of a polynomial multiplied by ``1 - theta``, one degree higher."""
    return times_theta(coefficients[::-1])[::-1]


def bernstein_from_powers(powers: np.ndarray) -> np.ndarray:
    """Bernstein coefficients (rows) from those of ``1, theta, theta^2, ...`` (rows)."""
    degree = len(powers) - 1
    change = np.array([[comb(j, k) / comb(degree, k) for k in range(degree + 1)] for j in range(degree + 1)])
    return change @ powers
