"""From a start to the attractor that its run settles on: its points, its period, its exponents."""

from __future__ import annotations

import math
from typing import Any

import attrs
import numpy as np

from hybrid.errors import HybridError
from hybrid.kernels.types import codes
from hybrid.measures.averages import TaperedMean, standard_error, taper_inflation
from hybrid.orbits.factors import fundamental_factors
from hybrid.orbits.periodic_schur import product_eigenvalues
from hybrid.orbits.triangles import Triangles
from hybrid.simulation.ending import status_of
from hybrid.simulation.simulate import simulate
from hybrid.sweep.attractors.attractor import UNKNOWN, Attractor
from hybrid.sweep.attractors.runs import Points
from hybrid.sweep.attractors.setup import Setup
from hybrid.system.elements import Guard
from hybrid.system.graph import HybridSystem
from hybrid.system.periodicity import closed_change
from hybrid.transform.markers import with_section

# Points in which a period is looked for, and after how many without one an attractor has none.
WINDOW, MOST_POINTS = 1024, 16_384
# Share of its points that an attractor visits again, near earlier ones, before a sample counts as complete.
REVISITED = 0.9
# Changes of a component at rest, in units of the solver's tolerances: a run may begin on its attractor.
ERRORS = 100.0
# Intervals from which exponents are averaged at first and at most, and those that show the size of the orbit.
INTERVALS, MOST_INTERVALS, LOOKED_AT = 400, 1600, 16


@attrs.frozen(eq=False)
class Found:
    """An attractor with what the search needs: how near is near, per component ``(n,)``.

    ``turns (n,)`` are the lengths of a turn of angles, 0 for other components.
    """

    attractor: Attractor
    radius: np.ndarray
    turns: np.ndarray

    def tree(self, points: np.ndarray) -> Any:
        """Points ``(P, n)`` to measure distances from in radii; those of angles are up to whole turns."""
        # SciPy's spatial algorithms take long to import.
        from scipy.spatial import cKDTree

        return cKDTree(self.in_radii(points), boxsize=self.turns / self.radius)

    def in_radii(self, states: np.ndarray) -> np.ndarray:
        """States ``(N, n)`` in radii, with angles within the first turn."""
        return within_turns(states, self.turns) / self.radius

    def distances(self, states: np.ndarray, mode: np.ndarray) -> np.ndarray:
        """How far states ``(N, n)`` in these modes ``(N,)`` are from the points, in radii."""
        far = np.full(len(states), np.inf)
        for name in np.unique(mode):
            own, theirs = self.attractor.mode == name, mode == name
            if own.any():
                tree = self.tree(self.attractor.points[own])
                far[theirs] = tree.query(self.in_radii(states[theirs]), p=np.inf)[0]
        return far


def find(setup: Setup, x0: np.ndarray, mode: str | None) -> Found | None:
    """The attractor that the run from a start settles on; None if the run ends."""
    points = Points(setup, x0, mode)
    before, _ = collected(points, setup.periods)
    if points.code != codes.DONE:
        return None
    turns = setup.turns
    extent, share = extent_of(np.vstack([x0, before]), setup), math.sqrt(setup.solver.rtol)
    sample = np.empty((0, len(x0))), np.empty((0, 2), dtype=np.int64)
    # Chaos may be a long transient of a periodic orbit, so it takes many points to call an attractor chaotic.
    while len(sample[0]) < MOST_POINTS:
        window = collected(points, WINDOW)
        if points.code != codes.DONE:
            return None
        extent = np.maximum(extent, np.ptp(window[0], axis=0))
        count = round_of(*window, extent, share, turns)
        if count:
            return _periodic(setup, points, count, extent, x0)
        sample = np.vstack([sample[0], window[0]]), np.vstack([sample[1], window[1]])
    return _wandering(setup, points, *sample, extent, x0)


