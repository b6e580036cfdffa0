"""CVODE of SUNDIALS with root finding, through scikit-sundae: stop at a root, reset, start again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import sksundae

from benchmarks.peers.problem import (
    ATOL_OVER_RTOL,
    Leave,
    Problem,
    compiled,
    equations,
    limit_events,
    returning,
)
from hybrid import Answer

MOST_STEPS = 1_000_000


def methods(problem: Problem) -> dict[str, Callable[[float], Answer]]:
    """Adams and BDF formulas with root finding, and BDF without; functions compiled with numba."""
    given = equations(problem.model)
    fields = [compiled(field) for field in given.fields]
    roots = [_roots(exits) for exits in given.exits]
    resets = [[None if e.reset is None else returning(e.reset) for e in exits] for exits in given.exits]

    def stopping(formula: str) -> Callable[[float], Answer]:
        def run(rtol: float) -> Answer:
            solvers = [
                _solver(formula, rtol, field, eventsfn=found, num_events=len(exits))
                for field, found, exits in zip(fields, roots, given.exits, strict=True)
            ]
            t, end = problem.t_span
            mode, x, times = problem.first_mode, np.array(problem.x0, dtype=float), []
            while True:
                solution = solvers[mode].solve(np.array([t, end]), x)
                t, x = float(solution.t[-1]), np.array(solution.y[-1])
                if solution.status < 0:
                    raise RuntimeError(solution.message)
                if solution.i_events is None or t >= end:
                    return Answer(x, times=times)
                fired = int(np.flatnonzero(solution.i_events[-1])[0])
                times.append(t)
                limit_events(times)
                if resets[mode][fired] is not None:
                    x = resets[mode][fired](t, x)
                mode = given.exits[mode][fired].target

        return run

    made = {f"CVODE {formula}": stopping(formula) for formula in ("Adams", "BDF")}
    if problem.straight is None:
        return made
    through = compiled(equations(problem.straight).fields[0])

    def not_stopping(rtol: float) -> Answer:
        solution = _solver("BDF", rtol, through).solve(np.array(problem.t_span), problem.straight_start)
        if solution.status < 0:
            raise RuntimeError(solution.message)
        return problem.straight_answer(solution.y[-1])

    return made | {"CVODE BDF, through": not_stopping}


def _roots(exits: Sequence[Leave]) -> Any:
    values = compiled([leave.guard for leave in exits])

    def found(t: float, x: np.ndarray, out: np.ndarray) -> None:
        values(t, x, out)

    found.terminal = [True] * len(exits)  # type: ignore[attr-defined]
    found.direction = [leave.direction for leave in exits]  # type: ignore[attr-defined]
    return found


def _solver(formula: str, rtol: float, field: Any, **events: Any) -> Any:
    def fill(t: float, x: np.ndarray, out: np.ndarray) -> None:
        field(t, x, out)

    return sksundae.cvode.CVODE(
        fill, method=formula, rtol=rtol, atol=rtol * ATOL_OVER_RTOL, max_num_steps=MOST_STEPS, **events
    )
