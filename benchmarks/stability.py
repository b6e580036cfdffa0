"""Where methods go wrong: measured errors and miscounted events, here and with SciPy as it is used today.

``python -m benchmarks.stability`` makes ``docs/stability.png``; ``--periods 1000000`` is long.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Iterable
from typing import Any

import attrs
import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp

import hybrid
import models
from benchmarks.common import ROOT, heading, table
from benchmarks.peers import Edge, GivenUp, Outcome, straight, with_events
from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, Transition, Tsit5, simulate
from hybrid.kernels import codes
from hybrid.plot import COLOURS
from hybrid.run import start
from models.impact_oscillator import one_impact_orbits

PICTURE = ROOT / "docs" / "stability.png"
G = 9.81
# Relative and absolute tolerances of the two runs of each method.
TIGHT, LOOSE = {"rtol": 1e-10, "atol": 1e-12}, {"rtol": 1e-5, "atol": 1e-7}
OURS: dict[str, Any] = {
    "DOP853, tight": DOP853(**TIGHT),
    "DOP853, loose": DOP853(**LOOSE),
    "Tsit5": Tsit5(**TIGHT),
}
# The implicit method is one of the library's only from some version on.
IMPLICIT = getattr(hybrid, "RadauIIA", None)
if IMPLICIT is not None:
    OURS["RadauIIA"] = IMPLICIT(**TIGHT)
THEIRS = ("SciPy, events", "SciPy, straight", "SciPy, smoothed", "SciPy, straight, loose")
# Width of the smoothed step, in units of the state.
WIDTH = 1e-3
# Calls of SciPy's after which its user is taken to have stopped waiting.
MOST_EVENTS = 1500
# Errors below this are drawn here.
LEAST = 1e-17
WITHOUT_PERIOD = "DOP853, time not split"
STYLES: dict[str, dict[str, Any]] = {
    "DOP853, tight": {"color": COLOURS[0], "marker": "o"},
    "DOP853, loose": {"color": COLOURS[5], "marker": "o", "markerfacecolor": "white"},
    "Tsit5": {"color": COLOURS[2], "marker": "s"},
    "RadauIIA": {"color": COLOURS[6], "marker": "D"},
    WITHOUT_PERIOD: {"color": COLOURS[0], "linestyle": ":"},
    "SciPy, events": {"color": COLOURS[1], "marker": "^", "linestyle": "--"},
    "SciPy, straight": {"color": COLOURS[3], "marker": "v", "linestyle": "--"},
    "SciPy, straight, loose": {
        "color": COLOURS[3],
        "marker": "v",
        "markerfacecolor": "white",
        "linestyle": ":",
    },
    "SciPy, smoothed": {"color": COLOURS[4], "marker": "x", "linestyle": "--"},
    "SciPy Radau": {"color": COLOURS[6], "marker": "+", "linestyle": "--"},
}
PLAIN = {"linewidth": 1.3, "markersize": 3.6, "markeredgewidth": 1.0}
Curves = dict[str, list[tuple[float, float]]]


def measure(
    curves: Curves,
    name: str,
    at: float,
    distance: Callable[[np.ndarray], float],
    run: Any,
    *arguments: Any,
    **options: Any,
) -> None:
    """Add the distance of a run's end from the truth as a point; none if the run was given up or failed."""
    try:
        result = run(*arguments, **options)
        x = result.x if isinstance(result, Outcome) else result.x[-1]
        done = isinstance(result, Outcome) or result.status.ok
        value = max(distance(x), LEAST) if done else math.nan
    except (GivenUp, ValueError, StopIteration):
        value = math.nan
    curves.setdefault(name, []).append((at, value))


# Penalty wall: x'' = -g, and -K x more below zero. Elastic and piecewise linear, so in closed form.
def penalty_wall() -> HybridSystem:
    return HybridSystem(
        name="penalty wall",
        state=("x", "v"),
        parameters={"K": 1e4, "c": 0.0},
        modes=[
            Mode("free", lambda t, x, p: (x.v, -G)),
            Mode("contact", lambda t, x, p: (x.v, -G - p.K * x.x - p.c * x.v)),
        ],
        transitions=[
            Transition("free", "contact", Guard(lambda t, x, p: x.x, direction=-1)),
            Transition("contact", "free", Guard(lambda t, x, p: x.x, direction=+1)),
        ],
    )


