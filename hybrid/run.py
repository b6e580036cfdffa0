"""One trajectory in the hands of the kernels: its state, its scratch memory, and how to take it further."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Any

import attrs
import numpy as np

from hybrid.compile import CompiledSystem, compile_system
from hybrid.errors import ArgumentError
from hybrid.kernels import codes
from hybrid.load import address, entry, load_kernels
from hybrid.solvers import RungeKutta, Taylor
from hybrid.status import Status, StatusCode, run_status
from hybrid.system import HybridSystem

# Degree of the polynomials fitted to guards that are not affine.
FIT_DEGREE = 8
# Deep enough for intervals halved down to rounding.
ISOLATION_DEPTH = 64
UNLIMITED = np.iinfo(np.int64).max


@cache
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
        implicit=int(tableau.implicit),
        order=solver.order if isinstance(solver, Taylor) else 0,
        exponent=1.0 / tableau.error_order,
        rtol=solver.rtol,
        atol=solver.atol,
        max_step=solver.max_step,
    )


@cache
def driver_parts(series_only: bool, implicit: bool) -> Any:
    """The pieces that the driver is handed; steps that the run does not take are not loaded."""
    from hybrid.kernels.layout import Attempts, Parts

    jumps, corners = load_kernels("hybrid.kernels.jump"), load_kernels("hybrid.kernels.corner")
    if implicit:
        attempt = load_kernels("hybrid.kernels.radau").attempt_radau
    else:
        attempt = load_kernels("hybrid.kernels.step").no_attempt
    if series_only:
        step = load_kernels("hybrid.kernels.step").no_step
    else:
        step = load_kernels("hybrid.kernels.runge_kutta").runge_kutta_step
    return Parts(
        attempts=Attempts(attempt_implicit=address(attempt)),
        runge_kutta_step=address(step),
        enter=address(jumps.enter),
        jump=address(jumps.jump),
        finish_chatter=address(jumps.finish_chatter),
        rest=address(jumps.rest),
        first_in_order=address(corners.first_in_order),
    )


def solver_parts(compiled: CompiledSystem, solver: RungeKutta) -> Any:
    """The pieces that the driver needs for a system and a solver."""
    kinds = [each.kind for each in compiled.emitted.propagators]
    series_only = isinstance(solver, Taylor) and codes.RUNGE_KUTTA not in kinds
    return driver_parts(series_only, bool(solver.tableau.implicit))


def dense_degree(method: Any) -> int:
    """Degree of the polynomials that a record of steps holds."""
    return max(len(method.interpolant) - 1, codes.HIGHEST_ORDER if method.order else 0)


def workspace(method: Any, dimension: int, tangents: int, columns: int) -> Any:
    """Scratch memory for one run; ``columns`` are those of series."""
    from hybrid.kernels.layout import Work

    n, length = dimension, dimension * (1 + tangents)
    stages, degree = len(method.a), len(method.interpolant) - 1
    coupled = len(method.b) if method.implicit else 0
    systems = np.zeros((n + coupled * (n + 1) + 4, coupled * n))
    systems[-1:] = -1.0
    nodes, fit = _fit_of_guards()
    # Whole vectors of columns are evaluated: there may be a few more than are in use.
    width_of_series = -(-columns // (2 * codes.NARROW)) * 2 * codes.NARROW
    width = max(dense_degree(method), FIT_DEGREE) + 4
    return Work(
        stages=np.zeros((stages, length + 1)),
        speeds=np.zeros(stages),
        trial=np.zeros(length),
        new=np.zeros(length),
        error=np.zeros(length),
        second_error=np.zeros(length),
        jacobian=np.zeros((n, n + 1)),
        reset_jacobian=np.zeros((n, n + 1)),
        gradient=np.zeros(n + 1),
        scalar=np.zeros(1),
        field=np.zeros(n),
        field_after=np.zeros(n),
        state=np.zeros(n),
        settled=np.zeros(n),
        saltation=np.zeros((n, n)),
        coefficients=np.zeros((degree + 1, n)),
        polynomial=np.zeros(width),
        stack=np.zeros((ISOLATION_DEPTH, width)),
        intervals=np.zeros((ISOLATION_DEPTH, 2)),
        nodes=nodes,
        fit=fit,
        systems=systems,
        pivots=np.zeros((coupled + 1) * n, dtype=np.int64),
        series=np.zeros((codes.HIGHEST_ORDER + 3, width_of_series) if method.order else (0, 0)),
        weights=np.zeros((1, width_of_series)),
    )


@cache
def _fit_of_guards() -> tuple[np.ndarray, np.ndarray]:
    """Nodes on [0, 1] and the matrix from values there to Bernstein coefficients."""
    j = np.arange(FIT_DEGREE + 1)
    nodes = 0.5 * (1 - np.cos(np.pi * j / FIT_DEGREE))
    binomials = np.array([math.comb(FIT_DEGREE, k) for k in j.tolist()])
    basis = binomials * nodes[:, None] ** j * (1 - nodes[:, None]) ** (FIT_DEGREE - j)
    return nodes, np.linalg.inv(basis)


def empty_record(dimension: int, degree: int, steps: int = 0, jumps: int = 0) -> Any:
    """A record with room for that many steps and jumps; none means that they are not kept."""
    from hybrid.kernels.layout import Record

    n = dimension
    return Record(
        used=np.zeros(3, dtype=np.int64),
        step_time=np.zeros((steps, 2)),
        step_place=np.zeros((steps, 3), dtype=np.int64),
        step_coefficients=np.zeros((steps, degree + 1, n + 1)),
        jump_time=np.zeros((jumps, 2)),
        jump_place=np.zeros((jumps, 3), dtype=np.int64),
        jump_states=np.zeros((jumps, 2, n)),
        jump_saltation=np.zeros((jumps, n, n)),
        grazing_time=np.zeros((jumps, 3)),
        grazing_place=np.zeros((jumps, 3), dtype=np.int64),
        grazing_state=np.zeros((jumps, n)),
    )


def check_state(system: HybridSystem, x0: Any) -> np.ndarray:
    """``x0`` as a finite vector ``(n,)``; ArgumentError if it is not one."""
    try:
        state = np.array(x0, dtype=float)
    except (TypeError, ValueError):
        raise ArgumentError(f"x0 must hold {system.dimension} numbers; got {x0!r}.") from None
    names = ", ".join(system.state_names)
    if state.shape != (system.dimension,):
        raise ArgumentError(
            f"x0 has shape {state.shape}; the state needs shape ({system.dimension},): {names}."
        )
    for name, value in zip(system.state_names, state, strict=True):
        if not np.isfinite(value):
            raise ArgumentError(f"x0: component {name!r} must be finite; got {value}.")
    return state


def check_count(name: str, value: object, least: int) -> None:
    """ArgumentError unless ``value`` is a whole number of at least ``least``."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise ArgumentError(f"{name} must be a whole number of at least {least}; got {value!r}.")


