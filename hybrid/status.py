"""How a run ended: a code, what happened, and what to do about it."""

from __future__ import annotations

from enum import IntEnum

import attrs

from hybrid.kernels import codes


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


SUCCESS = Status(StatusCode.SUCCESS, "Reached the end.")


def run_status(code: int, t: float, mode: str, transition: str | None) -> Status:
    """Status of a run that ended with a kernel code at time ``t`` in a mode, after a transition (or None)."""
    if code == StatusCode.SUCCESS:
        return SUCCESS
    where = f"at t = {t:.12g} in mode {mode!r}"
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
            "Loosen rtol and atol; a singular or discontinuous field wants a transition there.",
        ),
        StatusCode.NON_FINITE: (
            f"The field or the state became infinite or nan {where}.",
            "Check the model there; a field must be defined a little beyond the guards that end its mode.",
        ),
        StatusCode.ACCUMULATION: (
            f"Jumps of {last} accumulate {where}: infinitely many in finite time.",
            "Add a mode for the limit (rest, stick, slide) and a transition that leads to it.",
        ),
        StatusCode.STUCK: (
            f"Jumps follow one another without end {where}, last {last}: "
            "the fields on both sides point at the guard.",
            "Add a sliding mode, or derive one with hybrid.filippov.",
        ),
        StatusCode.TERMINAL: (
            f"Ended by {last} {where}.",
            "The model goes no further: that transition has no target.",
        ),
    }
    kind = StatusCode(code)
    return Status(kind, *texts[kind])
