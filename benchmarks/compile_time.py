"""Compile time of a new model: the time of the first run minus that of the second."""

from __future__ import annotations

import argparse
import json
import shutil
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.common import fresh_process, heading, table

CHAIN = """
import numpy as np
from hybrid import Guard, HybridSystem, Mode, Reset, Transition

def chain(n):
    '''A row of n masses on cubic springs; the last mass hits a wall.'''
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

def reactions(n, count, events):
    '''Random reactions among n species, as models of cells have them; doses at levels and at times.'''
    rng = np.random.default_rng(3)
    kinds, *places = rng.integers(4, size=count), *rng.integers(n, size=(3, count))
    network = [*zip(map(int, kinds), *(map(int, place) for place in places))]

    def field(t, x, p):
        rates = [0.0 * x[0]] * n
        for k, (kind, a, b, c) in enumerate(network):
            laws = (x[a], x[a] * x[b], x[a] / (0.5 + x[a]), x[a] ** 2 / (1.0 + x[a] ** 2 + x[b]))
            flow = p[k] * laws[kind]
            rates[a], rates[c] = rates[a] - flow, rates[c] + flow
        return rates

    def dose(number):
        watched, given, level = *map(int, rng.integers(n, size=2)), rng.uniform(0.2, 1.5)
        if number % 3 == 0:
            guard = Guard(lambda t, x, p: t - 0.25 * (number + 1), +1)
        else:
            guard = Guard(lambda t, x, p: x[watched] - level)

        def reset(t, x, p):
            x = list(x)
            x[given] = x[given] + 0.1
            return x

        return Transition("mix", "mix", guard, Reset(reset), name=f"dose {number}")

    values = {f"k{k}": float(value) for k, value in enumerate(rng.uniform(0.05, 1.0, count))}
    return HybridSystem(
        state=n, parameters=values, modes=[Mode("mix", field)], transitions=[dose(i) for i in range(events)]
    )
"""
MODELS = {
    "ball": "models.bouncing_ball()",
    "founding system": "models.vibroimpact()",
    "walker": "models.simplest_walker()",
    "stick-slip (filippov)": "models.stick_slip()",
    "Chua": "models.chua_circuit()",
    "20 states, dense": "dense(20)",
}
# Number of species, of reactions and of events, and whether with tangent vectors.
NETWORKS = {
    "22 species, 40 reactions, 30 events": ("reactions(22, 40, 30)", True),
    "52 species, 90 reactions, 60 events": ("reactions(52, 90, 60)", True),
    "371 species, 600 reactions, 20 events, state alone": ("reactions(371, 600, 20)", False),
}
RUNS = {"with tangent vectors": True, "state alone": False}
# Numbers of masses in the chain.
CHAINS = (2, 5, 10, 20, 50)
# The same chain for heyoka, in its compact mode for large systems.
HEYOKA = """
import json, time
import heyoka as hy
# Disable heyoka's cache of compiled code on disk.
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
# The same chain for diffrax on JAX; with arrays, XLA's program does not grow with the number of masses.
JAX = """
import os
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")
import json, time
import diffrax, jax, jax.numpy as jnp, optimistix
jax.config.update("jax_enable_x64", True)
jax.jit(lambda u: u + 1.0)(jnp.ones(2)).block_until_ready()
begin = time.perf_counter()
n = {masses}
def rates(t, x):
    q, v = x[:n], x[n:]
    stretch = jnp.diff(jnp.concatenate([jnp.zeros(1), q]))
    pull = 2.0 * stretch + 0.5 * stretch**3
    return jnp.concatenate([v, jnp.append(pull[1:], 0.0) - pull + 0.3 * jnp.cos(1.3 * t)])
def carried(t, y, args):
    x, vectors = y
    if vectors is None:
        return rates(t, x), None
    along = jax.vmap(lambda v: jax.jvp(lambda x: rates(t, x), (x,), (v,))[1])
    return rates(t, x), along(vectors)
wall = diffrax.Event(
    lambda t, y, args, **_: y[0][n - 1] - 0.5, optimistix.Newton(1e-8, 1e-8), direction=True
)
def run(y):
    return diffrax.diffeqsolve(
        diffrax.ODETerm(carried), diffrax.Dopri8(), 0.0, 1e-3, 1e-4, y,
        stepsize_controller=diffrax.PIDController(rtol=1e-9, atol=1e-11), event=wall, max_steps=4096,
    ).ys
start = 0.01 * jnp.arange(1.0, 2 * n + 1)
jax.block_until_ready(jax.jit(run)((start, jnp.eye(2 * n) if {tangent} else None)))
print(json.dumps(time.perf_counter() - begin))
"""
# Plain equations of a row of blocks on springs, split: dry contacts, and stops on one side or on both.
SPLIT = """
import json, time
import numpy as np
import hybrid, models
hybrid.simulate(models.stick_slip(), (0.5, 0.0), (0.0, 1.0), mode="below", tangent=True)
n, dry, stops = {blocks}, {dry}, {stops}
def rates(t, x, p):
    q, v = x[:n], x[n:]
    beside = np.concatenate([[0.0], q, [0.0]])
    force = beside[:-2] + beside[2:] - 2.2 * q - 0.05 * v + p.A * np.cos(0.8 * t + 0.3 * np.arange(n))
    if dry:
        force = force - p.mu * np.sign(v)
    if stops > 0:
        force = force - p.k * np.maximum(q - p.gap, 0)
    if stops > 1:
        force = force + p.k * np.maximum(-q - p.gap, 0)
    return np.concatenate([v, force])
