"""Properties of every event of a run."""

from __future__ import annotations

import numpy as np

from hybrid.simulation.jumps import Jump
from hybrid.system.functions import guard_function
from hybrid.testing.case import Case, as_case, guard_beyond
from hybrid.testing.errors import discard
from hybrid.testing.run import lasting, mode_after
from hybrid.testing.words import jump_told

JUMPS = "Events happen where their guard crosses zero in its direction, and do what their reset says"
SIDES = "A mode ends where its guards say"

# A guard is beyond zero by more than rounding at this share of its size on the run.
BEYOND = 1e-7


def check_jumps(case: Case) -> None:
    """At each jump the guard is zero and crosses in its direction, and the state after it is the reset's.

    Raises
    ------
    PropertyError
        If a jump violates one of these.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_jumps
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_jumps(case)
    """
    as_case(case)
    run = case.run
    if not len(run.arc.jumps):
        discard("no event on the run")
    mode, previous = case.mode, -np.inf
    for jump in run.arc.jumps:
        transition = case.transition(jump)
        told = jump_told(case, jump)
        if jump.source != mode:
            case.fail(JUMPS, told, f"the mode was {mode!r}", hint="events that fire in the wrong order.")
        mode = mode_after(jump)
        slope = case.slope(guard_function(transition), jump.transition, jump.t, jump.x_minus)
        value = float(case.evaluate(transition.guard.function, jump.t, jump.x_minus)[0])
        band = np.abs(slope[0, :-1]) @ run.scale + abs(slope[0, -1] * jump.t)
        # Change of the guard over the uncertainty of the event time.
        band += abs(jump.transversality) * case.duration
        # A reset may land beyond a guard, which then fires at the same instant.
        landed = jump.t == previous and value * transition.guard.direction > 0.0
        # A start that lies beyond sets off a correction of its mode.
        landed = landed or transition.guard.at_start
        # Ticks are not zeros of a function of the state: their times are known.
        landed = landed or transition.clock is not None
        previous = jump.t
        if not (landed or abs(value) <= 1e-9 * band or _guard_jumps(case, jump)):
            case.fail(
                JUMPS, told, f"the guard is {value:.6g}, not zero", hint="an event that is late or early."
            )
        if not landed and jump.transversality * transition.guard.direction < 0.0:
            case.fail(
                JUMPS,
                told,
                f"the guard's speed is {jump.transversality:.6g}, its direction {transition.guard.direction}",
                hint="a guard that fires in the wrong direction.",
            )
        wanted = case.after(jump, jump.t, jump.x_minus)
        if not np.all(np.abs(jump.x_plus - wanted) <= 1e-12 * (np.abs(wanted) + run.scale)):
            case.fail(
                JUMPS,
                told,
                f"wanted {case.state_told(wanted)} after it, the value of the reset",
                hint="a state that is moved after the reset (a nudge off the guard).",
            )


def _guard_jumps(case: Case, jump: Jump) -> bool:
    """Whether a guard is discontinuous at an event: its signs just before and just after differ."""
    transition = case.transition(jump)
    field = case.evaluate(case.rates_of(jump.source), jump.t, jump.x_minus)
    moment = 1e-9 * case.duration
    before, after = (
        float(case.evaluate(transition.guard.function, jump.t + shift, jump.x_minus + shift * field)[0])
        for shift in (-moment, moment)
    )
    return before * after < 0.0


def check_sides(case: Case) -> None:
    """Between events no guard of the mode is beyond zero in its direction, except passable ones.

    The whole run is judged. A guard with a condition, and one of time alone, end no mode by their side.

    Raises
    ------
    PropertyError
        If a mode continues beyond a guard that ends it.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_sides
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_sides(case)
    """
    arc = as_case(case).whole
    walls = [each for each in case.system.transitions if case.is_wall(each)]
    if not walls:
        discard("no guard has a direction")
    for i in np.flatnonzero(lasting(arc)):
        t, x, mode = float(arc.t[i]), arc.x[i], str(arc.mode[i])
        for transition in (wall for wall in walls if wall.source == mode):
            beyond = guard_beyond(case, transition, t, x)
            if not beyond > BEYOND * case.guard_size(transition):
                continue
            side, j = "above" if transition.guard.direction > 0 else "below", int(arc.j[i])
            case.fail(
                SIDES,
                f"guard of {transition.name!r}, which ends mode {mode!r} where it goes {side} zero: "
                f"{beyond * transition.guard.direction:.6g} at t = {t:.10g}, {case.state_told(x)}",
                jump_told(case, arc.jumps[j - 1]) if j else "no event before",
                hint="a guard with the wrong direction, or a reset with the wrong sign that leaves the "
                "state beyond the guard. If the state may cross this guard and stay in the mode, name "
                "the transition in passable=.",
            )
