"""Start-up times: the import, the first run with an empty cache, and the next process.

``--wheel FILE`` also times a first run of a wheel, which contains the kernels.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from tempfile import TemporaryDirectory

from benchmarks.common import Process, fastest_process, fresh_process, heading, table

IMPORT = "import hybrid"
RUN = """
import hybrid, models
arc = hybrid.simulate(models.vibroimpact(), (0.0, 0.0, 0.0, 0.0), (0.0, 10.0), mode="free")
assert arc.status.ok
"""
SPECTRUM = """
import lyapunov, models
start = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
assert lyapunov.lyapunov_spectrum(models.vibroimpact(), start, intervals=10).status.ok
"""
OWN_MODEL = """
from hybrid import Guard, HybridSystem, Mode, Reset, Transition, simulate
pendulum = HybridSystem(
    state=("q", "v"),
    modes=[Mode("swing", lambda t, x, p: (x.v, -x.q - 0.123 * x.q**3))],
    transitions=[Transition("swing", "swing", Guard(lambda t, x, p: x.q, direction=-1),
                            Reset(lambda t, x, p: (0.0, -0.9 * x.v)), name="stop")],
)
assert simulate(pendulum, (1.0, 0.0), (0.0, 5.0)).status.ok
"""


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--wheel", help="a wheel of this library")
    wheel = options.parse_args().wheel
    heading("Seconds of whole processes, including the start of the interpreter.")
    rows = []

    def report(what: str, process: Process, target: float | None = None) -> None:
        times = [f"{process.wall:.2f}", f"{process.processor:.2f}"]
        rows.append([what, *times, "" if target is None else f"{target:g}"])

    report("the interpreter alone", fastest_process("pass"))
    report("import numpy", fastest_process("import numpy"))
    report("import hybrid", fastest_process(IMPORT), 0.5)
    with TemporaryDirectory() as folder:
        cache = {"HYBRID_CACHE_DIR": folder}
        first = fresh_process(RUN, cache)
        report("first run, empty cache", first, 8)
        report("the next process", fastest_process(RUN, cache), 0.5)
        report("first spectrum after that", fresh_process(SPECTRUM, cache))
        report("the next process with a spectrum", fastest_process(SPECTRUM, cache), 0.5)
        report("first run of a new model", fresh_process(OWN_MODEL, cache))
        report("the next process with that model", fastest_process(OWN_MODEL, cache), 0.5)
    if wheel:
        with TemporaryDirectory() as folder:
            pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", folder, wheel]
            subprocess.run(pip, check=True)
            installed = {"HYBRID_CACHE_DIR": f"{folder}/cache", "PYTHONPATH": folder, "PYTHONSAFEPATH": "1"}
            report("first run of a wheel, empty cache", fresh_process(RUN, installed), 1)
            report("the next process", fastest_process(RUN, installed), 0.5)
    table(["", "wall clock", "processor", "target"], rows)
    print("Messages of the first run:", first.messages.replace("\n", " ") or "none")


if __name__ == "__main__":
    main()
