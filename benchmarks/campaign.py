"""Branches of natural systems: each comes back, and all that it lists holds when it is run anew.

Each branch runs in a process of its own, over a narrow and a wide span. Every bifurcation is checked by a run
of the system itself from its orbit: it lies within the span, the run closes, and its multipliers, from runs
alone, are what its kind says. Where a bifurcation of the narrow span is not found over the wide one, that is
told too. A dozen systems are written as users write them.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from typing import Any

import attrs
import numpy as np

import models
from benchmarks import written
from benchmarks.common import heading, table
from hybrid import Branch, PeriodicOrbit, Taylor, continue_orbit, periodic_orbit, simulate

Spans = dict[str, tuple[tuple[float, float], tuple[float, float]]]

# A run closes, and a multiplier is what its kind says, to these.
CLOSES = 1e-6
NEAR = 1e-3
# A bifurcation is found again at this share of the narrow span.
AGREES = 1e-6
LIMIT = 60.0


@attrs.frozen
class Case:
    """A system with a start, and the narrow and the wide span of each parameter."""

    system: Callable[[], Any]
    x0: tuple[float, ...]
    spans: Spans
    mode: str | None = None
    parameters: dict[str, float] = attrs.Factory(dict)
    settle: float = 300.0
    period: float | None = None
    periods: int = 1

    def orbit(self) -> PeriodicOrbit:
        """The orbit that a run settles to; the run takes so many periods, or so much time without forcing."""
        system = self.system()
        forcing = system.forcing_period(self.parameters or None)
        span = (0.0, self.settle * (forcing or 1.0))
        arc = simulate(system, self.x0, span, mode=self.mode, parameters=self.parameters)
        guess = {"periods": self.periods} if forcing else {"period": self.period}
        return periodic_orbit(system, arc.x[-1], mode=str(arc.mode[-1]), parameters=self.parameters, **guess)


def _model(name: str, x0: tuple[float, ...], spans: Spans, **options: Any) -> Case:
    return Case(getattr(models, name), x0, spans, **options)


def _own(name: str, x0: tuple[float, ...], spans: Spans, **options: Any) -> Case:
    return Case(getattr(written, name), x0, spans, **options)


CASES: dict[str, Case] = {
    "vibroimpact": _model(
        "vibroimpact",
        (0.0, 0.02, 0.0, 0.0),
        {"omega": ((7.0, 8.0), (5.0, 12.0)), "P": ((450, 550), (300, 900))},
        settle=600,
    ),
    "impact oscillator": _model(
        "impact_oscillator", (0.9, 1.0), {"w": ((0.9, 1.2), (0.75, 1.9)), "r": ((0.7, 0.9), (0.3, 0.99))}
    ),
    "bilinear oscillator": _model("bilinear_oscillator", (0.0, 0.0), {"w": ((0.8, 1.5), (0.45, 3.0))}),
    "stop oscillator": _model(
        "stop_oscillator",
        (0.1, 0.5),
        {"w": ((0.95, 1.05), (0.5, 2.5))},
        parameters={"F0": 0.5, "A": 2.0},
    ),
    "dry friction": _model(
        "dry_friction_oscillator", (1.0, 0.0), {"w": ((0.6, 0.8), (0.5, 0.95))}, mode="above"
    ),
    "bouncing table": _model(
        "bouncing_table", (0.001, 0.3), {"w": ((32.0, 39.0), (20.0, 60.0))}, mode="flight"
    ),
    "buck converter": _model(
        "buck_converter",
        (12.0, 0.5, 0.0),
        {"E": ((15.0, 23.0), (10.0, 33.0)), "V_ref": ((11.0, 11.6), (8.0, 13.0))},
        mode="on",
        parameters={"E": 20.0},
    ),
    "boost converter": _model(
        "boost_converter",
        (0.5, 15.0, 0.0),
        {"I_ref": ((0.7, 1.2), (0.3, 2.5))},
        parameters={"I_ref": 0.8},
    ),
    "sampled loop": _model(
        "sampled_loop", (1.0, 1.0, 0.0), {"Kp": ((3.0, 8.0), (0.5, 30.0)), "r": ((0.5, 1.2), (-2.0, 2.0))}
    ),
    "impact pair": _model("impact_pair", (0.1, 2.0), {"d": ((3.5, 4.5), (1.0, 8.0))}),
    "stick-slip": _model(
        "stick_slip", (0.5, 0.2), {"belt": ((0.15, 0.25), (0.02, 1.0))}, settle=200, period=12.0
    ),
    "rimless wheel": _model(
        "rimless_wheel", (0.0, 0.6), {"gamma": ((0.07, 0.1), (0.04, 0.3))}, settle=60, period=1.0
    ),
    "gear pair": _own(
        "gear_pair", (1.1, 0, 0, 0), {"Om": ((0.8, 1.6), (0.3, 1.6)), "eps": ((0.1, 0.3), (0, 0.6))}
    ),
    "sigma-delta": _own(
        "sigma_delta", (0.65,), {"u": ((0.0, 0.1), (-0.9, 0.9)), "a": ((0.7, 0.9), (0.05, 0.99))}, periods=2
    ),
    "driven neuron": _own(
        "driven_neuron", (0.1,), {"I": ((1.35, 1.45), (1.05, 3.0)), "k": ((0.2, 0.4), (0, 1))}
    ),
    "buck with a diode": _own(
        "buck", (1.0, 12.0), {"D": ((0.4, 0.6), (0.05, 0.95)), "R": ((8, 15), (1.0, 400.0))}, settle=3000
    ),
    "relay": _own(
        "relay",
        (1.0, 0.0, 0.0),
        {"h": ((0.03, 0.1), (0.0, 1.0)), "a": ((0.8, 1.2), (0.1, 3))},
        settle=200,
        period=4.712,
    ),
    "thermostat": _own(
        "thermostat", (20.0,), {"mean": ((4.9, 5.1), (-5, 20)), "heat": ((3.4, 3.6), (2.0, 6.0))}
    ),
    "harvest": _own(
        "harvest",
        (0.3, 0.5),
        {"alpha": ((0.45, 0.55), (0.2, 1.2)), "e": ((0.15, 0.25), (0.0, 0.6))},
        settle=3000,
        period=60.0,
    ),
    "belt": _own("belt", (0.1, 0.1), {"Om": ((0.75, 0.85), (0.4, 2.0)), "F": ((0.25, 0.35), (0.05, 1.0))}),
    "preloaded": _own(
        "preloaded", (0.1, 0.0), {"w": ((0.85, 1.0), (0.3, 2.5)), "F": ((0.15, 0.3), (0.05, 1))}
    ),
    "duffing with a stop": _own(
        "duffing_with_stop", (1.0, 0.0), {"F": ((0.15, 0.25), (0.02, 0.6)), "w": ((0.9, 1.1), (0.5, 2.5))}
    ),
    "vaccination": _own(
        "vaccination", (0.1, 1e-3), {"share": ((0.02, 0.1), (0.0, 0.3)), "beta": ((500, 700), (300, 2000))}
    ),
    "relief valve": _own(
        "relief_valve",
        (5.0, 0.0, 15.0),
        {"q": ((4.5, 5.5), (0.5, 10.0)), "beta": ((18, 22), (5, 40))},
        settle=300,
        period=2.155,
    ),
}


@attrs.frozen
class Outcome:
    """What one branch gave: its text, seconds, what is wrong with it, and its bifurcations."""

    text: str
    seconds: float
    faults: list[str]
    listed: list[tuple[str, float]]


def once(orbit: PeriodicOrbit, period: float) -> tuple[float, np.ndarray]:
    """How far a run from an orbit is from closing after a time, and the eigenvalues of its tangent map."""
    arc = simulate(
        orbit.system,
        orbit.x0,
        (orbit.t0, orbit.t0 + period),
        mode=orbit.mode,
        parameters=orbit.parameters,
        solver=Taylor(rtol=1e-12, atol=1e-14),
        tangent=True,
    )
    n, lengths = orbit.system.tangent_dimension, orbit.system.turn_lengths
    change = arc.x[-1, :n] - arc.x[0, :n]
    change -= np.where(
        lengths[:n] > 0, lengths[:n] * np.round(change / np.where(lengths[:n] > 0, lengths[:n], 1)), 0
    )
    sizes = np.abs(arc.x[:, :n]).max(axis=0)
    sizes = np.maximum(sizes, 1e-3 * sizes.max())
    return float(np.abs(change / sizes).max()), np.linalg.eigvals(arc.fundamental)


def faults_of(branch: Branch, span: tuple[float, float]) -> list[str]:
    """What does not hold when it is run anew."""
    found = []
    if not span[0] <= branch.parameter.min() <= branch.parameter.max() <= span[1]:
        found.append("outside the span")
    for i in range(0, len(branch), max(1, len(branch) // 6)):
        gap, _ = once(branch.orbit(i), float(branch.period[i]))
        if gap > CLOSES:
            found.append(f"orbit {i} misses its start by {gap:.1e}")
    for each in branch.bifurcations:
        halved = "half the period" in each.message
        gap, values = once(each.orbit, each.orbit.period / (2 if halved else 1))
        label = f"{each.kind} at {each.value:.6g}"
        if not span[0] <= each.value <= span[1]:
            found.append(f"{label}: outside the span")
        if each.kind in ("fold", "flip", "torus") and gap > CLOSES:
            found.append(f"{label}: misses its start by {gap:.1e}")
        apart = {
            "fold": lambda values: np.abs(values - 1).min(),
            "flip": lambda values: np.abs(values + 1).min(),
            "torus": lambda values: min(
                (abs(abs(v) - 1) for v in values if abs(v.imag) > NEAR), default=np.inf
            ),
        }
        if each.kind in apart and not apart[each.kind](values) < NEAR:
            found.append(f"{label}: multipliers {np.round(values, 4)}")
    return found


def branch_of(name: str, parameter: str, span: tuple[float, float]) -> Outcome:
    """One branch, in this process."""
    orbit = CASES[name].orbit()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        start = time.process_time()
        branch = continue_orbit(orbit, parameter, span, progress=False)
        seconds = time.process_time() - start
    faults = [f"warning: {each.message}" for each in told[:1]]
    faults += faults_of(branch, span)
    counts = {}
    for each in branch.bifurcations:
        counts[each.kind] = counts.get(each.kind, 0) + 1
    kinds = ", ".join(f"{count} {kind}" for kind, count in counts.items())
    text = f"{len(branch)} orbits; {kinds or 'nothing'}; {branch.status.message}"
    return Outcome(text, seconds, faults, [(each.kind, each.value) for each in branch.bifurcations])


def apart(name: str, parameter: str, which: int) -> Outcome:
    """The same in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.campaign", "--one", name, parameter, str(which)]
    try:
        made = subprocess.run(command, capture_output=True, text=True, timeout=3 * LIMIT, check=False)
    except subprocess.TimeoutExpired:
        return Outcome("", np.inf, [f"not back after {3 * LIMIT:g} s"], [])
    if made.returncode:
        return Outcome("", 0.0, [made.stderr.strip().splitlines()[-1]], [])
    return Outcome(**json.loads(made.stdout.splitlines()[-1]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="only these systems")
    parser.add_argument("--one", nargs=3, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        name, parameter, which = given.one
        outcome = branch_of(name, parameter, CASES[name].spans[parameter][int(which)])
        print(json.dumps(attrs.asdict(outcome)))
        return
    heading(__doc__.splitlines()[0])
    rows, wrong = [], 0
    for name, case in CASES.items():
        if given.names and name not in given.names:
            continue
        for parameter, spans in case.spans.items():
            narrow, wide = (apart(name, parameter, which) for which in (0, 1))
            size = spans[0][1] - spans[0][0]
            for kind, value in narrow.listed:
                if wide.text and not any(
                    kind == other and abs(value - there) < AGREES * size for other, there in wide.listed
                ):
                    wide.faults.append(f"{kind} at {value:.6g} of the narrow span is missing")
            for span, outcome in zip(spans, (narrow, wide), strict=True):
                if outcome.seconds > LIMIT:
                    outcome.faults.append("longer than a minute")
                wrong += bool(outcome.faults)
                over = f"{parameter} {span[0]:g} to {span[1]:g}"
                faults = "; ".join(outcome.faults)
                rows.append((name, over, f"{outcome.seconds:.1f} s", outcome.text, faults))
                print(*rows[-1], sep=" | ", flush=True)
    print()
    table(("system", "over", "time", "found", "wrong"), rows)
    print(f"{len(rows)} branches, {wrong} with something wrong")


if __name__ == "__main__":
    main()