def check_solver(solver: object) -> RungeKutta:
    """The solver, or the default one; ArgumentError for anything else."""
    if solver is None:
        return Taylor()
    if isinstance(solver, RungeKutta) and hasattr(solver, "tableau"):
        return solver
    raise ArgumentError(
        f"solver must be a solver object; got {solver!r}. Write for instance hybrid.DOP853(rtol=1e-8)."
    )


def split_time(t: float, period: float) -> tuple[int, float]:
    """Time as whole periods and a phase in ``[0, period)``; without a period (0) all of it is phase."""
    if period <= 0.0:
        return 0, float(t)
    cycle = int(np.floor(t / period))
    phase = t - cycle * period
    return (cycle + 1, 0.0) if phase >= period else (cycle, max(phase, 0.0))


@attrs.frozen(eq=False)
class Trajectory:
    """A run that can be advanced. ``run`` and ``work`` are mutated by the kernels; all else is fixed."""

    compiled: CompiledSystem
    model: Any
    method: Any
    run: Any
    work: Any
    tangents: int
    parts: Any
    max_steps: int
    phase0: float

    @property
    def system(self) -> HybridSystem:
        """The model that runs."""
        return self.compiled.system

    @property
    def t(self) -> float:
        """Current time."""
        return float(self.run.count[codes.CYCLE] * self.model.period + self.run.clock[codes.PHASE])

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
    def tangent_matrix(self) -> np.ndarray:
        """Tangent vectors as columns ``(n, k)``, a copy."""
        n = self.model.dimension
        return self.run.y[n:].reshape(self.tangents, n).T.copy()

    def propagators(self) -> dict[str, str]:
        """How each mode is advanced in this run."""
        kinds = (codes.PROPAGATORS[kind] for kind in self.model.propagator)
        return dict(zip(self.system.mode_names, kinds, strict=True))

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
        """Run to a number of whole periods and a phase; ``max_steps`` counts from the start of the run."""
        return int(
            entry(load_kernels().advance)(
                self.parts,
                self.model,
                self.method,
                self.run,
                record,
                self.tangents,
                False,
                cycle,
                phase,
                self.max_steps if max_steps is None else max_steps,
                max_jumps,
                self.work,
            )
        )

    def _grazed(self, grazed: int) -> Status:
        largest = self.run.clock[codes.LARGEST_SALTATION]
        return Status(
            StatusCode.SUCCESS,
            f"Reached the end. {grazed} of {self.jumps} jumps grazed within the tolerances: their saltation "
            f"matrices, with entries up to {largest:.2g}, stand for a square root.",
            "Tighten the tolerances to resolve them, or move the parameters away.",
        )

    def no_record(self) -> Any:
        """A record that keeps nothing."""
        return empty_record(self.model.dimension, dense_degree(self.method))

    def status(self, code: int) -> Status:
        """Status of the run after ``advance`` returned ``code``."""
        singular = int(self.run.count[codes.SINGULAR_JUMPS])
        if self.tangents and singular:
            return Status(
                StatusCode.SINGULAR_SALTATION,
                f"{singular} of {self.jumps} jumps had no saltation matrix: they grazed exactly.",
                "The tangent vectors mean nothing beyond them; move the parameters away from the grazing.",
            )
        ambiguous = int(self.run.count[codes.ORDER_MATTERED])
        grazed = int(self.run.count[codes.ILL_CONDITIONED]) if self.tangents else 0
        if code == codes.DONE and ambiguous:
            also = f" Besides, {grazed} of {self.jumps} jumps grazed within the tolerances." if grazed else ""
            return Status(
                StatusCode.AMBIGUOUS_ORDER,
                f"{ambiguous} times two guards were reached together and the order of their transitions "
                f"mattered; the one listed first was fired first.{also}",
                "Choose the order in which the transitions are listed, or add one for the corner.",
            )
        if code == codes.DONE and grazed:
            return self._grazed(grazed)
        last = self.run.count[codes.LAST_FIRED]
        name = self.system.transition_names[last] if last >= 0 else None
        return run_status(code, self.t, self.mode, name)


