"""One trajectory in the hands of the kernels: its state, its scratch memory, and how to take it further."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache, lru_cache
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compile import CompiledSystem, compile_system
from hybrid.ending import status_of
from hybrid.errors import ArgumentError
from hybrid.first_mode import choose_mode
from hybrid.interrupt import CTRL_C, FIRST_BURST, Bursts, Stop
from hybrid.kernels import codes
from hybrid.load import Absent, address, entry, load_kernels
from hybrid.periods import check_time, split_time
from hybrid.solvers import RungeKutta, Taylor
from hybrid.solvers.tableau import SERIES_NODES, SERIES_WEIGHTS
from hybrid.status import Status
from hybrid.system import HybridSystem

# Deep enough for intervals halved down to rounding.
ISOLATION_DEPTH = 64
# Transitions remembered in the order in which they fired: enough to see which go round without end. A power
# of two.
RECENT = 64
# Solvers, and shapes of memory, that are kept for the next run.
MOST_LAYOUTS = 64
UNLIMITED = np.iinfo(np.int64).max
DEFAULT_SOLVER = Taylor()


@lru_cache(MOST_LAYOUTS)
def kernel_method(solver: RungeKutta) -> Any:
    """The kernel's view of a solver: tableau and tolerances."""
    from hybrid.kernels.layout import Method

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
        order=solver.order if isinstance(solver, Taylor) else 0,
        exponent=1.0 / tableau.error_order,
        rtol=solver.rtol,
        atol=solver.atol,
        max_step=solver.max_step,
    )


@cache
def driver_parts(series_only: bool, implicit: bool, forced: bool) -> Any:
    """The pieces that the driver is handed; what the run does not need is not loaded."""
    from hybrid.kernels.layout import Attempts, Parts

    jumps, corners = load_kernels("hybrid.kernels.jump"), load_kernels("hybrid.kernels.corner")
    if implicit:
        attempt = load_kernels("hybrid.kernels.radau").attempt_radau
    else:
        attempt = load_kernels("hybrid.kernels.step").no_attempt
    if series_only and not forced:
        step = load_kernels("hybrid.kernels.step").no_step
    else:
        step = load_kernels("hybrid.kernels.runge_kutta").runge_kutta_step
    explained_step, explained_series = Absent(), Absent()
    if forced:
        forcing = load_kernels("hybrid.kernels.forcing")
        explained_step, explained_series = map(address, (forcing.explained_step, forcing.explained_series))
    return Parts(
        attempts=Attempts(
            attempt_implicit=address(attempt),
            explained_step=explained_step,
            explained_series=explained_series,
        ),
        runge_kutta_step=address(step),
        enter=address(corners.enter),
        jump=address(jumps.jump),
        finish_chatter=address(jumps.finish_chatter),
        rest=address(jumps.rest),
        first_in_order=address(corners.first_in_order),
    )


def propagator_kinds(compiled: CompiledSystem, solver: RungeKutta) -> list[int]:
    """How each mode is advanced: only Taylor takes series from the model."""
    modes = compiled.emitted.propagators
    return [each.kind for each in modes] if isinstance(solver, Taylor) else [codes.RUNGE_KUTTA] * len(modes)


def dense_degree(compiled: CompiledSystem, method: Any, kinds: list[int]) -> int:
    """Degree of the polynomials that a record of steps holds, for propagators of these kinds."""

    def degree_of(kind: int, of_solutions: int) -> int:
        if kind == codes.RUNGE_KUTTA:
            return len(method.interpolant) - 1
        return of_solutions or (codes.HIGHEST_ORDER if kind == codes.EXACT else method.order)

    modes = compiled.emitted.propagators
    return max(degree_of(kind, each.degree) for kind, each in zip(kinds, modes, strict=True))


def workspace(method: Any, dimension: int, tangents: int, columns: int, rows: int = 0) -> Any:
    """Scratch memory for one run; ``columns`` are those of series, ``rows`` those of the guards' programs."""
    return _fresh_work(work_layout(method, dimension, tangents, columns, rows), method)


def _fresh_work(layout: Any, method: Any) -> Any:
    """Scratch memory that knows nothing of another run."""
    work = layout.zeros()
    if method.implicit:
        # There is no last step whose polynomial could be a guess.
        work.systems[-1] = -1.0
    return work


