"""An orbit on a branch with its tangent, and steps along the branch."""

from __future__ import annotations

from collections.abc import Callable

import attrs
import numpy as np

from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.family import Family, Pass
from hybrid.orbits.continuation.route import Loop, divided, route_of
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.simulate import simulate

# A step may turn by this angle (its cosine).
LEAST_COSINE = 0.95
# A run jumps where the equations say so if the times agree to this share of the period.
SAME_TIME = 1e-6
# The unknowns are polynomials of a measure through places at these shares of the bracket around its zero.
SHARES = (-1.0, -0.6, -0.25, 0.25, 0.6, 1.0)
# Two of these polynomials agree to this, in units of the unknowns.
AGREE = 1e-12
LOOSE = 1e-7
MOST_ROUNDS = 5


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
    """

    orbit: Pass
    tangents: np.ndarray
    sizes: np.ndarray

    @property
    def family(self) -> Family:
        """The family of the orbit."""
        return self.orbit.family

    @property
    def units(self) -> np.ndarray:
        """Units of the unknowns."""
        return self.orbit.units(self.sizes)

    @property
    def values(self) -> np.ndarray:
        """The free parameters ``(k,)``."""
        return self.orbit.loop.values

    @property
    def value(self) -> float:
        """The first free parameter."""
        return float(self.orbit.loop.values[0])

    def step(self, lengths: np.ndarray) -> tuple[Place, int] | None:
        """The place at distances ``(k,)`` along the tangents, and how many corrections it took; or None."""
        units = self.units
        guess = self.orbit.loop.plus(units * (lengths @ self.tangents))
        try:
            made = self.family.corrected(guess, self.orbit, units, self.tangents)
        except ArgumentError:
            return None
        if made is None:
            return None
        found = place_of(made[0], self.tangents, self.sizes)
        if found is None or np.any(np.sum(found.tangents * self.tangents, axis=1) < LEAST_COSINE):
            return None
        return found, made[1]


def distance(place: Place, other: Place) -> float:
    """How far another place of the same route is along the first tangent."""
    return float(place.tangents[0] @ ((other.orbit.loop.flat - place.orbit.loop.flat) / place.units))


def zero_between(place: Place, after: Place, function: Callable[[Place], float]) -> Place | None:
    """The place between two of one branch where a function of places changes its sign."""
    from scipy.optimize import brentq

    length = distance(place, after)
    known = {0.0: place, length: after}

    def value(s: float) -> float:
        if s not in known:
            made = place.step(np.array([s]))
            if made is None:
                raise ArithmeticError
            known[s] = made[0]
        return function(known[s])

    try:
        root = brentq(value, 0.0, length, xtol=1e-14, rtol=4e-16 * 4, maxiter=60)
    except (ArithmeticError, ValueError):
        return None
    return known.get(root) or min(known.items(), key=lambda each: abs(each[0] - root))[1]


def interpolated_zero(
    place: Place, measure: Callable[[Pass], float], bracket: tuple[float, float]
) -> Place | None:
    """The place where a measure is zero, between two distances along the branch.

    The unknowns are smooth functions of the measure, also where the equations are singular at its zero. They
    are interpolated through places on both sides of the zero, none of which is near it.
    """
    low, high = bracket
    centre, width = 0.5 * (low + high), 0.5 * (high - low)
    best, error = None, np.inf
    for _ in range(MOST_ROUNDS):
        places, heights = [], []
        for share in SHARES:
            made = place.step(np.array([centre + share * width]))
            height = np.nan if made is None else measure(made[0].orbit)
            if made is not None and np.isfinite(height):
                places.append(made[0])
                heights.append(height)
        if len(places) < 3:
            return best
        unknowns = np.array([each.orbit.loop.flat for each in places])
        ends = [_at_zero(np.array(heights)[part], unknowns[part]) for part in (slice(None), slice(1, None))]
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
    return best if orbit is None else attrs.evolve(best, orbit=orbit)


def _at_zero(heights: np.ndarray, unknowns: np.ndarray) -> np.ndarray:
    """The polynomial of ``heights (k,)`` through ``unknowns (k, n)``, at zero (Neville's scheme)."""
    table = unknowns.copy()
    for step in range(1, len(heights)):
        left, right = heights[:-step, None], heights[step:, None]
        table = (right * table[:-1] - left * table[1:]) / (right - left)
    return np.asarray(table[0])


def place_of(orbit: Pass, onward: np.ndarray, sizes: np.ndarray) -> Place | None:
    """The place of an orbit, with the tangents that are nearest to given directions ``(k, m + k)``."""
    matrix, _ = orbit.equations(orbit, orbit.units(sizes))
    if not np.all(np.isfinite(matrix)):
        return None
    k = len(sizes)
    null = np.linalg.svd(matrix)[2][-k:]
    # The rotation of the basis that brings it nearest to the directions.
    left, _, right = np.linalg.svd(onward @ null.T)
    return Place(orbit, left @ right @ null, sizes)


def begun(family: Family, loop: Loop, sizes: np.ndarray) -> Place | None:
    """The place of the orbit near these unknowns, with the same parameters; towards larger values of them."""
    first = family.around(loop)
    if first is None:
        return None
    units, k = first.units(sizes), len(sizes)
    fixed = np.eye(len(units))[-k:]
    try:
        made = family.corrected(loop, first, units, fixed)
    except ArgumentError:
        return None
    return None if made is None else place_of(made[0], fixed, sizes)


def start_of(family: Family, arc: HybridArc, period: float, values: np.ndarray) -> tuple[Family, Loop] | None:
    """The family and the unknowns of the orbit that a run over one period shows; None if it has no value."""
    route, x, times = route_of(family.system, arc, period)
    family = attrs.evolve(family, route=route)
    first = family.around(Loop(x, times, values))
    if first is None:
        return None
    n = x.shape[1]
    arcs = [arc if flow.arc is None else flow.arc for flow in first.flows]
    growths = [
        float(np.linalg.norm(flow.slopes[:, :n] / first.scale[:, None] * first.scale, 2))
        for flow in first.flows
    ]
    route, x, times = divided(route, x, times, arcs, growths)
    return attrs.evolve(family, route=route), Loop(x, times, values)


def share_of(orbit: Pass, t: float) -> tuple[int, float]:
    """The stretch at a time, whole periods aside, and the share of the stretch before it."""
    times = orbit.loop.times
    t = times[0] + (t - times[0]) % orbit.loop.period
    i = min(max(int(np.searchsorted(times, t, side="right")) - 1, 0), len(times) - 2)
    length = times[i + 1] - times[i]
    return i, float((t - times[i]) / length) if length > 0.0 else 0.0


def moment(orbit: Pass, i: int, share: float) -> tuple[float, np.ndarray]:
    """Time and state ``(n,)`` at a share of a stretch."""
    begin, end = orbit.loop.times[i : i + 2]
    return float(begin + share * (end - begin)), orbit.flows[i].at(np.array([share]))[0]


def is_real(orbit: Pass) -> bool:
    """Whether the system itself goes this way.

    Each guard fires in its direction, and runs from the middle of each stretch to that of the next one jump
    as the equations say.
    """
    family, loop, route = orbit.family, orbit.loop, orbit.family.route
    if np.any(np.diff(loop.times) <= 0.0) or not all(map(orbit.fires_in_direction, range(len(route)))):
        return False
    middles = [moment(orbit, i, 0.5) for i in range(len(route))]
    middles.append((middles[0][0] + loop.period, middles[0][1]))
    parameters = family.all_parameters(loop.values)
    i = 0
    while i < len(route):
        wanted, last = list(route[i].fired), i + 1
        # Within a chatter there is no middle that a run could start from or end at.
        while last < len(route) and route[last].within:
            wanted += route[last].fired
            last += 1
        if route[i].within and len(route) > 1:
            i = last
            continue
        if not _goes(orbit, i, last, middles, wanted, parameters):
            return False
        i = last
    return True


def _goes(
    orbit: Pass,
    first: int,
    last: int,
    middles: list[tuple[float, np.ndarray]],
    wanted: list[str],
    parameters: dict[str, float],
) -> bool:
    """Whether a run from the middle of one stretch to that of another takes these transitions."""
    family, route = orbit.family, orbit.family.route
    (begin, x), (end, _) = middles[first], middles[last]
    passed = {name for stretch in route for name in stretch.within}
    arc = simulate(
        family.system,
        x,
        (begin, end),
        mode=route[first].mode,
        parameters=parameters,
        solver=family.solver,
    )
    jumps = [jump for jump in arc.jumps if jump.transition not in passed]
    if not arc.status.ok or [jump.transition for jump in jumps] != [
        name for name in wanted if name not in passed
    ]:
        return False
    late = [abs(jump.t - orbit.loop.times[last]) for jump in jumps]
    return max(late, default=0.0) <= SAME_TIME * orbit.loop.period
