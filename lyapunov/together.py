"""Growth rates of many runs, whose steps are taken together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from hybrid.compiler.cache.loader import load_kernels
from hybrid.kernels.types import codes
from hybrid.simulation.crew import Crew, together
from hybrid.status import StatusCode
from lyapunov.estimates import Estimates, Flight, Means

Result = TypeVar("Result")


def result_of(call: Callable[[], Result]) -> Result | Exception:
    """What a call returns, or its error."""
    try:
        return call()
    except Exception as failure:
        return failure


def alike(begun: Sequence[Flight | Exception]) -> list[list[int]]:
    """The places of the runs of each plan; errors are left out."""
    found: dict[int, list[int]] = {}
    for i, each in enumerate(begun):
        if isinstance(each, Flight):
            found.setdefault(id(each.trajectory.plan), []).append(i)
    return [*found.values()]


def means_together(estimates: Estimates, transient: int, intervals: int) -> Means:
    """``Estimates.means`` of runs whose steps are taken together."""
    first = estimates.first
    shared = together(first.compiled, first.plan, first.tangents)
    tasks = estimates.tasks
    crew = Crew(shared, first.plan, tasks, [estimates.growths] * len(tasks))
    memory, onward = crew.memory, load_kernels("lyapunov.kernels").growth_of_run
    memory.max_steps[:] = first.max_steps

    def go() -> None:
        under_way = estimates.codes == codes.DONE
        memory.codes[:] = np.where(under_way, codes.GO_ON, codes.DONE)
        crew.go(onward, first.stop)
        ended = np.where(memory.codes == codes.GO_ON, StatusCode.INTERRUPTED, memory.codes)
        np.copyto(estimates.codes, ended, where=under_way)

    return estimates.means(transient, intervals, False, go)
