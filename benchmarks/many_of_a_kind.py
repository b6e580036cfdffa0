"""Chains written with `hybrid.repeat` and by hand: time to the end of the first run, and of a long run.

    python -m benchmarks.many_of_a_kind [number of members]

Each member has a transition, and a parameter of its own. By hand, loops of lambdas read the state as an
array, or by names. All compile the same mathematics, so the differences are those of tracing and of checks.
Each time is that of a new process with compiled kernels, and of a model that the cache does not hold: the
least of several.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence

from benchmarks.common import fresh_process, heading, table

REPEATS = 5

NEURONS = """
# Leaky integrate-and-fire neurons in a row, coupled by their potentials.
def repeated(n):
    def rate(t, x, p, i):
        v = x.neuron
        left = v[i - 1].V if i else 0.0
        right = v[i + 1].V if i < n - 1 else 0.0
        return {"V": (p.neuron[i].I - v[i].V + p.k * (left - 2 * v[i].V + right)) / SALT}
    neurons = repeat(
        "neuron", n, state=("V",), parameters={"I": drives(n)}, field=rate,
        transitions=[
            Transition("rise", "rise", Guard(lambda t, x, p, i: x.neuron[i].V - p.peak, +1),
                       Reset(lambda t, x, p, i: {"V": p.low}), name="fire")
        ],
    )
    return HybridSystem(parameters=COMMON, repeats=[neurons], modes=[Mode("rise", lambda t, x, p: ())])

def as_array(n):
    def rates(t, x, p):
        beside = [0.0, *x, 0.0]
        return [(getattr(p, f"I{i}") - x[i] + p.k * (beside[i] - 2 * x[i] + beside[i + 2])) / SALT
                for i in range(n)]
    def fire(i):
        def reset(t, x, p):
            x = list(x)
            x[i] = p.low
            return x
        guard = Guard(lambda t, x, p, i=i: x[i] - p.peak, +1)
        return Transition("rise", "rise", guard, Reset(reset), name=f"fire {i}")
    own = {f"I{i}": drive for i, drive in enumerate(drives(n))}
    return HybridSystem(state=n, parameters=COMMON | own, modes=[Mode("rise", rates)],
                        transitions=[fire(i) for i in range(n)])

def by_names(n):
    def rates(t, x, p):
        beside = [0.0, *x, 0.0]
        return [(getattr(p, f"I{i}") - x[i] + p.k * (beside[i] - 2 * x[i] + beside[i + 2])) / SALT
                for i in range(n)]
    def fire(i):
        guard = Guard(lambda t, x, p: getattr(x, f"V{i}") - p.peak, +1)
        reset = Reset(lambda t, x, p: {f"V{i}": p.low})
        return Transition("rise", "rise", guard, reset, name=f"fire {i}")
    own = {f"I{i}": drive for i, drive in enumerate(drives(n))}
    return HybridSystem(state=tuple(f"V{i}" for i in range(n)), parameters=COMMON | own,
                        modes=[Mode("rise", rates)], transitions=[fire(i) for i in range(n)])

COMMON = {"k": 0.1, "peak": 1.0, "low": 0.0}
def drives(n):
    return [1.2 + 0.3 * math.sin(i) for i in range(n)]
def start(n):
    return [0.5 + 0.4 * math.cos(2 * i) for i in range(n)]
"""

BLOCKS = """
# Blocks in a row on cubic springs, each with a stop.
def repeated(n):
    def rates(t, x, p, i):
        q = x.block[i].q
        left = q - (x.block[i - 1].q if i else 0.0)
        right = (x.block[i + 1].q if i < n - 1 else 0.0) - q
        return {"q": x.block[i].v, "v": pull(p, right) - pull(p, left) + p.block[i].A * np.cos(SALT * t)}
    blocks = repeat(
        "block", n, state=("q", "v"), parameters={"A": pushes(n)}, field=rates,
        transitions=[
            Transition("swing", "swing", Guard(lambda t, x, p, i: x.block[i].q - p.gap, +1),
                       Reset(lambda t, x, p, i: {"v": -p.e * x.block[i].v}), name="stop")
        ],
    )
    return HybridSystem(parameters=COMMON, repeats=[blocks], modes=[Mode("swing", lambda t, x, p: ())])

def by_hand(n, p, t, q, v):
    stretch = [b - a for a, b in zip([0.0, *q], [*q, 0.0])]
    pulls = [pull(p, each) for each in stretch]
    return [e for i in range(n)
            for e in (v[i], pulls[i + 1] - pulls[i] + getattr(p, f"A{i}") * np.cos(SALT * t))]

