"""One lap around an orbit, as a run of the system shows it, stretch by stretch.

The stretches are those that a branch follows: `hybrid.orbits.continuation.passing` holds their equations and
saltation matrices. The tangent map of each stretch is known as well-conditioned factors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import attrs
import numpy as np

from hybrid.kernels.types import codes
from hybrid.orbits.continuation.family import Family, no_time
from hybrid.orbits.continuation.flow import Flow
from hybrid.orbits.continuation.passing import Pass
from hybrid.orbits.continuation.route import Loop, Stretch
from hybrid.orbits.factors import MOST_ATTEMPTS, OTHER_UNITS, Products, suited
from hybrid.orbits.periodic_schur import ProductEigenvalues, product_eigenvalues
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.periods import split_time
from hybrid.simulation.trajectory import Trajectory


@attrs.frozen(eq=False)
class Leg:
    """The motion up to the next jump that does not accumulate with others, or to a place where it is cut.

    ``x`` and ``end`` are whole states, ``factors`` those of its tangent map in the units of the lap.
    ``singular`` says that the jumps at its end annihilate a direction.
    """

    mode: str
    t: float
    x: np.ndarray
    first_rate: np.ndarray
    factors: list[np.ndarray]
    end_mode: str
    end_time: float
    end: np.ndarray
    last_rate: np.ndarray
    within: tuple[str, ...] = ()
    fired: tuple[str, ...] = ()
    singular: bool = False


@attrs.frozen
class Fired:
    """A jump of an orbit: when, which transition, and the mode after it."""

    t: float
    transition: str
    target: str | None


@attrs.frozen(eq=False)
class Lap:
    """A lap: its stretches as a pass, and the tangent map of each stretch and of each instant as factors.

    ``orbit`` is None where the run did not come around. ``maps`` are the factors by stretches, in ``units
    (n,)`` of the states, the jumps at the end of a stretch last. ``singular`` tells which of them annihilate
    a direction. ``legs`` has the flows with the legs that they come from.
    """

    orbit: Pass | None
    units: np.ndarray
    legs: tuple[tuple[Flow, Leg], ...] = ()
    maps: tuple[list[np.ndarray], ...] = ()
    singular: tuple[list[bool], ...] = ()

    def in_order_of(self, arc: HybridArc) -> Lap:
        """The lap with events that meet at one instant in the order in which another run makes them."""
        other = None if self.orbit is None else self.orbit.in_order_of(arc)
        return self if other is None or other is self.orbit else _mapped(other, self.legs, self.units)

    @property
    def jumps(self) -> list[Fired] | None:
        """The jumps in their order; None where the run did not come around, or where jumps accumulate."""
        if self.orbit is None or any(stretch.within for stretch in self.orbit.family.route):
            return None
        system, ends = self.orbit.family.system, self.orbit.loop.times[1:].tolist()
        return [
            Fired(t, name, system.transitions[system.transition_index(name)].target)
            for t, stretch in zip(ends, self.orbit.family.route, strict=True)
            for name in stretch.fired
        ]

    @property
    def eigenvalues(self) -> ProductEigenvalues:
        """The multipliers; nan where there are none."""
        factors = [each for maps in self.maps for each in maps]
        if not factors or not all(np.all(np.isfinite(each)) for each in factors):
            unknown = np.full(len(self.units), np.nan)
            return ProductEigenvalues(unknown, unknown.astype(complex))
        known = [each for flags in self.singular for each in flags]
        return product_eigenvalues(factors, {i for i, each in enumerate(known) if each})

    def fundamental(self, i: int, *, before: bool = False) -> np.ndarray:
        """The fundamental matrix ``(n, n)`` from the start of a stretch, or from before the jumps there."""
        maps = [*self.maps[i:], *self.maps[:i]]
        product = np.eye(len(self.units)) if maps else np.full((len(self.units),) * 2, np.nan)
        factors = [each for stretch in maps for each in stretch]
        if before:
            factors = [factors[-1], *factors[:-1]]
        with np.errstate(all="ignore"):
            for each in factors:
                product = each @ product
            return product * self.units[:, None] / self.units


def lap_of(
    family: Family,
    begin: Callable[[], Trajectory],
    stops: Sequence[float],
    accumulating: tuple[str, ...] = (),
) -> Lap:
    """The lap of a run up to the last of some times; at each of the others a stretch is cut.

    Jumps of the transitions in ``accumulating`` are within a stretch, but for the first of a row of them.
    """
    units = np.ones(family.n)
    for _ in range(MOST_ATTEMPTS):
        flight = _Flight(begin(), accumulating, units)
        if any(flight.to(t) != codes.DONE for t in stops):
            return Lap(None, units)
        better = suited(units, np.asarray(flight.sizes))
        change = better / units
        if change.max() <= OTHER_UNITS * change.min():
            break
        units = better
    try:
        return _measured(family, _joined(flight.legs), units)
    except ArithmeticError:
        return Lap(None, units)


@attrs.define(eq=False)
class _Flight:
    """A run of the system that is cut into legs."""

    trajectory: Trajectory
    accumulating: tuple[str, ...]
    units: np.ndarray
    legs: list[Leg] = attrs.field(factory=list)
    sizes: np.ndarray | float = 0.0
    # Whether the jump before may be the first of those that accumulate.
    begun: bool = False

    def to(self, t: float) -> int:
        """Make the legs up to a time; DONE, or why the run ends early."""
        place = split_time(t, self.trajectory.model.period)
        while True:
            leg, code = self._leg(place)
            if leg is None:
                return code
            self.legs.append(leg)
            if code == codes.DONE:
                return code

    def _leg(self, place: tuple[int, float]) -> tuple[Leg | None, int]:
        """The next leg, None if the run ends early; with DONE at the place."""
        run, n = self.trajectory, len(self.units)
        products = Products(run, self.units)
        begin = run.mode, run.t, run.x, run.field()[:n]
        within: tuple[str, ...] = ()
        while True:
            code = products.fly(place)
            if code not in (codes.DONE, codes.MAX_JUMPS):
                return None, code
            leg = Leg(*begin, products.factors, run.mode, run.t, run.x, run.field()[:n], within)
            jumps, sizes = run.jumps, products.all_sizes
            if code == codes.MAX_JUMPS:
                code = products.jump(place)
                if code not in (codes.DONE, codes.MAX_STEPS):
                    return None, code
            fired = self._fired(jumps)
            if fired and self._accumulates(fired):
                within = self.accumulating
            elif fired or code == codes.DONE:
                self.sizes = self.sizes + sizes
                singular = len(products.matrices) - 1 in products.singular
                return attrs.evolve(leg, fired=fired, singular=bool(fired) and singular), code

    def _fired(self, jumps: int) -> tuple[str, ...]:
        """Names of the transitions that have fired after so many jumps."""
        run = self.trajectory
        recent, names = run.run.recent, run.system.transition_names
        return tuple(names[recent[j % len(recent)]] for j in range(jumps, run.jumps))

    def _accumulates(self, fired: tuple[str, ...]) -> bool:
        """Whether jumps just made accumulate with others; the first of them is an ordinary jump."""
        if self.trajectory.run.last_kind == codes.LIMIT_OF_CHATTER:
            return True
        accumulates = fired[0] in self.accumulating
        if accumulates and self.begun:
            return True
        self.begun = accumulates
        return False


def _joined(legs: list[Leg]) -> list[Leg]:
    """The legs without those that take no time but for rounding: the jumps at their ends meet."""
    found: list[Leg] = []
    for leg in legs:
        if found and found[-1].fired and no_time(leg.t, leg.end_time):
            fired, singular = (*found[-1].fired, *leg.fired), found[-1].singular or leg.singular
            found[-1] = attrs.evolve(found[-1], fired=fired, singular=singular)
        else:
            found.append(leg)
    return found


def _measured(family: Family, legs: list[Leg], units: np.ndarray) -> Lap:
    """The lap of these legs."""
    n, no_values = family.n, np.zeros(0)
    route = tuple(
        Stretch(leg.mode, leg.end_mode, leg.within, leg.fired, tuple(leg.x[n:].tolist())) for leg in legs
    )
    loop = Loop(
        np.array([leg.x[:n] for leg in legs]),
        np.array([legs[0].t, *(leg.end_time for leg in legs)]),
        no_values,
    )
    flows = []
    for leg in legs:
        slopes = np.eye(n)
        for each in leg.factors:
            slopes = each @ slopes
        slopes = slopes * units[:, None] / units
        flows.append(
            Flow(None, leg.end[:n], slopes, leg.first_rate, leg.last_rate, tuple(leg.end[n:].tolist()))
        )
    counted = (legs[-1].end - legs[0].x)[n:]
    family = attrs.evolve(family, route=route, counted=counted)
    orbit = Pass(family, loop, tuple(flows), (None,) * len(legs)).parted
    return _mapped(orbit, tuple(zip(flows, legs, strict=True)), units)


def _mapped(orbit: Pass, legs: tuple[tuple[Flow, Leg], ...], units: np.ndarray) -> Lap:
    """The lap with these flows of legs, and others that take no time between them."""
    found, leg = {id(flow): leg for flow, leg in legs}, legs[0][1]
    maps, singular = list[list[np.ndarray]](), list[list[bool]]()
    for flow, landing, saltation in zip(orbit.flows, orbit.landings, orbit.saltations, strict=True):
        leg = found.get(id(flow), leg)
        maps.append([*leg.factors] if id(flow) in found else [])
        singular.append([False] * len(maps[-1]))
        if landing is not None:
            maps[-1].append(saltation / units[:, None] * units)
            singular[-1].append(leg.singular)
    if all(landing is None for landing in orbit.landings):
        maps[-1].append(orbit.onto_its_surface / units[:, None] * units)
        singular[-1].append(True)
    return Lap(orbit, units, legs, tuple(maps), tuple(singular))
