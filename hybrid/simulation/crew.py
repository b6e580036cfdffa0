"""Runs of one plan that are advanced together: steps of several at once, each proved by itself.

What a run finds does not depend, to the last bit, on the runs beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from time import perf_counter
from typing import Any

import attrs
import numpy as np

from hybrid.compiler.cache.loader import Absent, load_kernels
from hybrid.compiler.compiled import CompiledSystem
from hybrid.compiler.parts import ABREAST_SERIES, ABREAST_TANGENT_SERIES
from hybrid.compiler.statements.code import LoweringError
from hybrid.kernels.types import codes
from hybrid.kernels.types.abreast import DEGREE, LANE_NUMBERS, PER_GUARD, Abreast
from hybrid.kernels.types.abreast import Crew as Memory
from hybrid.kernels.types.structure import Layout
from hybrid.simulation.memory import MOST_LAYOUTS

# Rows of the series behind the last order; columns are read four at a time.
ROWS_OF_END, SPARE_COLUMNS = 5, 3
# A guard that is zero at the start is divided by its variable: it has a power more.
POWERS = DEGREE + 2
# Steps after which a run leaves its lane, so that Python hears of it; and in which tangent vectors that are
# kept orthonormal may come too close.
LONGEST_STAY = 256
APART = {codes.EXACT: codes.STEPS_IN_EXACT, codes.DESINGULARISED: codes.STEPS_IN_CONTACT}
# Runs that are advanced together: enough that lanes are full.
TOGETHER = 3 * codes.ABREAST
# Steps of the first burst of a crew, and seconds of the others.
FIRST_BURST, SECONDS = 4096, 0.02


@attrs.frozen(eq=False)
class Together:
    """What the crews of a plan have in common.

    Attributes
    ----------
    series
        The compiled series.
    able
        By mode: whether its steps may be taken abreast.
    longest
        By mode: steps after which a run leaves its lane, and the same for tangent vectors that are kept
        orthonormal.
    parameters
        How many parameters the model has.
    layout
        Of the memory in which steps are taken.
    """

    series: Any
    able: np.ndarray
    longest: tuple[np.ndarray, np.ndarray]
    parameters: int
    layout: Layout


def together(compiled: CompiledSystem, plan: Any, tangents: int) -> Together:
    """What the crews of a plan have in common."""
    if not plan.together:
        plan.together.append(_together(compiled, plan, tangents))
    found: Together = plan.together[0]
    return found


def _together(compiled: CompiledSystem, plan: Any, tangents: int) -> Together:
    system, emitted = compiled.system, compiled.emitted
    able = [
        each.abreast is not None
        and kind == each.kind
        and not emitted.is_fragile(mode)
        and not (tangents > 0 and emitted.abrupt[mode])
        for mode, (each, kind) in enumerate(zip(emitted.propagators, plan.model.propagator, strict=True))
    ]
    series: Any = Absent()
    # The cases of a system that grows are compiled one by one, as a run needs them.
    able = [each and system.growth is None for each in able]
    if any(able):
        try:
            [series] = compiled.functions(ABREAST_TANGENT_SERIES if tangents else ABREAST_SERIES).values()
        except LoweringError:
            able = [False] * len(able)
    strides = [0 if each.abreast is None else each.abreast.tangent_columns for each in emitted.propagators]
    sources = [each.source for each in system.transitions]
    guards = max(sources.count(name) for name in system.mode_names)
    n = system.dimension
    columns = emitted.tangent_start_abreast + tangents * max(strides) + SPARE_COLUMNS
    width, length = codes.ABREAST, n * (1 + tangents)
    entries = length + len(system.parameters) + LANE_NUMBERS + n + PER_GUARD * guards
    shapes = {
        "counters": (3,),
        "powers": (codes.HIGHEST_ORDER + ROWS_OF_END + guards, max(columns, n + 2) * width),
        "lanes": (len(system.modes), entries * width),
        "weights": (length * width,),
        "polynomial": (POWERS * width,),
        "moved": (POWERS * width,),
        "ends": (width,),
        "stops": (2 * width,),
        "fired": (width,),
    }
    able_of = np.array(able, dtype=np.int64)
    layout = Layout(
        Abreast,
        shapes,
        series=series,
        able=able_of,
        tangent_start=emitted.tangent_start_abreast,
        tangent_columns=np.array(strides, dtype=np.int64),
    )
    kinds = [each.kind for each in emitted.propagators]
    apart = [APART.get(kind, 1) if tangents > 1 else codes.STEPS_ALONE for kind in kinds]
    longest = np.full(len(kinds), LONGEST_STAY), np.array(apart)
    return Together(series, able_of, longest, len(system.parameters), layout)


@lru_cache(MOST_LAYOUTS)
def crew_layout(runs: int, modes: int) -> Layout:
    """Where the arrays of a crew lie."""
    shapes: dict[str, tuple[int, ...]] = dict.fromkeys(
        ("tasks", "jobs", "cycles", "phases", "max_steps", "max_jumps", "codes", "refused", "clocks"), (runs,)
    )
    shapes |= {
        "counters": (5,),
        "longest": (modes,),
        "rooms": (runs, 4),
        "waiting": (modes + 1, runs),
        "counts": (modes + 1,),
        "heads": (modes + 1,),
        "aboard": (modes, codes.ABREAST),
    }
    return Layout(Memory, shapes)


def berths(plan: Any, model: Any, count: int, origin: np.ndarray, t0: float, horizon: float = 0.0) -> Any:
    """Memories of a plan, each at the start of a run from ``origin``; the phase there."""
    found = [plan.memory() for _ in range(count)]
    phases = [each.begin(model, origin, None, t0, horizon) for each in found]
    return found, phases[0]


class Crew:
    """Runs that are advanced together.

    Parameters
    ----------
    shared, plan
        What all have in common.
    tasks
        Those of runs of the plan, each with memory of its own.
    jobs
        What belongs to each run, for the kernel that says what it does next.
    """

    def __init__(self, shared: Together, plan: Any, tasks: Sequence[Any], jobs: Sequence[Any] = ()) -> None:
        # The structures stay where they are: the kernels know their addresses.
        self.plan, self.tasks, self.jobs = plan, tasks, jobs
        self.sea = shared.layout.zeros()
        memory = self.memory = crew_layout(len(tasks), len(shared.able)).zeros()
        memory.tasks[:] = [each.address for each in tasks]
        memory.jobs[: len(jobs)] = [each.address for each in jobs]
        memory.max_steps[:] = memory.max_jumps[:] = codes.UNLIMITED
        memory.aboard[:] = -1
        memory.longest[:] = shared.longest[int(tasks[0].orthonormal != 0)]
        memory.parameters = shared.parameters

    def go(self, onward: Any, stop: Any) -> bool:
        """Advance the runs whose code is GO_ON until all are over; False if they were asked to stop before.

        Where Python looks for a stop has no influence on what is computed.
        """
        memory, steps = self.memory, FIRST_BURST
        memory.begun = memory.steps = memory.alone = 0
        kernel, advance = load_kernels("hybrid.kernels.abreast.pool").advance_abreast, load_kernels().advance
        while True:
            begin = perf_counter()
            memory.budget = memory.steps + memory.alone + steps
            if kernel(advance, self.plan.parts, self.sea, memory, onward) == codes.DONE:
                return True
            if stop.is_set():
                return False
            seconds = perf_counter() - begin
            steps = max(1, int(steps * min(2.0, SECONDS / max(seconds, 1e-6))))
