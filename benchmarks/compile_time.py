"""How long a model that was never seen waits for its compiler: the first run less the second."""

from __future__ import annotations

import json
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
    "chain of 4 states": "chain(2)",
    "chain of 10 states": "chain(5)",
    "chain of 20 states": "chain(10)",
    "chain of 40 states": "chain(20)",
    "chain of 100 states": "chain(50)",
    "20 states, dense": "dense(20)",
}
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


def main() -> None:
    heading("Seconds that a model never seen waits: the first run with tangent vectors, less the second.")
    rows = []
    with TemporaryDirectory() as folder:
        wait("models.bilinear_oscillator()", folder)
        for name, model in MODELS.items():
            rows.append([name, f"{wait(model, folder):.2f}"])
    table(["model", "seconds"], rows)


if __name__ == "__main__":
    main()
