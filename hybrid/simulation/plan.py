"""What all runs of a system by one solver have in common: method, kernels, layouts of memory."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, lru_cache, partial
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compiler.cache.loader import LIMITS, Absent, is_kept, load_kernels
from hybrid.compiler.compiled import CompiledSystem
from hybrid.errors import ArgumentError
from hybrid.kernels.types import codes
from hybrid.kernels.types.layout import Attempts, Method, Parts, Task
from hybrid.simulation.memory import MOST_LAYOUTS, Memory, no_record, run_layout, work_layout
from hybrid.solvers import Solver, Taylor
from hybrid.solvers.tableau import SERIES_NODES, SERIES_WEIGHTS
from hybrid.status import StatusCode
from hybrid.system.ticking import put_ticks

DEFAULT_SOLVER = Taylor()
# Memories that are kept for later: those of a crew for each of a few threads.
MOST_MEMORIES = 256


def check_solver(solver: object) -> Solver:
    """The solver, or the default one; ArgumentError for anything else."""
    if solver is None:
        return DEFAULT_SOLVER
    if isinstance(solver, Solver) and hasattr(solver, "tableau"):
        return solver
    raise ArgumentError(
        f"solver must be a solver object; got {arguments.shown(solver)}. "
        "Write for instance hybrid.DOP853(rtol=1e-8)."
    )


@attrs.define(eq=False)
class Plan:
    """What all runs of a system by a solver, with so many tangent vectors, have in common.

    ``advance`` is the driver. ``parts_so_far`` are ``parts`` without those that few runs call and that are
    not compiled yet. ``task`` keeps no record and lacks only what a run has for itself. ``model`` is that at
    the default parameters, see ``CompiledSystem.moved_by``. ``propagators`` says how each mode is advanced,
    by the name of the mode; ``degree`` is that of the steps in a record. ``by_steps`` is the mode that is
    advanced by steps of the solver, although it has a series.
    """

    method: Any
    advance: Any
    parts_so_far: Any
    task: Any
    model: Any
    propagators: dict[str, str]
    degree: int
    run_layout: Any
    work_layout: Any
    put_ticks: Callable[..., None] | None = None
    by_steps: int | None = None
    spares: list[Memory] = attrs.field(factory=list, init=False)
    # What crews of the plan have in common, once it is known (``crew``).
    together: list[Any] = attrs.field(factory=list, init=False)

    def memory(self) -> Memory:
        """The memory for a run."""
        try:
            return self.spares.pop()
        except IndexError:
            return Memory(self)

    def take_back(self, memory: Memory) -> None:
        """Keep the memory of a run that nobody can advance or look at any more."""
        if len(self.spares) < MOST_MEMORIES:
            self.spares.append(memory)

    @property
    def parts(self) -> Any:
        """All pieces that the driver may call; those that are not compiled yet are compiled now."""
        if not self.parts_so_far.complete:
            self.parts_so_far = completed(self.parts_so_far)
        return self.parts_so_far

    def called(self, call: Callable[[Any], Any], *memory: Any) -> int:
        """The code that ``call(parts)`` returns: first with the parts so far, with all if it needs them.

        ``memory`` are the structures and arrays that the call changes. They are put back before the second
        call, so that it does the same to the last bit. The code is INTERRUPTED if Ctrl-C comes while the
        missing parts are compiled.
        """
        if self.parts_so_far.complete:
            return int(call(self.parts_so_far))
        before = [each.copy() if isinstance(each, np.ndarray) else each.saved() for each in memory]
        code = int(call(self.parts_so_far))
        if code != codes.INCOMPLETE:
            return code
        for each, held in zip(memory, before, strict=True):
            if isinstance(each, np.ndarray):
                each[...] = held
            else:
                each.restore(held)
        try:
            parts = self.parts
        except KeyboardInterrupt:
            return StatusCode.INTERRUPTED
        return int(call(parts))


def plan_of(compiled: CompiledSystem, solver: Solver, tangents: int, by_steps: int | None = None) -> Plan:
    """The plan of a run, made once; kernels that the run needs are loaded.

    The mode ``by_steps`` is advanced by steps of the solver's Runge-Kutta method, even if it has a series.
    """
    plan = compiled.plans.get((solver, tangents, by_steps))
    if plan is None:
        system = compiled.system
        load_kernels("hybrid.kernels.runs.initial_mode")
        n, modes, transitions = system.dimension, len(system.modes), len(system.transitions)
        kinds = propagator_kinds(compiled, solver, tangents)
        if by_steps is not None:
            kinds[by_steps] = codes.RUNGE_KUTTA
        method = kernel_method(solver, any(kind != codes.RUNGE_KUTTA for kind in kinds))
        emitted = compiled.emitted
        parts, attempts = driver_parts(
            solver.attempt,
            steps=compiled.takes_steps(kinds),
            forced=bool(emitted.forcing_component),
            tangents=tangents > 0,
            abrupt=tangents > 0 and any(emitted.abrupt),
            timed=compiled.is_timed,
        )
        model = compiled.moved_by(compiled.moving(kinds, tangents), np.array(kinds, dtype=np.int64))
        columns, rows = compiled.series_columns(tangents), compiled.emitted.programs.longest
        guards = int(np.diff(model.first_outgoing).max(initial=0))
        plan = Plan(
            method,
            load_kernels().advance,
            completed(parts) if is_kept(LIMITS) else parts,
            _task(attempts, model, method, tangents),
            model,
            {name: codes.PROPAGATORS[kind] for name, kind in zip(system.mode_names, kinds, strict=True)},
            dense_degree(compiled, method, kinds),
            run_layout(n, tangents, modes, transitions, system.first_tick[-1]),
            work_layout(method, n, tangents, guards, columns, rows),
            partial(put_ticks, system) if system.first_tick[-1] else None,
            by_steps,
        )
        while len(compiled.plans) >= MOST_LAYOUTS:
            compiled.plans.pop(next(iter(compiled.plans)), None)
        compiled.plans[solver, tangents, by_steps] = plan
    return plan


def _task(attempts: Any, model: Any, method: Any, tangents: int) -> Any:
    """What the driver works on, without the memory of any run."""
    return Task(
        attempts=attempts,
        model=model,
        method=method,
        run=Absent(),
        record=no_record(model.dimension),
        work=Absent(),
        tangents=tangents,
        orthonormal=0,
    )


@lru_cache(MOST_LAYOUTS)
def kernel_method(solver: Solver, series: bool) -> Any:
    """The kernel's view of a solver: tableau and tolerances; with ``series``, some modes have series."""
    tableau = solver.tableau
    return Method(
        a=tableau.a,
        b=tableau.b,
        c=tableau.c,
        error=tableau.error,
        second_error=tableau.second_error,
        quadrature=tableau.quadrature,
        interpolant=tableau.interpolant,
        powers=tableau.powers,
        nodes=tableau.nodes,
        series_nodes=SERIES_NODES,
        series_weights=SERIES_WEIGHTS,
        implicit=int(tableau.implicit),
        order=solver.series_order if series else 0,
        exponent=1.0 / tableau.error_order,
        rtol=solver.rtol,
        atol=solver.atol,
        max_step=solver.max_step,
    )


