"""Where runs end: errors that break a run are told before it is cut to what can be judged."""

from __future__ import annotations

import numpy as np

from hybrid.simulation.arc import Jump
from hybrid.status import StatusCode
from hybrid.testing.case import Case, as_case, discard, guard_beyond

ENDS = "A run reaches its end, or a transition or a limit ends it"
# What ends a run for which the model is to blame, and the likely reason.
BROKEN = {
    StatusCode.STUCK: "resets that throw the state from guard to guard without end: two modes that each give "
    "the state back, or a reset that lands beyond the guard that leads back.",
    StatusCode.NON_FINITE: "a reset or a field that has no value there, or a state that grows without bound.",
    StatusCode.STEP_TOO_SMALL: "a field that jumps or ends inside of its mode (make the pieces modes, or use "
    "hybrid.split), or a solution that grows without bound.",
}
# A guard is left beyond if it is beyond zero by this share of its largest value on the run.
LEFT_BEYOND = 1e-3


def check_ends(case: Case) -> None:
    """No run of the model breaks, and no reset leaves the state beyond the guard that has just fired.

    The whole run is judged, not the part of it that the other properties use. A transition whose reset leaves
    the state beyond its own guard counts as crossed, and cannot fire again before the state has come back.

    Raises
    ------
    PropertyError
        If the run ends in ``STUCK``, ``NON_FINITE`` or ``STEP_TOO_SMALL``, or a reset lands beyond its guard.
    """
    arc = as_case(case).whole
    if arc is None:
        discard("no mode allows the start")
    sizes: dict[str, float] = {}
    for jump in arc.jumps:
        _check_landing(case, jump, arc.x, sizes)
    if arc.status.code not in BROKEN:
        return
    before = "before any jump"
    if len(arc.jumps):
        jump = arc.jumps[-1]
        before = (
            f"the last jump is {jump.transition!r} at t = {jump.t:.8g}, to {case.state_told(jump.x_plus)}"
        )
    case.fail(ENDS, f"got {arc.status.message}", before, hint=BROKEN[arc.status.code])


def _check_landing(case: Case, jump: Jump, states: np.ndarray, sizes: dict[str, float]) -> None:
    """Fail if a transition that leads back to its mode leaves the state beyond its own guard.

    ``sizes`` keeps the largest values of guards on the run, by transition.
    """
    transition = case.transition(jump)
    if jump.target != transition.source or transition.name in case.passable:
        return
    beyond = guard_beyond(case, transition, jump.t, jump.x_plus)
    if not (np.isfinite(beyond) and beyond > 0.0):
        return
    name = transition.name
    if name not in sizes:
        values = [abs(guard_beyond(case, transition, jump.t, x)) for x in states]
        sizes[name] = max((each for each in values if np.isfinite(each)), default=0.0)
    if beyond > LEFT_BEYOND * sizes[name]:
        case.fail(
            ENDS,
            f"{name} lands {beyond:.6g} beyond {name}",
            f"at t = {jump.t:.8g}, from {case.state_told(jump.x_minus)} to {case.state_told(jump.x_plus)}",
            hint=f"a threshold or a value in the reset of {name!r} with the wrong sign or size: after the "
            "reset the guard has to be on its near side again.",
        )
