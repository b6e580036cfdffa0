"""Where an event lands: a reset does not depend on the last digits, a limit goes on as a start there does."""

from __future__ import annotations

import numpy as np

from hybrid.errors import ModelError
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.jumps import Jump
from hybrid.testing.case import Case, as_case
from hybrid.testing.errors import discard
from hybrid.testing.words import jump_told

LANDINGS = "A reset gives the same a few units in the last place to either side of where its event lies"
LIMITS = "The limit of a chatter goes on as a run that starts there does"

# A reset that is continuous where its event lies changes by rounding alone.
BY_ROUNDING = 1e-9
ULPS = 4.0
# In the mode of a limit the guard of the chatter and its speed are at most this share of those before.
OFF_GUARD = 1e-4
# Share of the time of a case over which a speed is taken.
MOMENT = 1e-7


def check_landings(case: Case) -> None:
    """Each reset that an event of the flow sets off is continuous where the event lies.

    A reset may jump at its own guard, as ``np.mod`` and ``np.floor`` do for an angle that wraps. Events land
    beyond their guard, so the reset sees the crossing as made. A reset that jumps a few units in the last
    place away from there rounds another quantity than the guard does: its value is left to chance.

    Raises
    ------
    PropertyError
        If a reset gives other values at a neighbouring floating-point number.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_landings
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_landings(case)
    """
    as_case(case)
    jumps, seen, previous = case.run.arc.jumps, False, -np.inf
    for jump in jumps:
        transition, locked = case.transition(jump), jump.t == previous
        previous = jump.t
        if transition.reset is None or locked:
            continue
        seen = True
        wanted = case.after(jump, jump.t, jump.x_minus)
        # Rounding of the others reaches a component in which their parts cancel.
        rounding = ULPS * np.finfo(float).eps * np.abs(jump.x_minus).max()
        for way in (-np.inf, np.inf):
            t, x = np.nextafter(jump.t, way), np.nextafter(jump.x_minus, way)
            got = case.after(jump, t, x)
            if np.any(np.abs(got - wanted) > BY_ROUNDING * (np.abs(wanted) + case.run.scale) + rounding):
                case.fail(
                    LANDINGS,
                    jump_told(case, jump),
                    f"the reset gives {case.state_told(wanted)} there",
                    f"the reset gives {case.state_told(got)} at the neighbouring floating-point numbers",
                    hint="the reset of this transition jumps at its guard, as np.mod and np.floor do, "
                    "but rounds the quantity otherwise. Write the same expression in guard and reset.",
                )
    if not seen:
        discard("no event of the flow has a reset")


def check_limits(case: Case) -> None:
    """After the limit of a chatter the state stays on the guard, and the run goes on as a start there does.

    The mode of ``accumulates_to`` stands for infinitely many jumps: its field keeps the state on the guard of
    the jumps, without speed through it.

    Raises
    ------
    PropertyError
        If the mode leaves the guard at once, or a run that starts there has another mode or state at its end.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_limits
    >>> table = models.bouncing_table()
    >>> still = {**table.parameters, "A": 0.005}
    >>> case = Case(table, still, "flight", (0.001, 0.0), 0.0, 1.0)
    >>> check_limits(case)
    """
    arc = as_case(case).whole
    limits = [jump for jump in arc.jumps if jump.kind == "limit" and jump.target]
    if not limits:
        discard("no chatter with a limit on the run")
    for jump in limits:
        _check_stays(case, jump, arc)
    if not arc.status.ok:
        discard("no chatter with a limit on a run that ends well")
    jump = limits[-1]
    again = _from_limit(case, jump, arc)
    scale = np.abs(arc.x).max(axis=0)
    same = np.all(np.abs(again.x[-1] - arc.x[-1]) <= 1e-6 * scale)
    if str(again.mode[-1]) != str(arc.mode[-1]) or not same:
        case.fail(
            LIMITS,
            jump_told(case, jump),
            f"the run ends in mode {str(arc.mode[-1])!r} at {case.state_told(arc.x[-1])}",
            f"a run from the limit ends in mode {str(again.mode[-1])!r} at {case.state_told(again.x[-1])}",
            hint="the limit of the chatter leads into the wrong part of a mode.",
        )


def _check_stays(case: Case, jump: Jump, arc: HybridArc) -> None:
    """Fail if the mode of a limit moves the guard of the chatter, or its speed in the mode that chatters."""
    guard, field = case.transition(jump).guard.function, case.rates_of(jump.source)
    moment = MOMENT * (case.t1 - case.t0)

    def value_and_speed(t: float, x: np.ndarray) -> tuple[float, float]:
        f = case.evaluate(field, t, x)
        ahead, behind = (float(case.evaluate(guard, t + h, x + h * f)[0]) for h in (moment, -moment))
        return float(case.evaluate(guard, t, x)[0]), (ahead - behind) / (2.0 * moment)

    chatter = [value_and_speed(t, x) for t, x, j in zip(arc.t, arc.x, arc.j, strict=True) if j <= jump.j]
    sizes = np.abs(chatter).max(axis=0)
    for t, x, j in zip(arc.t, arc.x, arc.j, strict=True):
        if j != jump.j + 1:
            continue
        found = np.array(value_and_speed(t, x))
        if np.any(np.abs(found) > OFF_GUARD * sizes):
            worse = int(np.argmax(np.abs(found) / (sizes + (sizes == 0.0))))
            case.fail(
                LIMITS,
                f"mode {jump.target!r}, to which the jumps of {jump.transition!r} accumulate, leaves its "
                f"guard: its {('value', 'speed')[worse]} is {found[worse]:.6g} at t = {t:.8g}, "
                f"{case.state_told(x)}",
                jump_told(case, jump),
                hint=f"the field of mode {jump.target!r}: it has to keep the state on the guard of "
                f"{jump.transition!r}, without speed through it; or another mode is meant.",
            )


def _from_limit(case: Case, jump: Jump, arc: HybridArc) -> HybridArc:
    """The run from the state after a limit to the end of the arc, in the mode as the user names it."""
    names = {each.name: each.part_of or each.name for each in case.system.modes}
    try:
        return case.simulate(arc.t[-1], start=(jump.t, jump.x_plus, names[jump.target or ""]))
    except ModelError as refusal:
        discard(str(refusal))
