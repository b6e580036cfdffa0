"""Number of instructions per forcing period, which does not depend on other load of the machine.

``python -m benchmarks.instructions`` needs ``valgrind`` and takes three minutes. One process makes a first
run and then runs of two lengths; the difference between the two excludes the cost of setting up a run.
"""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.common import ROOT, fresh_process, heading, table

PERIODS = (10, 2010)
RUNS = {
    "simulate, the end alone": "simulate(system, START, (0.0, M * T), mode='free', samples=[M * T])",
    "lyapunov_spectrum, k = 4": "lyapunov_spectrum(system, START, k=4, intervals=M, transient=0)",
}
# Each call of getloadavg ends a part of the count; nothing else calls it.
CODE = f"""
import os
import models
from hybrid import simulate
from lyapunov import lyapunov_spectrum
START = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
system = models.vibroimpact()
T = system.forcing_period()
for run in {tuple(RUNS.values())!r}:
    for M in {(1, *PERIODS)!r}:
        result = eval(run)
        assert result.status.ok
        os.getloadavg()
"""
# Valgrind hides AVX-512, and numba's cache depends on the processor. With a processor that both support,
# nothing is compiled under valgrind.
PROCESSOR = {
    "NUMBA_CPU_NAME": "haswell",
    "NUMBA_CPU_FEATURES": "+64bit,+cmov,+cx16,+sse,+sse2,+sse3,+ssse3,+sse4.1,+sse4.2,+popcnt,+avx,"
    "+avx2,+fma,+f16c,+bmi,+bmi2,+lzcnt,+movbe",
}


def counts() -> list[int]:
    """Instructions from one call of getloadavg to the next; the first count begins with the process."""
    with TemporaryDirectory() as folder:
        cache, out = Path(folder, "cache"), Path(folder, "callgrind")
        environment = {
            **PROCESSOR,
            "HYBRID_CACHE_DIR": str(cache),
            "OPENBLAS_NUM_THREADS": "1",
            "PYTHONHASHSEED": "0",
        }
        fresh_process(CODE, environment)
        kept = set(cache.rglob("*"))
        tool = ["valgrind", "--tool=callgrind", "--dump-after=getloadavg", f"--callgrind-out-file={out}"]
        subprocess.run(
            [*tool, sys.executable, "-c", CODE],
            cwd=ROOT,
            env={**os.environ, **environment},
            capture_output=True,
            check=True,
        )
        if set(cache.rglob("*")) != kept:
            raise RuntimeError("kernels were compiled again under valgrind; their cache was not used")
        dumps = [out.with_suffix(f".{i + 1}") for i in range(len(RUNS) * (1 + len(PERIODS)))]
        return [_total(dump) for dump in dumps]


def _total(dump: Path) -> int:
    return int(re.search(r"^totals: (\d+)", dump.read_text(encoding="utf-8"), re.MULTILINE)[1])


def main() -> None:
    heading(f"Instructions per forcing period of the founding system, from runs of {PERIODS} periods.")
    if shutil.which("valgrind") is None:
        print("Skipped: valgrind is not on the path.")
        return
    if platform.machine() != "x86_64":
        print("Skipped: this benchmark runs on x86-64 only.")
        return
    found = counts()
    rows = []
    for i, name in enumerate(RUNS):
        first, last = found[3 * i + 1 : 3 * i + 3]
        a_period = (last - first) / (PERIODS[1] - PERIODS[0])
        set_up = first - PERIODS[0] * a_period
        rows.append([name, f"{a_period:.0f}", f"{set_up:.0f}"])
    table(["default solver", "instructions per period", "set-up"], rows)
    version = subprocess.run(["valgrind", "--version"], capture_output=True, text=True, check=True).stdout
    print(f"{version.strip()}, kernels compiled for {PROCESSOR['NUMBA_CPU_NAME']}")


if __name__ == "__main__":
    main()