def as_array(n):
    def stop(i):
        def reset(t, x, p):
            x = list(x)
            x[2 * i + 1] = -p.e * x[2 * i + 1]
            return x
        guard = Guard(lambda t, x, p, i=i: x[2 * i] - p.gap, +1)
        return Transition("swing", "swing", guard, Reset(reset), name=f"stop {i}")
    own = {f"A{i}": push for i, push in enumerate(pushes(n))}
    return HybridSystem(state=2 * n, parameters=COMMON | own, transitions=[stop(i) for i in range(n)],
                        modes=[Mode("swing", lambda t, x, p: by_hand(n, p, t, x[::2], x[1::2]))])

def by_names(n):
    def stop(i):
        guard = Guard(lambda t, x, p: getattr(x, f"q{i}") - p.gap, +1)
        reset = Reset(lambda t, x, p: {f"v{i}": -p.e * getattr(x, f"v{i}")})
        return Transition("swing", "swing", guard, reset, name=f"stop {i}")
    own = {f"A{i}": push for i, push in enumerate(pushes(n))}
    names = tuple(f"{name}{i}" for i in range(n) for name in "qv")
    return HybridSystem(state=names, parameters=COMMON | own, transitions=[stop(i) for i in range(n)],
                        modes=[Mode("swing", lambda t, x, p: by_hand(n, p, t, x[::2], x[1::2]))])

def pull(p, stretch):
    return p.k * stretch + p.c * stretch**3
COMMON = {"k": 2.0, "c": 0.5, "gap": 0.3, "e": 0.8}
def pushes(n):
    return [0.3 + 0.2 * math.sin(i) for i in range(n)]
def start(n):
    return [e for i in range(n) for e in (0.1 * math.cos(2 * i), 0.5 * math.sin(i))]
"""

PROGRAM = """
import json, math, time
import numpy as np
import hybrid, models
from hybrid import Guard, HybridSystem, Mode, Reset, Transition, repeat, simulate
SALT = {salt}
{chain}
# Another model loads the kernels first.
simulate(models.impact_pair(), np.ones(models.impact_pair().dimension), (0.0, 0.1))
n, tangent = {n}, {tangent}
begin = time.process_time()
system = {style}(n)
simulate(system, start(n), (0.0, 0.01), tangent=tangent)
first = time.process_time()
arc = simulate(system, start(n), (0.0, {end}))
longs = []
for _ in range(3):
    before = time.process_time()
    arc = simulate(system, start(n), (0.0, {end}))
    longs.append(time.process_time() - before)
print(json.dumps([first - begin, min(longs), len(arc.jumps), float(np.sum(arc.x[-1]))]))
"""
STYLES = {"hybrid.repeat": "repeated", "by hand, an array": "as_array", "by hand, names": "by_names"}


def measured(chain: str, style: str, n: int, end: float, tangent: bool, salt: float) -> list[float]:
    """Seconds to the end of the first run and of a long one, number of jumps, sum of the last state."""
    program = PROGRAM.format(chain=chain, style=style, n=n, end=end, tangent=tangent, salt=repr(salt))
    return json.loads(fresh_process(program).output.splitlines()[-1])


def main(arguments: Sequence[str] | None = None) -> None:
    given = sys.argv[1:] if arguments is None else arguments
    n = int(given[0]) if given else 50
    heading(f"{n} members with a transition each: seconds to the end of the first run, and of a long run.")
    rows = []
    for name, chain, end in (("neurons", NEURONS, 20.0), ("blocks", BLOCKS, 20.0)):
        for tangent in (False, True):
            found: dict[str, list[list[float]]] = {style: [] for style in STYLES}
            for _ in range(REPEATS):
                for style in STYLES:
                    # A number that no run before had, so that the cache does not know the model.
                    salt = 1.0 + 1e-9 * (time.time() % 1e6)
                    found[style].append(measured(chain, STYLES[style], n, end, tangent, salt))
            best = {
                style: [min(column) for column in zip(*each, strict=True)] for style, each in found.items()
            }
            for style, (first, run, jumps, _) in best.items():
                ratio = first / best["by hand, an array"][0]
                row = [name, "yes" if tangent else "no", style, f"{first:.2f}", f"{ratio:.2f}"]
                rows.append([*row, f"{1e3 * run:.1f}", str(int(jumps))])
    table(["chain", "tangents", "written", "first run, s", "ratio", "long run, ms", "jumps"], rows)


if __name__ == "__main__":
    main()
