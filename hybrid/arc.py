"""Solutions over hybrid time: smooth pieces joined by jumps (Goebel, Sanfelice and Teel 2012)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import comb
from typing import Any, overload

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid.errors import ArgumentError
from hybrid.status import Status
from hybrid.system import HybridSystem

# In the order of the kernel's codes.
KINDS = ("transverse", "grazing", "limit")


@attrs.frozen(eq=False)
class Jump:
    """One fired transition at hybrid time ``(t, j)``.

    Attributes
    ----------
    t, j
        Time, and the number of jumps before this one.
    transition, source, target
        Names of the transition and of the modes before and after; ``target`` is None where it ended the run.
    x_minus, x_plus
        States ``(n,)`` before and after.
    saltation
        Saltation matrix ``(n, n)``: what the jump does to tangent vectors, to first order. Where a jump sets
        off others at once, by landing beyond their guards, their time is that of its own guard: the product
        of the matrices is then the tangent map of all of them, if those before the last can be inverted.
    transversality
        ``D_t g + D_x g f_minus``, the guard's speed at the crossing; near zero the crossing grazes and the
        saltation matrix grows without bound, unless the jump was set off by another.
    """

    t: float
    j: int
    transition: str
    source: str
    target: str | None
    x_minus: np.ndarray
    x_plus: np.ndarray
    saltation: np.ndarray
    transversality: float
    kind: str


@attrs.frozen(eq=False)
class Grazing:
    """A guard that comes closer to zero than the tolerances can tell, and turns back: a touch, not a jump.

    Attributes
    ----------
    t, j
        Time, and the number of jumps before.
    transition
        Name of the transition that did not fire.
    x
        State ``(n,)``.
    value, acceleration
        The guard and its second derivative along the flow there; its speed is zero.
    """

    t: float
    j: int
    transition: str
    x: np.ndarray
    value: float
    acceleration: float


@attrs.frozen(eq=False, repr=False)
class Jumps(Sequence[Jump]):
    """The jumps of an arc in order, each made when looked at; the arrays hold all of them.

    Attributes
    ----------
    t, transversality
        ``(jumps,)``.
    transition
        ``(jumps,)`` indices into the system's transitions.
    kind
        ``(jumps,)`` indices into ``KINDS``.
    x_minus, x_plus
        ``(jumps, n)``.
    saltation
        ``(jumps, n, n)``, as in :class:`Jump`.
    """

    system: HybridSystem
    t: np.ndarray
    transversality: np.ndarray
    transition: np.ndarray
    kind: np.ndarray
    x_minus: np.ndarray
    x_plus: np.ndarray
    saltation: np.ndarray

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        return f"<{len(self)} jumps>"

    @overload
    def __getitem__(self, index: int) -> Jump: ...
    @overload
    def __getitem__(self, index: slice) -> list[Jump]: ...
    def __getitem__(self, index: int | slice) -> Jump | list[Jump]:
        if isinstance(index, slice):
            return [self._jump(i) for i in range(*index.indices(len(self)))]
        if not -len(self) <= index < len(self):
            raise IndexError(f"jump {index} of an arc with {len(self)} jumps")
        return self._jump(index % len(self))

    def __iter__(self) -> Iterator[Jump]:
        return (self._jump(i) for i in range(len(self)))

    def _jump(self, i: int) -> Jump:
        transition = self.system.transitions[self.transition[i]]
        kind = KINDS[self.kind[i]]
        target = transition.accumulates_to if kind == "limit" else transition.target
        return Jump(
            float(self.t[i]),
            i,
            transition.name,
            transition.source,
            target or transition.target,
            self.x_minus[i],
            self.x_plus[i],
            self.saltation[i],
            float(self.transversality[i]),
            kind,
        )


@attrs.frozen(eq=False)
class Pieces:
    """The smooth steps of a run: ``S`` polynomials in Bernstein form.

    Attributes
    ----------
    t, h
        Start and length of each step, ``(S,)``.
    mode, j
        Mode index and jump count of each, ``(S,)``.
    coefficients
        ``(S, d + 1, n + 1)`` of the state and, last, of the time since the start of the step. The variable
        of a desingularised mode is not proportional to time.
    """

    t: np.ndarray
    h: np.ndarray
    mode: np.ndarray
    j: np.ndarray
    coefficients: np.ndarray

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States ``(len(times), n)`` and the index of the step each was taken from; at a jump, after it."""
        index = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, None)
        coefficients = self.coefficients[index]
        theta = _places(coefficients[:, :, -1], times - self.t[index], self.h[index])
        return bernstein_values(coefficients[:, :, :-1], theta), index


