"""One trajectory in the hands of the kernels, and how to take it further."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compiler.cache.loader import load_kernels
from hybrid.compiler.compiled import CompiledSystem, compile_system
from hybrid.compiler.interrupts import CTRL_C, Stop, raise_if_dropped
from hybrid.kernels.types import codes
from hybrid.kernels.types.codes import UNLIMITED
from hybrid.simulation.end import (
    ArcEnd,
    age_of,
    check_tangents,
    goes_on_in,
    mode_by_steps,
    put_memory,
    with_component,
)
from hybrid.simulation.holding import tangent_projection
from hybrid.simulation.initial_mode import choose_mode
from hybrid.simulation.interrupt import FIRST_BURST, Bursts
from hybrid.simulation.memory import Memory, put_tangents
from hybrid.simulation.periods import check_time, split_time, time_at
from hybrid.simulation.plan import Plan, check_solver, plan_of
from hybrid.solvers import Solver
from hybrid.system.entries import has_age
from hybrid.system.graph import HybridSystem, as_system, starting_mode
from hybrid.system.growth import Unexplored, stage_of
from hybrid.transform.aged import aged, with_age


def start(
    system: HybridSystem,
    x0: Any,
    t0: float,
    *,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    solver: Solver | None = None,
    tangent: np.ndarray | None = None,
    time: str = "t0",
    horizon: float = 0.0,
    stop: Stop = CTRL_C,
    by_guards: bool = False,
) -> Trajectory:
    """A trajectory at its start, everything about the call checked.

    Without a ``mode`` the system says where a run starts. The guards do if it does not, or with
    ``by_guards``.

    ``tangent`` is an ``(n, k)`` matrix of tangent vectors, or None for a run without any. With them the run
    is one of the aged system, in which they know when a mode was entered. ``time`` is the
    name of the argument that ``t0`` comes from, ``horizon`` how long the run takes, 0 if that is not known,
    ``stop`` who may end the run early.
    """
    as_system("system", system)
    end = x0 if isinstance(x0, ArcEnd) else None
    if end is not None:
        mode, parameters = goes_on_in(system, end, t0, mode, parameters, time)
        x0 = end.x
    state = system.variables.state_values("x0", x0)
    t0 = arguments.number(time, t0)
    mode = mode if by_guards else starting_mode(system, mode)
    if system.growth is not None:
        mode = explore(system, t0, state, system.parameter_values(parameters), mode)
    whole, state, tangent = directed(system, state, tangent)
    common = Common(compile_system(whole), check_solver(solver), tangent, t0, time, horizon, stop)

    def model_of(plan: Plan, memory: Memory) -> Any:
        return common.compiled.given(parameters, plan.model)

    if end is None:
        return common.begin(state, mode, model_of)
    if whole is not system:
        age = whole.age
        assert age is not None, "tangent vectors are carried in the aged system"
        end = with_component(end, age, whole.state_names[age], age_of(end, system))
    return common.go_on(end, model_of)


def directed(
    system: HybridSystem, state: np.ndarray, tangent: np.ndarray | None
) -> tuple[HybridSystem, np.ndarray, np.ndarray | None]:
    """What runs with these tangent vectors: with any, the aged system from a state where a mode is entered.

    Vectors may have a part along the age.
    """
    if tangent is None or aged(system) is system:
        return system, state, tangent
    if len(tangent) == system.tangent_dimension:
        tangent = with_age(system, tangent.T).T
    return aged(system), with_age(system, state), tangent


def explore(
    system: HybridSystem, t0: float, state: np.ndarray, values: np.ndarray, mode: str | None
) -> str | None:
    """The mode to start in; Unexplored if modes of a growing system have been made for it only now."""
    growth = system.growth
    if growth is None:
        return mode
    # A run on a later stage of the system may have told the mode.
    later = mode not in system.mode_names and mode in stage_of(system).mode_names
    if later or growth.place(t0, state, values, mode):
        raise Unexplored(mode)
    return growth.mode_at(t0, state, values, mode)


@attrs.frozen(eq=False)
class Common:
    """What runs share that begin at one time by one solver: they differ in start and parameters.

    The fields are those of ``start``, everything about them checked; ``max_steps`` is given where it is not
    that of the solver.
    """

    compiled: CompiledSystem
    solver: Solver
    tangent: np.ndarray | None
    t0: float
    time: str = "t0"
    horizon: float = 0.0
    stop: Stop = CTRL_C
    max_steps: int | None = None

    def begin_at(self, state: np.ndarray, mode: str | None, values: np.ndarray) -> Trajectory:
        """A trajectory at its start, at a parameter vector."""
        period, knots = self.compiled.period_at(values), self.compiled.knots_at(values)
        return self.begin(state, mode, lambda plan, memory: memory.model_at(values, period, knots))

    def begin(
        self, state: np.ndarray, mode: str | None, model_of: Callable[[Plan, Memory], Any]
    ) -> Trajectory:
        """A trajectory at its start; ``model_of(plan, memory)`` is the model at the parameters of the run."""
        raise_if_dropped()
        compiled, tangents = self.compiled, 0 if self.tangent is None else self.tangent.shape[1]
        plan = plan_of(compiled, self.solver, tangents)
        memory = plan.memory()
        model = model_of(plan, memory)
        check_time(self.time, self.t0, model.period)
        phase0 = memory.begin(model, state, self.tangent, self.t0, self.horizon)
        run = memory.run
        index, beyond = choose_mode(compiled.system, plan, model, run, memory.work, mode)
        if beyond and model.propagator[index] in (codes.DESINGULARISED, codes.ROOTED):
            # These series hold the root of a guard, which may be negative here.
            plan.take_back(memory)
            plan = plan_of(compiled, self.solver, tangents, by_steps=index)
            memory = plan.memory()
            model = model_of(plan, memory)
            memory.begin(model, state, self.tangent, self.t0, self.horizon)
            choose_mode(compiled.system, plan, model, memory.run, memory.work, mode)
        memory.run.mode = index
        made = Trajectory(compiled, plan, model, memory, tangents, self._most, phase0, beyond, self.stop)
        if self.tangent is not None and made.holds:
            made.replace_tangents(self.tangent)
        return made

    def go_on(self, end: ArcEnd, model_of: Callable[[Plan, Memory], Any]) -> Trajectory:
        """A trajectory that goes on from the end of a run."""
        raise_if_dropped()
        compiled, tangents = self.compiled, 0 if self.tangent is None else self.tangent.shape[1]
        if tangents:
            check_tangents(end)
        plan = plan_of(compiled, self.solver, tangents, by_steps=mode_by_steps(end, compiled.system))
        memory = plan.memory()
        model = model_of(plan, memory)
        phase0 = memory.begin(model, end.x, self.tangent, self.t0, self.horizon)
        put_memory(end, memory.run, compiled.system)
        jumps = int(memory.run.jumps)
        return Trajectory(compiled, plan, model, memory, tangents, self._most, phase0, (), self.stop, jumps)

    @property
    def _most(self) -> int:
        """The largest number of steps."""
        return self.solver.max_steps if self.max_steps is None else self.max_steps


@attrs.frozen(eq=False)
class Trajectory:
    """A run that can be advanced. Kernels change what is in its ``memory``; all else is fixed.

    ``beyond`` names the transitions whose guards the start lies beyond, ``first_jump`` is how many jumps the
    runs have made that this one goes on from.
    """

    compiled: CompiledSystem
    plan: Plan
    model: Any
    memory: Memory
    tangents: int
    max_steps: int
    phase0: float
    beyond: tuple[str, ...] = ()
    stop: Stop = CTRL_C
    first_jump: int = 0

    @property
    def parameters(self) -> np.ndarray:
        """The values of the parameters; in the model, the numbers of tables lie behind them."""
        values: np.ndarray = self.model.parameters[: len(self.system.parameters)]
        return values

    @property
    def named_parameters(self) -> dict[str, float]:
        """The values of the parameters, by name."""
        return dict(zip(self.system.variables.parameter_names, self.parameters.tolist(), strict=True))

    @property
    def run(self) -> Any:
        """The state of the run."""
        return self.memory.run

    @property
    def work(self) -> Any:
        """Its scratch memory."""
        return self.memory.work

    @property
    def method(self) -> Any:
        """The kernel's view of the solver."""
        return self.plan.method

    @property
    def system(self) -> HybridSystem:
        """The model that runs."""
        return self.compiled.system

    @property
    def t(self) -> float:
        """Current time."""
        run = self.run
        return float(time_at(run.cycle, run.phase, run.phase_low, self.model.period))

    @property
    def x(self) -> np.ndarray:
        """Current state ``(n,)``, a copy."""
        return self.run.y[: self.model.dimension].copy()

    @property
    def mode(self) -> str:
        """Current mode."""
        return self.system.mode_names[self.run.mode]

    @property
    def holds(self) -> bool:
        """Whether the current mode holds quantities at zero."""
        return self.system.modes[self.run.mode].holds is not None

    @property
    def jumps(self) -> int:
        """Jumps so far."""
        return int(self.run.jumps) - self.first_jump

    @property
    def steps(self) -> int:
        """Steps tried so far."""
        return int(self.run.steps)

    @property
    def tangent_matrix(self) -> np.ndarray:
        """Tangent vectors as columns ``(n, k)``, a copy; counters have no rows."""
        n = self.model.dimension
        return self.run.y[n:].reshape(self.tangents, n)[:, : self.system.tangent_dimension].T.copy()

    def replace_tangents(self, matrix: np.ndarray) -> None:
        """Go on with other tangent vectors, the columns of ``(n, k)``.

        Where the age of the mode counts for nothing, they have no part along it. In a mode that holds
        something they are projected onto the directions that it allows.
        """
        if self.holds:
            mode = self.system.modes[self.run.mode]
            place = self.t, self.x, self.parameters
            matrix = tangent_projection(self.system, mode, *place) @ matrix
        if self.system.age is not None and not has_age(self.system, self.mode):
            matrix = matrix * (np.arange(len(matrix)) != self.system.age)[:, None]
        put_tangents(self.run.y, self.model.dimension, matrix)
        if self.run.stage == codes.READY:
            self.run.stage = codes.STALE

    def goes_on_from(self, other: Trajectory) -> None:
        """Take the time of another run in the same mode, and the sides of guards: what has fired is over.

        The system may be that of the other run with markers, which come first.
        """
        run, before = self.run, other.run
        run.cycle, run.phase, run.phase_low = before.cycle, before.phase, before.phase_low
        markers = len(run.side) - len(before.side)
        run.side[markers:], run.on_guard[markers:], run.due[:] = before.side, before.on_guard, 0
        run.tick[markers:], run.ticked[markers:] = before.tick, before.ticked
        for name in ("cycle", "phase", "low"):
            for begin in ("entry", "arrival"):
                setattr(run, f"{begin}_{name}", getattr(before, f"{begin}_{name}"))
        run.previous_mode = run.mode

    def jacobian(self) -> np.ndarray:
        """``D_x f`` of the current mode at the current point, ``(n, n)``."""
        run, n = self.run, self.model.dimension
        load_kernels("hybrid.kernels.steps.step").jacobian_at(
            self.model, run.mode, run.phase, run.y, self.work.jacobian
        )
        return self.work.jacobian[:, :n].copy()

    def field(self, x: np.ndarray | None = None) -> np.ndarray:
        """``f`` of the current mode at the current time, ``(n,)``, at the current state or at another one."""
        run, out = self.run, np.empty(self.model.dimension)
        state = run.y if x is None else x
        load_kernels("hybrid.kernels.steps.step").field_at(self.model, run.mode, run.phase, state, out)
        return out

    def advance(self, t: float, record: Any, max_jumps: int = UNLIMITED) -> int:
        """Run to time ``t`` or until something else ends it; a code of ``hybrid.kernels.types.codes``."""
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
        most = min(limit, self.memory.run.steps + FIRST_BURST)
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
        plan, memory = self.plan, self.memory
        task = memory.driven(self.model, record, self.tangents)
        parts = plan.parts_so_far
        if parts.complete:
            return int(plan.advance(parts, task, cycle, phase, max_steps, max_jumps))
        return plan.called(
            lambda parts: plan.advance(parts, task, cycle, phase, max_steps, max_jumps),
            memory.run,
            memory.work,
            record.used,
        )

    def task(self, record: Any, *, orthonormal: bool = False) -> Any:
        """What the driver works on: this run and a record.

        With ``orthonormal`` these are orthonormalised whenever they come too close to each other.
        """
        task = self.memory.task(self.model, orthonormal=orthonormal)
        changes: dict[str, Any] = {}
        if record is not task.record:
            changes["record"] = record
        # A run may go on without the tangent vectors that it began with.
        if self.tangents != task.tangents:
            changes["tangents"] = self.tangents
        return task.replace(**changes) if changes else task

    def words(self) -> np.ndarray:
        """All that the run is, as a copy, for ``as_it_was``."""
        return self.plan.run_layout.words(self.memory.run).copy()

    def as_it_was(self, words: np.ndarray) -> Trajectory:
        """A trajectory in another memory, whose run is what ``words`` gave once."""
        memory = self.plan.memory()
        self.plan.run_layout.words(memory.run)[:] = words
        others = self.tangents, self.max_steps, self.phase0, self.beyond, self.stop, self.first_jump
        return Trajectory(self.compiled, self.plan, self.model, memory, *others)

    def release(self) -> None:
        """Let the next run have the memory of this one, which cannot be advanced or looked at any more."""
        self.plan.take_back(self.memory)

    def no_record(self) -> Any:
        """A record that keeps nothing."""
        return self.plan.task.record
