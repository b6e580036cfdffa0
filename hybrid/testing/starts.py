"""Where a run may start: on the near side of all guards, where the laws of the mode allow it.

Where contacts are, the state tells the mode: those whose gap is zero and stays so are held.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import attrs
import numpy as np

from hybrid.errors import ArgumentError
from hybrid.expression.evaluation import scalar
from hybrid.simulation.simulate import simulate
from hybrid.system.derivatives import evaluate
from hybrid.system.elements import Function
from hybrid.system.growth import finished, stage_of
from hybrid.testing.case import Case, guard_beyond
from hybrid.transform.contacts.growth import SETTLING, ContactGrowth, contacts_of

# Newton's method ends where no quantity is larger than this share of its terms, or after so many steps; what
# it has found then must be within the other share.
ON_SURFACE = 1e-14
NEAR_SURFACE = 1e-9
MOST_STEPS = 30
# What is smaller than this share of a state stands for zero.
DUST = 1e-13
# Step of the differences.
NUDGE = 2.0**-26


def start_in(case: Case, mode: str) -> tuple[float, ...] | None:
    """The state nearest to that of a case from which a run may start in a mode; None if there is none near.

    It lies on the surfaces of the ``equal`` of the mode and of what the mode holds, on the near side of its
    guards, where its field has a value and no invariant is negative.
    """
    names = case.names_of_mode(mode)
    functions = [each for law in case.laws.equal if (each := law.in_mode(*names)) is not None]
    functions += held_by(case, mode)
    x = nearest_zero(case, functions, case.t0, np.array(case.x0, dtype=float))
    if x is None or evaluate(case.system.variables, case.rates_of(mode), case.t0, x, case.values) is None:
        return None
    walls = (each for each in case.system.transitions if each.source == mode)
    if not all(guard_beyond(case, each, case.t0, x) < 0.0 for each in walls):
        return None
    for law in case.laws.invariant:
        function = law.in_mode(*names)
        value = 0.0 if function is None else _value(case, function, case.t0, x)
        if value is None or value < 0.0:
            return None
    growth = contacts_of(case.system)
    if growth is not None and _mode_told(case, growth, x) != mode:
        return None
    return tuple(float(each) for each in x)


def held_by(case: Case, mode: str) -> list[Function]:
    """What a mode keeps at zero, as functions of one value."""
    holds = case.mode_of(mode).holds
    if holds is None:
        return []
    count = len(np.ravel(case.evaluate(holds, case.t0, case.x0)))
    return [partial(_entry, holds, i) for i in range(count)]


def _entry(function: Function, i: int, t: float, x: object, p: object) -> float:
    return float(np.ravel(np.asarray(function(t, x, p), dtype=float))[i])


def start_touching(case: Case, touching: Sequence[int], still: bool) -> Case | None:
    """The case with a start near to its own, at which some contacts are closed, in the mode told there.

    None if there is none. Its system has the modes that its run needs.

    Parameters
    ----------
    touching
        The contacts, by number, whose gap and its rate are to be zero.
    still
        Whether these do not slip either.
    """
    growth = contacts_of(case.system)
    assert growth is not None, "this is asked of systems with contacts"
    view = growth.mechanics.view
    functions: list[Function] = []
    for i in touching:
        normal, across = growth.mechanics.places[i]
        rates = [normal] if across is None or not still else [normal, across]
        functions += [scalar(view.gaps[i]), *(scalar(view.speeds[row]) for row in rates)]
    x = nearest_zero(case, functions, case.t0, np.array(case.x0, dtype=float))
    if x is None:
        return None
    # What Newton's method leaves of a zero is in the way of differences.
    x[np.abs(x) < DUST * np.abs(x).max()] = 0.0
    mode = _mode_told(case, growth, x)
    if mode is None:
        return None
    state = tuple(float(each) for each in x)
    try:
        simulate(case.system, state, (case.t0, case.t1), mode=mode, parameters=case.parameters)
    except ArgumentError:
        return None
    made = attrs.evolve(case, system=finished(stage_of(case.system)), x0=state)
    start = start_in(made, mode)
    return None if start is None else attrs.evolve(made, mode=mode, x0=start)


def _mode_told(case: Case, growth: ContactGrowth, x: np.ndarray) -> str | None:
    """The mode that a state tells; None if a gap is negative there, or none or several modes are possible."""
    try:
        mode = growth.mode_at(case.t0, x, case.values, None)
    except ArgumentError:
        return None
    return None if mode == SETTLING else mode


def nearest_zero(case: Case, functions: list[Function], t: float, x: np.ndarray) -> np.ndarray | None:
    """A state near ``x`` where scalar functions of ``(t, x, p)`` are zero, by Newton's method; or None."""
    if not functions:
        return x
    for _ in range(MOST_STEPS):
        found = [_value_and_slope(case, function, t, x) for function in functions]
        pairs = [pair for pair in found if pair is not None]
        if len(pairs) < len(found):
            return None
        residual, jacobian = (np.array(each) for each in zip(*pairs, strict=True))
        if np.all(np.abs(residual) <= ON_SURFACE * (np.abs(jacobian) @ np.abs(x))):
            return x
        # A counter stays what it is.
        free = case.system.tangent_dimension
        x = x - np.append(np.linalg.pinv(jacobian[:, :free]) @ residual, np.zeros(len(x) - free))
        if not np.all(np.isfinite(x)):
            return None
    return x if np.all(np.abs(residual) <= NEAR_SURFACE * (np.abs(jacobian) @ np.abs(x))) else None


def _value_and_slope(
    case: Case, function: Function, t: float, x: np.ndarray
) -> tuple[float, list[float]] | None:
    value, slopes = _value(case, function, t, x), []
    for i in range(len(x)):
        aside = x.copy()
        aside[i] += NUDGE * max(1.0, abs(x[i]))
        there = _value(case, function, t, aside)
        if value is None or there is None:
            return None
        slopes.append((there - value) / (aside[i] - x[i]))
    return None if value is None else (value, slopes)


def _value(case: Case, function: Function, t: float, x: np.ndarray) -> float | None:
    found = evaluate(case.system.variables, function, t, x, case.values)
    return None if found is None else float(found[0])
