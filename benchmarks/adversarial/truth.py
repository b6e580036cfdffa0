"""All changes of sign of a guard along a known motion, proved by interval arithmetic.

The guard and its derivative in time are bounded over pieces of the run. A piece is cut until it holds no zero
or one simple zero, or until it is as short as a point. Many runs of one guard are computed at once: a run is
an index into the arrays of parameters.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from benchmarks.adversarial.interval import FUNCTIONS, Enclosure, down, up

# Number of initial pieces of a run, and place of a cut: not at the middle.
PIECES, CUT = 16, 0.4871
# A piece of this many units in the last place is a point.
SMALLEST = 4
# A guard has no sign on a piece if it stays within this many roundings of zero.
UNRESOLVED = 32
BISECTIONS = 64
# Largest number of pieces computed at once, to limit memory.
CHUNK = 200_000


class Roots(NamedTuple):
    """Changes of sign, sorted by run and time, and touches: intervals with an unknown sign."""

    run: np.ndarray
    time: np.ndarray
    # Effect of rounding on the time.
    error: np.ndarray
    direction: np.ndarray
    touch_run: np.ndarray
    touch: np.ndarray
    # Sign at the start of each run, 0 if it is uncertain.
    start: np.ndarray


class Scalar:
    """A guard or one state of a motion as text, compiled for numbers and for enclosures."""

    def __init__(self, text: str) -> None:
        self.text = text
        code = compile(f"lambda t, x, p: {text}", "<guard>", "eval")
        self.on_numbers = eval(code, {"np": np})
        self.on_enclosures = eval(code, {"np": FUNCTIONS})


class Composed:
    """A guard along a motion, as a function of time and of the index of a run."""

    def __init__(
        self, guard: Scalar, names: tuple[str, ...], motion: list[Scalar], parameters: dict[str, np.ndarray]
    ) -> None:
        self.guard, self.names, self.motion, self.parameters = guard, names, motion, parameters

    def _parameters(self, run: np.ndarray) -> SimpleNamespace:
        return SimpleNamespace(**{name: values[run] for name, values in self.parameters.items()})

    def over(self, run: np.ndarray, low: np.ndarray, high: np.ndarray) -> Enclosure:
        """Bounds of value and derivative over intervals of time."""
        p = self._parameters(run)
        t = Enclosure(low, high, np.ones_like(low), np.ones_like(low))
        x = {name: part.on_enclosures(t, None, p) for name, part in zip(self.names, self.motion, strict=True)}
        with np.errstate(invalid="ignore"):
            return self.guard.on_enclosures(t, SimpleNamespace(**x), p)

    def near(self, run: np.ndarray, time: np.ndarray, ulps: float, away: dict[str, np.ndarray]) -> Enclosure:
        """Bounds of the guard over states within ``away`` of the motion and times within ``ulps`` ulps."""
        p = self._parameters(run)
        t = Enclosure(time - ulps * np.spacing(np.abs(time)), time + ulps * np.spacing(np.abs(time)))
        x = {}
        for name, part in zip(self.names, self.motion, strict=True):
            value = part.on_enclosures(t, None, p)
            x[name] = Enclosure(value.low - away[name], value.high + away[name])
        with np.errstate(invalid="ignore"):
            return self.guard.on_enclosures(t, SimpleNamespace(**x), p)

    def states(self, run: np.ndarray, time: np.ndarray) -> dict[str, np.ndarray]:
        p = self._parameters(run)
        return {
            name: part.on_numbers(time, None, p) + 0.0 * time
            for name, part in zip(self.names, self.motion, strict=True)
        }

    def value(self, run: np.ndarray, time: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            x = SimpleNamespace(**self.states(run, time))
            return self.guard.on_numbers(time, x, self._parameters(run)) + 0.0 * time


def all_roots(composed: Composed, start: float, end: float, runs: int) -> Roots:
    """All changes of sign of a guard on runs ``0`` to ``runs - 1``."""
    edges = start + (end - start) * np.linspace(0.0, 1.0, PIECES + 1)
    run = np.repeat(np.arange(runs), PIECES)
    work = [(run, np.tile(edges[:-1], runs), np.tile(edges[1:], runs))]
    brackets: list[tuple[np.ndarray, ...]] = []
    points: list[tuple[np.ndarray, ...]] = []
    while work:
        run, low, high = work.pop()
        if len(run) > CHUNK:
            half = len(run) // 2
            work += [(run[:half], low[:half], high[:half]), (run[half:], low[half:], high[half:])]
            continue
        value = full(composed.over(run, low, high), low)
        open_ = value.sign == 0
        run, low, high = run[open_], low[open_], high[open_]
        value, tiny = sharpened(composed, run, low, high, picked(value, open_))
        open_ = value.sign == 0
        steep = np.flatnonzero(open_ & ((value.slope_low > 0) | (value.slope_high < 0)))
        first, last = np.zeros((2, len(run)))
        for signs, ends in ((first, low), (last, high)):
            signs[steep] = full(composed.over(run[steep], ends[steep], ends[steep]), ends[steep]).sign
        simple = (first != 0) & (last != 0)
        crossed = simple & (first != last)
        brackets.append((run[crossed], low[crossed], high[crossed], last[crossed]))
        point = open_ & ~simple & (tiny | (high - low <= SMALLEST * np.spacing(np.abs(high))))
        points.append((run[point], low[point], high[point]))
        again = open_ & ~simple & ~point
        if again.any():
            run, low, high = run[again], low[again], high[again]
            middle = low + CUT * (high - low)
            work.append(
                (np.concatenate([run, run]), np.concatenate([low, middle]), np.concatenate([middle, high]))
            )
    simple_roots = bisected(composed, *columns(brackets, 4))
    point_roots, touches = gathered(composed, *columns(points, 3), start, end)
    found = [np.concatenate(pair) for pair in zip(simple_roots, point_roots, strict=True)]
    order = np.lexsort((found[1], found[0]))
    everywhere = np.arange(runs)
    at_start = composed.over(everywhere, np.full(runs, start), np.full(runs, start)).sign
    return Roots(*(column[order] for column in found), *touches, np.broadcast_to(at_start, runs))


def columns(rows: list[tuple[np.ndarray, ...]], count: int) -> list[np.ndarray]:
    return [np.concatenate([row[i] for row in rows]) for i in range(count)]


def picked(a: Enclosure, which: np.ndarray) -> Enclosure:
    return Enclosure(a.low[which], a.high[which], a.slope_low[which], a.slope_high[which])


def sharpened(
    composed: Composed, run: np.ndarray, low: np.ndarray, high: np.ndarray, value: Enclosure
) -> tuple[Enclosure, np.ndarray]:
    """Bounds over pieces, tightened by the mean value form, and whether the guard is zero to rounding."""
    middle = low + 0.5 * (high - low)
    half = up(0.5 * (high - low))
    with np.errstate(invalid="ignore", over="ignore"):
        reach = up(np.maximum(np.abs(value.slope_low), np.abs(value.slope_high)) * half)
    # The mean value form needs a bounded derivative.
    smooth = np.flatnonzero(np.isfinite(reach))
    tiny = np.zeros(len(run), dtype=bool)
    thin = full(composed.over(run[smooth], middle[smooth], middle[smooth]), middle[smooth])
    value.low[smooth] = np.maximum(value.low[smooth], down(thin.low - reach[smooth]))
    value.high[smooth] = np.minimum(value.high[smooth], up(thin.high + reach[smooth]))
    largest = np.maximum(np.abs(value.low[smooth]), np.abs(value.high[smooth]))
    tiny[smooth] = largest <= UNRESOLVED * (thin.high - thin.low)
    return value, tiny


def full(a: Enclosure, like: np.ndarray) -> Enclosure:
    """All four bounds as separate arrays, with infinite bounds in place of undefined values."""

    def bound(values: Any, undefined: float) -> np.ndarray:
        values = np.array(np.broadcast_to(values, like.shape), dtype=float)
        return np.where(np.isnan(values), undefined, values)

    return Enclosure(
        bound(a.low, -np.inf),
        bound(a.high, np.inf),
        bound(a.slope_low, -np.inf),
        bound(a.slope_high, np.inf),
    )


def bisected(
    composed: Composed, run: np.ndarray, low: np.ndarray, high: np.ndarray, last: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Simple roots, to rounding."""
    low, high = low.copy(), high.copy()
    for _ in range(BISECTIONS):
        middle = low + 0.5 * (high - low)
        beyond = np.sign(composed.value(run, middle)) == last
        high = np.where(beyond, middle, high)
        low = np.where(beyond, low, middle)
    time = high
    thin = full(composed.over(run, time, time), time)
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = np.minimum(np.abs(thin.slope_low), np.abs(thin.slope_high))
        error = np.where(speed > 0, (thin.high - thin.low) / speed, 0.0)
    return run, time, error + 2 * np.spacing(np.abs(time)), last


