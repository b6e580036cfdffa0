"""Clocks fire when they should: no tick is lost, and none fires twice."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from hybrid.simulation.jumps import Jump
from hybrid.system.clocks import Clock, numbers_of
from hybrid.system.elements import Transition
from hybrid.system.entries import enters_anew
from hybrid.system.schedule import At
from hybrid.testing.case import Case, as_case, jump_told
from hybrid.testing.errors import discard

TICKS = "A clock fires at each of its ticks, once"

# Ticks are known up to the rounding of a few operations with times.
ROUNDING = 64.0 * float(np.finfo(float).eps)


def check_ticks(case: Case) -> None:
    """Between two jumps no clock of the mode ticks, each jump of a clock is at a tick, no tick fires twice.

    The whole run is judged. Ticks may be passed over by a condition (``when=``).

    Raises
    ------
    PropertyError
        If a tick is lost, late, early or doubled.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_ticks
    >>> doses = models.dosing_schedule()
    >>> check_ticks(Case(doses, doses.parameters, "body", (0.0, 0.0), 0.0, 96.0))
    """
    arc = as_case(case).whole
    clocks = [each for each in case.system.transitions if each.clock]
    if arc is None or not clocks:
        discard("no transition has a clock" if arc else "no mode allows the start")
    entry, fired = _start_of_stay(case, case.t0, arc.x[0]), set[tuple[str, int | None]]()
    times = [case.t0, *arc.jumps.t.tolist(), float(arc.t[-1])]
    states = [arc.x[0], *arc.jumps.x_plus]
    mode: str | None = str(arc.mode[0])
    for i, (begin, end) in enumerate(pairwise(times)):
        for transition in clocks:
            if transition.source == mode and transition.guard.when is None:
                _check_between(case, transition, states[i], entry, begin, end)
        if i == len(arc.jumps):
            break
        jump = arc.jumps[i]
        if end > begin:
            fired.clear()
        _check_at(case, jump, entry, fired)
        if enters_anew(case.system, case.transition(jump)):
            entry = jump.t
        mode = jump.target


def _start_of_stay(case: Case, t: float, x: np.ndarray) -> float:
    """When the mode was entered in which a run begins."""
    return t if case.system.age is None else t - float(x[case.system.age])


def _check_between(
    case: Case, transition: Transition, x: np.ndarray, entry: float, begin: float, end: float
) -> None:
    """Fail if a clock ticks between two jumps, by more than rounding away from both."""
    assert transition.clock is not None
    numbers = _numbers(case, transition.clock, x)
    band = _band(numbers, begin, end)
    tick = _first_behind(transition.clock, numbers, entry, begin + band)
    if tick < end - band:
        case.fail(
            TICKS,
            f"{transition.name!r} ticks at t = {tick:.10g}, and no jump is there: the jumps before and after "
            f"that are at t = {begin:.10g} and {end:.10g}",
            hint="a tick that is lost.",
        )


def _check_at(case: Case, jump: Jump, entry: float, fired: set[tuple[str, int | None]]) -> None:
    """Fail if a jump of a clock is at no tick, or has ``fired`` before at this instant."""
    clock = case.transition(jump).clock
    if clock is None:
        return
    numbers = _numbers(case, clock, jump.x_minus)
    band = _band(numbers, entry, jump.t)
    tick = _first_behind(clock, numbers, entry, jump.t - band)
    if not abs(tick - jump.t) <= band:
        case.fail(TICKS, jump_told(case, jump), f"the next tick is at t = {tick:.10g}", hint="it is early.")
    if (jump.transition, jump.row) in fired:
        case.fail(TICKS, jump_told(case, jump), "it has fired at this instant", hint="a tick fires twice.")
    fired.add((jump.transition, jump.row))


def _numbers(case: Case, clock: Clock, x: np.ndarray) -> np.ndarray:
    variables = case.system.variables
    return np.array(numbers_of(clock, variables.state_view(x), variables.parameter_view(case.values)), float)


def _band(numbers: np.ndarray, *times: float) -> float:
    return ROUNDING * float(np.abs([*numbers, *times]).max())


def _first_behind(clock: Any, numbers: np.ndarray, entry: float, t: float) -> float:
    """The first tick of a clock behind a time; infinite if there is none."""
    if clock.counts_from_entry:
        tick = entry + float(numbers[0])
        return tick if tick > t else math.inf
    if clock.number == At.number:
        return float(np.min(numbers[numbers > t], initial=math.inf))
    period, offset = numbers
    return float(offset + (math.floor((t - offset) / period) + 1) * period)
