"""An orbit on a branch with its tangent, and steps along the branch."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import attrs
import numpy as np

from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.equations import CLOSED
from hybrid.orbits.continuation.family import ROUNDING, Family
from hybrid.orbits.continuation.parts import divided, growth, holding
from hybrid.orbits.continuation.passing import Pass
from hybrid.orbits.continuation.route import LARGEST_GROWTH, Loop, route_of
from hybrid.orbits.held import conserved_at
from hybrid.orbits.zeros import SHARES, at_zero, interpolated, zero_on_the_way
from hybrid.simulation.arc import HybridArc
from hybrid.solvers import Solver
from hybrid.transform.aged import aged, with_age

# A step may turn by this angle (its cosine).
LEAST_COSINE = 0.95
# A step is halved down to this length.
SHORTEST_STEP = 1e-7
# Stretches are divided anew if errors grow by this much more along one of them than they may.
TOO_LARGE = 10.0
# Two of these polynomials agree to this, in units of the unknowns.
AGREE = 1e-12
LOOSE = 1e-7
# A zero between two places may lie outside of them by this share of their distance.
BESIDE = 1e-3
MOST_ROUNDS = 5
# Places that a step is guessed from are not nearer to each other than this part of it.
NEAREST = 8.0


# Unknowns ``(m + k,)`` of an orbit and the direction of its branch there, neither of them scaled.
Knot = tuple[np.ndarray, np.ndarray]


@attrs.frozen(eq=False)
class Place:
    """An orbit on the branch.

    Attributes
    ----------
    orbit
        The pass around it.
    tangents
        Orthonormal directions ``(k, m + k)`` of the solutions there, in scaled unknowns.
    sizes
        Units ``(k,)`` of the parameters.
    path
        Unknowns ``(m + k,)`` of other places of the branch, at most two, each with the tangent there.
    firm
        Whether the equations hold the orbit on the branch: not where other orbits are beside it.
    """

    orbit: Pass
    tangents: np.ndarray
    sizes: np.ndarray
    path: tuple[Knot, ...] = ()
    firm: bool = True

    @property
    def family(self) -> Family:
        """The family of the orbit."""
        return self.orbit.family

    @cached_property
    def units(self) -> np.ndarray:
        """Units of the unknowns."""
        return self.orbit.units(self.sizes)

    @property
    def matrix(self) -> np.ndarray:
        """Derivatives ``(m, m + k)`` of the scaled equations in the scaled unknowns."""
        return self.orbit.derivatives(self.sizes)

    @property
    def values(self) -> np.ndarray:
        """The free parameters ``(k,)``."""
        return self.orbit.loop.values

    @property
    def value(self) -> float:
        """The first free parameter."""
        return float(self.orbit.loop.values[0])

    @property
    def knot(self) -> Knot:
        """The unknowns and the tangent, for places beside this one."""
        return self.orbit.loop.flat, self.units * self.tangents[0]

    def towards(self, other: Place) -> Place:
        """The same place, knowing another place of its branch between which and this one steps will lead."""
        return attrs.evolve(self, path=(other.knot, *self.path[:1]))

    def step(self, lengths: np.ndarray) -> tuple[Place, int] | None:
        """The place at distances ``(k,)`` along the tangents, and how many corrections it took; or None."""
        units, length = self.units, float(np.abs(lengths).max())
        reach = max(length / 2.0, SHORTEST_STEP)
        try:
            made = self.family.corrected(
                self.orbit.loop.plus(self._guessed(lengths, reach)),
                self.orbit,
                units,
                self.tangents,
                reach if self.firm else np.inf,
            )
        except ArgumentError:
            return None
        if made is None:
            return None
        found = place_of(made[0], self.tangents, self.sizes)
        if found is None or np.any(np.sum(found.tangents * self.tangents, axis=1) < LEAST_COSINE):
            return None
        if len(lengths) == 1:
            found = attrs.evolve(found, path=(self.knot, *self.path[:1]))
        return found, made[1]

    def _guessed(self, lengths: np.ndarray, reach: float) -> np.ndarray:
        """The change of the unknowns that leads near the place at distances along the tangents."""
        flat, units = self.orbit.loop.flat, self.units
        straight = units * (lengths @ self.tangents)
        if not self.path or not self.firm:
            return straight
        if len(lengths) == 1:
            curved = interpolated(self._knots_for(abs(float(lengths[0]))), float(lengths[0])) - flat
        else:
            # On a surface a place beside the one that is looked for is as good as a polynomial.
            known = self.path[0][0] - flat
            curved = known + units * ((lengths - self.tangents @ (known / units)) @ self.tangents)
        # What the other places say is worth nothing where it is another way.
        return curved if np.abs((curved - straight) / units).max() <= reach else straight

    def _knots_for(self, length: float) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """Distances along the tangent, unknowns and their slopes, here and where the path knows them.

        Places that are much nearer than a step or to each other would carry their rounding far.
        """
        flat, units, tangent = self.orbit.loop.flat, self.units, self.tangents[0]
        found = [(0.0, flat, units * tangent)]
        for there, direction in self.path:
            along = float(tangent @ (direction / units))
            s = float(tangent @ ((there - flat) / units))
            apart = min(abs(s - each) for each, *_ in found)
            if abs(along) > LEAST_COSINE**2 and apart > max(length, abs(s)) / NEAREST:
                found.append((s, there, direction / along))
        return found


def at_value(place: Place, value: float) -> Place | None:
    """The place at a value of the first parameter, beside one that has it but for rounding."""
    loop, units = place.orbit.loop, place.units.copy()
    there = attrs.evolve(loop, values=np.append(value, loop.values[1:]))
    # An unknown without a unit stays as it is, also where other orbits are beside this one.
    units[-len(place.sizes)] = np.finfo(float).tiny
    made = place.family.corrected(there, place.orbit, units)
    return None if made is None else place_of(made[0], place.tangents, place.sizes)


def distance(place: Place, other: Place) -> float:
    """How far another place of the same route is along the first tangent."""
    return float(place.tangents[0] @ ((other.orbit.loop.flat - place.orbit.loop.flat) / place.units))


def zero_between(place: Place, after: Place, function: Callable[[Place], float]) -> Place | None:
    """The place between two of one branch where a function of places changes its sign."""
    near = place.towards(after)

    def step(s: float) -> Place | None:
        made = near.step(np.array([s]))
        return None if made is None else made[0]

    return zero_on_the_way({0.0: place, distance(place, after): after}, step, function)


def interpolated_zero(
    place: Place, function: Callable[[Place], float], bracket: tuple[float, float]
) -> Place | None:
    """The place where a function is zero, between two distances along the branch.

    The unknowns depend smoothly on its value, also where the equations are singular at its zero. They
    are interpolated through places on both sides of the zero, none of which is near it.
    """
    low, high = bracket
    centre, width = 0.5 * (low + high), 0.5 * (high - low)
    best, error = None, np.inf
    for _ in range(MOST_ROUNDS):
        places, heights = [], []
        for share in SHARES:
            made = place.step(np.array([centre + share * width]))
            height = np.nan if made is None else function(made[0])
            if made is not None and np.isfinite(height):
                places.append(made[0])
                heights.append(height)
        # A function that takes a value twice does not tell the places apart.
        if len(places) < 3 or len(set(heights)) < len(heights):
            break
        unknowns = np.array([each.orbit.loop.flat for each in places])
        ends = [at_zero(np.array(heights)[part], unknowns[part]) for part in (slice(None), slice(1, None))]
        units = place.units
        new = float(np.max(np.abs(ends[0] - ends[1]) / units))
        if not np.isfinite(new) or not new < error:
            break
        zero = places[int(np.argmin(np.abs(heights)))]
        loop = place.orbit.loop.plus(ends[0] - place.orbit.loop.flat)
        best, error = attrs.evolve(zero, orbit=attrs.evolve(zero.orbit, loop=loop)), new
        centre = float(place.tangents[0] @ ((ends[0] - place.orbit.loop.flat) / units))
        if error < AGREE:
            break
        width *= 0.2
    if best is None or not error < LOOSE:
        return None
    orbit = best.family.around(best.orbit.loop)
    found = best if orbit is None else attrs.evolve(best, orbit=orbit)
    beside = BESIDE * (high - low)
    return found if low - beside <= distance(place, found) <= high + beside else None


def place_of(orbit: Pass, onward: np.ndarray, sizes: np.ndarray) -> Place | None:
    """The place of an orbit, with the tangents that are nearest to given directions ``(k, m + k)``."""
    matrix = orbit.derivatives(sizes)
    if not np.all(np.isfinite(matrix)):
        return None
    _, values, vectors = np.linalg.svd(matrix)
    # There are more directions than parameters where orbits come in families of their own.
    null = vectors[min(int(np.sum(values > ROUNDING * values[0])), len(matrix.T) - len(sizes)) :]
    left, _, right = np.linalg.svd(onward @ null.T, full_matrices=False)
    return Place(orbit, left @ right @ null, sizes, firm=bool(values[-1] > LOOSE * values[0]))


def begun(family: Family, loop: Loop, sizes: np.ndarray) -> Place | None:
    """The place of the orbit near these unknowns, with the same parameters; towards larger values of them."""
    first = family.around(loop)
    if first is None:
        return None
    units, k = first.units(sizes), len(sizes)
    fixed = np.eye(len(units))[-k:]
    try:
        # At a fold there is none with the same parameters but for rounding.
        made = family.corrected(loop, first, units, fixed) or family.corrected(loop, first, units)
    except ArgumentError:
        return None
    return None if made is None else place_of(made[0], fixed, sizes)


def place_on(orbit: Any, names: tuple[str, ...], sizes: np.ndarray, solver: Solver) -> Place:
    """A :class:`hybrid.PeriodicOrbit` among those over some parameters, whose units are ``sizes (k,)``.

    Raises
    ------
    ArgumentError
        If the orbit is not found again.
    """
    if orbit.transitions:
        # Without a jump no mode is entered, and the age has no value to return to.
        x0 = with_age(orbit.system, orbit.x0)
        orbit = attrs.evolve(orbit, system=aged(orbit.system), x0=x0)
    family = Family(orbit.system, names, dict(orbit.parameters), orbit.forcing_periods, solver, ())
    arc, values = orbit.arc(solver), np.array([orbit.parameters[name] for name in names])
    held = conserved_at(orbit.system, family.vector(values), orbit.mode, orbit.t0, orbit.x0)
    started = start_of(family, arc, orbit.period, values) if arc.status.ok else None
    place = None if started is None else begun(*started, sizes)
    if place is not None and held is not None:
        orbit = holding(place.orbit, held, sizes)
        place = begun(orbit.family, orbit.loop, sizes)
    if place is None:
        raise ArgumentError(
            "orbit is not found again, stretch by stretch: solve it with tighter tolerances, and see that "
            "the fields have values a little beyond their guards."
        )
    return place


def start_of(family: Family, arc: HybridArc, period: float, values: np.ndarray) -> tuple[Family, Loop] | None:
    """The family and the unknowns of the orbit that a run over one period shows; None if it has no value."""
    route, x, times = route_of(family.system, arc, period)
    counted = (arc.x[-1] - arc.x[0])[family.n :]
    least = np.maximum(np.abs(arc.x[:, : family.n]).max(axis=0), family.least)
    if family.forced:
        # Where the period depends on a parameter a late start would move through the phases with it.
        forcing = family.period(values) / family.periods
        times = times - forcing * np.floor(times[0] / forcing)
    family = attrs.evolve(family.latest, route=route, counted=counted, least=least, held=None)
    first = family.around(Loop(x, times, values))
    if first is None:
        return None
    first = first.parted
    return divided(attrs.evolve(first, family=attrs.evolve(first.family, least=first.scale)))


def refined(place: Place) -> Place:
    """The same orbit, with more stretches where errors have come to grow too much along one of them."""
    orbit, route = place.orbit, place.family.route
    if all(
        growth(orbit, i) < TOO_LARGE * LARGEST_GROWTH for i, stretch in enumerate(route) if not stretch.within
    ):
        return place
    family, loop = divided(orbit)
    finer = family.around(loop)
    if finer is None:
        return place
    # The tangent at the points that both have in common says where the way goes on.
    n, k = loop.x.shape[1], len(place.sizes)
    onward = np.zeros((k, len(loop.flat)))
    onward[:, :n], onward[:, -k:] = place.tangents[:, :n], place.tangents[:, -k:]
    return place_of(finer, onward, place.sizes) or place


def share_of(orbit: Pass, t: float) -> tuple[int, float]:
    """The stretch at a time, whole periods aside, and the share of the stretch before it.

    What is no farther than rounding from the end of a stretch is at the begin of the next one, after the
    jumps: the state before them need not be a start, since a clock does not tick at the start of a run.
    """
    times, period = orbit.loop.times, orbit.loop.period
    least = CLOSED * period
    after = (t - times[0]) % period
    t = times[0] + (after if after < period - least else 0.0)
    i = min(max(int(np.searchsorted(times, t + least, side="right")) - 1, 0), len(times) - 2)
    return i, float((t - times[i]) / (times[i + 1] - times[i])) if t > times[i] + least else 0.0


def moment(orbit: Pass, i: int, share: float) -> tuple[float, np.ndarray]:
    """Time and whole state at a share of a stretch."""
    begin, end = orbit.loop.times[i : i + 2]
    if share == 0.0:
        return float(begin), orbit.whole(i, orbit.loop.x[i])
    return float(begin + share * (end - begin)), orbit.whole(i, orbit.flows[i].at(np.array([share]))[0])
