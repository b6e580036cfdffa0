"""Each change of sign of a guard fires its transition once."""

from __future__ import annotations

import numpy as np

from hybrid.system.elements import Transition
from hybrid.testing.case import Case, as_case, discard, stretches

CROSSINGS = "Each change of sign of a guard in its direction fires once"

# Between two events a guard is looked at in so many places.
PLACES = np.linspace(0.0, 1.0, 65)[1:-1]
# Two jumps of one transition closer than this, as a share of the run, are the same event twice.
AT_ONCE = 1e-12


def check_crossings(case: Case) -> None:
    """Between two events no guard changes its sign in its direction, and no event happens twice.

    Guards with a condition are left out: a crossing that the condition refuses does not fire.

    Raises
    ------
    PropertyError
        If a crossing does not fire, or fires twice.
    """
    as_case(case)
    run = case.run
    guards = [each for each in case.system.transitions if each.guard.when is None]
    if not guards:
        discard("every guard has a condition")
    _check_doubled(case)
    for _, mode, start, length in stretches(case):
        places = start + length * PLACES
        states = run.arc(places)
        for transition in (guard for guard in guards if guard.source == mode):
            _check_between(case, transition, places, states)


def _check_doubled(case: Case) -> None:
    """No transition fires twice at one time but for another in between."""
    jumps = case.run.arc.jumps
    for before, after in zip(jumps, list(jumps)[1:], strict=False):
        apart = after.t - before.t
        if before.transition == after.transition and not apart > AT_ONCE * (case.run.t1 - case.t0):
            case.fail(
                CROSSINGS,
                f"{after.transition!r} fired at t = {before.t:.15g} and again at t = {after.t:.15g}",
                hint="an event that is found again where it has just fired.",
            )


def _check_between(case: Case, transition: Transition, times: np.ndarray, states: np.ndarray) -> None:
    """A guard keeps its sign between two events, or changes it against its direction."""
    values = np.array(
        [case.evaluate(transition.guard.function, t, x)[0] for t, x in zip(times, states, strict=True)]
    )
    clear = np.abs(values) > 1e-7 * np.abs(values).max()
    signs, times = np.sign(values[clear]), times[clear]
    direction = transition.guard.direction
    changes = np.flatnonzero((signs[1:] != signs[:-1]) & ((direction == 0) | (signs[1:] == direction)))
    if len(changes):
        first = changes[0]
        case.fail(
            CROSSINGS,
            f"guard of {transition.name!r} in mode {transition.source!r}: it changes its sign between "
            f"t = {times[first]:.10g} and t = {times[first + 1]:.10g}, and nothing fires",
            hint="an event that is missed: a guard that is looked at in too few places.",
        )