@lru_cache(MOST_LAYOUTS)
def work_layout(method: Any, dimension: int, tangents: int, columns: int, rows: int) -> Any:
    """Where the arrays of a workspace lie."""
    from hybrid.kernels.lanes import whole_registers
    from hybrid.kernels.layout import Work
    from hybrid.kernels.structure import Layout

    n, length = dimension, dimension * (1 + tangents)
    stages, degree = len(method.a), len(method.interpolant) - 1
    coupled = len(method.b) if method.implicit else 0
    # Whole vectors of columns are evaluated: there may be a few more than are in use.
    width_of_series = whole_registers(columns, codes.WIDE)
    width = max(degree, codes.HIGHEST_ORDER if method.order else 0) + 4
    shapes = {
        "stages": (stages, length + 1),
        "speeds": (stages,),
        "trial": (length,),
        "new": (length,),
        "error": (length,),
        "second_error": (length,),
        "jacobian": (n, n + 1),
        "reset_jacobian": (n, n + 1),
        "gradient": (n + 1,),
        "scalar": (1,),
        "field": (n,),
        "field_after": (n,),
        "state": (n,),
        "settled": (n,),
        "saltation": (n, n),
        "path": (degree + 1, n),
        "polynomial": (width,),
        "stack": (ISOLATION_DEPTH, width),
        "intervals": (ISOLATION_DEPTH, 2),
        "systems": (n + coupled * (n + 1) + 4, coupled * n),
        "pivots": ((coupled + 1) * n,),
        "series": (codes.HIGHEST_ORDER + 3, width_of_series) if method.order else (0, 0),
        "weights": (1, width_of_series),
        "registers": (rows, codes.REGISTERS),
        "samples": (max(len(method.nodes), len(method.series_nodes)) + 1, 2 * rows),
    }
    return Layout(Work, shapes)


def empty_record(dimension: int, degree: int, steps: int = 0, jumps: int = 0) -> Any:
    """A record with room for that many steps and jumps; none means that they are not kept."""
    # Room that is not used costs nothing, not even to be cleared: all is written before it is read.
    record = record_layout(dimension, degree, steps, jumps).unwritten()
    record.used[:] = 0
    return record


@lru_cache(MOST_LAYOUTS)
def record_layout(dimension: int, degree: int, steps: int, jumps: int) -> Any:
    """Where the arrays of a record lie."""
    from hybrid.kernels.layout import Record
    from hybrid.kernels.structure import Layout

    n = dimension
    shapes = {
        "used": (4,),
        "step_time": (steps, 3),
        "step_place": (steps, 3),
        "step_coefficients": (steps, degree + 1, n + 1),
        "jump_time": (jumps, 2),
        "jump_place": (jumps, 4),
        "jump_states": (jumps, 2, n),
        "jump_saltation": (jumps, n, n),
        "grazing_time": (jumps, 3),
        "grazing_place": (jumps, 3),
        "grazing_state": (jumps, n),
    }
    return Layout(Record, shapes)


@lru_cache(MOST_LAYOUTS)
def _run_layout(dimension: int, tangents: int, modes: int, transitions: int) -> Any:
    from hybrid.kernels.layout import Run
    from hybrid.kernels.structure import Layout

    n = dimension
    shapes = {
        "count": (codes.COUNTERS,),
        "clock": (codes.CLOCKS,),
        "y": (n * (1 + tangents),),
        "side": (transitions,),
        "on_guard": (transitions,),
        "due": (transitions,),
        "recent": (RECENT,),
        "rehearsal": (3, transitions),
        "visits": (RECENT, n + 2),
        "first_step": (modes,),
        "stay": (modes,),
        "scale": (n,),
        "growth": (tangents,),
        "trail": (3, n + 1),
        "before": (n * tangents,),
        "growth_before": (tangents,),
        "instant": (n * (1 + n),),
    }
    return Layout(Run, shapes)


def check_solver(solver: object) -> RungeKutta:
    """The solver, or the default one; ArgumentError for anything else."""
    if solver is None:
        return DEFAULT_SOLVER
    if isinstance(solver, RungeKutta) and hasattr(solver, "tableau"):
        return solver
    raise ArgumentError(
        f"solver must be a solver object; got {arguments.shown(solver)}. "
        "Write for instance hybrid.DOP853(rtol=1e-8)."
    )


