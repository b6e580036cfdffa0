"""Where an orbit changes smoothly: functions of places that are zero at folds, flips, tori, branch points."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from hybrid.orbits.continuation.equations import CLOSED
from hybrid.orbits.continuation.place import Place

Test = Callable[[Place], float]

# Distance on either side of a torus at which the pair is looked at.
APART = 1e-3


def fold(place: Place) -> float:
    """The part of the tangent in the parameter."""
    return float(place.tangents[0, -1])


def flip(place: Place) -> float:
    """The product of all ``mu + 1``."""
    return float(np.prod(place.orbit.free_multipliers + 1.0).real)


def torus(place: Place) -> float:
    """The product of all ``mu_i mu_j - 1``, i < j (Kuznetsov 2023, section 10.2)."""
    values = place.orbit.free_multipliers
    pairs = [values[i] * values[j] - 1.0 for i in range(len(values)) for j in range(i)]
    return float(np.prod(pairs).real) if pairs else 1.0


def branch_point(place: Place) -> float:
    """The determinant of the equations with the tangents below them, without its size."""
    return _root_of_determinant(np.vstack([place.matrix, place.tangents]))


def singular(place: Place) -> float:
    """The determinant of the equations at fixed parameters, without its size: zero at folds."""
    return _root_of_determinant(place.matrix[:, : -len(place.sizes)])


def _root_of_determinant(matrix: np.ndarray) -> float:
    """The smallest singular value, with the sign of the determinant."""
    return float(np.linalg.slogdet(matrix)[0] * np.linalg.svd(matrix, compute_uv=False)[-1])


def changes(one: float, other: float) -> bool:
    """Whether a function changes its sign; one that is zero all along, as orbits close, says nothing."""
    return one * other < 0.0 and min(abs(one), abs(other)) >= CLOSED


TESTS: dict[str, Test] = {"fold": fold, "flip": flip, "torus": torus, "branch point": branch_point}


def told(kind: str, place: Place) -> str:
    """What happens at a bifurcation, in words; empty if the multipliers say that it is none."""
    if kind == "torus":
        # Two real ones may be inverse to each other, and a pair of a conservative system stays on the circle.
        beside = [place.step(np.array([sign * APART])) for sign in (1.0, -1.0)]
        pair, *pairs = (_pair(each) for each in (place, *(made[0] for made in beside if made is not None)))
        outside = [abs(each) - 1.0 for each in pairs]
        if pair == 0.0 or len(pairs) < 2 or max(outside) < CLOSED or min(outside) > -CLOSED:
            return ""
        angle = math.atan2(pair.imag, pair.real)
        return f"a pair of multipliers crosses the unit circle at the angle {angle:.6g}"
    if kind == "flip":
        # Where a guard loses its speed a multiplier changes its sign through infinity.
        if not np.abs(place.orbit.free_multipliers + 1.0).min() < 1e-3:
            return ""
        return "a multiplier is -1: an orbit of twice the period begins"
    if kind == "fold":
        return "the branch turns back in the parameter: a multiplier is 1"
    return "a multiplier is 1, and another branch crosses"


def _pair(place: Place) -> complex:
    """The multiplier above the real axis that is nearest to the unit circle; 0 if there is none."""
    above = [complex(each) for each in place.orbit.free_multipliers if each.imag > 0.0]
    return min(above, key=lambda each: abs(abs(each) - 1.0), default=0j)