values = {{"A": 1.0, "mu": 0.2, "k": 20.0, "gap": 0.5}}
begin = time.perf_counter()
system = hybrid.from_equations(rates, state=2 * n, parameters=values, period=2 * np.pi / 0.8)
start = np.concatenate([np.linspace(0.1, 0.4, n), np.linspace(1.0, -1.0, n)])
first = hybrid.simulate(system, start, (0.0, 60.0), tangent=True)
middle = time.perf_counter()
hybrid.simulate(system, start, (0.0, 60.0), tangent=True)
seconds = 2 * middle - begin - time.perf_counter()
print(json.dumps([seconds, len(set(first.mode)), len(first.system.modes), len(first.jumps)]))
"""
ROWS = {
    "2 blocks, dry": (2, True, 0),
    "3 blocks, dry": (3, True, 0),
    "4 blocks, dry": (4, True, 0),
    "4 blocks between stops": (4, False, 2),
    "4 blocks, dry, a stop each": (4, True, 1),
}
KERNELS = "from hybrid.__main__ import compile_kernels; compile_kernels(2)"
# Two small models load the kernels first.
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
    hybrid.simulate(system, start, (0.0, 1e-3), mode=system.mode_names[0], tangent={tangent})
    seconds.append(time.perf_counter() - begin)
print(json.dumps(seconds[0] - seconds[1]))
"""


def wait(model: str, cache: str, tangent: bool = True) -> float:
    """Compile time in seconds of an uncached model, in a new process with compiled kernels."""
    program = PROGRAM.format(chain=CHAIN, model=model, tangent=tangent)
    with TemporaryDirectory() as folder:
        own = shutil.copytree(cache, Path(folder) / "cache")
        done = fresh_process(program, {"HYBRID_CACHE_DIR": str(own)})
    return float(json.loads(done.output.splitlines()[-1]))


def wait_of_peer(program: str, masses: int, tangent: bool) -> float:
    """Seconds from the equations of a chain to the end of the first run."""
    done = fresh_process(program.format(masses=masses, tangent=tangent))
    return float(json.loads(done.output.splitlines()[-1]))


def wait_of_split(blocks: int, dry: bool, stops: int, cache: str) -> list[str]:
    """Seconds to split a row of blocks and to compile what a run visits; modes visited, modes made, jumps."""
    with TemporaryDirectory() as folder:
        own = shutil.copytree(cache, Path(folder) / "cache")
        program = SPLIT.format(blocks=blocks, dry=dry, stops=stops)
        done = fresh_process(program, {"HYBRID_CACHE_DIR": str(own)})
    seconds, *counts = json.loads(done.output.splitlines()[-1])
    return [f"{seconds:.1f}", *map(str, counts)]


# Colour and marker of each package.
LOOKS = {"hybrid": ("0.1", "*"), "heyoka": ("tab:orange", "^"), "diffrax on JAX": ("tab:blue", "s")}


def picture(waits: Mapping[str, Sequence[float]], path: Path) -> None:
    """Draw the compile times over the number of states."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    states = [2 * masses for masses in CHAINS]
    with plt.rc_context({"font.size": 9, "axes.linewidth": 0.7}):
        figure, axes = plt.subplots(figsize=(7.4, 3.6))
        for name, seconds in waits.items():
            package, dashed = name.partition(",")[0], "tangent" not in name
            colour, marker = LOOKS[package]
            axes.plot(
                states,
                seconds,
                label=name,
                color=colour,
                marker=marker,
                linestyle="--" if dashed else "-",
                linewidth=1.1,
                markersize=5,
            )
        axes.plot(
            states,
            [0.02 * n for n in states],
            color="0.75",
            linewidth=1.0,
            label="proportional to the states",
        )
        axes.set(
            xscale="log", yscale="log", xlabel="states of the chain", ylabel="seconds before the first run"
        )
        axes.set_xticks(states, [str(n) for n in states])
        axes.tick_params(which="minor", length=0, labelbottom=False)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="0.92", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
        figure.tight_layout()
        figure.savefig(path, dpi=150, metadata={"Software": None})
        plt.close(figure)


def main(arguments: Sequence[str] | None = None) -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--picture", type=Path, help="file for the picture of the chains")
    options.add_argument("--split", action="store_true", help="only the systems that are split")
    given = options.parse_args(arguments)
    heading("Compile time of a new model: seconds of the first run with tangent vectors minus the second.")
    with TemporaryDirectory() as folder:
        fresh_process(KERNELS, {"HYBRID_CACHE_DIR": folder})
        fresh_process(
            PROGRAM.format(chain=CHAIN, model="models.bilinear_oscillator()", tangent=True),
            {"HYBRID_CACHE_DIR": folder},
        )
        split = [[name, *wait_of_split(*row, folder)] for name, row in ROWS.items()]
        table(["plain equations, split", "seconds", "modes visited", "made", "jumps"], split)
        if given.split:
            return
        models = {name: (model, True) for name, model in MODELS.items()} | NETWORKS
        rows = [[name, f"{wait(model, folder, tangent):.2f}"] for name, (model, tangent) in models.items()]
        table(["model", "seconds"], rows)
        waits = {
            f"hybrid, {name}": [wait(f"chain({n})", folder, tangent) for n in CHAINS]
            for name, tangent in RUNS.items()
        }
    for peer, module, program in (("heyoka", "heyoka", HEYOKA), ("diffrax on JAX", "diffrax", JAX)):
        if find_spec(module) is not None:
            for name, tangent in RUNS.items():
                waits[f"{peer}, {name}"] = [wait_of_peer(program, n, tangent) for n in CHAINS]
    rows = [[name, *(f"{each:.2f}" for each in seconds)] for name, seconds in waits.items()]
    table(["a chain of", *(f"{2 * n} states" for n in CHAINS)], rows)
    if given.picture is not None:
        picture(waits, given.picture)


if __name__ == "__main__":
    main()
