"""Piecewise-affine Filippov systems solved slowly and plainly: a reference for other implementations.

The state is ``x`` in R^n. The switches are ``h_k(x) = a_k . x - c_k``. Each sign pattern of the switches has
its own affine field ``A x + b``. In an open cell the flow is a matrix exponential. On a set ``Z`` of surfaces
the orbit slides along the field that is multilinear in ``u`` in ``[-1, 1]^Z`` and keeps each ``h_i`` at zero.
For one surface this is Filippov's convex combination. For two it is the bilinear interpolation of Alexander
and Seidman. For switches that enter the field linearly it is Utkin's equivalent control.

Of several solutions ``u`` the stable one counts, for which ``(-1)^|Z| det(dh'/du) > 0``. For one surface this
says that both fields push towards it. For more surfaces it is necessary for attraction, but not sufficient.
The orbit leaves a surface where its ``|u_i|`` reaches one.

At an event the next mode is found by brute force: each surface that the orbit is on may be left to either
side or slid along, and the orbit goes on only if exactly one of these assignments is consistent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.polynomial.polynomial import polyval
from scipy.integrate import DOP853
from scipy.optimize import brentq, minimize_scalar

MARGINAL = 1e-7  # A condition that holds or fails by less than this fraction of its scale is not decided.
TOGETHER = 1e-9  # Events closer than this in time count as one degenerate event.
FRESH = 1e-5  # An orbit that returns this soon to a surface it has just left counts as grazing.
WINDOW = 0.2  # Longest search for events in an open cell.
TERMS = 22  # Of the exponential series, whose argument has at most norm one.
STEP = 0.1  # Longest step of the integration along surfaces.
Mode = tuple[int, ...]  # One of -1, 0, +1 for each switch; 0 means sliding.


@dataclass(frozen=True)
class System:
    """Table of affine fields; index 0 of a switch's axis is its negative side, index 1 the positive one."""

    normals: np.ndarray  # (m, n): the vectors a_k
    offsets: np.ndarray  # (m,): the numbers c_k
    matrices: np.ndarray  # (2,) * m + (n, n)
    constants: np.ndarray  # (2,) * m + (n,)
    additive: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None  # A, b, C of A x + b + C sign(h)

    def heights(self, x: np.ndarray) -> np.ndarray:
        """The values ``h_k`` for one state or for an array of states."""
        return x @ self.normals.T - self.offsets

    def field(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """The field that is multilinear in the values ``u`` of the switches."""
        return _Surface(self, (0,) * len(self.offsets)).field(x, np.asarray(u, float))


@dataclass
class Run:
    """What `solve` returns. The states are NaN at sample times that the orbit did not reach."""

    status: str  # "ended", "undecided", "grazing", "too many events"
    t: float
    x: np.ndarray
    times: list[float]  # of events
    modes: list[Mode]  # one more than events
    states: np.ndarray  # (number of samples, n)


class _Halt(Exception):
    """The orbit cannot be followed further; the argument is the status."""


class _Surface:
    """The intersection of the surfaces on which a mode slides, and the fields of the cells around it."""

    def __init__(self, system: System, mode: Mode) -> None:
        index = tuple(slice(None) if s == 0 else (s + 1) // 2 for s in mode)
        n = system.normals.shape[1]
        self.system, self.mode = system, mode
        self.sliding = [k for k, s in enumerate(mode) if s == 0]
        self.sides = [k for k, s in enumerate(mode) if s != 0]
        self.matrices = system.matrices[index].reshape(-1, n, n)
        self.constants = system.constants[index].reshape(-1, n)
        self.signs = np.array(list(product((-1, 1), repeat=len(self.sliding))))
        count = range(len(self.sliding))
        self.others = np.array([[j for j in count if j != i] for i in count], int)  # Row i: all but i.
        self.normals = system.normals[self.sliding]
        self.guess = np.zeros(len(self.sliding))

    def vertices(self, x: np.ndarray) -> np.ndarray:
        return self.matrices @ x + self.constants

    def field(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.prod((1 + self.signs * u) / 2, axis=1) @ self.vertices(x)

    def speed(self, x: np.ndarray) -> float:
        return np.linalg.norm(self.vertices(x), axis=1).max()

    def equivalent(self, x: np.ndarray) -> np.ndarray:
        """The stable ``u`` near the last one."""
        rates = self.vertices(x) @ self.normals.T
        if len(self.sliding) == 1:
            minus, plus = rates[:, 0]
            if minus <= plus:
                raise _Halt("undecided")
            alpha = minus / (minus - plus)
            return np.array([2 * alpha - 1])
        u = self.newton(rates, self.guess)
        if u is None or self.stability(rates, u) <= 0:
            raise _Halt("undecided")
        return u

    def jacobian(self, rates: np.ndarray, u: np.ndarray) -> np.ndarray:
        """The derivative of the rates ``h'`` by ``u``."""
        factors = (1 + self.signs * u) / 2
        return rates.T @ (self.signs / 2 * np.prod(factors[:, self.others], axis=2))

    def stability(self, rates: np.ndarray, u: np.ndarray) -> float:
        return (-1) ** len(u) * np.linalg.det(self.jacobian(rates, u))

    def newton(self, rates: np.ndarray, u: np.ndarray) -> np.ndarray | None:
        """A zero of the multilinear rates, which are given at the vertices."""
        for _ in range(40):
            residual = np.prod((1 + self.signs * u) / 2, axis=1) @ rates
            try:
                step = np.linalg.solve(self.jacobian(rates, u), residual)
            except np.linalg.LinAlgError:
                return None
            u = u - step
            if np.abs(step).max() < 1e-8:  # The error is of the order of the step's square.
                return u
            if np.abs(u).max() > 1e3:
                return None
        return None

    def zeros(self, rates: np.ndarray, previous: np.ndarray) -> list[np.ndarray]:
        """All zeros that Newton's method finds from the centre, the previous ``u`` and each half diagonal."""
        if not self.sliding:
            return [np.zeros(0)]
        found: list[np.ndarray] = []
        for start in (0 * previous, previous, *(self.signs / 2)):
            u = self.newton(rates, start)
            if u is not None and all(np.abs(u - v).max() > 1e-9 for v in found):
                found.append(u)
        return found

    def margins(self, x: np.ndarray) -> np.ndarray:
        """What stays positive in the mode: distances to the surfaces beside it, then 1 + u and 1 - u."""
        heights = self.system.heights(x)[..., self.sides] * [self.mode[k] for k in self.sides]
        if not self.sliding:
            return heights
        u = np.array([self.equivalent(y) for y in np.atleast_2d(x)]).reshape(*x.shape[:-1], -1)
        return np.concatenate([heights, 1 + u, 1 - u], axis=-1)

    def meaning(self, index: int) -> tuple[int, int]:
        """The switch of one margin, and the side to which sliding on it ends; 0 if its surface is reached."""
        count = len(self.sides)
        if index < count:
            return self.sides[index], 0
        side = -1 if index < count + len(self.sliding) else 1
        return self.sliding[(index - count) % len(self.sliding)], side


def solve(system: System, x0, t1: float, samples=(), mode: Mode | None = None, max_events: int = 200) -> Run:
    """Follow the orbit from ``x0`` over ``0 <= t <= t1``; ``mode`` decides where several are consistent."""
    x, samples = np.array(x0, float), np.asarray(samples, float)
    run = Run("ended", 0.0, x, [], [], np.full((len(samples), len(x)), np.nan))
    on = np.flatnonzero(np.abs(system.heights(x)) <= 1e-12 * np.linalg.norm(system.normals, axis=1))
    outside = tuple(np.sign(system.heights(x)).astype(int))
    try:
        start = np.zeros(len(outside))
        here, u = (mode, start) if mode else _decide(system, x, outside, list(on), start, None)
        run.modes.append(here)
        fresh = [k for k in on if here[k]]
        while True:
            surface = _Surface(system, here)
            surface.guess = u[surface.sliding]
            event = _until_event(surface, run, t1, samples, fresh)
            if event is None:
                return run
            k, side = event
            on = sorted({*surface.sliding, k})
            u = np.array(here, float)
            u[surface.sliding] = np.clip(surface.guess, -1, 1)
            normals = system.normals[on]
            run.x = run.x - np.linalg.lstsq(normals, normals @ run.x - system.offsets[on])[0]
            here, u = _decide(system, run.x, here, on, u, event if side else None)
            if len(run.times) >= max_events:
                raise _Halt("too many events")
            run.times.append(run.t)
            run.modes.append(here)
            fresh = [k for k in on if here[k]]
    except _Halt as halt:
        run.status = halt.args[0]
        return run


def _decide(system, x, mode, on, previous, leaving) -> tuple[Mode, np.ndarray]:
    """The only consistent mode, with its ``u``, of an orbit on the surfaces ``on``.

    ``leaving`` is the switch and the side of a sliding that has just ended: then sliding on all surfaces is
    excluded, and the surface is left to that side with a speed that grows from zero.
    """
    everything = _Surface(system, tuple(0 if k in on else s for k, s in enumerate(mode)))
    scales = np.linalg.norm(system.normals, axis=1) * everything.speed(x) + 1e-300
    consistent = []
    for choice in product((-1, 0, 1), repeat=len(on)):
        if leaving and not any(choice):
            continue
        candidate = np.array(mode)
        candidate[on] = choice
        surface = _Surface(system, tuple(candidate.tolist()))
        rates = surface.vertices(x) @ surface.normals.T / scales[surface.sliding]
        first_order = leaving and choice == tuple(leaving[1] if k == leaving[0] else 0 for k in on)
        for u in surface.zeros(rates, previous[surface.sliding]):
            speeds = system.normals @ surface.field(x, u) / scales
            conditions = [s * speeds[k] for k, s in zip(on, choice, strict=True) if s and not first_order]
            if surface.sliding:
                conditions += [*(1 - np.abs(u)), surface.stability(rates, u)]
            worst = min(conditions, default=1.0)
            if abs(worst) < MARGINAL:
                raise _Halt("grazing")
            if worst > 0:
                full = candidate.astype(float)
                full[surface.sliding] = u
                consistent.append((surface.mode, full))
    if len(consistent) != 1:
        raise _Halt("undecided")
    return consistent[0]


def _until_event(surface, run, t1, samples, fresh) -> tuple[int, int] | None:
    """Follow one mode to its end; ``fresh`` are the switches whose surfaces it has just left."""
    began = run.t
    windows = _slide(surface, began, run.x, t1) if surface.sliding else _cell(surface, began, run.x)
    new = [surface.sides.index(k) for k in fresh]
    for t, flow, grid, states in windows:
        event = _first(lambda tau: surface.margins(flow(tau)), grid, surface.margins(states), new, began - t)  # noqa: B023
        tau = grid[-1] if event is None else event[0]
        last = min(t + tau, t1)
        for i in np.flatnonzero((samples >= t) & (samples <= last)):
            run.states[i] = flow(samples[i] - t)
        run.t, run.x = last, flow(last - t)
        if surface.sliding:
            surface.guess = surface.equivalent(run.x)
        if t + tau >= t1:
            return None
        if event is not None:
            _, index, touch = event
            k, side = surface.meaning(index)
            after, before = (surface.margins(flow(tau + delta)) for delta in (FRESH, -FRESH))
            slope = (before - after)[index] / (2 * FRESH)
            speed = 1.0 if side else np.linalg.norm(surface.system.normals[k]) * surface.speed(run.x)
            others = np.delete(surface.margins(flow(tau + TOGETHER)), index)
            together = run.t - began < TOGETHER or others.min(initial=1.0) <= 0
            if touch or together or slope < MARGINAL * speed:
                raise _Halt("grazing")
            return k, side
    return None


def _grid(length: float, count: int) -> np.ndarray:
    """Times from 0 to ``length``, close together at the ends so that a minimum there is seen.

    One comes just after `FRESH`, where an orbit that has left a surface is first looked for on it again.
    """
    grid = length * np.concatenate([[0, 1e-4], np.arange(1, count) / count, [1 - 1e-4, 1]])
    return np.unique(np.append(grid, 1.01 * FRESH)) if length > 1.01 * FRESH else grid


def _cell(surface: _Surface, t: float, x: np.ndarray) -> Iterator[tuple]:
    """Windows of the exact flow in an open cell: start, flow, times and states for the search of events.

    The exponential series of the augmented matrix is summed until its terms are far below the rounding.
    """
    n = len(x)
    generator = np.zeros((n + 1, n + 1))
    generator[:n, :n], generator[:n, n] = surface.matrices[0], surface.constants[0]
    length = min(WINDOW, 1 / (np.linalg.norm(generator, 2) + 1e-300))
    grid = _grid(length, 32)
    while True:
        terms = [np.append(x, 1.0)]
        for order in range(1, TERMS):
            terms.append(generator @ terms[-1] / order)
        series = np.array(terms)[:, :n]
        flow = lambda tau, series=series: polyval(tau, series).T  # noqa: E731
        yield t, flow, grid, flow(grid)
        t, x = t + length, flow(length)


def _slide(surface: _Surface, t: float, x: np.ndarray, t1: float) -> Iterator[tuple]:
    """The same for sliding, one window for each step; steps shrink where the equivalent ``u`` is lost."""
    longest = STEP
    field = lambda _, y: surface.field(y, surface.equivalent(y))  # noqa: E731
    make = lambda: DOP853(field, t, x, t1, longest, rtol=1e-12, atol=1e-13)  # noqa: E731
    solver = make()
    while solver.status == "running":
        try:
            solver.step()
        except _Halt:
            longest /= 8
            if longest < 1e-6:
                raise
            solver = make()
            continue
        if solver.status == "failed":
            raise _Halt("undecided")
        grid, dense = _grid(solver.t - t, 8), solver.dense_output()
        yield t, lambda tau, t=t, dense=dense: dense(t + tau), grid, dense(t + grid).T
        t, x = solver.t, solver.y


def _first(margins: Callable, grid, values, new, began) -> tuple[float, int, bool] | None:
    """The first zero of any margin in a window: its time, the margin's index, and whether it only touches."""
    found = []
    for q, column in enumerate(values.T):
        one = lambda tau, q=q: margins(tau)[q]  # noqa: E731
        start = np.searchsorted(grid, began + FRESH) if q in new else 0
        if start == len(grid):
            continue
        if column[start] <= 0:
            found.append((grid[start], q, True))
            continue
        negative = np.flatnonzero(column[start:] <= 0)
        stop = start + negative[0] if len(negative) else len(grid) - 1
        if len(negative):
            found.append((brentq(one, grid[stop - 1], grid[stop], xtol=1e-15), q, False))
        before, inner, after = (
            column[start : stop - 1],
            column[start + 1 : stop],
            column[start + 2 : stop + 1],
        )
        low = (inner <= before) & (inner <= after) & (inner < np.ptp(column))
        for i in start + 1 + np.flatnonzero(low):
            bounds = grid[i - 1], grid[i + 1]
            best = minimize_scalar(one, bounds=bounds, method="bounded", options={"xatol": 1e-9})
            if best.fun <= 0:
                found.append((brentq(one, grid[i - 1], best.x, xtol=1e-15), q, False))
            elif best.fun < MARGINAL * np.ptp(column):
                found.append((best.x, q, True))
    return min(found, default=None)


def random_system(rng: np.random.Generator, n: int, m: int, kind: str, attraction: float = 0.5) -> System:
    """A random table; each surface attracts orbits, on average over the cells, with chance ``attraction``.

    Of kind ``"additive"`` the field is ``A x + b + C sign(h)``. Of kind ``"general"`` each cell moreover has
    its own perturbation of ``A`` and ``b``. Orbits from near the origin stay small over five time units.
    """
    if kind not in ("additive", "general"):
        raise ValueError(f"kind is {kind!r}; it must be 'additive' or 'general'.")
    normals = rng.normal(size=(m, n))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets = 0.3 * rng.normal(size=m)
    A, b = rng.normal(size=(n, n)) / np.sqrt(n), 0.4 * rng.normal(size=n)
    A += rng.uniform(0.0, 2.0) * (A - A.T)  # Rotation, so that orbits meet surfaces again and leave sliding.
    A += (rng.uniform(-0.8, 0.0) - np.linalg.eigvals(A).real.max()) * np.eye(n)
    pull = np.where(rng.random(m) < attraction, -1, 1) * rng.uniform(0.5, 1.5, size=m)
    C = 0.4 * rng.normal(size=(n, m))
    C += normals.T * (pull - np.sum(normals.T * C, axis=0))
    signs = np.moveaxis(np.array(np.meshgrid(*[[-1.0, 1.0]] * m, indexing="ij")), 0, -1)
    matrices, constants = np.broadcast_to(A, (2,) * m + (n, n)), b + signs @ C.T
    if kind == "additive":
        return System(normals, offsets, matrices, constants, (A, b, C))
    matrices = matrices + 0.3 * rng.normal(size=matrices.shape) / np.sqrt(n)
    return System(normals, offsets, matrices, constants + 0.3 * rng.normal(size=constants.shape))


def as_function(system: System) -> Callable:
    """The field as ``f(t, x, p)`` on scalars, with ``np.sign(h)`` or nested ``np.where(h > 0, ...)``."""
    m, n = system.normals.shape
    heights = np.column_stack([system.normals, -system.offsets]).tolist()

    def affine(row, x):
        return sum(row[j] * x[j] for j in range(n)) + row[n]

    def nested(table, h, x, i):
        if not h:
            return affine(table[i], x)
        return np.where(h[0] > 0, nested(table[1], h[1:], x, i), nested(table[0], h[1:], x, i))

    if system.additive:
        rows = np.column_stack(system.additive[:2]).tolist()
        jumps = system.additive[2].tolist()

        def field(t, x, p):
            s = [np.sign(affine(row, x)) for row in heights]
            return [affine(rows[i], x) + sum(jumps[i][k] * s[k] for k in range(m)) for i in range(n)]

    else:
        cells = np.concatenate([system.matrices, system.constants[..., None]], axis=-1).tolist()

        def field(t, x, p):
            h = [affine(row, x) for row in heights]
            return [nested(cells, h, x, i) for i in range(n)]

    return field
