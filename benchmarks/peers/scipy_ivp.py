"""SciPy: with events and restarts, as documented, or across the discontinuity without events."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.peers.problem import ATOL_OVER_RTOL, Problem, equations, returning
from hybrid import Answer

Field = Callable[[float, np.ndarray], Sequence[float]]
# A run is aborted after this many evaluations of the right-hand side, unless the caller sets a limit.
MOST_EVALUATIONS = 1_000_000


class GivenUp(Exception):
    """The run needs too many evaluations."""


class Edge(NamedTuple):
    """An exit of a mode: guard, direction, next mode, reset."""

    guard: Callable[[float, np.ndarray], float]
    direction: int
    target: int
    reset: Callable[[np.ndarray], Sequence[float]] | None = None


class Outcome(NamedTuple):
    """End state, times of events, number of evaluations, mode at the end, number of steps."""

    x: np.ndarray
    events: np.ndarray
    evaluations: int
    mode: int
    steps: int


def counted(field: Field, count: list[int], most: int) -> Field:
    def evaluate(t: float, x: np.ndarray) -> Sequence[float]:
        count[0] += 1
        if count[0] > most:
            raise GivenUp(f"more than {most} evaluations of the field")
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
    """One call without events; only the error control handles the discontinuity."""
    count = [0]
    solution = solve_ivp(counted(field, count, most_evaluations), t_span, x0, **options)
    return Outcome(solution.y[:, -1], np.array([]), count[0], 0, len(solution.t) - 1)


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
    """The documented way: a terminal event of the current mode, its reset, and a new call."""
    (t, end), x, count, times = t_span, np.array(x0, dtype=float), [0], []
    steps = 0
    while t < end and len(times) < most_events:
        events = [terminal(edge) for edge in edges[mode]]
        field = counted(fields[mode], count, most_evaluations)
        solution = solve_ivp(field, (t, end), x, events=events, **options)
        t, x = float(solution.t[-1]), solution.y[:, -1]
        steps += len(solution.t) - 1
        if solution.status != 1:
            break
        fired = next(i for i, found in enumerate(solution.t_events) if len(found))
        times.append(t)
        edge = edges[mode][fired]
        if edge.reset is not None:
            x = np.array(edge.reset(x), dtype=float)
        mode = edge.target
    return Outcome(x, np.array(times), count[0], mode, steps)


def terminal(edge: Edge) -> Any:
    def event(t: float, x: np.ndarray) -> float:
        return edge.guard(t, x)

    event.terminal, event.direction = True, edge.direction  # type: ignore[attr-defined]
    return event


WITH_EVENTS = ("RK45", "DOP853", "LSODA", "Radau")
MOST_THROUGH = 200_000
STRAIGHT = ("DOP853", "LSODA", "Radau")


def methods(problem: Problem) -> dict[str, Callable[[float], Answer]]:
    """SciPy's methods with events and restarts, and without events; functions compiled with numba."""
    given = equations(problem.model)
    fields = [returning(field) for field in given.fields]
    edges = [
        [
            Edge(
                returning([leave.guard], scalar=True),
                leave.direction,
                leave.target,
                None if leave.reset is None else at_event(returning(leave.reset)),
            )
            for leave in exits
        ]
        for exits in given.exits
    ]

    def stopping(method: str) -> Callable[[float], Answer]:
        def run(rtol: float) -> Answer:
            options = {"method": method, "rtol": rtol, "atol": rtol * ATOL_OVER_RTOL}
            start = problem.first_mode
            found = with_events(fields, edges, problem.x0, problem.t_span, mode=start, **options)
            return Answer(found.x, times=found.events, steps=found.steps)

        return run

    made = {f"SciPy {method}": stopping(method) for method in WITH_EVENTS}
    if problem.straight is None:
        return made
    through = returning(equations(problem.straight).fields[0])

    def not_stopping(method: str) -> Callable[[float], Answer]:
        def run(rtol: float) -> Answer:
            options = {"method": method, "rtol": rtol, "atol": rtol * ATOL_OVER_RTOL}
            found = straight(
                through, problem.straight_start, problem.t_span, most_evaluations=MOST_THROUGH, **options
            )
            return problem.straight_answer(found.x, steps=found.steps)

        return run

    return made | {f"SciPy {method}, through": not_stopping(method) for method in STRAIGHT}


def at_event(reset: Callable[[float, np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
    """The reset as a function of the state; resets of these problems do not depend on time."""
    return lambda x: reset(0.0, x)
