"""Peak memory of a spectrum by the number of intervals."""

from __future__ import annotations

from benchmarks.common import fresh_process, heading, table

CODE = """
import resource
import models
from hybrid import Tsit5
from lyapunov import lyapunov_spectrum
solver = Tsit5(rtol=1e-5, atol=1e-7)
def run(intervals, history):
    lyapunov_spectrum(
        models.impact_oscillator(), (0.0, 0.0), intervals=intervals, history=history, solver=solver
    )
run(10, False)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
run({intervals}, {history})
after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(before, after)
"""
INTERVALS = (10, 1_000, 100_000, 1_000_000)


def main() -> None:
    heading("Peak resident memory of a process that computes the spectrum of the impact oscillator, in MB.")
    rows = []
    for intervals in INTERVALS:
        cells = []
        for history in (False, True):
            process = fresh_process(CODE.format(intervals=intervals, history=history))
            before, after = (int(kilobytes) / 1024 for kilobytes in process.output.split())
            cells += [f"{after:.0f}", f"{after - before:+.1f}"]
        rows.append([str(intervals), *cells])
    table(["intervals", "history=False", "growth", "history=True", "growth"], rows)


if __name__ == "__main__":
    main()
