"""Where runs end: errors that break a run are told before it is cut to what can be judged."""

from __future__ import annotations

from itertools import zip_longest

import attrs
import numpy as np

from hybrid.simulation.jumps import Jump
from hybrid.status import StatusCode
from hybrid.testing.case import Case, as_case, guard_beyond
from hybrid.testing.errors import discard
from hybrid.testing.words import jump_told

ENDS = "A run reaches its end, or a transition or a limit ends it"
SIDES_AFTER = "A jump leaves the state on the near side of every guard, or another fires at once"
# What ends a run for which the model is to blame, and the likely reason.
BROKEN = {
    StatusCode.STUCK: "two modes that each give the state back at once: swapped thresholds, a guard with the "
    "wrong direction, or a reset that lands beyond the guard that leads back.",
    StatusCode.NON_FINITE: "a reset or a field that has no value there, or a state that grows without bound.",
    StatusCode.STEP_TOO_SMALL: "a field that jumps or ends inside of its mode (make the pieces modes, or use "
    "hybrid.split), or a solution that grows without bound.",
}
# Relative distance of a start from which a run breaks as well, if it is no accident.
NEAR = 1e-3
# A state that has grown by this factor has nothing left of its start but rounding.
GROWN = 1.0 / np.finfo(float).eps
# A guard is left beyond if it is beyond zero by this share of its largest value on the run.
LEFT_BEYOND = 1e-3


def check_ends(case: Case) -> None:
    """No run of the model breaks; the whole run is judged, not the part that other properties use.

    Raises
    ------
    PropertyError
        If the run ends in ``STUCK``, ``NON_FINITE`` or ``STEP_TOO_SMALL``.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_ends
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_ends(case)
    """
    arc = as_case(case).whole
    if arc.status.code not in BROKEN:
        return
    neighbour = attrs.evolve(case, x0=tuple(x * (1.0 + NEAR / (i + 2)) for i, x in enumerate(case.x0)))
    if neighbour.whole.status.code not in BROKEN:
        discard("the run breaks, and runs from starts nearby do not")
    if arc.status.code == StatusCode.STUCK and np.abs(arc.x[-1]).max() > GROWN * np.abs(arc.x[0]).max():
        discard("jumps follow one another within the rounding of time, since the state grows without bound")
    before = f"the last jump: {jump_told(case, arc.jumps[-1])}" if len(arc.jumps) else "before any jump"
    hint = (
        f"{BROKEN[arc.status.code]} Or a start that no run has: Laws(invariant=..., equal=...) say where "
        "runs are."
    )
    case.fail(ENDS, f"got {arc.status.message}", before, hint=hint, time=float(arc.t[-1]))


def check_sides_after(case: Case) -> None:
    """No reset leaves the state beyond a guard that does not fire next.

    A guard that a reset leaves behind it counts as crossed, and cannot fire before the state has come back.

    Raises
    ------
    PropertyError
        If a reset lands beyond a guard.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_sides_after
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_sides_after(case)
    """
    arc = as_case(case).whole
    jumps = list(arc.jumps)
    for jump, after in zip_longest(jumps, jumps[1:]):
        # A run that breaks at a jump may end before the next.
        if after is not None or arc.status.code not in BROKEN:
            _check_landing(case, jump, after)


def _check_landing(case: Case, jump: Jump, after: Jump | None) -> None:
    """Fail if a jump leaves the state beyond a guard of its mode, and the next jump is not at once."""
    if jump.target is None or jump.kind == "limit" or (after is not None and after.t == jump.t):
        return
    for transition in case.system.transitions:
        name = transition.name
        if transition.source != jump.target or transition.guard.at_start:
            continue
        beyond = guard_beyond(case, transition, jump.t, jump.x_plus)
        if np.isfinite(beyond) and beyond > LEFT_BEYOND * case.guard_size(transition):
            case.fail(
                SIDES_AFTER,
                f"{jump.transition} lands {beyond:.6g} beyond {name}, which does not fire",
                jump_told(case, jump),
                hint=f"a threshold or a value in the reset of {jump.transition!r} with the wrong sign or "
                f"size, or the wrong direction of {name!r}: after the reset that has to be on its near side.",
                time=jump.t,
            )