@cache
def driver_parts(
    attempt: tuple[str, str],
    *,
    steps: bool,
    forced: bool,
    tangents: bool,
    abrupt: bool,
    timed: bool,
) -> tuple[Any, Any]:
    """The pieces that the driver is handed first; what the run does not need is not loaded.

    Whether some mode takes steps of the solver's method ``attempt``, some rate depends on time alone, the run
    has tangent vectors, some field may change abruptly below them, and something in the system depends on
    time.
    """

    def needed(asked: bool, load: Callable[[], Any]) -> Any:
        return load() if asked else Absent()

    def late() -> Any:
        return load_kernels("hybrid.kernels.steps.field.late")

    def forcing() -> Any:
        return load_kernels("hybrid.kernels.steps.field.explained")

    jumps, corners = load_kernels("hybrid.kernels.jumps.jump"), load_kernels("hybrid.kernels.jumps.corner")
    module, name = attempt
    if steps:
        step = load_kernels("hybrid.kernels.steps.runge_kutta").runge_kutta_step
    else:
        step = load_kernels("hybrid.kernels.steps.step").no_step
    parts = Parts(
        runge_kutta_step=step,
        enter=corners.enter,
        rests_on_guard=corners.rests_on_guard,
        arrived=corners.arrived,
        keep_apart=needed(tangents, lambda: load_kernels("hybrid.kernels.arithmetic.tangent").keep_apart),
        look_back=needed(abrupt, lambda: load_kernels("hybrid.kernels.steps.field.jumps").look_back),
        late_step=needed(timed, lambda: late().late_step),
        late_jump=needed(timed, lambda: late().late_jump),
        jump=jumps.jump,
        jump_plainly=load_kernels("hybrid.kernels.jumps.plain").jump_plainly,
        finish_chatter=Absent(),
        complete=0,
        rest=jumps.rest,
        first_in_order=corners.first_in_order,
    )
    attempts = Attempts(
        attempt_implicit=vars(load_kernels(module))[name],
        explained_step=needed(forced, lambda: forcing().explained_step),
        explained_attempt=needed(forced, lambda: forcing().explained_attempt),
        follows_attempt=needed(forced, lambda: forcing().follows_attempt),
        explained_series=needed(forced, lambda: forcing().explained_series),
        crossing_on_path=load_kernels("hybrid.kernels.guards.isolate").crossing_on_path,
    )
    return parts, attempts


@cache
def completed(parts: Any) -> Any:
    """The pieces with those that few runs call."""
    return parts.replace(finish_chatter=load_kernels(LIMITS).finish_chatter, complete=1)


def propagator_kinds(compiled: CompiledSystem, solver: Solver, tangents: int) -> list[int]:
    """How each mode is advanced: by its series if the solver prefers them, or tangent vectors need them."""
    return [
        each.kind if solver.by_series or (tangents > 0 and compiled.needs_series(mode)) else codes.RUNGE_KUTTA
        for mode, each in enumerate(compiled.emitted.propagators)
    ]


def dense_degree(compiled: CompiledSystem, method: Any, kinds: list[int]) -> int:
    """Degree of the polynomials that a record of steps holds, for propagators of these kinds."""

    def degree_of(kind: int, of_solutions: int) -> int:
        if kind == codes.RUNGE_KUTTA:
            return len(method.interpolant) - 1
        return of_solutions or (codes.HIGHEST_ORDER if kind == codes.EXACT else method.order)

    modes = compiled.emitted.propagators
    degrees = [degree_of(kind, each.degree) for kind, each in zip(kinds, modes, strict=True)]
    return max(degrees + [degree_of(codes.RUNGE_KUTTA, 0)] * compiled.takes_steps(kinds))