def start(
    system: HybridSystem,
    x0: Any,
    t0: float,
    *,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    solver: RungeKutta | None = None,
    tangent: np.ndarray | None = None,
) -> Trajectory:
    """A trajectory at its start, everything about the call checked.

    ``tangent`` is an ``(n, k)`` matrix of tangent vectors, or None for a run without any.
    """
    compiled = compile_system(system)
    state = check_state(system, x0)
    solver = check_solver(solver)
    model = compiled.model(parameters)
    if not isinstance(solver, Taylor):
        model = model.replace(propagator=np.full_like(model.propagator, codes.RUNGE_KUTTA))
    method = kernel_method(solver)
    tangents = 0 if tangent is None else tangent.shape[1]
    y = state if tangent is None else np.concatenate([state, tangent.T.ravel()])
    run = _fresh_run(system, model, y, tangents, t0)
    work = workspace(method, system.dimension, tangents, compiled.series_columns(tangents))
    run.count[codes.MODE] = choose_mode(system, model, run, work, mode)
    phase0 = split_time(t0, model.period)[1]
    return Trajectory(
        compiled,
        model,
        method,
        run,
        work,
        tangents,
        solver_parts(compiled, solver),
        solver.max_steps,
        phase0,
    )


def _fresh_run(system: HybridSystem, model: Any, y: np.ndarray, tangents: int, t0: float) -> Any:
    from hybrid.kernels.layout import Run

    count = np.zeros(codes.COUNTERS, dtype=np.int64)
    clock = np.zeros(codes.CLOCKS)
    count[codes.CYCLE], clock[codes.PHASE] = split_time(t0, model.period)
    count[codes.PHASE_OF_RUN] = codes.ENTERING
    for slot in (codes.LAST_FIRED, codes.PENDING, codes.PREVIOUS_MODE):
        count[slot] = codes.NO_TRANSITION
    clock[codes.LAST_JUMP_PHASE] = np.nan
    transitions = len(system.transitions)
    return Run(
        count=count,
        clock=clock,
        y=y,
        side=np.zeros(transitions, dtype=np.int64),
        on_guard=np.zeros(transitions, dtype=np.int64),
        first_step=np.zeros(len(system.modes)),
        scale=np.abs(y[: system.dimension]),
        growth=np.zeros(tangents),
        trail=np.zeros((3, system.dimension + 1)),
        before=np.zeros(system.dimension * tangents),
        growth_before=np.zeros(tangents),
        instant=np.zeros(system.dimension * (1 + system.dimension)),
    )


