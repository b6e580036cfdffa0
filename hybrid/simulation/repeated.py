"""Runs of one system that differ in their start and span alone: what they share is found once."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import attrs
import numpy as np

from hybrid.compiler.compiled import CompiledSystem, compile_system
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.ending import status_of
from hybrid.simulation.periods import check_time
from hybrid.simulation.plan import Plan
from hybrid.simulation.recorder import Recorder
from hybrid.simulation.trajectory import Common
from hybrid.solvers import Solver
from hybrid.system.graph import HybridSystem


@attrs.frozen(eq=False)
class Led:
    """Where a run has led.

    Attributes
    ----------
    arc
        The run.
    ok
        Whether it has reached the end of its span, and its tangent vectors have a meaning.
    mode, x
        Mode and state ``(n,)`` at the end.
    tangents
        The fundamental matrix at the end, with a row and a column for each component but the counters.
    first_rate, last_rate
        The field ``(n,)`` at the start and at the end.
    """

    arc: HybridArc
    ok: bool
    mode: str
    x: np.ndarray
    tangents: np.ndarray
    first_rate: np.ndarray
    last_rate: np.ndarray


@attrs.frozen(eq=False)
class Repeated:
    """Runs of a system at the same parameters, by the same solver, with all tangent vectors.

    They are those of ``simulate(..., tangent=True)`` for a caller who makes thousands of short ones: the
    arguments are not checked, and modes of a growing system are not made.
    """

    system: HybridSystem
    parameters: Mapping[str, float]
    solver: Solver
    _models: dict[Plan, Any] = attrs.field(factory=dict, init=False)

    def __reduce__(self) -> tuple[Any, ...]:
        return Repeated, (self.system, self.parameters, self.solver)

    @cached_property
    def _compiled(self) -> CompiledSystem:
        return compile_system(self.system)

    @cached_property
    def _tangent(self) -> np.ndarray:
        return np.eye(self.system.tangent_dimension)

    def _model(self, plan: Plan, _: object) -> Any:
        if plan not in self._models:
            self._models[plan] = self._compiled.given(self.parameters, plan.model)
        return self._compiled.own(self._models[plan])

    def run(self, mode: str, x: np.ndarray, span: tuple[float, float], max_steps: int, max_jumps: int) -> Led:
        """The run from a mode and a state over a span.

        Raises
        ------
        ArgumentError
            If a guard is not finite at the start, or a time has no phase.
        """
        t0, t1 = span
        common = Common(self._compiled, self.solver, self._tangent, t0, horizon=t1 - t0, max_steps=max_steps)
        trajectory = common.begin(x, mode, self._model)
        check_time("t1", t1, trajectory.model.period)
        first_rate = trajectory.field()
        recorder = Recorder(trajectory, None, t1, keeps_jumps=True)
        arc = recorder.run(t1, max_jumps)
        assert arc.fundamental is not None
        led = Led(
            arc,
            status_of(trajectory, recorder.code).ok,
            trajectory.mode,
            trajectory.x,
            arc.fundamental,
            first_rate,
            trajectory.field(),
        )
        trajectory.release()
        return led
