"""One pass around an orbit: the equations stretch by stretch, their derivatives, and the tangent maps."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import attrs
import numpy as np

from hybrid.orbits.continuation.equations import CLOSED, hold, stretch_by_stretch
from hybrid.orbits.continuation.flow import Flow, Landing
from hybrid.orbits.continuation.route import Loop
from hybrid.orbits.periodic_schur import product_eigenvalues
from hybrid.simulation.arc import HybridArc

# An orbit is a point below this share of its size: the root of rounding, as sizes shrink like roots.
NO_SIZE = 2.0**-26
# Places of a stretch at which the size of the states is taken.
LOOKED_AT = 17
# A stretch of a neighbour may take so many times the steps of the longest, and so many besides.
MORE_STEPS = 10
FEWEST_STEPS = 1000
# Eigenvalues of one matrix are wrong by its norm times rounding; above this they come from its factors.
BLURRED = 1e-9


@attrs.frozen(eq=False)
class Pass:
    """One pass around an orbit, or near one: where its stretches end, and how that depends on unknowns."""

    family: Any
    loop: Loop
    flows: tuple[Flow, ...]
    landings: tuple[Landing | None, ...]
    _derivatives: dict[tuple[float, ...], np.ndarray] = attrs.field(factory=dict, init=False)

    @cached_property
    def scale(self) -> np.ndarray:
        """Sizes ``(n,)`` of the components along the orbit, or along the first one if these are larger.

        The size of an angle, which may count many turns, is its turn.
        """
        sizes = np.maximum(self.own_scale, self.family.least)
        turns = self.family.system.turn_lengths[: len(sizes)]
        sizes = np.where(turns > 0.0, turns, sizes)
        return np.where(sizes > 0.0, sizes, 1.0)

    @cached_property
    def own_scale(self) -> np.ndarray:
        """Largest absolute values ``(n,)`` of the components along the orbit."""
        return np.asarray(np.abs(self._states).max(axis=0))

    @property
    def is_point(self) -> bool:
        """Whether nothing moves along it but cyclic components: an equilibrium is no orbit."""
        if self.family.forced:
            return False
        still = np.ptp(self._states, axis=0) <= NO_SIZE * self.scale
        return bool(np.all(still | self._cyclic))

    @property
    def _cyclic(self) -> np.ndarray:
        """Whether each component ``(n,)`` is cyclic."""
        return np.asarray(self.family.system.is_cyclic[: self.loop.x.shape[1]])

    @property
    def extremes(self) -> np.ndarray:
        """The smallest and the largest values of the components ``(2, n)``."""
        return np.array([self._states.min(axis=0), self._states.max(axis=0)])

    @cached_property
    def _states(self) -> np.ndarray:
        """States ``(N, n)`` all along the orbit."""
        shares = np.linspace(0.0, 1.0, LOOKED_AT)
        states = [flow.at(shares) for flow in self.flows if flow.arc is not None]
        return np.concatenate([self.loop.x, *states])

    @property
    def period(self) -> float:
        """Time until it closes: that of the forcing exactly."""
        return self.family.period(self.loop.values) if self.family.forced else self.loop.period

    @property
    def steps_allowed(self) -> int:
        """Steps that one stretch of a neighbour may take: more mean that it is no neighbour."""
        taken = [flow.arc.steps + flow.arc.rejected for flow in self.flows if flow.arc is not None]
        return FEWEST_STEPS + MORE_STEPS * max(taken, default=0)

    @property
    def parted(self) -> Pass:
        """The same orbit, with a stretch that takes no time between events that meet by themselves."""
        family, loop = self.family, self.loop
        stretches: list[Any] = []
        states, times, flows = [], [], []
        for i, (stretch, flow) in enumerate(zip(family.route, self.flows, strict=True)):
            end = float(loop.times[i + 1])
            parts = family.by_themselves(stretch, flow, end, loop.values, loop.period)
            stretches += [each for each, _ in parts]
            states += [loop.x[i], *(x for _, x in parts[1:])]
            times += [loop.times[i], *([end] * (len(parts) - 1))]
            flows += [flow, *(family.flow(each, x, end, end, loop.values) for each, x in parts[1:])]
        family = attrs.evolve(family, route=tuple(stretches))
        loop = Loop(np.array(states), np.array([*times, loop.times[-1]]), loop.values)
        landings = tuple(
            family.landing(stretch, flow, float(t), loop.values)
            for stretch, flow, t in zip(stretches, flows, loop.times[1:], strict=True)
        )
        return Pass(family, loop, tuple(flows), landings)

    @property
    def has_meetings(self) -> bool:
        """Whether events meet at one instant by themselves."""
        return bool(np.any(np.diff(self.loop.times) <= CLOSED * self.loop.period))

    def in_order_of(self, arc: HybridArc) -> Pass:
        """The same orbit, with events that meet at one instant in the order in which a run around makes them.

        Rounding decides that order. The events may be other transitions then, through other modes.
        """
        route, period = self.family.route, self.loop.period
        lasting = np.flatnonzero(np.diff(self.loop.times) > CLOSED * period)
        ends, stretches, changed = [*lasting[1:], len(route)], [], False
        for i, after in zip(lasting.tolist(), ends, strict=True):
            fired = tuple(name for stretch in route[i:after] for name in stretch.fired)
            late = (arc.jumps.t - self.loop.times[i + 1] + 0.5 * period) % period - 0.5 * period
            jumps = [arc.jumps[int(j)] for j in np.flatnonzero(np.abs(late) <= CLOSED * period)]
            if after > i + 1 and jumps and not route[i].within:
                ends_meet = jumps[0].source, jumps[-1].target
                names = tuple(jump.transition for jump in jumps)
                if names != fired and ends_meet == (route[i].end_mode, route[after % len(route)].mode):
                    fired, changed = names, True
            stretches.append(attrs.evolve(route[i], fired=fired))
        if not changed or lasting[0] != 0:
            return self
        flows = tuple(self.flows[i] for i in lasting)
        times = np.append(self.loop.times[lasting], self.loop.times[-1])
        loop = Loop(self.loop.x[lasting], times, self.loop.values)
        family = attrs.evolve(self.family.latest, route=tuple(stretches))
        return Pass(family, loop, flows, (None,) * len(flows)).parted

    def units(self, sizes: np.ndarray) -> np.ndarray:
        """Units of the unknowns, for parameters of the ``sizes (k,)``.

        The states and times of many stretches count as much together as those of one.
        """
        count = len(self.flows)
        share = np.sqrt(count)
        return np.concatenate(
            [np.tile(share * self.scale, count), np.full(count + 1, share * self._span), sizes]
        )

    def derivatives(self, sizes: np.ndarray) -> np.ndarray:
        """Derivatives ``(m, m + k)`` of the scaled equations here, made once for these sizes."""
        key = tuple(sizes)
        if key not in self._derivatives:
            self._derivatives[key] = self.equations(self, self.units(sizes))[0]
        return self._derivatives[key]

    @property
    def _span(self) -> float:
        return abs(self.loop.period) or 1.0

    def whole(self, i: int, x: np.ndarray) -> np.ndarray:
        """States ``(..., n)`` in a stretch with the counters that it begins with."""
        counters = np.array(self.family.route[i].counters)
        return np.concatenate([x, np.broadcast_to(counters, (*x.shape[:-1], len(counters)))], axis=-1)

    @property
    def change(self) -> np.ndarray:
        """Change ``(n,)`` of the state over the period: whole turns of angles and shifts, else but errors."""
        pairs = zip(self.flows, self.landings, strict=True)
        ends = [flow.end if landing is None else landing.after for flow, landing in pairs]
        return np.asarray(np.sum(np.array(ends) - np.roll(self.loop.x, -1, axis=0), axis=0))

    @cached_property
    def saltations(self) -> list[np.ndarray]:
        """The saltation matrix ``(n, n)`` of the jumps at the end of each stretch, or the identity."""
        n, found = self.loop.x.shape[1], []
        for i, (flow, landing) in enumerate(zip(self.flows, self.landings, strict=True)):
            if landing is None:
                found.append(np.eye(n))
                continue
            before, after = flow.last_rate, self.flows[(i + 1) % len(self.flows)].first_rate
            late = after - landing.slopes[:, :n] @ before - landing.slopes[:, -1]
            with np.errstate(all="ignore"):
                moved = np.outer(late, landing.gradient[:n]) / self.speed(i)
            found.append(landing.slopes[:, :n] + moved)
        return found

    @cached_property
    def maps(self) -> list[np.ndarray]:
        """The tangent map ``(n, n)`` of each stretch and the jumps at its end, at fixed times."""
        n = self.loop.x.shape[1]
        pairs = zip(self.saltations, self.flows, strict=True)
        # Where a guard is touched a saltation matrix has no bound.
        with np.errstate(all="ignore"):
            found = [saltation @ flow.slopes[:, :n] for saltation, flow in pairs]
        if all(landing is None for landing in self.landings):
            found[-1] = self.onto_its_surface @ found[-1]
        return found

    @property
    def onto_its_surface(self) -> np.ndarray:
        """The projection ``(n, n)`` onto the surface that an orbit without jumps stays on; else the identity.

        Other orbits come to such a surface by a jump, which forgets how far they were from it.
        """
        family, loop, n = self.family, self.loop, self.loop.x.shape[1]
        mode, t, x = family.route[0].mode, float(loop.times[0]), self.whole(0, loop.x[0])
        across = []
        for transition in family.system.transitions:
            if transition.target != mode or transition.source == mode:
                continue
            gradient = family.gradient(transition.name, t, x, loop.values)[:n]
            height = family.height(transition.name, t, x, loop.values)
            near = abs(height) <= CLOSED * float(np.abs(gradient) @ self.scale)
            if near and family.is_along(transition.name, mode, t, x, loop.values):
                across.append(gradient)
        if not across:
            return np.eye(n)
        normals = np.linalg.svd(np.array(across))[2][: np.linalg.matrix_rank(np.array(across))]
        return np.asarray(np.eye(n) - normals.T @ normals)

    @cached_property
    def multipliers(self) -> np.ndarray:
        """Floquet multipliers ``(n,)``, largest first; nan where a guard is touched."""
        free = self.free_multipliers
        values = np.append(free, np.ones(self.loop.x.shape[1] - len(free)))
        return values[np.argsort(-np.abs(values), kind="stable")]

    @cached_property
    def free_multipliers(self) -> np.ndarray:
        """The multipliers ``(n - r,)`` but those that are 1 on every orbit of the family, largest first.

        The field of an autonomous system and the directions of cyclic components are right eigenvectors of
        the tangent map over the period, and the gradient of a held quantity is a left one. What is left is
        the map of the states of one value of each quantity, across the field and the shifts.
        """
        basis, maps = self._free_directions, self._turned_maps
        product = basis
        with np.errstate(all="ignore"):
            for each in maps:
                product = each @ product
        if not np.all(np.isfinite(product)):
            return np.full(basis.shape[1], np.nan, dtype=complex)
        if len(maps) > 1 and np.finfo(float).eps * np.linalg.norm(product) > BLURRED:
            factors, vectors = list[np.ndarray](), basis
            for each in maps[:-1]:
                vectors, factor = np.linalg.qr(each @ vectors)
                factors.append(factor)
            values = product_eigenvalues([*factors, basis.T @ maps[-1] @ vectors], set()).values
        else:
            values = np.linalg.eigvals(basis.T @ product)
        return values[np.argsort(-np.abs(values), kind="stable")]

    @property
    def stable(self) -> bool:
        """Whether no free multiplier is outside the unit circle, as far as the orbit is closed."""
        free = self.free_multipliers
        if self.is_point and len(free):
            # At a Hopf point 1 is a double multiplier, which rounding splits.
            free = np.delete(free, np.argmin(np.abs(free - 1.0)))
        return bool(np.all(np.abs(free) <= 1.0 + CLOSED))

    @property
    def _turned_maps(self) -> list[np.ndarray]:
        """The scaled tangent maps ``(n, n)`` of the stretches, from where quantities are held."""
        maps = [*self.maps[self._first :], *self.maps[: self._first]]
        return [each / self.scale[:, None] * self.scale for each in maps]

    @property
    def monodromy(self) -> np.ndarray:
        """The tangent map ``(n, n)`` over the period from the point where quantities are held."""
        product = np.eye(len(self.scale))
        for each in self._turned_maps:
            product = each @ product
        return product * self.scale[:, None] / self.scale

    @property
    def _first(self) -> int:
        """The stretch at whose start conserved quantities are taken, or the first."""
        held = self.family.held
        return 0 if held is None else int(held.stretch)

    @property
    def _free_directions(self) -> np.ndarray:
        """An orthonormal basis ``(n, n - r)`` of scaled states across field, shifts and held gradients."""
        taken = [*np.eye(len(self.scale))[self._cyclic]]
        if not self.family.forced:
            taken.append(self.flows[self._first].first_rate / self.scale)
        if self.departure is not None:
            taken += [*self.departure[1][:, : len(self.scale)] * self.scale]
        if not taken:
            return np.eye(len(self.scale))
        rows = np.array([each / (np.linalg.norm(each) or 1.0) for each in taken])
        return np.linalg.svd(rows)[2][np.linalg.matrix_rank(rows) :].T

    @cached_property
    def departure(self) -> tuple[np.ndarray, np.ndarray] | None:
        """How far held quantities are from their values ``(h,)``; None if nothing is held.

        And their derivatives ``(h, n + k + 1)`` in the state at the start of their stretch, in the parameters
        and in the time there.
        """
        family, loop, i = self.family, self.loop, self._first
        if family.held is None:
            return None
        held = attrs.evolve(
            family.held, parameters=family.vector(loop.values), counters=family.route[i].counters
        )
        t, x, n = float(loop.times[i]), loop.x[i], loop.x.shape[1]
        free = [n + list(family.system.parameters).index(name) for name in family.names]
        slopes = held.slopes(t, x, self.scale)
        return held.off(t, x), slopes[:, [*range(n), *free, -1]]

    def speed(self, i: int, rate: np.ndarray | None = None) -> float:
        """Speed of the guard at the end of a stretch, along the field there or another rate ``(n,)``."""
        landing, n = self.landings[i], self.loop.x.shape[1]
        assert landing is not None
        along = self.flows[i].last_rate if rate is None else rate
        return float(landing.gradient[:n] @ along + landing.gradient[-1])

    def fires_in_direction(self, i: int) -> bool:
        """Whether the guard at the end of a stretch, if there is one, is crossed in its direction."""
        stretch, system = self.family.route[i], self.family.system
        if not stretch.fired:
            return True
        transition = system.transitions[system.transition_index(stretch.fired[0])]
        return float(transition.guard.direction) * self.speed(i) >= 0.0

    def equations(self, anchor: Pass, units: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Scaled equations: derivatives ``(m, m + k)`` in the scaled unknowns, and values ``(m,)``.

        ``anchor`` is the orbit before: sizes are those there, and the phase of an autonomous orbit without
        jumps.
        """
        count, n = self.loop.x.shape
        first = count * n
        matrix, values = (each.copy() for each in self._stretch_by_stretch)
        if self.departure is not None and anchor.departure is not None:
            gradients = anchor.departure[1][:, :n]
            hold(self.departure, gradients, anchor.scale, (self._first, count), matrix, values)
        self._let_shift(anchor, matrix, values)
        self._close(anchor, matrix[-1], values, first)
        matrix *= units
        sizes = np.concatenate([np.tile(anchor.scale, count), np.abs(matrix[first:]).max(axis=1)])
        sizes[sizes == 0.0] = 1.0
        return matrix / sizes[:, None], values / sizes

    @cached_property
    def _stretch_by_stretch(self) -> tuple[np.ndarray, np.ndarray]:
        """The equations without units and without the last one, which closes the orbit."""
        turns = self.family.system.turn_lengths[: self.loop.x.shape[1]]
        return stretch_by_stretch(self.loop, self.flows, self.landings, turns)

    def _let_shift(self, anchor: Pass, matrix: np.ndarray, values: np.ndarray) -> None:
        """A cyclic component has any value at the end of the orbit, and at its start that of the anchor."""
        count, n = self.loop.x.shape
        [own] = np.nonzero(self._cyclic)
        rows = (count - 1) * n + own
        matrix[rows] = 0.0
        matrix[rows, own] = 1.0
        values[rows] = self.loop.x[0, own] - anchor.loop.x[0, own]

    def _close(self, anchor: Pass, row: np.ndarray, values: np.ndarray, first: int) -> None:
        """The last equation: the period is that of the forcing, or the time of the start is fixed."""
        loop, family, k = self.loop, self.family, len(self.loop.values)
        jumps = any(landing is not None for landing in self.landings)
        if not jumps:
            values[-2] = loop.times[0] - anchor.loop.times[0]
        if family.forced:
            row[-k - 1], row[first] = 1.0, -1.0
            row[-k:] = -family.slopes_of_period(loop.values)
            values[-1] = loop.period - family.period(loop.values)
        elif jumps:
            row[first], values[-1] = 1.0, loop.times[0] - anchor.loop.times[0]
        else:
            n = loop.x.shape[1]
            across = np.where(self._cyclic, 0.0, anchor.flows[0].first_rate / anchor.scale**2)
            row[:n] = across
            values[-1] = across @ (loop.x[0] - anchor.loop.x[0])
