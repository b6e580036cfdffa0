"""``python -m benchmarks.piecewise_affine`` compares `hybrid.split` with an independent event loop."""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Iterator

import numpy as np

from benchmarks.common import heading, table
from benchmarks.piecewise_affine.families import KINDS, Family
from benchmarks.piecewise_affine.trial import Outcome, compare, start_of

# All families whose hybrid system is compiled within minutes.
FAMILIES = [
    *(Family(n, m, kind) for n in (2, 3, 4) for m in (1, 2) for kind in KINDS),
    *(Family(n, 2, "additive", parallel=True) for n in (2, 3)),
    *(Family(n, m, "additive") for n, m in ((3, 3), (4, 3), (4, 4))),
]


def outcomes(family: Family, first: int, systems: int, starts: int, limit: float) -> Iterator[Outcome]:
    """Compare some systems, up to so many seconds after the first; print what differs."""
    began = None
    for number in range(first, first + systems):
        if began is not None and time.monotonic() - began > limit:
            return
        rng = np.random.default_rng((number, family.n, family.m, KINDS.index(family.kind), family.parallel))
        system = family.draw(rng)
        for start in range(starts):
            outcome = compare(family, system, start_of(rng, system))
            if outcome.difference:
                print(f"{family}, system {number}, start {start}: {outcome.difference}", flush=True)
            yield outcome
        began = began or time.monotonic()


def row(family: Family, found: list[Outcome], starts: int) -> list[str]:
    """One line of the table."""
    statuses = Counter(outcome.status for outcome in found)
    sliding = np.sum([outcome.sliding for outcome in found], axis=0)
    return [
        str(family),
        str(len(found) // starts),
        str(len(found)),
        str(sum(outcome.events for outcome in found)),
        " / ".join(map(str, sliding)),
        str(len(found) - statuses["ended"]),
        str(sum(bool(outcome.difference) for outcome in found)),
        f"{max(outcome.times for outcome in found):.0e}",
        f"{max(outcome.states for outcome in found):.0e}",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--systems", type=int, default=100, help="right-hand sides of each family")
    parser.add_argument("--first", type=int, default=0, help="number of the first one")
    parser.add_argument("--starts", type=int, default=2, help="orbits of each")
    parser.add_argument("--seconds", type=float, default=60.0, help="longest time for a family")
    parser.add_argument("--family", type=int, nargs="*", help="numbers of families; all by default")
    arguments = parser.parse_args()
    heading("Does split follow the orbits of random piecewise-affine fields?")
    rows = []
    for number in arguments.family if arguments.family is not None else range(len(FAMILIES)):
        family = FAMILIES[number]
        found = [*outcomes(family, arguments.first, arguments.systems, arguments.starts, arguments.seconds)]
        rows.append(row(family, found, arguments.starts))
        print(f"{family}: {len(found)} orbits", flush=True)
    print()
    columns = ["family", "fields", "orbits", "events", "sliding on 1 / 2 / 3", "not decided", "disagreements"]
    table([*columns, "times", "states"], rows)


if __name__ == "__main__":
    main()
