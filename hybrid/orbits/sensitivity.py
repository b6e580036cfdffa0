"""Derivatives of a periodic orbit in parameters: of its point, its period and its multipliers."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.errors import ArgumentError
from hybrid.orbits.shots import Family, Point, Shot

# Relative change of a parameter for the differences of multipliers, which are extrapolated.
STEP = 1e-4
# The equations of an isolated orbit have no singular value below this share of the largest.
SINGULAR = 1e-12


@attrs.frozen(eq=False)
class OrbitSensitivity:
    """Derivatives of a periodic orbit in ``m`` parameters.

    Attributes
    ----------
    names
        Names of the parameters.
    x0
        Of the orbit's point, ``(n, m)``: of a forced system at the time ``t0``; of an autonomous one in the
        plane through the point across the field.
    period
        Of the period, ``(m,)``.
    multipliers
        Of the multipliers ``(n, m)``, in their order, by extrapolated differences of neighbouring orbits.
    """

    names: tuple[str, ...]
    x0: np.ndarray
    period: np.ndarray
    multipliers: np.ndarray


def sensitivity_of(families: list[Family], point: Point) -> OrbitSensitivity:
    """The derivatives of the orbit through a point, in the parameter of each family.

    The end of the orbit, less its start, is zero: its derivatives in the start, the period and the parameter
    give those of the point and of the period (implicit function theorem).

    Raises
    ------
    ArgumentError
        If the orbit is not isolated.
    """
    columns = [_of_parameter(family, attrs.evolve(point, value=_value(family))) for family in families]
    x0, period, multipliers = (np.stack(each, axis=-1) for each in zip(*columns, strict=True))
    return OrbitSensitivity(tuple(family.name for family in families), x0, period, multipliers)


def _value(family: Family) -> float:
    return float(family.parameters[family.name])


def _of_parameter(family: Family, point: Point) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    step = STEP * (abs(point.value) or 1.0)
    shot = family.shoot(point)
    units = np.append(shot.scale, [point.period, step])
    made = family.at_value(point, shot, units) if shot.whole else None
    slope = None if made is None else _slope(family, made, units)
    if made is None or slope is None:
        raise ArgumentError(f"orbit is not isolated, or not smooth in {family.name}: it has no derivative.")
    n, shot = len(point.x), made
    changes = []
    for h in (step, step / 2):
        ends = [_neighbour(family, shot, units, slope, sign * h) for sign in (1.0, -1.0)]
        changes.append((ends[0] - ends[1]) / (2 * h))
    period = family.slope_of_period(point.value) if family.forced else slope[n]
    return slope[:n], np.array(period), (4 * changes[1] - changes[0]) / 3


def _slope(family: Family, shot: Shot, units: np.ndarray) -> np.ndarray | None:
    """Derivatives ``(n + 2,)`` of the unknowns in the parameter; None if the orbit is not isolated."""
    matrix, _ = family.equations(shot, shot, units)
    sizes = np.linalg.svd(matrix[:, :-1], compute_uv=False)
    if not sizes[-1] > SINGULAR * sizes[0]:
        return None
    scaled = np.linalg.solve(matrix[:, :-1], -matrix[:, -1] / units[-1])
    return np.append(scaled * units[:-1], 1.0)


def _neighbour(family: Family, shot: Shot, units: np.ndarray, slope: np.ndarray, change: float) -> np.ndarray:
    """Multipliers ``(n,)`` of the orbit at another value of the parameter, in the order of those here."""
    here = shot.multipliers
    guess = family.along(shot.point, change * slope)
    made = None if guess is None else family.at_value(guess, shot, units)
    if made is None:
        return np.full(len(here), np.nan)
    there, found = list(made.multipliers), []
    for each in here:
        found.append(there.pop(int(np.argmin(np.abs(np.array(there) - each)))))
    return np.array(found)