def wall_fields(K: float, c: float) -> tuple[list[Any], list[list[Edge]]]:
    def free(t, x):
        return x[1], -G

    def contact(t, x):
        return x[1], -G - K * x[0] - c * x[1]

    def height(t, x):
        return x[0]

    return [free, contact], [[Edge(height, -1, 1)], [Edge(height, +1, 0)]]


def bounced(K: float, bounces: int) -> float:
    """Time half-way down from the top of the flight after that many elastic bounces from height 1."""
    speed, w = math.sqrt(2 * G), math.sqrt(K)
    # x = (-1 + cos s) g / K - (speed / w) sin s returns to zero at tan(s / 2) = -speed w / g.
    contact = 2 * (math.pi - math.atan2(speed * w, G)) / w
    return bounces * (2 * speed / G + contact) + math.sqrt(1 / G)


def stiffness_curves(bounces: int = 5) -> Curves:
    """Error of the height half-way down a flight, where an error of energy shows, and one of phase too."""
    curves: Curves = {}
    system = penalty_wall()
    options = {"method": "DOP853", **TIGHT}
    for K in 10.0 ** np.arange(2, 8.1, 0.5):
        run = (1.0, 0.0), (0.0, bounced(K, bounces))
        for name, solver in OURS.items():
            measure(
                curves,
                name,
                K,
                off_the_middle,
                simulate,
                system,
                *run,
                mode="free",
                parameters={"K": K},
                solver=solver,
            )
        measure(curves, THEIRS[0], K, off_the_middle, with_events, *wall_fields(K, 0.0), *run, **options)
        measure(curves, THEIRS[1], K, off_the_middle, straight, switched_wall(K), *run, **options)
        measure(
            curves, THEIRS[3], K, off_the_middle, straight, switched_wall(K), *run, method="DOP853", **LOOSE
        )
        measure(curves, THEIRS[2], K, off_the_middle, straight, smoothed_wall(K), *run, **options)
    return curves


def off_the_middle(x: np.ndarray) -> float:
    return abs(float(x[0]) - 0.5)


def switched_wall(K: float) -> Any:
    return lambda t, x: (x[1], -G - K * min(x[0], 0.0))


def smoothed_wall(K: float) -> Any:
    return lambda t, x: (x[1], -G - K * x[0] * 0.5 * (1 - math.tanh(x[0] / WIDTH)))


# A motion that dips below its guard by the same depth once a turn.
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
    """Share of the crossings that a method misses without a word, over the depth of the dips."""
    curves: Curves = {}
    system = dipping()
    rng = np.random.default_rng(1)
    starts = rng.uniform(0.2, 2.0, phases)
    expected = 2 * turns * phases
    for depth in 10.0 ** -np.arange(1, 13.1, 0.5):

        def begin(phase: float, depth: float = depth) -> tuple[float, float, float]:
            return 1 - depth + math.cos(phase), -math.sin(phase), 0.0

        end = 2 * math.pi * turns
        for name, solver in OURS.items():
            found, said = 0, 0
            for phase in starts:
                arc = simulate(system, begin(phase), (0, end), parameters={"depth": depth}, solver=solver)
                found += len(arc.jumps)
                # A grazing says that two crossings, or none, are within the tolerances there.
                said += 2 * len(arc.grazings)
            silent = max(expected - found - said, 0) if found <= expected else found - expected
            curves.setdefault(name, []).append((depth, silent / expected))
            curves.setdefault(f"{name}: reported", []).append((depth, said / expected))

        def swing(t, x, depth=depth):
            return x[1], 1 - depth - x[0]

        def crossing(t, x):
            return x[0]

        found = 0
        for phase in starts:
            found += crossings(swing, begin(phase)[:2], end, crossing)
        curves.setdefault(THEIRS[0], []).append((depth, abs(expected - found) / expected))
    return curves


def crossings(field: Any, x0: tuple[float, ...], end: float, event: Any) -> int:
    return len(solve_ivp(field, (0, end), x0, method="DOP853", events=event, **TIGHT).t_events[0])


# A ball on rigid ground, to one and a half times the limit of its bounces.
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