@attrs.frozen(eq=False)
class Trajectory:
    """A run that can be advanced. ``run`` and ``work`` are mutated by the kernels; all else is fixed.

    ``beyond`` names the transitions whose guards the start lies beyond.
    """

    compiled: CompiledSystem
    plan: Plan
    model: Any
    run: Any
    work: Any
    tangents: int
    max_steps: int
    phase0: float
    beyond: tuple[str, ...] = ()
    stop: Stop = CTRL_C

    @property
    def method(self) -> Any:
        """The kernel's view of the solver."""
        return self.plan.method

    @property
    def parts(self) -> Any:
        """The pieces that the driver is handed."""
        return self.plan.parts

    @property
    def system(self) -> HybridSystem:
        """The model that runs."""
        return self.compiled.system

    @property
    def t(self) -> float:
        """Current time."""
        run = self.run
        return run.count.item(codes.CYCLE) * self.model.period + run.clock.item(codes.PHASE)

    @property
    def x(self) -> np.ndarray:
        """Current state ``(n,)``, a copy."""
        return self.run.y[: self.model.dimension].copy()

    @property
    def mode(self) -> str:
        """Current mode."""
        return self.system.mode_names[self.run.count[codes.MODE]]

    @property
    def jumps(self) -> int:
        """Jumps so far."""
        return int(self.run.count[codes.JUMPS])

    @property
    def steps(self) -> int:
        """Steps tried so far."""
        return int(self.run.count.item(codes.STEPS))

    @property
    def tangent_matrix(self) -> np.ndarray:
        """Tangent vectors as columns ``(n, k)``, a copy."""
        n = self.model.dimension
        return self.run.y[n:].reshape(self.tangents, n).T.copy()

    def replace_tangents(self, matrix: np.ndarray) -> None:
        """Go on with other tangent vectors, the columns of ``(n, k)``."""
        self.run.y[self.model.dimension :] = matrix.T.ravel()
        if self.run.count[codes.PHASE_OF_RUN] == codes.READY:
            self.run.count[codes.PHASE_OF_RUN] = codes.STALE

    def jacobian(self) -> np.ndarray:
        """``D_x f`` of the current mode at the current point, ``(n, n)``."""
        from hybrid.kernels.step import flow_jacobian

        run, n = self.run, self.model.dimension
        flow_jacobian(self.model, run.count[codes.MODE], run.clock[codes.PHASE], run.y, self.work.jacobian)
        return self.work.jacobian[:, :n].copy()

    def field(self) -> np.ndarray:
        """``f`` of the current mode at the current point, ``(n,)``."""
        from hybrid.kernels.step import field

        run, out = self.run, np.empty(self.model.dimension)
        field(self.model, run.count[codes.MODE], run.clock[codes.PHASE], run.y, out)
        return out

    def advance(self, t: float, record: Any, max_jumps: int = UNLIMITED) -> int:
        """Run to time ``t`` or until something else ends it; a code of ``hybrid.kernels.codes``."""
        return self.advance_to(*split_time(t, self.model.period), record, max_jumps=max_jumps)

    def advance_to(
        self,
        cycle: int,
        phase: float,
        record: Any,
        *,
        max_steps: int | None = None,
        max_jumps: int = UNLIMITED,
    ) -> int:
        """Run to a number of whole periods and a phase; ``max_steps`` counts from the start of the run.

        The code is INTERRUPTED if the run was asked to stop. A run of few steps does not ask.
        """
        limit = self.max_steps if max_steps is None else max_steps
        most = min(limit, self.steps + FIRST_BURST)
        code = self._burst(cycle, phase, record, most, max_jumps)
        if code != codes.MAX_STEPS or most == limit:
            return code
        bursts = Bursts([self])
        code = codes.GO_ON
        with self.stop:
            while code == codes.GO_ON:
                most = min(limit, bursts.most())
                code = self._burst(cycle, phase, record, most, max_jumps)
                if code == codes.MAX_STEPS and most < limit:
                    code = bursts.judged(code)
        return code

    def _burst(self, cycle: int, phase: float, record: Any, max_steps: int, max_jumps: int) -> int:
        return int(
            entry(load_kernels().advance)(
                self.plan.parts,
                self.model,
                self.plan.method,
                self.run,
                record,
                self.tangents,
                False,
                cycle,
                phase,
                max_steps,
                max_jumps,
                self.work,
            )
        )

    def release(self) -> None:
        """Let the next run have the memory of this one, which cannot be advanced or looked at any more."""
        self.plan.run_layout.take_back(self.run)
        self.plan.work_layout.take_back(self.work)

    def no_record(self) -> Any:
        """A record that keeps nothing."""
        return empty_record(self.model.dimension, self.plan.degree)

    def status(self, code: int) -> Status:
        """Status of the run after ``advance`` returned ``code``."""
        return status_of(self, code)


