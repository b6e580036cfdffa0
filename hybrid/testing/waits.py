"""Delays: so long after each jump of its trigger a transition fires, as often as there were jumps."""

from __future__ import annotations

import numpy as np

from hybrid.simulation.arc import HybridArc
from hybrid.system.elements import Transition
from hybrid.system.places import NEVER, UnderWay
from hybrid.testing.case import Case

TICKS = "A clock fires at each of its ticks, once"

# The time of a tick is known up to this share of the times and durations that it is made of.
ROUNDING = 1e-12


def check_waits(case: Case, arc: HybridArc, transition: Transition, clock: UnderWay) -> None:
    """Compare the jumps of a transition with those of its trigger, a duration later.

    What the state itself says of it counts at the start of the run alone. A tick may be passed over by a
    condition, or missed in another mode.

    Raises
    ------
    PropertyError
        If a tick is lost, doubled, or at another time.
    """
    due = np.sort(_due(case, arc, clock))
    band = ROUNDING * float(np.abs([*due, case.t0, arc.t[-1]]).max())
    own = np.array([each.t for each in arc.jumps if each.transition == transition.name])
    for t in own:
        if not np.any(np.abs(due - t) <= band):
            case.fail(
                TICKS,
                f"{transition.name!r} fires at t = {t:.10g}, {clock.told}, and no jump was that long before",
                hint="a tick from nowhere.",
            )
    for t in due[due < float(arc.t[-1]) - band]:
        wanted, found = (int(np.sum(np.abs(times - t) <= band)) for times in (due, own))
        if found > wanted or (found < wanted and _must_fire(arc, transition, float(t), band)):
            case.fail(
                TICKS,
                f"{transition.name!r}, {clock.told}, is due {wanted} times at t = {t:.10g}, and fires "
                f"{found} times",
                hint="a tick that is lost, or fires twice.",
            )


def _due(case: Case, arc: HybridArc, clock: UnderWay) -> list[float]:
    """When the transition is due, from what is under way at the start and from the jumps of the trigger."""
    variables, places = case.system.variables, clock.places
    p = variables.parameter_view(case.values)
    left = [float(each) for each in places.left(variables.state_view(arc.x[0]))]
    begun = (each for each in arc.jumps if each.transition in clock.delay.trigger)
    waits = [each.t + float(places.wait(variables.state_view(each.x_plus), p)) for each in begun]
    return [*(case.t0 + each for each in left if each < NEVER), *waits]


def _must_fire(arc: HybridArc, transition: Transition, t: float, band: float) -> bool:
    """Whether a tick fires in any case: without a condition, in one mode from before until after."""
    modes = {str(mode) for mode in arc.mode[np.abs(arc.t - t) <= band]}
    modes.add(str(arc.mode[np.searchsorted(arc.t, t - band, side="right") - 1]))
    return transition.guard.when is None and modes == {transition.source}