def collected(points: Points, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The next points of a run, with their modes and jumps.

    Angles are within the first turn, and cyclic components, which may grow without bound, are 0.
    """
    states, places = points.more(count)
    setup = points.runs.setup
    states = np.where(setup.system.is_cyclic, 0.0, within_turns(states, setup.turns))
    if points.code != codes.DONE:
        # A run that needs a mode which has not been made yet is repeated.
        status_of(points.trajectory, points.code)
    return states, places


def within_turns(states: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """States ``(N, n)`` with angles from zero to below a turn."""
    angles = turns > 0.0
    if not np.any(angles):
        return states
    whole = np.where(angles, turns, 1.0)
    reduced = np.mod(states, whole)
    # The rest of a small negative angle is rounded to a whole turn.
    return np.where(angles, np.where(reduced < whole, reduced, 0.0), states)


def extent_of(states: np.ndarray, setup: Setup) -> np.ndarray:
    """Size of what a run visits ``(n,)``; that of the state itself where a component does not change.

    A change or a size below ``ERRORS`` times the solver's tolerances is an error of the run. The size of an
    angle is its turn. That of a cyclic component is infinite: states that differ by a shift are near.
    """
    extent, size = np.ptp(states, axis=0), np.abs(states).max(axis=0)
    small = ERRORS * setup.solver.atol
    changes, counts = extent > ERRORS * setup.solver.rtol * size + small, size > small
    still = np.where(counts, size, 1.0)
    found = np.where(setup.turns > 0, setup.turns, np.where(changes, extent, still))
    return np.where(setup.system.is_cyclic, np.inf, found)


def round_of(
    states: np.ndarray, places: np.ndarray, extent: np.ndarray, share: float, turns: np.ndarray
) -> int:
    """The smallest number of points after which a whole round repeats, up to a share of the extent; or 0."""
    mode = places[:, 0]
    far = np.abs(closed_change(states[-1] - states[-2::-1], turns)) / extent
    back = (far <= share).all(axis=1) & (mode[-2::-1] == mode[-1])
    for count in (np.flatnonzero(back) + 1).tolist():
        if 2 * count > len(states):
            break
        last, earlier = states[-count:], states[-2 * count : -count]
        if np.all(np.abs(closed_change(last - earlier, turns)) <= share * extent):
            return int(count)
    return 0


def _periodic(setup: Setup, points: Points, count: int, extent: np.ndarray, x0: np.ndarray) -> Found | None:
    """A stable periodic orbit of ``count`` points, or equilibrium, at which the run has arrived; or None."""
    run = points.trajectory
    origin, mode, begin, jumps, steps = run.x, run.mode, run.t, run.jumps, run.steps
    states, places = collected(points, count)
    if points.code != codes.DONE:
        return None
    period = count * setup.interval if setup.forced else run.t - begin
    jumps = run.jumps - jumps - (count if setup.markers else 0)
    moved = _orbit(setup, origin, mode, period)
    rests = jumps == 0 and bool(np.all(moved <= math.sqrt(setup.solver.rtol) * extent))
    log_moduli = _log_moduli(setup, origin, mode, period)
    if np.any(log_moduli > math.sqrt(setup.solver.rtol)):
        # The run has come to rest on the stable manifold of an unstable orbit.
        return None
    error = np.full(len(log_moduli), setup.solver.rtol * (run.steps - steps) / period)
    size = np.where(moved > math.sqrt(setup.solver.rtol) * extent, moved, extent)
    attractor = Attractor(
        kind="equilibrium" if rests else "periodic",
        points=states,
        mode=np.array(run.system.mode_names)[places[:, 0]],
        round=count,
        period=period,
        jumps=float(jumps),
        exponents=log_moduli / period,
        standard_error=error,
        start=x0,
    )
    if rests:
        attractor = attrs.evolve(attractor, points=states[-1:], mode=attractor.mode[-1:], round=1)
    return Found(attractor, setup.tolerance * size, setup.turns)


def _orbit(setup: Setup, x: np.ndarray, mode: str, time: float) -> np.ndarray:
    """How far the components move over a time ``(n,)``; infinite for cyclic ones."""
    span = (setup.t0, setup.t0 + time)
    arc = simulate(setup.system, x, span, mode=mode, parameters=setup.parameters, solver=setup.solver)
    states = np.vstack([arc.x, arc(np.linspace(arc.t[0], arc.t[-1], 64 * LOOKED_AT))])
    turns = setup.turns
    moved = np.ptp(states, axis=0)
    moved = np.where(turns > 0.0, np.minimum(moved, turns), moved)
    return np.asarray(np.where(setup.system.is_cyclic, np.inf, moved))


def _log_moduli(setup: Setup, x: np.ndarray, mode: str, period: float) -> np.ndarray:
    """Logarithms of the moduli of the multipliers ``(n,)``; nan if they cannot be computed."""
    n = setup.system.tangent_dimension
    try:
        trajectory = setup.begin(x, mode, tangent=np.eye(n))
        factors = fundamental_factors(trajectory, trajectory.t + period, np.ones(n))
    except HybridError:
        return np.full(n, np.nan)
    if factors.code != codes.DONE or not all(np.all(np.isfinite(each)) for each in factors.matrices):
        return np.full(n, np.nan)
    return product_eigenvalues(factors.matrices, factors.singular).log_moduli


def _wandering(
    setup: Setup, points: Points, states: np.ndarray, places: np.ndarray, extent: np.ndarray, x0: np.ndarray
) -> Found | None:
    """An attractor without a period: a sample of its points, dense enough to be met again."""
    run = points.trajectory
    origin, mode, begin, jumps = run.x, run.mode, run.t, run.jumps
    more, more_places = collected(points, WINDOW)
    if points.code != codes.DONE:
        return None
    # Time and jumps per point.
    pace = setup.interval if setup.forced else (run.t - begin) / WINDOW
    rate = (run.jumps - jumps) / WINDOW - (1 if setup.markers else 0)
    exponents, error = _exponents(setup, origin, mode, pace)
    moved = np.maximum(_orbit(setup, origin, mode, LOOKED_AT * pace), np.ptp(states, axis=0))
    names = np.array(run.system.mode_names)
    attractor = Attractor(
        kind=_kind(exponents, error, neutral(setup.system)),
        points=states,
        mode=names[places[:, 0]],
        round=0,
        period=math.nan,
        jumps=float(rate),
        exponents=exponents,
        standard_error=error,
        start=x0,
    )
    radius = setup.tolerance * np.where(moved > 0, moved, extent)
    whole = Found(attractor, radius, setup.turns)
    if attractor.kind == "periodic":
        whole = attrs.evolve(whole, attractor=_closed(setup, attractor, origin, mode))
    return _thinned(whole, more, names[more_places[:, 0]])


def _closed(setup: Setup, attractor: Attractor, x: np.ndarray, mode: str) -> Attractor:
    """The attractor with the period and the multipliers of its orbit, if that crosses a plane in rounds.

    Points at equal times do not come back. The plane lies through a point, across the speed there.
    """
    turns = setup.turns
    extent = np.maximum(extent_of(attractor.points, setup), np.finfo(float).tiny)
    normal = (setup.begin(x, mode).field() / extent / extent).tolist()
    place = list(enumerate(zip(normal, x.tolist(), turns.tolist(), strict=True)))

    def height(i: int, x: Any, at: float, turn: float) -> Any:
        # Of an angle it is the same a turn further.
        return np.sin(2.0 * np.pi / turn * (x[i] - at)) * turn / (2.0 * np.pi) if turn else x[i] - at

    plane = Guard(lambda t, x, p: sum(each * height(i, x, *rest) for i, (each, *rest) in place), +1)
    marked = with_section(setup.system, plane)
    crossed = attrs.evolve(setup, section=plane, marked=marked)
    points = Points(crossed, x, mode)
    states, places = collected(points, WINDOW)
    share = math.sqrt(setup.solver.rtol)
    count = round_of(states, places, extent, share, turns) if len(states) == WINDOW else 0
    found = _periodic(crossed, points, count, extent, attractor.start) if count else None
    if found is None:
        return attractor
    orbit = found.attractor
    names = ("period", "jumps", "exponents", "standard_error")
    return attrs.evolve(attractor, **{name: getattr(orbit, name) for name in names})


def _thinned(whole: Found, states: np.ndarray, mode: np.ndarray) -> Found:
    """The attractor with as many of its points as it takes to be near later ones.

    A sample tells nothing below the distances of its own points, so the radius grows if all are too few.
    """
    count = WINDOW
    while True:
        attractor = whole.attractor
        part = attrs.evolve(attractor, points=attractor.points[:count], mode=attractor.mode[:count])
        found = attrs.evolve(whole, attractor=part)
        far = float(np.quantile(found.distances(states, mode), REVISITED))
        if far <= 1.0 or not np.isfinite(far):
            return found
        if count >= len(attractor.points):
            return attrs.evolve(found, radius=found.radius * far)
        count *= 2


def extended(found: Found, states: np.ndarray, mode: np.ndarray) -> Found:
    """The attractor with more points."""
    before = found.attractor
    points, modes = np.vstack([before.points, states]), np.concatenate([before.mode, mode])
    return attrs.evolve(found, attractor=attrs.evolve(before, points=points, mode=modes))


def _exponents(setup: Setup, x: np.ndarray, mode: str, pace: float) -> tuple[np.ndarray, np.ndarray]:
    """Exponents ``(n,)`` and their standard errors, averaged over intervals of one point each.

    They are averaged for longer while more of them cannot be told from zero than must be zero.
    """
    n = setup.system.tangent_dimension
    try:
        trajectory = setup.begin(x, mode, tangent=np.eye(n))
    except HybridError:
        return np.full(n, np.nan), np.full(n, np.nan)
    basis = np.linalg.qr(np.random.default_rng(0).normal(size=(n, n)))[0]
    triangles = Triangles(trajectory, pace, basis)
    growths = np.empty((0, n))
    while True:
        count = max(INTERVALS, len(growths))
        rows = [each.growth / pace for each in triangles.following(count)]
        growths = np.vstack([growths, *rows])
        mean = TaperedMean(n)
        mean.add(growths)
        values, error = mean.value(), standard_error(growths) * taper_inflation()
        zeros = int(np.sum(np.abs(values) <= 2 * error)) - neutral(setup.system)
        if zeros <= 0 or len(rows) < count or len(growths) >= MOST_INTERVALS:
            order = np.argsort(-values, kind="stable")
            return values[order], error[order]


def neutral(system: HybridSystem) -> int:
    """How many exponents are zero by nature: that of the flow, without forcing, and those of shifts."""
    return len(system.cyclic) + (0 if system.period is not None else 1)


def _kind(exponents: np.ndarray, error: np.ndarray, neutral: int) -> str:
    """The kind of motion by the signs of its exponents, of which so many are zero by nature."""
    # The error of a direction that jumps annihilate, whose exponent is minus infinity, is not known.
    if np.isnan(exponents).any() or np.isnan(error[np.isfinite(exponents)]).any():
        return UNKNOWN
    zero = np.abs(exponents) <= 2 * error
    if np.any((exponents > 0) & ~zero):
        return "chaotic"
    zeros = int(zero.sum()) - neutral
    return "torus" if zeros > 0 else "periodic"
