"""One run of one method: its seconds and its errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import arguments
from hybrid.accuracy.answer import Answer, as_answer, errors_of
from hybrid.errors import ArgumentError
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.simulate import simulate
from hybrid.solvers import Solver
from hybrid.status import StatusCode
from hybrid.system.graph import HybridSystem

# Short runs are repeated for this many seconds: the first ones depend on what ran before them.
SETTLED = 0.05

MOST_REPEATS = 1000


Method = Solver | Callable[[float], Any]


@attrs.frozen
class TableRow:
    """A row of the table: the errors of one method at one tolerance, by quantity, and what it took."""

    method: str
    tolerance: float
    errors: Mapping[str, float] = attrs.Factory(dict)
    seconds: float = np.nan
    compile_seconds: float = np.nan
    steps: float = np.nan
    events: float = np.nan
    status: str = "SUCCESS"


def runner(name: str, method: Method, *problem: Any) -> Callable[[float], Any]:
    """The method as a function of the tolerance."""
    if isinstance(method, Solver):
        ratio = method.atol / method.rtol
        return lambda rtol: own_answer(attrs.evolve(method, rtol=rtol, atol=rtol * ratio), *problem)
    if isinstance(method, type) or not callable(method):
        raise ArgumentError(
            f"Method {arguments.shown(name)} must be a solver, Taylor() say, or a function of the tolerance; "
            f"got {arguments.shown(method)}."
        )
    return method


def own_answer(
    solver: Solver,
    system: HybridSystem,
    x0: ArrayLike,
    t_span: tuple[float, float],
    mode: str | None,
    parameters: Mapping[str, float] | None,
    tangent: bool,
) -> HybridArc:
    """The run of one of the library's solvers; Ctrl-C ends the whole comparison."""
    arc = simulate(
        system,
        x0,
        t_span,
        mode=mode,
        parameters=parameters,
        solver=solver,
        tangent=tangent,
        samples=[t_span[1]],
        keep_jumps=True,
    )
    if arc.status.code == StatusCode.INTERRUPTED:
        raise KeyboardInterrupt
    return arc


def check_clock(clock: object) -> None:
    """Whether a function tells the time as a number."""
    wanted = "be a function without arguments that returns seconds"
    if not callable(clock) or isinstance(clock, type):
        raise arguments.refusal("clock", wanted, clock)
    try:
        told = clock()
    except Exception as error:
        raise arguments.refusal("clock", wanted, clock) from error
    arguments.number("clock: the time returned", told)


def measured(
    name: str,
    run: Callable[[float], Any],
    tolerance: float,
    truth: Answer,
    shape: tuple[int, float],
    repeats: int,
    longest: float,
    clock: Callable[[], float],
) -> TableRow:
    """Run a method several times and compare its answer with the truth.

    ``shape`` is the dimension of the state and the length of the run. A run is repeated unless it takes
    longer than ``longest`` seconds, and the median counts.
    """

    def timed() -> tuple[Any, float]:
        start = clock()
        result = run(tolerance)
        seconds = clock() - start
        own = result.seconds if isinstance(result, Answer) else None
        return result, seconds if own is None else own

    first, begin = float("nan"), clock()
    # If the first run fails, so does the second, which tells how long that takes without compiling.
    try:
        with suppress(Exception):
            first = timed()[1]
        begin = clock()
        result, seconds = timed()
        times = [seconds]
        most = repeats if repeats == 1 else max(repeats, MOST_REPEATS)
        while len(times) < most and times[-1] <= longest:
            if len(times) >= repeats and sum(times) >= SETTLED:
                break
            times.append(timed()[1])
    except ArgumentError:
        raise
    except KeyboardInterrupt:
        return TableRow(name, tolerance, seconds=clock() - begin, status=StatusCode.INTERRUPTED.name)
    except Exception as error:  # another package's failure is a result of the comparison
        said = f"{type(error).__name__}: {error}".strip().splitlines()[0]
        return TableRow(name, tolerance, seconds=clock() - begin, status=said)
    answer = as_answer(f"Method {name!r}: what it returns", result, *shape)
    seconds = float(np.median(times))
    return TableRow(
        method=name,
        tolerance=tolerance,
        errors=errors_of(answer, truth),
        seconds=seconds,
        compile_seconds=max(first - seconds, 0.0),
        steps=np.nan if answer.steps is None else answer.steps,
        events=np.nan if answer.times is None else len(answer.times),
        status=result.status.code.name if isinstance(result, HybridArc) else "SUCCESS",
    )
