"""``python -m benchmarks.adversarial`` counts events missed, invented and doubled on random systems."""

from __future__ import annotations

import argparse
import time
from collections import Counter

import numpy as np

from benchmarks.adversarial.pool import Hung, parts
from benchmarks.adversarial.tally import Tally, error_rows, family_rows, method_rows
from benchmarks.adversarial.trial import METHODS, described
from benchmarks.common import heading, table


def guards(arguments: argparse.Namespace) -> Tally:
    """Run all structures; returns what came."""
    indices = list(range(arguments.structures)) if arguments.structure is None else arguments.structure
    # A structure has two guards on average.
    samples = max(1, arguments.guards // (2 * arguments.structures))
    tally, began, done = Tally(), time.perf_counter(), 0

    def finished(index: int) -> None:
        nonlocal done
        done += 1
        if done % 10 == 0 or done == len(indices):
            seconds = time.perf_counter() - began
            print(f"{done} of {len(indices)} structures, {seconds:.0f} s", flush=True)

    for part in parts(
        arguments.seed, indices, samples, arguments.processes, tuple(arguments.methods), finished
    ):
        if isinstance(part, Hung):
            tally.hang(part)
            case = "the rest" if part.run < 0 else described(arguments.seed, part.index, samples, 0, part.run)
            print(f"hung: {part.method}, {case}", flush=True)
            continue
        tally.add(part)
        if arguments.failures:
            shown: Counter[tuple[int, str]] = Counter()
            for guard, outcome in enumerate(part.outcomes):
                for run, kind, t in outcome.examples:
                    shown[guard, kind] += 1
                    if shown[guard, kind] <= arguments.failures:
                        text = described(arguments.seed, part.index, samples, guard, run)
                        print(f"{kind} at {t!r}: {part.method}, {text}", flush=True)
    return tally


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--guards", type=int, default=100_000, help="random guards, 0 for none")
    parser.add_argument("--structures", type=int, default=160, help="models among which they are shared")
    parser.add_argument("--structure", type=int, nargs="*", help="only these structures")
    parser.add_argument("--methods", nargs="*", default=METHODS, choices=METHODS)
    parser.add_argument("--failures", type=int, default=0, help="cases to print per kind, guard and method")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    arguments = parser.parse_args()
    heading("Random guards along known motions: which changes of sign are missed, invented, doubled?")
    if arguments.guards:
        tally = guards(arguments)
        print()
        table(*method_rows(tally))
        table(*error_rows(tally))
        table(*family_rows(tally, METHODS[0]))
        seconds = {name: f"{value:.0f} s" for name, value in sorted(tally.seconds.items())}
        print(f"Seconds of all processes: {seconds}; runs in doubt: {tally.doubts}")


if __name__ == "__main__":
    np.seterr(all="ignore")
    main()