def choose_mode(system: HybridSystem, model: Any, run: Any, work: Any, mode: str | None) -> int:
    """Index of the mode to start in: the one named, the only one, or the only one that allows the state.

    Raises
    ------
    ModelError
        If the name is unknown; if the state violates every mode, or more than one allows it.
    """
    if mode is not None:
        index = system.mode_index(mode)
        _guards_beyond(system, model, run, work, index)
        return index
    beyond = [_guards_beyond(system, model, run, work, index) for index in range(len(system.modes))]
    if len(system.modes) == 1:
        strictly = [name for name, on_guard in beyond[0] if not on_guard]
        if not strictly:
            return 0
    allowed = [index for index, guards in enumerate(beyond) if not guards]
    if len(allowed) == 1:
        return allowed[0]
    where = f"x0 = {tuple(float(v) for v in run.y[: system.dimension])}"
    if not allowed:
        faults = "; ".join(
            f"mode {name!r} is left through {', '.join(repr(guard) for guard, _ in guards)}"
            for name, guards in zip(system.mode_names, beyond, strict=True)
        )
        raise ArgumentError(
            f"{where} violates every mode: {faults}. Start on the other side of a guard, or name the mode "
            "with mode= if that side is meant."
        )
    candidates = ", ".join(system.mode_names[index] for index in allowed)
    raise ArgumentError(f"{where} is allowed in more than one mode: {candidates}. Choose one with mode=.")


def _guards_beyond(
    system: HybridSystem, model: Any, run: Any, work: Any, index: int
) -> list[tuple[str, bool]]:
    """Transitions of the mode whose guard the state is on, moving beyond, or beyond; and whether just on."""
    from hybrid.kernels.guards import guard_values

    phase = run.clock[codes.PHASE]
    values = np.ones(2 * len(system.transitions))
    entry(guard_values)(model, phase, run.y, values)
    run.count[codes.MODE] = index
    entry(load_kernels("hybrid.kernels.jump").enter)(model, run, work)
    beyond = []
    for i, transition in enumerate(system.transitions):
        if transition.source != system.mode_names[index]:
            continue
        if not np.isfinite(values[i]):
            raise ArgumentError(
                f"Transition {transition.name!r}: the guard is {values[i]} at t = {phase}, "
                f"x0 = {tuple(float(v) for v in run.y[: system.dimension])}. "
                "A guard must be finite wherever its mode runs."
            )
        allowed = values[i + len(system.transitions)] > 0.0
        if transition.guard.direction == run.side[i] and allowed and not transition.is_marker:
            beyond.append((transition.name, bool(run.on_guard[i])))
    return beyond
