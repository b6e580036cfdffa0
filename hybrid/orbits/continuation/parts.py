"""Stretches of an orbit in parts: where errors grow too much along one, and where quantities are held."""

from __future__ import annotations

import math

import attrs
import numpy as np

from hybrid.orbits.continuation.family import Family
from hybrid.orbits.continuation.passing import Pass
from hybrid.orbits.continuation.route import LARGEST_GROWTH, Loop, Stretch
from hybrid.orbits.held import Held

# A singular value of the scaled equations that is this share of the largest belongs to a family of orbits.
FREE = 1e-7


def growth(orbit: Pass, i: int) -> float:
    """By how much an error at the start of a stretch grows up to its end, at least 1."""
    n, scale = orbit.loop.x.shape[1], orbit.scale
    return max(1.0, float(np.linalg.norm(orbit.flows[i].slopes[:, :n] / scale[:, None] * scale, 2)))


def divided(orbit: Pass) -> tuple[Family, Loop]:
    """The same orbit with stretches along which no error grows too much."""
    numbers = [
        1 if stretch.within else max(1, math.ceil(math.log(growth(orbit, i), LARGEST_GROWTH)))
        for i, stretch in enumerate(orbit.family.route)
    ]
    return _in_parts(orbit, numbers)


def _in_parts(orbit: Pass, numbers: list[int]) -> tuple[Family, Loop]:
    """The same orbit with each stretch in so many parts, which take the same time between two jumps."""
    loop, route, n, held = orbit.loop, orbit.family.route, orbit.loop.x.shape[1], orbit.family.held
    stretches: list[Stretch] = []
    states, times, first = [], [], 0
    for i, stretch in enumerate(route):
        if not stretch.fired and i + 1 < len(route):
            continue
        count = sum(numbers[first : i + 1])
        if count == i + 1 - first:
            states.append(loop.x[first : i + 1])
            times.append(loop.times[first : i + 1])
            stretches += route[first : i + 1]
        else:
            begins = np.linspace(loop.times[first], loop.times[i + 1], count, endpoint=False)
            states.append(np.vstack([loop.x[first], *(_state_at(orbit, t) for t in begins[1:])]))
            times.append(begins)
            stretches += [attrs.evolve(route[first], fired=())] * (count - 1) + [stretch]
        first = i + 1
    if held is not None:
        held = attrs.evolve(held, stretch=sum(numbers[: held.stretch]))
    family = attrs.evolve(orbit.family, route=tuple(stretches), held=held)
    return family, Loop(
        np.concatenate(states).reshape(-1, n), np.append(np.concatenate(times), loop.times[-1]), loop.values
    )


def _state_at(orbit: Pass, t: float) -> np.ndarray:
    """The state ``(n,)`` at a time within one of the stretches."""
    times = orbit.loop.times
    i = int(np.searchsorted(times[1:-1], t, side="right"))
    share = (t - times[i]) / (times[i + 1] - times[i])
    return np.asarray(orbit.flows[i].at(np.array([share]))[0])


def holding(orbit: Pass, held: Held, sizes: np.ndarray) -> Pass:
    """The same orbit among those that hold what it keeps of some conserved quantities.

    They are taken within the longest stretch, since a formula may have a kink on a guard. A period that is
    given may decide their values: then nothing is held. ``sizes (k,)`` are units of the free parameters.
    """
    route, stays = orbit.family.route, np.diff(orbit.loop.times)
    formulas = [None if stretch.within else held.in_mode(stretch.mode) for stretch in route]
    i = max(range(len(route)), key=lambda i: -1.0 if formulas[i] is None else stays[i])
    formula = formulas[i]
    if formula is None:
        return orbit
    numbers = np.ones(len(route), dtype=int)
    numbers[i] += orbit.landings[i - 1] is not None
    family, loop = _in_parts(orbit, numbers.tolist())
    formula = attrs.evolve(formula, stretch=i + int(numbers[i]) - 1)
    found = attrs.evolve(family, held=formula).around(loop)
    if found is None or found.departure is None:
        return orbit
    slopes = found.departure[1][:, : family.n]
    share = math.sqrt(family.solver.rtol)
    kept = formula.kept(slopes, slopes, found.monodromy, found.scale, share)
    if kept is None:
        return orbit
    found = attrs.evolve(found, family=attrs.evolve(family, held=kept))
    fewer = _free(orbit, sizes) - _free(found, sizes)
    return orbit if family.forced and fewer < len(kept.values) else found


def _free(orbit: Pass, sizes: np.ndarray) -> int:
    """In how many directions there are other orbits at the same parameters."""
    values = np.linalg.svd(orbit.derivatives(sizes)[:, : -len(sizes)], compute_uv=False)
    return int(np.sum(values <= FREE * values[0]))