def bernstein_values(coefficients: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Values ``(N, ...)`` of polynomials ``(N, d + 1, ...)`` at one place of ``[0, 1]`` each."""
    degree = coefficients.shape[1] - 1
    theta = theta.reshape(-1, *[1] * (coefficients.ndim - 2))
    total, power, rest = np.zeros_like(coefficients[:, 0]), np.ones_like(theta), 1.0 - theta
    # Of the form of Horner's rule, with the binomials along the way; all terms of one sign stay so.
    for j in range(degree + 1):
        total = total * rest + comb(degree, j) * power * coefficients[:, j]
        power = power * theta
    return total


def _places(clock: np.ndarray, since: np.ndarray, span: np.ndarray) -> np.ndarray:
    """Place on ``[0, 1]`` where each clock ``(N, d + 1)`` shows the time ``since`` the start of its step."""
    theta = np.clip(since / span, 0.0, 1.0)
    degree = clock.shape[1] - 1
    even = np.arange(degree + 1) / degree
    uneven = np.flatnonzero(np.max(np.abs(clock - span[:, None] * even), axis=1) > 1e-12 * span)
    if not uneven.size:
        return theta
    clock, since = clock[uneven], since[uneven]
    low, high = np.zeros(uneven.size), np.ones(uneven.size)
    place, slopes = theta[uneven], degree * np.diff(clock, axis=1)
    for _ in range(60):
        misfit = bernstein_values(clock, place) - since
        low, high = np.where(misfit <= 0.0, place, low), np.where(misfit >= 0.0, place, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = place - misfit / bernstein_values(slopes, place)
        newton = np.where((newton >= low) & (newton <= high), newton, 0.5 * (low + high))
        moved, place = np.max(np.abs(newton - place)), newton
        if moved <= 1e-16:
            break
    theta[uneven] = place
    return theta


@attrs.frozen(eq=False, repr=False)
class HybridArc:
    """A solution over hybrid time ``(t, j)``.

    Without ``samples`` the points are the solver's own: both sides of every jump and the ends of every step.
    With ``samples`` they are the states at those times, at a jump the state after it.

    Attributes
    ----------
    system, parameters
        The model and the parameter values ``(m,)`` of the run.
    t, j, x, mode
        Times ``(N,)``, jump counts ``(N,)``, states ``(N, n)``, mode names ``(N,)``.
    jumps
        Sequence of :class:`Jump`.
    grazings
        Each :class:`Grazing`, in order.
    status
        How the run ended; what was computed is here even where it ended early.
    fundamental
        ``(n, k)`` tangent vectors at the end, carried by the variational equation and the saltation matrices,
        if they were asked for.
    propagators
        How each mode was advanced, by its name: ``"exact"``, ``"Taylor series"``, ``"Taylor series,
        desingularised"`` or ``"Runge-Kutta pair"``. Where every mode is exact no crossing was missed that
        rounding does not hide.
    steps, rejected
        Steps tried, and how many of them the error control rejected.
    """

    system: HybridSystem
    parameters: np.ndarray
    t: np.ndarray
    j: np.ndarray
    x: np.ndarray
    mode: np.ndarray
    jumps: Jumps
    grazings: tuple[Grazing, ...]
    status: Status
    fundamental: np.ndarray | None
    propagators: dict[str, str]
    steps: int
    rejected: int
    _pieces: Pieces | None = attrs.field(alias="pieces")

    def __repr__(self) -> str:
        span = f"t = {self.t[0]:.6g} to {self.t[-1]:.6g}" if len(self.t) else "no points"
        return f"<HybridArc {span}, {len(self.jumps)} jumps, {self.status.code.name}>"

    def __call__(self, t: ArrayLike) -> np.ndarray:
        """State at time ``t``, a scalar or an array, from the dense output: ``t.shape + (n,)``.

        At the time of a jump this is the state after it.

        Raises
        ------
        ArgumentError
            If a time lies outside the run, or the run kept samples only.
        """
        times = np.asarray(t, dtype=float)
        if self._pieces is None:
            raise ArgumentError(
                "This arc keeps samples only. Run simulate without samples= for dense output."
            )
        if times.size and not (times.min() >= self.t[0] and times.max() <= self.t[-1]):
            raise ArgumentError(
                f"t must lie in the run, [{self.t[0]}, {self.t[-1]}]; got {times.min()} to {times.max()}."
            )
        flat = times.ravel()
        if len(self._pieces.t) == 0:
            return np.broadcast_to(self.x[-1], (*times.shape, self.system.dimension)).copy()
        states, index = self._pieces.at(flat)
        # A step ends at its jump: what lies at or after the last of them is the end of the run.
        states[(flat >= self.t[-1]) & (self._pieces.j[index] < self.j[-1])] = self.x[-1]
        return states.reshape(*times.shape, self.system.dimension)


def hybrid_points(
    system: HybridSystem, pieces: Pieces, jumps: Jumps, end: tuple[float, np.ndarray, int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Times, jump counts, states, mode indices in order: step starts, states before jumps, the end."""
    t_end, x_end, mode_end = end
    last = [t_end], [len(jumps)], [x_end], [mode_end]
    starts = pieces.t, pieces.j, pieces.coefficients[:, 0, :-1], pieces.mode
    if not len(jumps):
        t, j, x, mode = join([starts, last])
        return t, j, x, mode
    sources = np.array([system.mode_index(tr.source) for tr in system.transitions], dtype=np.int64)
    before = jumps.t, np.arange(len(jumps)), jumps.x_minus, sources[jumps.transition]
    t, j, x, mode = join([starts, before, last])
    kind = np.repeat([0, 1, 1], [len(pieces.t), len(jumps), 1])
    order = np.lexsort((kind, j))
    return t[order], j[order], x[order], mode[order]


def join(chunks: list[tuple[Any, ...]]) -> tuple[np.ndarray, ...]:
    """Concatenate the columns of rows of arrays."""
    if len(chunks) == 1:
        return chunks[0]
    return tuple(np.concatenate(column) for column in zip(*chunks, strict=True))
