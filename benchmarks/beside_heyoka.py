"""Time of runs beside heyoka, alternated in one process: the founding system, and chains of masses that hit.

Run ``pip install '.[benchmarks]'``, then ``OMP_NUM_THREADS=1 python -m benchmarks.beside_heyoka``.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import attrs
import heyoka as hy
import numpy as np

from benchmarks.common import heading, least_in_turns, table
from benchmarks.compile_time import CHAIN
from benchmarks.peers import heyoka_taylor
from benchmarks.problems import problems
from hybrid import Taylor, simulate

TOLERANCES = (1e-10, 1e-12)
# Masses of a chain, the time of a run, and the gap to the wall: without hits it is out of reach.
CHAINS = ((10, 40.0, 0.5), (50, 7.0, 0.5), (50, 7.0, 100.0))


def heyoka_chain(masses: int, x0: np.ndarray, t_end: float, gap: float, tol: float) -> Callable[[], Any]:
    """A run of the chain by heyoka in its compact mode, the hits by a callback."""
    x = hy.make_vars(*(f"x{i}" for i in range(2 * masses)))
    q, v = x[:masses], x[masses:]
    stretch = [q[0], *(b - a for a, b in pairwise(q))]
    pull = [*(2.0 * s + 0.5 * s**3 for s in stretch), 0.0]
    push = 0.3 * hy.cos(1.3 * hy.time)
    rates = [*zip(q, v, strict=True)]
    rates += [(v[i], pull[i + 1] - pull[i] + push) for i in range(masses)]

    def back(integrator: Any, direction: int) -> bool:
        integrator.state[-1] *= -0.8
        return True

    wall = hy.t_event(q[-1] - gap, callback=back, direction=hy.event_direction.positive)
    integrator = hy.taylor_adaptive(rates, x0, t_events=[wall], compact_mode=True, tol=tol)

    def run() -> np.ndarray:
        integrator.time = 0.0
        integrator.state[:] = x0
        integrator.reset_cooldowns()
        integrator.propagate_until(t_end)
        return integrator.state

    return run


def chains(turns: int) -> list[list[str]]:
    scope: dict[str, Any] = {}
    exec(CHAIN, scope)
    rows = []
    for masses, t_end, gap in CHAINS:
        system, x0 = scope["chain"](masses), 0.01 * np.arange(1.0, 2 * masses + 1)
        system = attrs.evolve(system, parameters={**system.parameters, "gap": gap})
        for tol in TOLERANCES:
            solver = Taylor(rtol=tol, atol=tol / 100)

            def ours(system=system, x0=x0, t_end=t_end, solver=solver) -> Any:
                return simulate(system, x0, (0.0, t_end), samples=[t_end], solver=solver)

            theirs = heyoka_chain(masses, x0, t_end, gap, tol)
            apart = np.abs(ours().x[-1] - theirs()).max()
            one, other = least_in_turns([ours, theirs], turns)
            cells = [str(2 * masses), f"{t_end:g}", str(ours().jump_count), f"{tol:.0e}"]
            rows.append(
                [*cells, f"{1e3 * one:.3f}", f"{1e3 * other:.3f}", f"{other / one:.2f}", f"{apart:.0e}"]
            )
    return rows


def founding(turns: int) -> list[list[str]]:
    rows = []
    for periods in (10, 100):
        problem = problems()[f"founding-{periods}-0"]
        end, exact = problem.t_span[1], problem.reference.state
        for tol in TOLERANCES:
            solver = Taylor(rtol=tol, atol=tol / 100)
            theirs = heyoka_taylor.methods(problem)["heyoka"]

            def ours(problem=problem, end=end, solver=solver) -> Any:
                return simulate(
                    problem.system,
                    problem.x0,
                    problem.t_span,
                    mode=problem.mode,
                    samples=[end],
                    solver=solver,
                )

            errors = [
                np.abs(x - exact).max() / np.abs(exact).max() for x in (ours().x[-1], theirs(tol).state)
            ]
            one, other = least_in_turns([ours, lambda theirs=theirs, tol=tol: theirs(tol)], turns)
            cells = [str(periods), f"{tol:.0e}", f"{1e3 * one:.3f}", f"{1e3 * other:.3f}"]
            rows.append([*cells, f"{other / one:.2f}", *(f"{error:.0e}" for error in errors)])
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--turns", type=int, default=40, help="turns of each run")
    turns = parser.parse_args().turns
    heading("Processor time of runs, and heyoka's divided by ours.")
    ms = ["hybrid, ms", "heyoka, ms", "ratio"]
    table(["periods", "rtol", *ms, "error", "heyoka's"], founding(turns))
    table(["states", "time", "hits", "rtol", *ms, "apart"], chains(turns))


if __name__ == "__main__":
    main()