def start(
    system: HybridSystem,
    x0: Any,
    t0: float,
    *,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    solver: RungeKutta | None = None,
    tangent: np.ndarray | None = None,
    time: str = "t0",
    stop: Stop = CTRL_C,
) -> Trajectory:
    """A trajectory at its start, everything about the call checked.

    ``tangent`` is an ``(n, k)`` matrix of tangent vectors, or None for a run without any. ``time`` is the
    name of the argument that ``t0`` comes from, ``stop`` who may end the run early.
    """
    compiled = compile_system(system)
    state = arguments.state("x0", x0, system)
    t0 = arguments.number(time, t0)
    solver = check_solver(solver)
    tangents = 0 if tangent is None else tangent.shape[1]
    plan = plan_of(compiled, solver, tangents)
    model = compiled.at(parameters, plan.model) if parameters else plan.model
    check_time(time, t0, model.period)
    run, phase0 = _fresh_run(plan.run_layout, model, state, tangent, t0)
    work = _fresh_work(plan.work_layout, plan.method)
    run.count[codes.MODE], beyond = choose_mode(system, plan.parts, model, run, work, mode)
    return Trajectory(compiled, plan, model, run, work, tangents, solver.max_steps, phase0, beyond, stop)


@attrs.frozen(eq=False)
class Plan:
    """What all runs of a system by a solver, with so many tangent vectors, have in common.

    ``model`` is that at the default parameters. ``propagators`` says how each mode is advanced, by its name;
    ``degree`` is that of a record's steps.
    """

    method: Any
    parts: Any
    model: Any
    propagators: dict[str, str]
    degree: int
    run_layout: Any
    work_layout: Any


def plan_of(compiled: CompiledSystem, solver: RungeKutta, tangents: int) -> Plan:
    """The plan of a run, made once; kernels that the run needs are loaded."""
    plan = compiled.plans.get((solver, tangents))
    if plan is None:
        system, method = compiled.system, kernel_method(solver)
        load_kernels("hybrid.kernels.first_mode")
        n, modes, transitions = system.dimension, len(system.modes), len(system.transitions)
        kinds, is_taylor = propagator_kinds(compiled, solver), isinstance(solver, Taylor)
        plan = Plan(
            method,
            driver_parts(
                codes.RUNGE_KUTTA not in kinds,
                bool(solver.tableau.implicit),
                bool(compiled.emitted.forcing_component),
            ),
            compiled.moved_by(
                compiled.moving(kinds, tangents), None if is_taylor else np.array(kinds, dtype=np.int64)
            ),
            {name: codes.PROPAGATORS[kind] for name, kind in zip(system.mode_names, kinds, strict=True)},
            dense_degree(compiled, method, kinds),
            _run_layout(n, tangents, modes, transitions),
            work_layout(
                method, n, tangents, compiled.series_columns(tangents), compiled.emitted.programs.longest
            ),
        )
        while len(compiled.plans) >= MOST_LAYOUTS:
            compiled.plans.pop(next(iter(compiled.plans)), None)
        compiled.plans[solver, tangents] = plan
    return plan


def _fresh_run(
    layout: Any, model: Any, state: np.ndarray, tangent: np.ndarray | None, t0: float
) -> tuple[Any, float]:
    """The run at its start, in no mode yet, and the phase of the start."""
    run, n = layout.zeros(), model.dimension
    count, clock, y = run.count, run.clock, run.y
    cycle, phase = split_time(t0, model.period)
    count[codes.CYCLE], clock[codes.PHASE] = cycle, phase
    count[codes.PHASE_OF_RUN] = codes.ENTERING
    for slot in (codes.LAST_FIRED, codes.PENDING, codes.PREVIOUS_MODE):
        count[slot] = codes.NO_TRANSITION
    clock[codes.LAST_JUMP_PHASE] = np.nan
    y[:n] = state
    if tangent is not None:
        y[n:] = tangent.T.ravel()
    np.abs(state, out=run.scale)
    return run, phase
