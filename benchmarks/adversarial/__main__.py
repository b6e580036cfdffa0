"""``python -m benchmarks.adversarial`` counts events missed, invented and doubled on random systems."""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np

from benchmarks.adversarial import instants, trial
from benchmarks.adversarial.picture import picture
from benchmarks.adversarial.pool import Begin, Hung, parts
from benchmarks.adversarial.tally import (
    InstantTally,
    Tally,
    error_rows,
    family_rows,
    instant_rows,
    method_rows,
)
from benchmarks.common import heading, table
from hybrid import Guard, HybridSystem, Mode, Transition, simulate


def chosen(arguments: argparse.Namespace, count: int) -> list[int]:
    return list(range(count)) if arguments.structure is None else arguments.structure


def guards(arguments: argparse.Namespace) -> Tally:
    """Run random guards; return the tally."""
    seed = arguments.seed
    # A structure has two guards on average.
    samples = max(1, arguments.guards // (2 * arguments.structures))

    def work(
        index: int, methods: Iterable[str], begin: Begin, left_out: Mapping[str, set[int]]
    ) -> Iterator[trial.Part]:
        return trial.trial(seed, index, samples, methods, begin, left_out)

    tally = Tally()
    indices = chosen(arguments, arguments.structures)
    for part in parts(work, indices, tuple(arguments.methods), arguments.processes, "guards"):
        if isinstance(part, Hung):
            tally.hang(part)
            case = "the rest" if part.run < 0 else trial.described(seed, part.index, samples, 0, part.run)
            print(f"hung: {part.method}, {case}", flush=True)
            continue
        tally.add(part)
        for guard, outcome in enumerate(part.outcomes):
            shown: Counter[str] = Counter()
            for run, kind, t in outcome.examples:
                shown[kind] += 1
                if shown[kind] <= arguments.failures:
                    text = trial.described(seed, part.index, samples, guard, run)
                    print(f"{kind} at {float(t)!r}: {part.method}, {text}", flush=True)
    return tally


def systems(arguments: argparse.Namespace) -> InstantTally:
    """Run random instants; return the tally."""
    seed = arguments.seed
    cases = max(1, arguments.systems // arguments.instants)

    def work(
        index: int, methods: Iterable[str], begin: Begin, left_out: Mapping[str, set[int]]
    ) -> Iterator[instants.Compared]:
        return instants.compared(seed, index, cases, methods, begin, left_out)

    tally = InstantTally()
    methods = tuple(method for method in arguments.methods if method in instants.SOLVERS)
    for part in parts(work, chosen(arguments, arguments.instants), methods, arguments.processes, "instants"):
        if isinstance(part, Hung):
            tally.hang(part)
            print(f"hung: {part.method}, structure {part.index}, draw {part.run}", flush=True)
            continue
        tally.add(part)
        for number, kind, said in part.differences[: arguments.failures]:
            made = instants.instant(seed, part.index)
            drawn = instants.case(made, seed, part.index, number)
            text = instants.text_of(made, drawn) if drawn else ""
            print(
                f"{kind}: {part.method}, structure {part.index}, draw {number}: {said}\n  {text}", flush=True
            )
    return tally


def warm_up() -> None:
    """Load the kernels once, for all processes started later."""
    system = HybridSystem(
        state=("q",),
        modes=[Mode("run", lambda t, x, p: (-np.sin(x.q),))],
        transitions=[Transition("run", "run", Guard(lambda t, x, p: np.tanh(x.q) - 0.5))],
    )
    for solver in trial.SOLVERS.values():
        simulate(system, (1.0,), (0.0, 2.0), solver=solver)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--guards", type=int, default=100_000, help="random guards, 0 for none")
    parser.add_argument("--systems", type=int, default=10_000, help="random instants, 0 for none")
    parser.add_argument("--structures", type=int, default=120, help="models that share the guards")
    parser.add_argument("--instants", type=int, default=80, help="models that share the systems")
    parser.add_argument("--structure", type=int, nargs="*", help="only these models")
    parser.add_argument("--methods", nargs="*", default=trial.METHODS, choices=trial.METHODS)
    parser.add_argument("--failures", type=int, default=0, help="cases to print per kind, guard and method")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--picture", type=Path, help="file for the picture of the guards")
    arguments = parser.parse_args()
    heading("Random guards and random instants: events missed, invented or doubled.")
    began = time.perf_counter()
    warm_up()
    if arguments.guards:
        tally = guards(arguments)
        print()
        table(*method_rows(tally))
        table(*error_rows(tally))
        table(*family_rows(tally, arguments.methods[0]))
        seconds = {name: f"{value:.0f} s" for name, value in sorted(tally.seconds.items())}
        print(f"Seconds of all processes: {seconds}; runs with a doubtful exact answer: {tally.doubts}\n")
        if arguments.picture:
            picture(tally, arguments.picture)
            print(f"Picture: {arguments.picture}\n")
    if arguments.systems:
        many = systems(arguments)
        print()
        table(*instant_rows(many))
    print(f"{time.perf_counter() - began:.0f} s on {arguments.processes} processes")


if __name__ == "__main__":
    np.seterr(all="ignore")
    main()
