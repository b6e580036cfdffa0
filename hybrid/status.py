"""How a run ended: a code, what happened, and what to do about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import TYPE_CHECKING, Any, Self

import attrs

from hybrid.kernels.types import codes

if TYPE_CHECKING:
    from hybrid.system.elements import Transition

PLAIN = "Reached the end."


class StatusCode(IntEnum):
    """Why a run ended.

    Each code is one row: its number, what its status says, with places for the facts of a run, and what to
    do. Where several things lead to one code, the others say theirs where they are found.

    Examples
    --------
    >>> import hybrid, models
    >>> arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 5.0))
    >>> arc.status.code == hybrid.StatusCode.ACCUMULATION
    True
    >>> hybrid.StatusCode(0).name
    'SUCCESS'
    """

    message: str
    remedy: str
    complete: bool

    def __new__(cls, number: int, message: str = "", remedy: str = "", complete: bool = False) -> Self:
        """A code with its number, what it mostly says, and whether the result is complete and valid."""
        code = int.__new__(cls, number)
        code._value_ = number
        code.message, code.remedy, code.complete = message, remedy, complete
        return code

    SUCCESS = codes.DONE, PLAIN, "", True
    MAX_STEPS = (
        codes.MAX_STEPS,
        "The limit of steps was reached {where}.",
        "Raise max_steps of the solver, loosen its tolerances, or check whether the mode is stiff.",
    )
    MAX_JUMPS = (
        codes.MAX_JUMPS,
        "The limit of jumps was reached {where}.",
        "Raise max_jumps, or check whether the jumps accumulate.",
    )
    STEP_TOO_SMALL = (
        codes.STEP_TOO_SMALL,
        "No step was small enough for the tolerance {where}.",
        "Loosen rtol and atol; if the field is singular or discontinuous there, add a transition.",
    )
    NON_FINITE = (
        codes.NON_FINITE,
        "The field or the state became infinite or nan {where}.",
        "Check the model there; a field must also be defined slightly beyond the guards of its mode, as "
        "np.maximum(depth, 0)**1.5 is.",
    )
    ACCUMULATION = (
        codes.ACCUMULATION,
        "After {last} the state rests on its guard {where} and the field pushes it through the guard: jumps "
        "with no time between them accumulate.",
        "Add a mode for the limit (rest, stick, slide) and name it: Transition(..., accumulates_to=...).",
    )
    STUCK = (
        codes.STUCK,
        "Jumps repeat endlessly {where}: {names}, then the first again. Each jump takes the state beyond the "
        "guard of the next.",
        "Change the resets so that one of them leaves the state before the next guard, or give a guard a "
        "condition (when=).",
    )
    TERMINAL = (
        codes.TERMINAL,
        "Ended by {last} {where}.",
        "That transition has no target mode, so the run stops there.",
    )
    AMBIGUOUS_ORDER = (
        99,
        "{count} times two guards were reached together and the order of their transitions mattered; the one "
        "listed first was fired first.",
        "Choose the order in which the transitions are listed and declare HybridSystem(listed_order=True), "
        "or add one for the corner.",
    )
    SINGULAR_SALTATION = (
        100,
        "{count} of {jumps} jumps had no saltation matrix: they grazed exactly, or were the limit of several "
        "transitions that accumulate in turn.",
        "The tangent vectors are not valid after these jumps. Move the parameters away from the grazing.",
    )
    NOT_CONVERGED = 101
    NOT_RUN = 102
    DISCONTINUOUS_FIELD = (
        103,
        "Reached the end, but {places}: tangent vectors, and results computed from them, are not valid "
        "beyond such a jump.",
        "hybrid.split(system) makes modes joined by guards of a field that is written with NumPy functions, "
        "with the sliding modes between them.",
    )
    INTERRUPTED = (
        104,
        "Interrupted {where}.",
        "The result holds everything up to that time. An arc goes on from its end, "
        "simulate(system, arc.end, (arc.end.t, t1)); or call again.",
    )
    INDISTINCT_TANGENTS = (
        105,
        "{count} times the tangent vectors became parallel to rounding; the exponents after the first are "
        "not known.",
        "Shorten the steps by max_step= of the solver, or ask for fewer exponents.",
    )
    FAILED = 106
    INFINITE_SLOPE = (
        107,
        "{where} The slope of {powers} is infinite where its base is zero: steps in time lose digits of the "
        "tangent vectors there, and results computed from them are not valid.",
    )
    ROUNDED_TIME = (
        108,
        "Reached the end, but the time is so large that its rounding changes the field, a guard or a reset: "
        "up to {tolerances:.2g} times the tolerance in one step or jump.",
        "Shift the origin of time, or loosen rtol and atol to what the result needs.",
    )
    OUT_OF_MEMORY = (
        109,
        "The steps and jumps that the run keeps fill a third of this machine's memory {where}.",
        "The result holds everything up to that time. Ask for the states at given times with samples=: then "
        "neither the steps nor, without keep_jumps=True, the jumps are kept.",
    )
    START_BEYOND = (
        110,
        "Reached the end. The start lies beyond {guards} crossed there and never {fires} in this run. A run "
        "from the near side would have left this motion.",
        "Start before the guard, or in the mode behind the guard. Without mode= the guards choose the mode.",
        True,
    )
    DELAY_FULL = (
        111,
        "The delay of transition {name!r}, {told}, has {places} places, and one more would be under way "
        "{where}.",
        "Raise places= of the Delay.",
    )


@attrs.frozen
class Status:
    """Code, message and remedy of a result.

    ``status.ok`` is true for ``SUCCESS``, and for ``START_BEYOND``, where the start is unlikely: the result
    is complete and valid. It is false for ``TERMINAL``, also where the model plans this end. If a run ended
    early, the result holds everything that was computed before.

    Examples
    --------
    >>> import hybrid, models
    >>> status = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 3.0), max_jumps=2).status
    >>> status.ok, status.code.name
    (False, 'MAX_JUMPS')
    >>> print(status.message)
    The limit of jumps was reached at t = 1.75191172702 in mode 'flight'.
    """

    code: StatusCode
    message: str
    remedy: str = ""

    @property
    def ok(self) -> bool:
        """Whether the result is complete and valid."""
        return self.code.complete

    @property
    def brief(self) -> str:
        """The code, and the first sentence of what a complete run has to say besides having ended."""
        said = self.message.removeprefix(f"{PLAIN} ")
        if not self.ok or said == PLAIN:
            return self.code.name
        return f"{self.code.name}: {said.partition('. ')[0].removesuffix('.')}"

    def __str__(self) -> str:
        text = f"{self.code.name}: {self.message}"
        return f"{text} {self.remedy}" if self.remedy else text


def told(code: StatusCode, remedy: str | None = None, /, **facts: Any) -> Status:
    """What the row of a code says of a run with these facts, with its remedy or another one."""
    return Status(code, code.message.format(**facts), code.remedy if remedy is None else remedy)


def noting(status: Status, *sentences: str) -> Status:
    """The status of a complete run with more to say of it, before what it says already."""
    rest = status.message.removeprefix(PLAIN).strip()
    return attrs.evolve(status, message=" ".join(filter(None, [PLAIN, *sentences, rest])))


# Of equations that have been split: nobody has written a transition that could name a mode.
REST_OF_EQUATIONS = (
    "These transitions come from switches in the equations, such as np.sign, and no mode is derived in which "
    "the run goes on where the surfaces of the switches meet. Either the motion there is not unique, because "
    "the fields around the meeting differ in too many directions, or the case is not known: more than two "
    "surfaces take turns, or the rate of the position is not a constant times the switching velocity. To go "
    "on from there, write the model as a HybridSystem with a mode for the rest."
)
DECLARE_PERIOD = (
    "If the forcing is periodic, declare the period with HybridSystem(period=...): the phase of the forcing "
    "then keeps all its digits."
)
SUCCESS = Status(StatusCode.SUCCESS, PLAIN)


def run_status(
    code: int, where: str, transition: str | None, *, bare_time: bool, derived: bool = False
) -> Status:
    """Status for the code with which the kernel ended a run.

    ``transition`` names the last transition, if any, and ``derived`` says that it comes from a switch in the
    equations. ``bare_time`` says that the mode depends on time and no forcing period is declared.
    """
    kind, remedy = StatusCode(code), None
    if kind == StatusCode.ACCUMULATION and derived:
        remedy = REST_OF_EQUATIONS
    if kind == StatusCode.STEP_TOO_SMALL and bare_time:
        late = "This mode depends on time, and large times are rounded coarsely."
        remedy = f"{kind.remedy} {late} {DECLARE_PERIOD}"
    last = f"transition {transition!r}" if transition else "a transition"
    return told(kind, remedy, where=where, last=last)


def chatter_status(where: str, names: Sequence[str], *, derived: bool) -> Status:
    """Status of a run that ended at the limit of chatter; the named transitions fire in turn.

    ``derived`` says that all of them come from switches in the equations.
    """
    fired = f"transition {names[0]!r}" if len(names) == 1 else "transitions " + ", ".join(map(repr, names))
    in_turn = "" if len(names) == 1 else " in turn"
    return Status(
        StatusCode.ACCUMULATION,
        f"Jumps of {fired}{in_turn} accumulate {where}: the times between jumps become ever shorter, "
        "so infinitely many jumps take a finite time.",
        REST_OF_EQUATIONS if derived else StatusCode.ACCUMULATION.remedy,
    )


def stuck_status(where: str, transitions: Sequence[Transition], facing: bool) -> Status:
    """Status of a run whose transitions, given in firing order, repeat endlessly at one instant.

    ``facing`` says that two modes send the state back to each other across the same guard.
    """
    names = ", ".join(repr(transition.name) for transition in transitions)
    if not facing:
        return told(StatusCode.STUCK, where=where, names=names)
    return Status(
        StatusCode.STUCK,
        f"Jumps repeat endlessly {where}: {names}, then the first again: the fields on both sides point "
        "towards the guard.",
        "Add a sliding mode, or derive one with hybrid.filippov.",
    )


def beyond_status(names: Sequence[str]) -> Status:
    """Status of a complete run whose start lies beyond guards that have not fired in it."""
    listed = ", ".join(map(repr, names))
    one = len(names) == 1
    guards = f"the guard of {listed}, which counts as" if one else f"the guards of {listed}, which count as"
    return told(StatusCode.START_BEYOND, guards=guards, fires="fires" if one else "fire")


def discontinuous_status(jumps: Mapping[str, str]) -> Status:
    """Status of a run with tangent vectors if fields jump; ``jumps`` maps modes to the places, in words."""
    places = [f"the field of mode {mode!r} jumps {where}" for mode, where in jumps.items()]
    return told(StatusCode.DISCONTINUOUS_FIELD, places=", and ".join(places))


def late_status(tolerances: float, *, declared: bool) -> Status:
    """Status of a run in which the rounding of the time was worth so many tolerances in one step or jump.

    ``declared`` says that the system has a forcing period.
    """
    others = StatusCode.ROUNDED_TIME.remedy
    remedy = others if declared else f"{DECLARE_PERIOD} Otherwise {others[0].lower()}{others[1:]}"
    return told(StatusCode.ROUNDED_TIME, remedy, tolerances=tolerances)


def steep_status(where: str, powers: Mapping[str, str], *, inside: bool) -> Status:
    """Status of a run with tangent vectors if the slopes of fields are infinite where steps in time go.

    ``powers`` maps modes to the powers in their fields. ``inside`` says that these powers switch inside of
    the modes, not at guards.
    """
    named = ", and ".join(f"{words} in mode {mode!r}" for mode, words in powers.items())
    remedy = (
        "Write the powers of one guard with numbers such as 1/4, 1/3, 1/2 or 3/4 as exponents: then the mode "
        "has a series in the root of that guard, which carries tangent vectors. "
        "print(hybrid.compile_system(system)) says why it has none."
    )
    if inside:
        remedy = (
            "hybrid.split(system) makes guards of what switches inside of a mode: series in the root of a "
            "guard carry tangent vectors across it."
        )
    remedy = f"{remedy} Runs without tangent vectors are not affected."
    return told(StatusCode.INFINITE_SLOPE, remedy, where=where, powers=named)


def apart_status(jumps: int, others: int) -> Status:
    """Status of a run whose derivatives come from a run with other jumps."""
    return Status(
        StatusCode.INDISTINCT_TANGENTS,
        f"The run with derivatives makes {others} jumps where the run itself makes {jumps}: the tolerances "
        "decide, so the derivatives are not those of this run.",
        "Tighten the tolerances, or end the run before the shallow crossing.",
    )
