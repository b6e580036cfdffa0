"""An elastic system runs backwards to where it started."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from hybrid import arguments
from hybrid.compiler.compiled import compile_system
from hybrid.simulation.arc import HybridArc
from hybrid.system.graph import HybridSystem
from hybrid.testing.case import Case, as_case
from hybrid.testing.errors import discard
from hybrid.testing.invariance import LAST_INSTANT

ELASTIC = "An elastic system runs backwards to where it started"


def check_elastic(case: Case, flip: Iterable[str] | Callable[[np.ndarray], np.ndarray]) -> None:
    """An autonomous elastic system with its velocities reversed at the end runs back to its start.

    Parameters
    ----------
    case
        Its parameters must make the system elastic.
    flip
        Names of the components that change sign when time is reversed, or the involution of the state.

    Raises
    ------
    PropertyError
        If the run does not come back.
    ArgumentError
        If a name in ``flip`` is no component of the state.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_elastic
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, {"g": 9.81, "e": 1.0}, "flight", (1.0, 0.0), 0.0, 2.0)
    >>> check_elastic(case, flip=("v",))
    """
    turn = turned("flip", as_case(case).system, flip)
    if not all(compile_system(case.system).emitted.autonomous):
        discard("a field depends on time")
    run = case.run
    start = (case.t0, turn(run.arc.x[-1]), str(run.arc.mode[-1]))
    arc = case.simulate(run.t1, start=start)
    other = case.simulate(run.t1, start=start, solver=case.looser)
    (end, jumps), (other_end, other_jumps) = _returned(case, arc), _returned(case, other)
    if not arc.status.ok or other_jumps != jumps:
        discard("the events of the run backwards depend on the tolerances")
    back = turn(end)
    error = np.abs(turn(other_end) - back)
    if not np.all(np.abs(back - np.array(case.x0)) <= run.tolerance + 100.0 * error):
        case.fail(
            ELASTIC,
            f"wanted {case.state_told(case.x0)} at the end of the run backwards",
            f"got {case.state_told(back)}, after {len(run.arc.jumps)} events there and {jumps} back",
            hint="a reset that loses energy or moves the state off the guard (a nudge), or damping.",
        )


def _returned(case: Case, arc: HybridArc) -> tuple[np.ndarray, int]:
    """The end of a run backwards, and its number of jumps.

    A start on a guard has not made the jump there, which the run backwards may make at its end.
    """
    made = len(case.run.arc.jumps)
    if len(arc.jumps) == made + 1 and arc.t[-1] - arc.jumps[made].t <= LAST_INSTANT * (arc.t[-1] - arc.t[0]):
        return arc.jumps[made].x_minus, made
    return arc.x[-1], len(arc.jumps)


def turned(
    name: str, system: HybridSystem, flip: Iterable[str] | Callable[[np.ndarray], np.ndarray]
) -> Callable[[np.ndarray], np.ndarray]:
    """The involution of the state: ``flip`` itself, or the sign change of the components named in it."""
    known = system.state_names
    wanted = "be names of components of the state, or a function of it"
    if callable(flip):
        return lambda x: _turned_by(name, flip, x)
    names = [
        arguments.known(f"{name}: State component", each, known, "State components")
        for each in arguments.items(name, flip, wanted)
    ]
    signs = np.array([-1.0 if each in names else 1.0 for each in known])
    return lambda x: signs * x


def _turned_by(name: str, flip: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> np.ndarray:
    """What a user's function makes of a state."""
    wanted = f"be a function that returns {x.size} numbers for a state"
    try:
        given: object = flip(x.copy())
    except Exception as error:
        raise arguments.refusal(
            name, f"{wanted}; it fails with {type(error).__name__}: {error}", flip
        ) from error
    found = arguments.numbers(f"{name}: the state returned", given, f"hold {x.size} numbers")
    if found.shape != x.shape:
        raise arguments.refusal(name, wanted, flip)
    return found
