"""Derivatives of a periodic orbit in parameters: of its point, its period and its multipliers."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.passing import Pass
from hybrid.orbits.continuation.place import Place, share_of

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
        plane through the point across the field. Cyclic components are held, so theirs are 0.
    period
        Of the period, ``(m,)``.
    multipliers
        Of the multipliers ``(n, m)``, in their order, by extrapolated differences of neighbouring orbits.
    """

    names: tuple[str, ...]
    x0: np.ndarray
    period: np.ndarray
    multipliers: np.ndarray


def sensitivity_of(place: Place, t: float) -> OrbitSensitivity:
    """The derivatives of an orbit in the free parameters, of its point at a time.

    The equations of the orbit are zero: their derivatives in the unknowns and in the parameters give those of
    the unknowns (implicit function theorem).

    Raises
    ------
    ArgumentError
        If the orbit is not isolated.
    """
    orbit, units, matrix, k = place.orbit, place.units, place.matrix, len(place.sizes)
    if not is_isolated(place):
        raise _no_derivative(place)
    slopes = np.linalg.solve(matrix[:, :-k], -matrix[:, -k:] / units[-k:]) * units[:-k, None]
    first = orbit.loop.x.size
    columns = [_multipliers(place, np.append(slopes[:, j], np.eye(k)[j]), j) for j in range(k)]
    return OrbitSensitivity(
        place.family.names,
        _of_point(orbit, slopes, t),
        slopes[-1] - slopes[first],
        np.stack(columns, axis=-1),
    )


def is_isolated(place: Place) -> bool:
    """Whether there is no other orbit beside one, at the same parameters."""
    sizes = np.linalg.svd(place.matrix[:, : -len(place.sizes)], compute_uv=False)
    return bool(sizes[-1] > SINGULAR * sizes[0])


def _of_point(orbit: Pass, slopes: np.ndarray, t: float) -> np.ndarray:
    """Derivatives ``(n, k)`` of the point at a time; of an autonomous orbit in the plane across the field."""
    loop, n = orbit.loop, orbit.loop.x.shape[1]
    i, share = share_of(orbit, t)
    begin, end = loop.times[i : i + 2]
    flow = orbit.family.flow(
        orbit.family.route[i], loop.x[i], float(begin), float(begin + share * (end - begin)), loop.values
    )
    start = slopes[i * n : (i + 1) * n] - np.outer(flow.first_rate, slopes[loop.x.size + i])
    cyclic = orbit.family.system.is_cyclic[:n]
    found = np.where(cyclic[:, None], 0.0, flow.slopes[:, :n] @ start + flow.slopes[:, n:])
    if orbit.family.forced:
        # The stretch passes the point some periods after the time, which stays.
        later = round((begin + share * (end - begin) - t) / loop.period)
        longer = slopes[-1] - slopes[loop.x.size]
        return np.asarray(found + later * np.outer(np.where(cyclic, 0.0, flow.last_rate), longer))
    along = np.where(cyclic, 0.0, flow.last_rate)
    across = along / orbit.scale**2
    return np.asarray(found - np.outer(along, across @ found) / (across @ along))


def _multipliers(place: Place, slope: np.ndarray, j: int) -> np.ndarray:
    """Derivatives ``(n,)`` of the multipliers in one parameter, by extrapolated differences."""
    step = STEP * (abs(place.values[j]) or 1.0)
    changes = []
    for h in (step, step / 2):
        ends = [_neighbour(place, sign * h * slope) for sign in (1.0, -1.0)]
        changes.append((ends[0] - ends[1]) / (2 * h))
    return np.asarray((4 * changes[1] - changes[0]) / 3)


def _neighbour(place: Place, change: np.ndarray) -> np.ndarray:
    """Multipliers ``(n,)`` of the orbit at other values of the parameters, in the order of those here."""
    orbit, units, here = place.orbit, place.units, place.orbit.multipliers
    fixed = np.eye(len(units))[-len(place.sizes) :]
    made = place.family.corrected(orbit.loop.plus(change), orbit, units, fixed)
    if made is None:
        raise _no_derivative(place)
    there, found = list(made[0].multipliers), []
    for each in here:
        found.append(there.pop(int(np.argmin(np.abs(np.array(there) - each)))))
    return np.array(found)


def _no_derivative(place: Place) -> ArgumentError:
    names = ", ".join(place.family.names)
    return ArgumentError(f"orbit is not isolated, or not smooth in {names}: it has no derivative.")