def gathered(
    composed: Composed, run: np.ndarray, low: np.ndarray, high: np.ndarray, start: float, end: float
) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, np.ndarray]]:
    """Merge adjacent points into a change of sign or a touch."""
    order = np.lexsort((low, run))
    run, low, high = run[order], low[order], high[order]
    begins = np.ones(len(run), dtype=bool)
    begins[1:] = (run[1:] != run[:-1]) | (low[1:] > up(high[:-1], SMALLEST))
    index = np.flatnonzero(begins)
    run, low = run[index], low[index]
    high = np.maximum.reduceat(high, index) if len(index) else high[:0]
    first = full(composed.over(run, low, low), low).sign
    last = full(composed.over(run, high, high), low).sign
    step = np.spacing(np.maximum(np.abs(low), np.abs(high)))
    # Move the ends outwards until their signs are certain, at most 16 times.
    for _ in range(16):
        low = np.where(first == 0, np.maximum(low - step, start), low)
        high = np.where(last == 0, np.minimum(high + step, end), high)
        first = full(composed.over(run, low, low), low).sign
        last = full(composed.over(run, high, high), low).sign
        step = step * 2
    crossed = (first != 0) & (last != 0) & (first != last)
    time = 0.5 * (low + high)
    roots = (
        run[crossed],
        time[crossed],
        (0.5 * (high - low))[crossed] + 2 * np.spacing(np.abs(time[crossed])),
    )
    rest = ~crossed
    return (*roots, last[crossed]), (run[rest], np.column_stack([low[rest], high[rest]]))