def restitution_curves() -> tuple[Curves, Curves]:
    """Events computed up to one and a half times the limit time, and the relative error of that limit."""
    counts: Curves = {}
    errors: Curves = {}
    system = resting_ball()
    ends = 10.0 ** -np.arange(1, 4.1, 0.5)
    for e in np.concatenate([ends[::-1], np.arange(0.2, 0.85, 0.1), 1 - ends]):
        limit = math.sqrt(2 / G) * (1 + e) / (1 - e)
        run = (1.0, 0.0), (0.0, 1.5 * limit)
        for name, solver in OURS.items():
            arc = simulate(system, *run, mode="flight", parameters={"e": e}, solver=solver)
            counts.setdefault(name, []).append((e, len(arc.jumps) if arc.status.ok else math.nan))
            errors.setdefault(name, []).append((e, max(abs(arc.jumps[-1].t / limit - 1), LEAST)))
        outcome = with_events(
            [fall], [[ground(e)]], *run, most_events=MOST_EVENTS, method="DOP853", rtol=1e-10, atol=1e-12
        )
        counts.setdefault(THEIRS[0], []).append((e, len(outcome.events)))
    return counts, errors


def fall(t: float, x: np.ndarray) -> tuple[float, float]:
    return x[1], -G


def ground(e: float) -> Edge:
    return Edge(lambda t, x: x[0], -1, 0, lambda x: (0.0, -e * x[1]))


def damping_curves(span: float = 0.3) -> tuple[Curves, Curves]:
    """Seconds, and error of the height, for a landing on a damped wall that does not let go again."""
    errors: Curves = {}
    seconds: Curves = {}
    system = penalty_wall()
    K, speed = 1e4, 1.0
    for c in 10.0 ** np.arange(2.5, 8.6, 0.5):
        exact = sunk(K, c, speed, span)
        for name, solver in OURS.items():
            solver = attrs.evolve(solver, max_steps=300_000)
            parameters = {"K": K, "c": c}
            begin = time.perf_counter()
            arc = simulate(
                system,
                (0.0, -speed),
                (0, span),
                mode="contact",
                parameters=parameters,
                solver=solver,
                samples=[span],
            )
            spent = time.perf_counter() - begin
            done = arc.status.ok
            seconds.setdefault(name, []).append((c, spent if done else math.nan))
            error = max(abs(arc.x[-1, 0] - exact), LEAST) if done else math.nan
            errors.setdefault(name, []).append((c, error))
        contact = wall_fields(K, c)[0][1]
        for name, method in (("SciPy, events", "DOP853"), ("SciPy Radau", "Radau")):
            if method == "DOP853" and c > 2e5:
                continue
            begin = time.perf_counter()
            solution = solve_ivp(contact, (0, span), (0.0, -speed), method=method, **TIGHT)
            seconds.setdefault(name, []).append((c, time.perf_counter() - begin))
            errors.setdefault(name, []).append((c, max(abs(solution.y[0, -1] - exact), LEAST)))
    return seconds, errors


def sunk(K: float, c: float, speed: float, t: float) -> float:
    """Height after ``t`` in the damped contact from zero height, for a wall that is overdamped."""
    root = math.sqrt(c * c - 4 * K)
    fast, slow = -(c + root) / 2, -2 * K / (c + root)
    # x = -g/K + a exp(fast t) + b exp(slow t)
    b = (-speed - fast * G / K) / (slow - fast)
    a = G / K - b
    # b (exp - 1) and a together, without cancellation of the weight.
    return a * math.expm1(fast * t) + b * math.expm1(slow * t)


