"""Each change of sign of a guard fires its transition once."""

from __future__ import annotations

import numpy as np

from hybrid.system.elements import Transition
from hybrid.testing.case import Case, as_case, stretches
from hybrid.testing.errors import discard

CROSSINGS = "Each change of sign of a guard in its direction fires once"

# A guard is evaluated at these places between two events, as shares of the stretch.
PLACES = np.linspace(0.0, 1.0, 65)[1:-1]
# Two jumps of one transition are the same event if closer than this share of the run.
AT_ONCE = 1e-12


def check_crossings(case: Case) -> None:
    """Between two events no guard crosses zero in its direction, and no event happens twice.

    Guards with a condition are skipped: a crossing that the condition refuses does not fire.

    Raises
    ------
    PropertyError
        If a crossing does not fire or fires twice.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_crossings
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_crossings(case)
    """
    as_case(case)
    run = case.run
    guards = [each for each in case.system.transitions if each.guard.when is None and not each.clock]
    if not guards:
        discard("every guard has a condition, or is a clock")
    _check_doubled(case)
    for _, mode, start, length in stretches(case):
        places = start + length * PLACES
        states = run.arc(places)
        for transition in (guard for guard in guards if guard.source == mode):
            _check_between(case, transition, places, states)


def _check_doubled(case: Case) -> None:
    """Fail if a transition fires twice in a row at the same time."""
    jumps = case.run.arc.jumps
    for before, after in zip(jumps, list(jumps)[1:], strict=False):
        apart = after.t - before.t
        if before.transition == after.transition and not apart > AT_ONCE * case.duration:
            case.fail(
                CROSSINGS,
                f"{after.transition!r} fired at t = {before.t:.15g} and again at t = {after.t:.15g}",
                hint="the solver finds an event again right after it has fired.",
            )


def _check_between(case: Case, transition: Transition, times: np.ndarray, states: np.ndarray) -> None:
    """Fail if a guard crosses zero in its direction between two events."""
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
            f"guard of {transition.name!r} in mode {transition.source!r} changes sign between "
            f"t = {times[first]:.10g} and t = {times[first + 1]:.10g}, but no transition fires",
            hint="the solver misses an event because it evaluates the guard at too few times.",
        )
