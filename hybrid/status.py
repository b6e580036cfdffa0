"""How a run ended: a code, what happened, and what to do about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import TYPE_CHECKING

import attrs

from hybrid.kernels.types import codes

if TYPE_CHECKING:
    from hybrid.system.elements import Transition


class StatusCode(IntEnum):
    """Why a run ended."""

    SUCCESS = codes.DONE
    MAX_STEPS = codes.MAX_STEPS
    MAX_JUMPS = codes.MAX_JUMPS
    STEP_TOO_SMALL = codes.STEP_TOO_SMALL
    NON_FINITE = codes.NON_FINITE
    ACCUMULATION = codes.ACCUMULATION
    STUCK = codes.STUCK
    TERMINAL = codes.TERMINAL
    AMBIGUOUS_ORDER = 99
    SINGULAR_SALTATION = 100
    NOT_CONVERGED = 101
    NOT_RUN = 102
    DISCONTINUOUS_FIELD = 103
    INTERRUPTED = 104
    INDISTINCT_TANGENTS = 105


@attrs.frozen
class Status:
    """Code, message and remedy of a result.

    ``status.ok`` is true only for a complete and valid one. What was computed before a run ended early is in
    the result all the same.
    """

    code: StatusCode
    message: str
    remedy: str = ""

    @property
    def ok(self) -> bool:
        """Whether the result is complete and valid."""
        return self.code == StatusCode.SUCCESS

    def __str__(self) -> str:
        text = f"{self.code.name}: {self.message}"
        return f"{text} {self.remedy}" if self.remedy else text


NAME_THE_LIMIT = (
    "Add a mode for the limit (rest, stick, slide) and name it: Transition(..., accumulates_to=...)."
)
DECLARE_PERIOD = (
    "This mode depends on time, and late times are rounded coarsely. If its forcing has a period, declare "
    "the period with HybridSystem(period=...): the phase of the forcing then keeps all its digits."
)
SUCCESS = Status(StatusCode.SUCCESS, "Reached the end.")


def run_status(code: int, where: str, transition: str | None, *, bare_time: bool) -> Status:
    """Status of a run that ended with a kernel code, after a transition (or None).

    ``bare_time`` says that the mode depends on time and no forcing period is declared.
    """
    if code == StatusCode.SUCCESS:
        return SUCCESS
    last = f"transition {transition!r}" if transition else "a transition"
    texts = {
        StatusCode.MAX_STEPS: (
            f"The limit of steps was reached {where}.",
            "Raise max_steps of the solver, loosen its tolerances, or check whether the mode is stiff.",
        ),
        StatusCode.MAX_JUMPS: (
            f"The limit of jumps was reached {where}.",
            "Raise max_jumps, or check whether the jumps accumulate.",
        ),
        StatusCode.STEP_TOO_SMALL: (
            f"No step was small enough for the tolerance {where}.",
            "Loosen rtol and atol; a singular or discontinuous field wants a transition there."
            + (f" {DECLARE_PERIOD}" if bare_time else ""),
        ),
        StatusCode.NON_FINITE: (
            f"The field or the state became infinite or nan {where}.",
            "Check the model there; a field must be defined a little beyond the guards that end its mode.",
        ),
        StatusCode.ACCUMULATION: (
            f"After {last} the state rests on its guard {where} and is pushed through it: jumps of "
            "length zero accumulate.",
            NAME_THE_LIMIT,
        ),
        StatusCode.INTERRUPTED: (
            f"Interrupted {where}.",
            "What was computed so far is in the result. Go on from that time, state and mode, or call again.",
        ),
        StatusCode.TERMINAL: (
            f"Ended by {last} {where}.",
            "The model goes no further: that transition has no target.",
        ),
    }
    kind = StatusCode(code)
    return Status(kind, *texts[kind])


def chatter_status(where: str, names: Sequence[str]) -> Status:
    """Status of a run that ended in the limit of jumps of these transitions, in turn."""
    told = f"transition {names[0]!r}" if len(names) == 1 else "transitions " + ", ".join(map(repr, names))
    in_turn = "" if len(names) == 1 else " in turn"
    return Status(
        StatusCode.ACCUMULATION,
        f"Jumps of {told}{in_turn} accumulate {where}: the flights between them shorten by a steady ratio, "
        "and infinitely many take a finite time.",
        NAME_THE_LIMIT,
    )


def stuck_status(where: str, transitions: Sequence[Transition], facing: bool) -> Status:
    """Status of a run in which transitions go round at one instant, in the order in which they fire.

    ``facing`` says that two modes send the state back to each other across one guard.
    """
    names = ", ".join(repr(transition.name) for transition in transitions)
    message = f"Jumps follow one another without end {where}: {names}, and again from the first on."
    if facing:
        return Status(
            StatusCode.STUCK,
            f"{message[:-1]}: the fields on both sides point at the guard.",
            "Add a sliding mode, or derive one with hybrid.filippov.",
        )
    return Status(
        StatusCode.STUCK,
        f"{message} Each one takes the state beyond the guard of the next.",
        "Change the resets so that one of them leaves the state on the near side of these guards, or give a "
        "guard a condition (when=).",
    )


def discontinuous_status(jumps: Mapping[str, str]) -> Status:
    """Status of a run with tangent vectors in a system whose fields jump: where, by the name of the mode."""
    places = [f"the field of mode {mode!r} jumps where {where}" for mode, where in jumps.items()]
    return Status(
        StatusCode.DISCONTINUOUS_FIELD,
        f"Reached the end, but {', and '.join(places)}: tangent vectors, and what is made of them, are not "
        "valid beyond such a jump.",
        "Make the pieces of the field modes joined by guards there; where they point at each other, "
        "hybrid.filippov derives the sliding mode between them.",
    )
