"""Numbers of instructions, which do not depend on other load of the machine.

``python -m benchmarks.instructions`` needs ``valgrind`` and takes two minutes. One process makes a first run
and then runs of two lengths; the difference between the two excludes the cost of setting up a run. With
``--check`` the numbers are compared with those kept in ``instructions.json``, and more than 3 % above one of
them is a failure; ``--keep`` keeps those found now. A commit that does so says why.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import llvmlite
import numba
import numpy

from benchmarks.common import ROOT, fresh_process, heading, table

KEPT = Path(__file__).with_suffix(".json")
# How far a number may be above the one that is kept.
MOST = 1.03
# What is counted: the code of a run, two lengths of it, and how many units a length is.
RUNS = {
    "a period of a run": ("simulate(system, START, (0.0, M * T), mode='free', samples=[M * T])", 10, 510, 1),
    "with a tangent vector": ("lyapunov_spectrum(system, START, k=1, intervals=M, transient=0)", 10, 260, 1),
    "with four": ("lyapunov_spectrum(system, START, k=4, intervals=M, transient=0)", 10, 260, 1),
    "a period of a run among 24": (
        "simulate_many(system, [START] * 24, (0.0, M * T), mode='free', executor=1, progress=False)",
        10,
        110,
        24,
    ),
    "of a row of a chart": ("means_together(rows(), 0, M)", 10, 60, 24),
    "a call of one period": (
        "[simulate(system, START, (0.0, T), mode='free', samples=[T]) for _ in range(M)][0]",
        10,
        60,
        1,
    ),
}
# Each call of getloadavg ends a part of the count; nothing else calls it.
CODE = f"""
import os
import models
from hybrid import simulate, simulate_many
from hybrid.simulation.trajectory import start
from lyapunov import lyapunov_spectrum
from lyapunov.directions import first_vectors
from lyapunov.spectrum import Estimates, Flight
from lyapunov.together import means_together
START = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
system = models.vibroimpact()
T = system.forcing_period()

def rows():
    runs = [start(system, START, 0.0, mode="free", tangent=first_vectors(system, 1, None)) for _ in range(24)]
    return Estimates([Flight(run, T) for run in runs], 1)

for run, *lengths, _ in {[*RUNS.values()]!r}:
    for M in (1, *lengths):
        result = eval(run)
        os.getloadavg()
"""
# Valgrind knows no AVX-512, and code for a family of processors is the same on each of them.
PROCESSOR = "x86-64"


def counts() -> list[int]:
    """Instructions from one call of getloadavg to the next; the first count begins with the process."""
    environment = {"HYBRID_CPU": PROCESSOR, "OPENBLAS_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}
    # Nothing is compiled under valgrind.
    fresh_process(CODE, environment)
    with TemporaryDirectory() as folder:
        out = Path(folder, "callgrind")
        tool = ["valgrind", "--tool=callgrind", "--dump-after=getloadavg", f"--callgrind-out-file={out}"]
        subprocess.run(
            [*tool, sys.executable, "-c", CODE],
            cwd=ROOT,
            env={**os.environ, **environment},
            capture_output=True,
            check=True,
        )
        return [_total(out.with_suffix(f".{i + 1}")) for i in range(3 * len(RUNS))]


def _total(dump: Path) -> int:
    return int(re.search(r"^totals: (\d+)", dump.read_text(encoding="utf-8"), re.MULTILINE)[1])


def versions() -> dict[str, str]:
    """What the numbers depend on besides the sources."""
    python = ".".join(platform.python_version_tuple()[:2])
    return {
        "python": python,
        "numpy": numpy.__version__,
        "numba": numba.__version__,
        "llvmlite": llvmlite.__version__,
    }


def found_now() -> dict[str, int]:
    """Instructions by name."""
    found, numbers = counts(), {}
    for i, (name, (_, first, last, units)) in enumerate(RUNS.items()):
        numbers[name] = round((found[3 * i + 2] - found[3 * i + 1]) / (last - first) / units)
    return numbers


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="fail if a number is above the one that is kept")
    parser.add_argument("--keep", action="store_true", help="keep the numbers")
    options = parser.parse_args()
    heading("Instructions of runs of the founding system.")
    if shutil.which("valgrind") is None or platform.machine() != "x86_64":
        print("Skipped: this needs valgrind on an x86-64 processor.")
        return
    numbers = found_now()
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {"numbers": {}}
    rows = []
    for name, number in numbers.items():
        before = kept["numbers"].get(name)
        rows.append([name, f"{number}", "" if before is None else f"{before}"])
    table(["of", "instructions", "kept"], rows)
    if options.keep:
        content = {"versions": versions(), "numbers": numbers}
        KEPT.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    if options.check:
        if kept.get("versions") != versions():
            print(f"Not compared: the kept numbers are those of {kept.get('versions')}.")
            return
        above = [name for name, number in numbers.items() if number > MOST * kept["numbers"][name]]
        if above:
            sys.exit(f"More instructions than kept, by more than 3 %: {', '.join(above)}.")


if __name__ == "__main__":
    main()