def split_curves(clocks: int = 60) -> Curves:
    """Share of runs with a wrong count if they are split within ulps of an event: a clock that runs out."""
    curves: Curves = {}
    system = HybridSystem(
        name="clock",
        state=("x", "n"),
        modes=[Mode("run", lambda t, x, p: (-1.0, 0.0))],
        transitions=[
            Transition("run", "run", Guard(lambda t, x, p: x.x), Reset(lambda t, x, p: (x.x, x.n + 1)))
        ],
    )
    for ulps in (-1000, -100, -30, -10, -3, -1, 0, 1, 3, 10, 30, 100, 1000):
        wrong = dict.fromkeys([*OURS, THEIRS[0]], 0)
        for h in np.random.default_rng(2).uniform(0.5, 2.0, clocks):
            cut = h + ulps * np.spacing(h)
            for name, solver in OURS.items():
                one = simulate(system, (h, 0.0), (0.0, cut), solver=solver)
                two = simulate(system, one.x[-1], (cut, 2 * h), solver=solver)
                wrong[name] += two.x[-1, 1] != 1
            options = {"method": "DOP853", "events": lambda t, x: x[0], **TIGHT}
            one = solve_ivp(lambda t, x: [-1.0], (0.0, cut), [h], **options)
            two = solve_ivp(lambda t, x: [-1.0], (cut, 2 * h), one.y[:, -1], **options)
            wrong[THEIRS[0]] += len(one.t_events[0]) + len(two.t_events[0]) != 1
        for name, count in wrong.items():
            curves.setdefault(name, []).append((ulps, count / clocks))
    return curves


def phase_curves(periods: int) -> Curves:
    """Error of the forcing phase at the impacts of a stable orbit, over the number of periods."""
    system = models.impact_oscillator()
    p = dict(system.parameters)
    (orbit,) = one_impact_orbits(**p)
    period, phase = 2 * math.pi / p["w"], orbit.theta / p["w"]
    after = (p["d"], -p["r"] * orbit.V)
    counts = np.unique(np.geomspace(1, periods, 40).astype(int))
    curves: Curves = {}
    for name, solver in OURS.items():
        curves[name] = phases(system, after, phase, period, counts, solver)
    plain = attrs.evolve(system, period=None)
    curves[WITHOUT_PERIOD] = phases(plain, after, phase, period, counts, OURS["DOP853, tight"])

    def flight(t, x):
        return x[1], p["A"] * math.cos(p["w"] * t) - p["c"] * x[1] - p["k"] * x[0]

    edge = Edge(lambda t, x: x[0] - p["d"], +1, 0, lambda x: (p["d"], -p["r"] * x[1]))
    span = (phase, phase + (min(periods, 1000) + 0.5) * period)
    times = with_events([flight], [[edge]], after, span, method="DOP853", **TIGHT).events
    number = np.arange(1, len(times) + 1)
    errors = np.maximum.accumulate(np.maximum(np.abs(times - phase - number * period), LEAST))
    chosen = counts[counts <= len(times)]
    curves[THEIRS[0]] = [(int(count), float(errors[count - 1])) for count in chosen]
    return curves


def phases(
    system: HybridSystem,
    after: tuple[float, float],
    phase: float,
    period: float,
    counts: Iterable[int],
    solver: Any,
) -> list[tuple[float, float]]:
    """Largest phase error so far of the impacts in the periods counted, in one run that keeps no history."""
    trajectory = start(system, after, phase, solver=solver)
    record = trajectory.no_record()
    errors, largest = [], 0.0
    for count in counts:
        trajectory.advance(phase + (count + 0.5) * period, record)
        clock, cycles = trajectory.run.clock, trajectory.run.count[codes.JUMPS]
        found = float(clock[codes.LAST_JUMP_PHASE]) - phase
        # With a period that is a phase already, without it a time.
        whole = round(found / period) if trajectory.model.period > 0 else cycles
        # The largest so far: a time as one number is right now and then by chance.
        largest = max(largest, abs(found - whole * period))
        errors.append((float(count), max(largest, LEAST)))
    return errors


def draw(axes: Any, curves: Curves) -> None:
    for name, points in curves.items():
        if name not in STYLES:
            continue
        x, y = np.array(points).T
        axes.plot(x, y, label=name, **{**PLAIN, **STYLES[name]})


def finish(axes: Any, letter: str, title: str, xlabel: str, ylabel: str) -> None:
    axes.set_title(f"{letter}  {title}", loc="left", fontsize=9.5, fontweight="bold")
    axes.set_xlabel(xlabel)
    axes.set_ylabel(ylabel)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(which="minor", length=0)


