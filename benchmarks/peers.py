"""How these problems are solved today with SciPy: events and restarts, straight through, smoothed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

Field = Callable[[float, np.ndarray], Sequence[float]]
# More right-hand sides than this and the run is given up, if the caller has no other limit.
MOST_EVALUATIONS = 1_000_000


class GivenUp(Exception):
    """A run that would take too long to be worth a point."""


class Edge(NamedTuple):
    """Where a mode is left: guard, direction, mode that follows, reset."""

    guard: Callable[[float, np.ndarray], float]
    direction: int
    target: int
    reset: Callable[[np.ndarray], Sequence[float]] | None = None


class Outcome(NamedTuple):
    """End state, times of events, right-hand sides evaluated; whether a restart failed to move on."""

    x: np.ndarray
    events: np.ndarray
    evaluations: int
    mode: int


def counted(field: Field, count: list[int], most: int) -> Field:
    def evaluate(t: float, x: np.ndarray) -> Sequence[float]:
        count[0] += 1
        if count[0] > most:
            raise GivenUp
        return field(t, x)

    return evaluate


def straight(
    field: Field,
    x0: Sequence[float],
    t_span: tuple[float, float],
    *,
    most_evaluations: int = MOST_EVALUATIONS,
    **options: Any,
) -> Outcome:
    """One call, no events: the error control is left to cope with the discontinuity."""
    count = [0]
    solution = solve_ivp(counted(field, count, most_evaluations), t_span, x0, **options)
    return Outcome(solution.y[:, -1], np.array([]), count[0], 0)


def with_events(
    fields: Sequence[Field],
    edges: Sequence[Sequence[Edge]],
    x0: Sequence[float],
    t_span: tuple[float, float],
    *,
    mode: int = 0,
    most_events: int = 100_000,
    most_evaluations: int = MOST_EVALUATIONS,
    **options: Any,
) -> Outcome:
    """Terminal events of the current mode, its reset, and a new call from there: the documented way."""
    (t, end), x, count, times = t_span, np.array(x0, dtype=float), [0], []
    while t < end and len(times) < most_events:
        events = [terminal(edge) for edge in edges[mode]]
        field = counted(fields[mode], count, most_evaluations)
        solution = solve_ivp(field, (t, end), x, events=events, **options)
        t, x = float(solution.t[-1]), solution.y[:, -1]
        if solution.status != 1:
            break
        fired = next(i for i, found in enumerate(solution.t_events) if len(found))
        times.append(t)
        edge = edges[mode][fired]
        if edge.reset is not None:
            x = np.array(edge.reset(x), dtype=float)
        mode = edge.target
    return Outcome(x, np.array(times), count[0], mode)


def terminal(edge: Edge) -> Any:
    def event(t: float, x: np.ndarray) -> float:
        return edge.guard(t, x)

    event.terminal, event.direction = True, edge.direction  # type: ignore[attr-defined]
    return event
