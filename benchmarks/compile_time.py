"""How long a model that was never seen waits for its compiler: the first run less the second."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.common import fresh_process, heading, table

CHAIN = """
import numpy as np
from hybrid import Guard, HybridSystem, Mode, Reset, Transition

def chain(n):
    '''n masses in a row on cubic springs, the last of which hits a wall.'''
    def field(t, x, p):
        q, v = x[:n], x[n:]
        stretch = np.diff(np.concatenate([[0.0], q]))
        pull = p.k * stretch + p.c * stretch**3
        return np.concatenate([v, np.append(pull[1:], 0.0) - pull + p.A * np.cos(p.w * t)])

    def back(t, x, p):
        x = list(x)
        x[-1] = -p.e * x[-1]
        return x

    wall = Transition("swing", "swing", Guard(lambda t, x, p: x[n - 1] - p.gap, +1), Reset(back))
    return HybridSystem(
        state=2 * n,
        parameters={"k": 2.0, "c": 0.5, "A": 0.3, "w": 1.3, "gap": 0.5, "e": 0.8},
        modes=[Mode("swing", field)],
        transitions=[wall],
    )

def dense(n):
    '''Each rate depends on all states.'''
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, n, n)) / n
    def field(t, x, p):
        linear, bent = ([sum(m[i, j] * x[j] for j in range(n)) for i in range(n)] for m in (a, b))
        return [linear[i] - p.d * x[i] + np.sin(bent[i]) for i in range(n)]
    return HybridSystem(state=n, parameters={"d": 1.0}, modes=[Mode("flow", field)])
"""
MODELS = {
    "ball": "models.bouncing_ball()",
    "founding system": "models.vibroimpact()",
    "walker": "models.simplest_walker()",
    "stick-slip (filippov)": "models.stick_slip()",
    "Chua": "models.chua_circuit()",
    "20 states, dense": "dense(20)",
}
# Numbers of masses in the chain.
CHAINS = (2, 5, 10, 20, 50)
# The same chain for heyoka, in the mode that it has for large systems.
HEYOKA = """
import json, time
import heyoka as hy
# It keeps what it has compiled on disk, as this library does.
hy.llvm_state.set_diskcache_enabled(False)
hy.taylor_adaptive(hy.model.pendulum(), [0.0, 0.1])
begin = time.perf_counter()
n = {masses}
x = hy.make_vars(*(f"x{{i}}" for i in range(2 * n)))
q, v = x[:n], x[n:]
stretch = [q[0], *(b - a for a, b in zip(q, q[1:]))]
pull = [*(2.0 * s + 0.5 * s**3 for s in stretch), 0.0]
push = 0.3 * hy.cos(1.3 * hy.time)
rates = [(q[i], v[i]) for i in range(n)] + [(v[i], pull[i + 1] - pull[i] + push) for i in range(n)]
if {tangent}:
    rates = hy.var_ode_sys(rates, hy.var_args.vars)
wall = hy.t_event(q[-1] - 0.5)
start = [0.01 * (i + 1) for i in range(2 * n)]
integrator = hy.taylor_adaptive(rates, start, t_events=[wall], compact_mode=True)
integrator.propagate_until(1e-3)
print(json.dumps(time.perf_counter() - begin))
"""
KERNELS = "from hybrid.__main__ import compile_kernels; compile_kernels(2)"
# The kernels are loaded by a model that is small and another one.
PROGRAM = """
import json, time
import hybrid, models
{chain}
warm = hybrid.HybridSystem(state=("x",), modes=[hybrid.Mode("a", lambda t, x, p: (np.sin(x.x) + 0.0,))])
hybrid.simulate(warm, (1.0,), (0.0, 1.0), tangent=True)
hybrid.simulate(models.impact_pair(), np.ones(models.impact_pair().dimension), (0.0, 0.1), tangent=True)
system = {model}
start = 0.05 * np.ones(system.dimension)
seconds = []
for _ in range(2):
    begin = time.perf_counter()
    hybrid.simulate(system, start, (0.0, 1e-3), mode=system.mode_names[0], tangent=True)
    seconds.append(time.perf_counter() - begin)
print(json.dumps(seconds[0] - seconds[1]))
"""


def wait(model: str, cache: str) -> float:
    """Seconds that a model waits in a new process whose kernels are compiled."""
    program = PROGRAM.format(chain=CHAIN, model=model)
    done = fresh_process(program, {"HYBRID_CACHE_DIR": cache})
    return float(json.loads(done.output.splitlines()[-1]))


def wait_of_heyoka(masses: int, tangent: bool) -> float:
    """Seconds from the equations of a chain to the end of the first step."""
    done = fresh_process(HEYOKA.format(masses=masses, tangent=tangent))
    return float(json.loads(done.output.splitlines()[-1]))


def picture(waits: Mapping[str, Sequence[float]], path: Path) -> None:
    """Waits over the number of states."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    from hybrid.plot import COLOURS

    states = [2 * masses for masses in CHAINS]
    with plt.rc_context({"font.size": 9, "axes.linewidth": 0.7}):
        figure, axes = plt.subplots(figsize=(5.6, 3.6))
        for name, seconds in waits.items():
            ours, dashed = name.startswith("hybrid"), "tangent" not in name
            axes.plot(
                states,
                seconds,
                label=name,
                color="0.1" if ours else COLOURS[1],
                marker="*" if ours else "^",
                linestyle="--" if dashed else "-",
                linewidth=1.1,
                markersize=5,
            )
        axes.plot(
            states,
            [0.02 * n for n in states],
            color="0.75",
            linewidth=1.0,
            label="in proportion to the states",
        )
        axes.set(
            xscale="log", yscale="log", xlabel="states of the chain", ylabel="seconds before the first run"
        )
        axes.set_xticks(states, [str(n) for n in states])
        axes.tick_params(which="minor", length=0, labelbottom=False)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="0.92", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.legend(frameon=False, fontsize=8)
        figure.tight_layout()
        figure.savefig(path, dpi=150, metadata={"Software": None})
        plt.close(figure)


def main(arguments: Sequence[str] | None = None) -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--picture", type=Path, help="where to draw the waits of the chains")
    given = options.parse_args(arguments)
    heading("Seconds that a model never seen waits: the first run with tangent vectors, less the second.")
    with TemporaryDirectory() as folder:
        fresh_process(KERNELS, {"HYBRID_CACHE_DIR": folder})
        wait("models.bilinear_oscillator()", folder)
        table(["model", "seconds"], [[name, f"{wait(model, folder):.2f}"] for name, model in MODELS.items()])
        waits = {"hybrid, with tangent vectors": [wait(f"chain({n})", folder) for n in CHAINS]}
    if find_spec("heyoka") is not None:
        waits["heyoka, with tangent vectors"] = [wait_of_heyoka(n, True) for n in CHAINS]
        waits["heyoka, state alone"] = [wait_of_heyoka(n, False) for n in CHAINS]
    rows = [[name, *(f"{each:.2f}" for each in seconds)] for name, seconds in waits.items()]
    table(["a chain of", *(f"{2 * n} states" for n in CHAINS)], rows)
    if given.picture is not None:
        picture(waits, given.picture)


if __name__ == "__main__":
    main()
