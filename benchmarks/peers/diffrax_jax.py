"""diffrax on JAX, compiled by XLA for one core: stop at an event, reset, call again."""

from __future__ import annotations

import os

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")

from collections.abc import Callable, Sequence
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix
import sympy

from benchmarks.peers.problem import ATOL_OVER_RTOL, Problem, equations, limit_events
from hybrid import Answer

jax.config.update("jax_enable_x64", True)
MOST_STEPS = 65536
# With tighter tolerances the root finder sometimes fails because of rounding in the interpolant.
ROOT = optimistix.Newton(1e-8, 1e-8)
SOLVERS = {"Dopri8": diffrax.Dopri8, "Tsit5": diffrax.Tsit5}


def methods(problem: Problem) -> dict[str, Callable[[float], Answer]]:
    given = equations(problem.model)
    fields = [_function(field) for field in given.fields]
    guards = [[_scalar(leave.guard) for leave in exits] for exits in given.exits]
    ways = [[{-1: False, 0: None, 1: True}[e.direction] for e in exits] for exits in given.exits]
    resets = [
        [None if e.reset is None else jax.jit(_function(e.reset)) for e in exits] for exits in given.exits
    ]

    def with_solver(name: str) -> Callable[[float], Answer]:
        stays = [
            _stay(SOLVERS[name](), field, diffrax.Event(conditions, ROOT, direction))
            for field, conditions, direction in zip(fields, guards, ways, strict=True)
        ]

        def run(rtol: float) -> Answer:
            # Arrays, because Python numbers would be compiled into the function.
            t, end, tolerance = map(jnp.asarray, (*problem.t_span, rtol))
            mode, x, times, steps = problem.first_mode, jnp.array(problem.x0, dtype=float), [], 0
            while True:
                t, x, mask, taken, good = stays[mode](t, end, x, tolerance)
                if not good:
                    raise RuntimeError("the event's root was not found, or the steps ran out")
                steps += int(taken)
                fired = np.flatnonzero([bool(hit) for hit in mask])
                if not fired.size:
                    return Answer(np.asarray(x), times=times, steps=steps)
                exit_ = int(fired[0])
                times.append(float(t))
                limit_events(times)
                if resets[mode][exit_] is not None:
                    x = resets[mode][exit_](t, x, None)
                mode = given.exits[mode][exit_].target

        return run

    return {f"diffrax {name}": with_solver(name) for name in SOLVERS}


def _stay(solver: Any, field: Any, event: Any) -> Any:
    @eqx.filter_jit
    def run(t0: Any, t1: Any, x0: Any, rtol: Any) -> Any:
        control = diffrax.PIDController(rtol=rtol, atol=rtol * ATOL_OVER_RTOL)
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field), solver, t0, t1, None, x0,
            stepsize_controller=control, event=event, max_steps=MOST_STEPS, throw=False,
        )  # fmt: skip
        good = diffrax.is_okay(solution.result)
        return solution.ts[-1], solution.ys[-1], solution.event_mask, solution.stats["num_steps"], good

    return run


def _function(expressions: Sequence[sympy.Expr]) -> Any:
    inner = sympy.lambdify([sympy.Symbol("t"), sympy.Symbol("x")], list(expressions), modules="jax", cse=True)
    return lambda t, x, args: jnp.stack([jnp.asarray(value, dtype=float) for value in inner(t, x)])


def _scalar(expression: sympy.Expr) -> Any:
    inner = _function([expression])
    return lambda t, y, args, **_: inner(t, y, args)[0]
