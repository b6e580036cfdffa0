"""Compares found events with the true changes of sign: missed, invented, doubled, mistimed, off zero."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from benchmarks.adversarial.interval import Enclosure
from benchmarks.adversarial.truth import Composed, Roots

EPS = np.finfo(float).eps
# An event belongs to a change of sign if closer than this, and than this part of the gap to the next change.
FARTHEST, PART = 0.02, 0.45
# Assumed error of a method's motion: multiples of the largest error seen, and of rounding.
ERRORS, ROUNDINGS = 10.0, 64.0
# A guard is zero at an event if it changes sign within this many roundings of state and time.
ZERO = 64
# Points at which the guard is evaluated between two changes of sign.
POINTS = 33


class Found(NamedTuple):
    """Events of one guard over all runs, and how each run went."""

    run: list[np.ndarray]
    time: list[np.ndarray]
    states: list[np.ndarray]
    reached: np.ndarray
    last: np.ndarray
    done: np.ndarray
    ran: np.ndarray
    # All events of the run, also of other guards: points at which the motion can be compared.
    seen: list[tuple[np.ndarray, np.ndarray, np.ndarray]]

    @classmethod
    def empty(cls, samples: int, n: int) -> Found:
        def flags() -> np.ndarray:
            return np.zeros(samples, dtype=bool)

        return cls([], [], [], np.zeros(samples), np.zeros((samples, n)), flags(), flags(), [])

    def add(self, k: int, times: np.ndarray, states: np.ndarray) -> None:
        self.run.append(np.full(len(times), k))
        self.time.append(times)
        self.states.append(states)

    def see(self, k: int, times: np.ndarray, states: np.ndarray) -> None:
        self.seen.append((np.full(len(times), k), times, states))

    def end(self, k: int, t: float, x: np.ndarray, done: bool) -> None:
        self.reached[k], self.last[k], self.done[k], self.ran[k] = t, x, done, True


class Outcome(NamedTuple):
    """Counts over the runs of a guard, and the errors of each run ``(N,)``."""

    runs: int
    crossings: int
    missed: int
    invented: int
    doubled: int
    unclear: int
    mistimed: int
    off_zero: int
    stopped: int
    sharpness: np.ndarray
    # Crossings, missed, invented and doubled of each run.
    per_run: np.ndarray
    # Errors of event times in units of the rounding error.
    errors: np.ndarray
    examples: list[tuple[int, str, float]]


def compare(composed: Composed, roots: Roots, found: Found, direction: int, sharpness: np.ndarray) -> Outcome:
    samples, n = found.last.shape
    run = np.concatenate(found.run) if found.run else np.zeros(0, dtype=int)
    time = np.concatenate(found.time) if found.time else np.zeros(0)
    states = np.concatenate(found.states) if found.states else np.zeros((0, n))
    away = distances(composed, found)
    usable = found.ran & (roots.start != 0)
    by_run = Cases(composed, roots, away, found.reached)
    per_run = np.zeros((samples, 4), dtype=int)
    unclear, examples, errors = 0, [], []
    bounds = np.searchsorted(run, np.arange(samples + 1))
    root_bounds = np.searchsorted(roots.run, np.arange(samples + 1))
    for k in np.flatnonzero(usable):
        there = slice(root_bounds[k], root_bounds[k + 1])
        times, directions = roots.time[there], roots.direction[there]
        wanted = (directions == direction) | (direction == 0)
        # Changes of sign at the very end, or after a run has stopped, are not required.
        wanted &= times < found.reached[k] * (1 - 1e-9)
        true = times[wanted]
        events = time[bounds[k] : bounds[k + 1]]
        events = events[events < found.reached[k] * (1 - 1e-9)]
        hits, invented = matched(true, events)
        per_run[k, 0] = len(true)
        index = np.flatnonzero(wanted)
        for i, (t, its) in enumerate(zip(true, hits, strict=True)):
            if len(its):
                bound = roots.error[there][index[i]]
                errors.append(min(abs(event - t) for event in its) / bound)
            if len(its) > 1:
                per_run[k, 3] += len(its) - 1
                examples.append((k, "doubled", t))
            elif not len(its):
                if by_run.shallow(k, index[i]):
                    unclear += 1
                else:
                    per_run[k, 1] += 1
                    examples.append((k, "missed", t))
        for event in invented:
            if by_run.touches(k, event):
                unclear += 1
            else:
                per_run[k, 2] += 1
                examples.append((k, "invented", event))
    keep = usable[run]
    run, time, states = run[keep], time[keep], states[keep]
    off, late = off_zero(composed, run, time, states), mistimed(composed, run, time, away)
    examples += [(int(run[i]), "off zero", float(time[i])) for i in np.flatnonzero(off)]
    examples += [(int(run[i]), "mistimed", float(time[i])) for i in np.flatnonzero(late & ~off)]
    stopped = usable & ~found.done
    examples += [(int(k), "stopped", float(found.reached[k])) for k in np.flatnonzero(stopped)]
    crossings, missed, invented_, doubled = per_run.sum(axis=0).tolist()
    return Outcome(
        int(usable.sum()), crossings, missed, invented_, doubled, unclear, int(late.sum()), int(off.sum()),
        int(stopped.sum()), sharpness[usable], per_run[usable], np.array(errors), examples,
    )  # fmt: skip


def matched(true: np.ndarray, events: np.ndarray) -> tuple[list[list[float]], list[float]]:
    """Events of each change of sign, and events that belong to no change of sign."""
    hits: list[list[float]] = [[] for _ in true]
    rest = []
    gaps = np.diff(true, prepend=-math.inf, append=math.inf)
    for event in events.tolist():
        i = int(np.argmin(np.abs(true - event))) if len(true) else -1
        if i >= 0 and abs(true[i] - event) <= min(FARTHEST, PART * gaps[i], PART * gaps[i + 1]):
            hits[i].append(event)
        else:
            rest.append(event)
    return hits, rest


def distances(composed: Composed, found: Found) -> dict[str, np.ndarray]:
    """Bound ``(N,)`` per state on the distance of each run from the motion, from the errors seen."""
    samples = len(found.last)
    everywhere = np.arange(samples)
    runs = [everywhere[found.ran], *(row[0] for row in found.seen)]
    times = [found.reached[found.ran], *(row[1] for row in found.seen)]
    states = [found.last[found.ran], *(row[2] for row in found.seen)]
    run, time, state = np.concatenate(runs), np.concatenate(times), np.concatenate(states)
    exact = composed.states(run, time)
    away = {}
    for place, name in enumerate(composed.names):
        largest, size = np.zeros(samples), np.zeros(samples)
        np.maximum.at(largest, run, np.abs(state[:, place] - exact[name]))
        size = amplitude(composed, name, samples, float(found.reached.max()))
        away[name] = ERRORS * largest + ROUNDINGS * EPS * size
    return away


def amplitude(composed: Composed, name: str, samples: int, end: float) -> np.ndarray:
    """Largest size of a state over each run, ``(N,)``."""
    everywhere, size = np.arange(samples), np.zeros(samples)
    for t in np.linspace(0.0, end, POINTS):
        size = np.maximum(size, np.abs(composed.states(everywhere, np.full(samples, t))[name]))
    return size


class Cases:
    """Decides which differences the errors of the motion can explain."""

    def __init__(
        self, composed: Composed, roots: Roots, away: dict[str, np.ndarray], reached: np.ndarray
    ) -> None:
        self.composed, self.roots, self.away, self.reached = composed, roots, away, reached
        self.bounds = np.searchsorted(roots.run, np.arange(len(reached) + 1))

    def shallow(self, k: int, place: int) -> bool:
        """Whether the guard is within the error of the motion on one side of a change of sign."""
        times = self.roots.time[self.bounds[k] : self.bounds[k + 1]]
        edges = np.concatenate([[0.0], times, [self.reached[k]]])
        return any(self._hidden(k, np.linspace(edges[i], edges[i + 1], POINTS)) for i in (place, place + 1))

    def touches(self, k: int, event: float) -> bool:
        """Whether the guard is zero at the event within the error of the motion."""
        times = self.roots.time[self.bounds[k] : self.bounds[k + 1]]
        if len(times):
            nearest = int(np.argmin(np.abs(times - event)))
            if abs(times[nearest] - event) < 1e-9:
                return self.shallow(k, nearest)
        return self._hidden(k, np.array([event]))

    def _hidden(self, k: int, times: np.ndarray) -> bool:
        run = np.full(len(times), k)
        away = {name: values[run] for name, values in self.away.items()}
        return bool((self.composed.near(run, times, 4, away).sign == 0).all())


def mistimed(
    composed: Composed, run: np.ndarray, time: np.ndarray, away: dict[str, np.ndarray]
) -> np.ndarray:
    """Events at whose time the guard is not zero for any state within the error of the true motion."""
    if not len(run):
        return np.zeros(0, dtype=bool)
    near = composed.near(run, time, 4, {name: values[run] for name, values in away.items()})
    return np.broadcast_to(near.sign != 0, run.shape)


def off_zero(composed: Composed, run: np.ndarray, time: np.ndarray, states: np.ndarray) -> np.ndarray:
    """Events at whose reported state the guard is not zero to rounding."""
    if not len(run):
        return np.zeros(0, dtype=bool)
    samples = int(run.max()) + 1
    t = around(time, ZERO * EPS * np.abs(time))
    x: dict[str, Any] = {}
    for place, name in enumerate(composed.names):
        size = amplitude(composed, name, samples, float(time.max()))[run]
        x[name] = around(states[:, place], ZERO * EPS * (np.abs(states[:, place]) + size))
    p = SimpleNamespace(**{name: values[run] for name, values in composed.parameters.items()})
    with np.errstate(invalid="ignore"):
        value = composed.guard.on_enclosures(t, SimpleNamespace(**x), p)
    return np.broadcast_to(value.sign != 0, run.shape)


def around(a: np.ndarray, distance: np.ndarray) -> Enclosure:
    return Enclosure(a - distance, a + distance)
