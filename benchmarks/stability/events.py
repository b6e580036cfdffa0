"""Panels b, c and e: shallow dips below a guard, the limit of bounces, and a run split at an event."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.peers.scipy_ivp import Edge, with_events
from benchmarks.stability.methods import EVENTS, LEAST, OURS, SCIPY, Curves
from benchmarks.stability.wall import G
from hybrid import Guard, HybridSystem, Mode, Reset, Transition, simulate

# SciPy's run of the bouncing ball is stopped after this many events.
MOST_EVENTS = 1000
# Value drawn for a ball that never comes to rest.
NEVER = 1.0


# A motion that dips below its guard by the same depth once per turn.
def dipping() -> HybridSystem:
    return HybridSystem(
        name="dips",
        state=("q", "v", "n"),
        parameters={"depth": 0.1},
        modes=[Mode("swing", lambda t, x, p: (x.v, 1 - p.depth - x.q, 0.0))],
        transitions=[
            Transition(
                "swing", "swing", Guard(lambda t, x, p: x.q), Reset(lambda t, x, p: (x.q, x.v, x.n + 1))
            )
        ],
    )


def grazing_curves(turns: int = 10, phases: int = 6) -> Curves:
    """Share of crossings that a method miscounts without a report, over the depth of the dips."""
    curves: Curves = {}
    system = dipping()
    rng = np.random.default_rng(1)
    starts = rng.uniform(0.2, 2.0, phases)
    expected = 2 * turns * phases
    end = 2 * math.pi * turns
    for depth in 10.0 ** -np.arange(1, 13.1, 0.5):

        def begin(phase: float, depth: float = depth) -> tuple[float, float, float]:
            return 1 - depth + math.cos(phase), -math.sin(phase), 0.0

        for name, solver in OURS.items():
            found, said = 0, 0
            for phase in starts:
                arc = simulate(system, begin(phase), (0, end), parameters={"depth": depth}, solver=solver)
                found += len(arc.jumps)
                # A reported grazing stands for two crossings or none, within the tolerances.
                said += 2 * len(arc.grazings)
            silent = max(expected - found - said, 0) if found <= expected else found - expected
            curves.setdefault(name, []).append((depth, silent / expected))
            curves.setdefault(f"{name}: reported", []).append((depth, said / expected))

        def swing(t, x, depth=depth):
            return x[1], 1 - depth - x[0]

        def crossing(t, x):
            return x[0]

        runs = [solve_ivp(swing, (0, end), begin(phase)[:2], events=crossing, **SCIPY) for phase in starts]
        found = sum(len(run.t_events[0]) for run in runs)
        curves.setdefault(EVENTS, []).append((depth, abs(expected - found) / expected))
    return curves


# A ball on rigid ground, simulated to 1.5 times the limit of its bounces.
def resting_ball() -> HybridSystem:
    return HybridSystem(
        name="ball",
        state=("q", "v"),
        parameters={"e": 0.8},
        modes=[Mode("flight", lambda t, x, p: (x.v, -G)), Mode("rest", lambda t, x, p: (0.0, 0.0))],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, direction=-1),
                Reset(lambda t, x, p: (0.0, -p.e * x.v)),
                accumulates_to="rest",
            )
        ],
    )


def restitution_curves() -> Curves:
    """Relative error of the time at which the ball comes to rest; ``NEVER`` if it does not."""
    curves: Curves = {}
    system = resting_ball()
    ends = 10.0 ** -np.arange(1, 4.1, 0.5)
    for e in np.concatenate([ends[::-1], np.arange(0.2, 0.85, 0.1), 1 - ends]):
        limit = math.sqrt(2 / G) * (1 + e) / (1 - e)
        run = (1.0, 0.0), (0.0, 1.5 * limit)
        for name, solver in OURS.items():
            arc = simulate(system, *run, mode="flight", parameters={"e": e}, solver=solver)
            rests = arc.status.ok and arc.mode[-1] == "rest"
            error = max(abs(arc.jumps[-1].t / limit - 1), LEAST) if rests else NEVER
            curves.setdefault(name, []).append((e, error))
        bounces = with_events([fall], [[ground(e)]], *run, most_events=MOST_EVENTS, **SCIPY).events
        # SciPy reports no limit, so the time of the last bounce is used unless the bounces go on.
        gone_on = len(bounces) == MOST_EVENTS
        curves.setdefault(EVENTS, []).append((e, NEVER if gone_on else abs(bounces[-1] / limit - 1)))
    return curves


def fall(t: float, x: np.ndarray) -> tuple[float, float]:
    return x[1], -G


def ground(e: float) -> Edge:
    return Edge(lambda t, x: x[0], -1, 0, lambda x: (0.0, -e * x[1]))


def clock() -> HybridSystem:
    return HybridSystem(
        name="clock",
        state=("x", "n"),
        modes=[Mode("run", lambda t, x, p: (-1.0, 0.0))],
        transitions=[
            Transition("run", "run", Guard(lambda t, x, p: x.x), Reset(lambda t, x, p: (x.x, x.n + 1)))
        ],
    )


def split_curves(clocks: int = 40) -> Curves:
    """Share of runs of a clock with a wrong event count if the run is split within ulps of the event."""
    curves: Curves = {}
    system = clock()
    options: dict[str, Any] = {"events": lambda t, x: x[0], **SCIPY}
    for ulps in (-1000, -100, -30, -10, -3, -1, 0, 1, 3, 10, 30, 100, 1000):
        wrong = dict.fromkeys([*OURS, EVENTS], 0)
        for h in np.random.default_rng(2).uniform(0.5, 2.0, clocks):
            cut = h + ulps * np.spacing(h)
            for name, solver in OURS.items():
                one = simulate(system, (h, 0.0), (0.0, cut), solver=solver)
                two = simulate(system, one.x[-1], (cut, 2 * h), solver=solver)
                wrong[name] += two.x[-1, 1] != 1
            one = solve_ivp(lambda t, x: [-1.0], (0.0, cut), [h], **options)
            two = solve_ivp(lambda t, x: [-1.0], (cut, 2 * h), one.y[:, -1], **options)
            wrong[EVENTS] += len(one.t_events[0]) + len(two.t_events[0]) != 1
        for name, count in wrong.items():
            curves.setdefault(name, []).append((ulps, count / clocks))
    return curves
