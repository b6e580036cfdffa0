"""Where an event lands: a reset does not depend on the last digits, a limit goes on as a start there does."""

from __future__ import annotations

import numpy as np

from hybrid.errors import ModelError
from hybrid.simulation.arc import HybridArc, Jump
from hybrid.testing.case import Case, as_case, discard
from hybrid.testing.saltation import event_told

LANDINGS = "A reset gives the same a few units in the last place to either side of where its event lies"
LIMITS = "The limit of a chatter goes on as a run that starts there does"

# A reset that is continuous where its event lies changes by rounding alone.
BY_ROUNDING = 1e-9
# A chatter is followed for this many jumps.
MOST_JUMPS = 200


def check_landings(case: Case) -> None:
    """Each reset that an event of the flow sets off is continuous where the event lies.

    A reset may jump at its own guard, as ``np.mod`` and ``np.floor`` do for an angle that wraps. Events land
    beyond their guard, so the reset sees the crossing as made. A reset that jumps a few units in the last
    place away from there rounds another quantity than the guard does: its value is left to chance.

    Raises
    ------
    PropertyError
        If a reset gives other values at a neighbouring floating-point number.
    """
    as_case(case)
    jumps, seen, previous = case.run.arc.jumps, False, -np.inf
    for jump in jumps:
        reset, locked = case.transition(jump).reset, jump.t == previous
        previous = jump.t
        if reset is None or locked:
            continue
        seen = True
        wanted = case.evaluate(reset.function, jump.t, jump.x_minus)
        for way in (-np.inf, np.inf):
            t, x = np.nextafter(jump.t, way), np.nextafter(jump.x_minus, way)
            got = case.evaluate(reset.function, t, x)
            if np.any(np.abs(got - wanted) > BY_ROUNDING * (np.abs(wanted) + case.run.scale)):
                case.fail(
                    LANDINGS,
                    event_told(case, jump),
                    f"the reset gives {case.state_told(wanted)} there",
                    f"the reset gives {case.state_told(got)} at the neighbouring floating-point numbers",
                    hint="the reset of this transition jumps at its guard, as np.mod and np.floor do, "
                    "but rounds the quantity otherwise. Write the same expression in guard and reset.",
                )
    if not seen:
        discard("no event of the flow has a reset")


def check_limits(case: Case) -> None:
    """After the limit of a chatter the run goes on as a run does that starts there, in the same mode.

    Raises
    ------
    PropertyError
        If the mode or the state at the end is another one.
    """
    as_case(case)
    arc = case.simulate(case.t1, max_jumps=MOST_JUMPS)
    limits = np.flatnonzero(arc.jumps.kind == "limit")
    if not len(limits) or not arc.status.ok:
        discard("no chatter with a limit on the run")
    jump = arc.jumps[int(limits[-1])]
    again = _from_limit(case, jump, arc)
    scale = np.abs(arc.x).max(axis=0)
    same = np.all(np.abs(again.x[-1] - arc.x[-1]) <= 1e-6 * scale)
    if str(again.mode[-1]) != str(arc.mode[-1]) or not same:
        case.fail(
            LIMITS,
            event_told(case, jump),
            f"the run ends in mode {str(arc.mode[-1])!r} at {case.state_told(arc.x[-1])}",
            f"a run from the limit ends in mode {str(again.mode[-1])!r} at {case.state_told(again.x[-1])}",
            hint="the limit of the chatter leads into the wrong part of a mode.",
        )


def _from_limit(case: Case, jump: Jump, arc: HybridArc) -> HybridArc:
    """The run from the state after a limit to the end of the arc, in the mode as the user names it."""
    names = {each.name: each.part_of or each.name for each in case.system.modes}
    try:
        return case.simulate(arc.t[-1], start=(jump.t, jump.x_plus, names[jump.target or ""]))
    except ModelError as refusal:
        discard(str(refusal))