def picture(panels: dict[str, Curves], periods: int) -> None:
    figure, grid = plt.subplots(2, 3, figsize=(11.4, 7.2))
    stiff, grazing, restitution, damping, split, phase = grid.ravel()

    draw(stiff, panels["stiffness"])
    stiff.set(xscale="log", yscale="log", ylim=(1e-12, 1e0))
    finish(
        stiff, "a", "Stiff contact, elastic", "wall stiffness $K$ (1/s²)", "height error after 5 bounces (m)"
    )

    draw(grazing, panels["grazing"])
    reported = np.array(panels["grazing"]["DOP853, tight: reported"]).T
    grazing.fill_between(*reported, color=COLOURS[0], alpha=0.13, linewidth=0, label="reported as grazing")
    grazing.set(xscale="log", ylim=(-0.04, 1.08))
    grazing.invert_xaxis()
    finish(grazing, "b", "Near grazing", "depth of the dips", "crossings miscounted silently (share)")

    draw(restitution, panels["restitution"])
    restitution.axhline(MOST_EVENTS, color="0.4", linewidth=0.8, linestyle=":")
    restitution.annotate(
        "stopped here, at the limit for ever", (0.5, MOST_EVENTS * 1.15), ha="center", fontsize=8
    )
    restitution.set(xscale="logit", yscale="log", ylim=(3, 5000))
    restitution.set_xticks([1e-4, 1e-2, 0.5, 0.99, 0.9999], ["$10^{-4}$", "0.01", "0.5", "0.99", "0.9999"])
    finish(restitution, "c", "Through the limit of the bounces", "restitution $e$", "events computed")

    draw(damping, panels["damping"])
    damping.set(xscale="log", yscale="log")
    finish(damping, "d", "Damped contact, overdamped", "wall damping $c$ (1/s)", "time to solution (s)")

    draw(split, panels["split"])
    split.set_xscale("symlog", linthresh=1, linscale=0.4)
    split.set_xticks([-1000, -30, -1, 1, 30, 1000], ["−1000", "−30", "−1", "1", "30", "1000"])
    split.set_ylim(-0.04, 1.08)
    finish(split, "e", "Run split at an event", "split minus event (ulp)", "runs with a wrong count (share)")

    draw(phase, panels["phase"])
    phase.set(xscale="log", yscale="log", ylim=(1e-14, 1e-5))
    finish(
        phase,
        "f",
        f"{periods:,} periods".replace(",", " "),
        "forcing periods",
        "largest phase error of impacts (rad)",
    )

    shown: dict[str, Any] = {}
    for axes in grid.ravel():
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            shown.setdefault(label, handle)
    figure.tight_layout(rect=(0, 0.075, 1, 1), w_pad=2.0, h_pad=2.0)
    figure.legend(shown.values(), shown.keys(), loc="lower center", ncols=5, frameon=False, fontsize=8.5)
    figure.savefig(PICTURE, dpi=150, metadata={"Software": None})


def summary(panels: dict[str, Curves]) -> None:
    rows = []
    for panel, curves in panels.items():
        for name, points in curves.items():
            values = np.array([value for _, value in points])
            good = values[np.isfinite(values)]
            given_up = str(len(values) - len(good))
            if len(good):
                spread = [f"{number:.1e}" for number in (good.min(), np.median(good), good.max())]
            else:
                spread = ["-"] * 3
            rows.append([panel, name, *spread, given_up])
    table(["panel", "method", "least", "median", "largest", "no result"], rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--periods", type=int, default=100_000, help="periods of panel f")
    arguments = parser.parse_args()
    heading("Where methods go wrong: errors against closed forms, and miscounted events.")
    panels: dict[str, Curves] = {}
    jobs: dict[str, Callable[[], Curves]] = {
        "stiffness": stiffness_curves,
        "grazing": grazing_curves,
        "split": split_curves,
        "phase": lambda: phase_curves(arguments.periods),
    }
    for name, job in jobs.items():
        begin = time.perf_counter()
        panels[name] = job()
        print(f"{name}: {time.perf_counter() - begin:.0f} s", flush=True)
    begin = time.perf_counter()
    panels["restitution"], panels["restitution: limit time"] = restitution_curves()
    panels["damping"], panels["damping: error"] = damping_curves()
    print(f"restitution, damping: {time.perf_counter() - begin:.0f} s\n", flush=True)
    summary(panels)
    with plt.rc_context({"font.size": 9, "axes.linewidth": 0.7}):
        picture(panels, arguments.periods)
    print(f"Picture: {PICTURE.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
