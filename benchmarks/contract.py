"""How many errors in models `check_system` finds, and whether it leaves right models alone."""

from __future__ import annotations

import signal
import time
from argparse import ArgumentParser
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import attrs

from benchmarks.common import heading, table
from benchmarks.contract_models import FIRST, Error, Subject
from benchmarks.contract_more import SECOND
from hybrid import HybridSystem, ModelError
from hybrid.testing import PropertyError, check_system

SUBJECTS = (*FIRST, *SECOND)
# Seconds of wall time that one check may take.
LIMIT = 60
RAISED, SILENT, BROKE, LATE = "yes", "no", "broke", f"not in {LIMIT} s"
# The right model raises the same error.
ANYWAY = "as if right"
# Lines of a message that tell the run, and so name parts of the model whatever is wrong.
TOLD = ("  case: ", "  event ", "  the last jump")


@attrs.frozen
class Outcome:
    """What one check said: whether it raised an error, its text, and the seconds of wall time."""

    raised: str
    message: str
    seconds: float

    @property
    def property(self) -> str:
        """The first line of the message: the property that fails."""
        return self.message.partition("\n")[0]

    def names(self, words: Iterable[str]) -> bool:
        """Whether the message, without the lines that tell the run, contains one of the words."""
        lines = [line for line in self.message.splitlines() if not line.startswith(TOLD)]
        return any(word in line for word in words for line in lines)


class _TooLate(BaseException):
    """The time limit of a check; no ``except Exception`` catches it."""


def checked(make: Callable[[], HybridSystem], known: Mapping[str, Any], examples: int) -> Outcome:
    """Make a system and check it."""
    start, raised, message = time.perf_counter(), SILENT, ""
    try:
        with _limited(LIMIT):
            report = check_system(make(), examples=examples, **known)
            message = str(report)
    except (PropertyError, ModelError) as error:
        raised, message = RAISED, str(error)
    except _TooLate:
        raised = LATE
    except Exception as error:
        raised, message = BROKE, f"{type(error).__name__}: {error}"
    return Outcome(raised, message, time.perf_counter() - start)


@contextmanager
def _limited(seconds: int) -> Iterator[None]:
    def late(signum: int, frame: object) -> None:
        raise _TooLate

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def report_errors(found: list[tuple[Subject, Error, Outcome]]) -> None:
    rows = [
        [
            subject.system.name,
            error.kind,
            error.told,
            outcome.raised,
            _by_name(outcome, error),
            f"{outcome.seconds:.1f}",
        ]
        for subject, error, outcome in found
    ]
    table(["model", "kind", "error", "raised", "named", "seconds"], rows)
    kinds = dict.fromkeys(error.kind for _, error, _ in found)
    groups = {kind: [each for each in found if each[1].kind == kind] for kind in kinds} | {"all": found}
    rows = []
    for kind, group in groups.items():
        told = [outcome for _, _, outcome in group if outcome.raised == RAISED]
        named = [outcome for _, error, outcome in group if _by_name(outcome, error) == "yes"]
        rows.append([kind, str(len(group)), str(len(told)), str(len(named))])
    table(["kind", "errors", "raised", "named"], rows)


def _by_name(outcome: Outcome, error: Error) -> str:
    if outcome.raised != RAISED:
        return "-"
    return "yes" if outcome.names(error.words) else "no"


def main() -> None:
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--examples", type=int, default=20, help="runs drawn per check")
    parser.add_argument("--messages", action="store_true", help="print what each check said")
    parser.add_argument("--only", default="", help="part of the name of the models to check")
    options = parser.parse_args()
    heading("How many errors that people make in models does check_system find?")
    subjects = [subject for make in SUBJECTS if options.only in (subject := make()).system.name]
    right: list[tuple[Subject, Outcome]] = []
    wrong: list[tuple[Subject, Error, Outcome]] = []

    def heard(what: str, outcome: Outcome) -> Outcome:
        if options.messages:
            print(f"## {what}: {outcome.raised}\n{outcome.message}\n", flush=True)
        return outcome

    for subject in subjects:
        name, system = subject.system.name, subject.system
        outcome = checked(lambda system=system: system, subject.known, options.examples)
        right.append((subject, heard(name, outcome)))
        for error in subject.errors:
            found = checked(
                lambda error=error, system=system: error.change(system), subject.known, options.examples
            )
            if found.raised == RAISED and found.property == outcome.property:
                found = attrs.evolve(found, raised=ANYWAY)
            wrong.append((subject, error, heard(f"{name}, {error.kind}: {error.told}", found)))
    report_errors(wrong)
    rows = [[subject.system.name, outcome.raised, f"{outcome.seconds:.1f}"] for subject, outcome in right]
    table(["right model", "false alarm", "seconds"], rows)


if __name__ == "__main__":
    main()
