"""Growth rates of many runs, whose steps are taken together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeVar

from hybrid.compiler.cache.loader import load_kernels
from hybrid.kernels.types import codes
from hybrid.simulation.crew import Crew, together
from hybrid.status import StatusCode
from lyapunov.interval import growth_of
from lyapunov.spectrum import INTERVALS_AT_ONCE, Estimate, Means

Result = TypeVar("Result")


def result_of(call: Callable[[], Result]) -> Result | Exception:
    """What a call returns, or its error."""
    try:
        return call()
    except Exception as failure:
        return failure


def alike(estimates: Sequence[Estimate | Exception]) -> list[dict[int, Estimate]]:
    """The estimates of each plan, by their places; errors are left out."""
    found: dict[int, dict[int, Estimate]] = {}
    for i, each in enumerate(estimates):
        if isinstance(each, Estimate):
            found.setdefault(id(each.trajectory.plan), {})[i] = each
    return [*found.values()]


def means_together(estimates: Sequence[Estimate], transient: int, intervals: int) -> list[Means | Exception]:
    """``Estimate.run`` for many runs of one plan; an error stands in the place of its run."""
    first = estimates[0].trajectory
    shared = together(first.compiled, first.plan, first.tangents)
    found: list[Any] = [None] * len(estimates)
    work = [each.rounds(transient, intervals, False) for each in estimates]
    rooms = min(INTERVALS_AT_ONCE, max(transient, intervals))
    growths = [growth_of(each.end, each.sums, each.interval, rooms, each.columns) for each in estimates]
    crew = Crew(shared, first.plan, [each.task for each in estimates], growths)
    memory, onward = crew.memory, load_kernels("lyapunov.kernels").growth_of_run
    memory.max_steps[:] = [each.trajectory.max_steps for each in estimates]
    asked: dict[int, Any] = {}
    for i, each in enumerate(work):
        go_on(i, partial(next, each), asked, found)
    while asked:
        memory.codes[:] = codes.DONE
        for i, rates in asked.items():
            memory.codes[i], memory.max_jumps[i] = codes.GO_ON, estimates[i].trajectory.jumps
            growths[i].done, growths[i].count = 0, len(rates)
        crew.go(onward, first.stop)
        for i, rates in list(asked.items()):
            growth, code = growths[i], int(memory.codes[i])
            done = int(growth.done)
            rates[:done] = growth.rates[:done]
            code = StatusCode.INTERRUPTED if code == codes.GO_ON else code
            del asked[i]
            go_on(i, partial(work[i].send, (done, code)), asked, found)
    return found


def go_on(i: int, more: Callable[[], Any], asked: dict[int, Any], found: list[Any]) -> None:
    """Take what run ``i`` asks for next, or what it has found; its error is its own, the others go on."""
    try:
        asked[i] = more()
    except StopIteration as end:
        found[i] = end.value
    except Exception as failure:
        found[i] = failure
