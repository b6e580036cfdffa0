"""Clocks fire when they should: no tick is lost, and none fires twice."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import attrs
import numpy as np

from hybrid.simulation.jumps import Jump
from hybrid.system.clocks import Clock, numbers_of
from hybrid.system.delay import Delay
from hybrid.system.elements import Transition
from hybrid.system.entries import enters_anew, enters_itself
from hybrid.system.places import UnderWay
from hybrid.system.schedule import At
from hybrid.testing.case import Case, as_case
from hybrid.testing.errors import discard
from hybrid.testing.waits import TICKS, check_waits
from hybrid.testing.words import jump_told

# Ticks are known up to the rounding of a few operations with times.
ROUNDING = 64.0 * float(np.finfo(float).eps)


@attrs.define
class Begins:
    """When the mode of a run was entered, and when from another mode; the clocks that have fired since."""

    entry: float
    arrival: float
    over: set[str] = attrs.field(factory=set)


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
    every = [each for each in case.system.transitions if each.clock]
    if not every:
        discard("no transition has a clock")
    clocks = [each for each in every if each.clock and each.clock.number != Delay.number]
    for each in every:
        if isinstance(each.clock, UnderWay):
            check_waits(case, arc, each, each.clock)
    age = 0.0 if case.system.age is None else float(arc.x[0][case.system.age])
    begins, fired = Begins(case.t0 - age, case.t0 - age), set[tuple[str, int | None]]()
    times = [case.t0, *arc.jumps.t.tolist(), float(arc.t[-1])]
    states = [arc.x[0], *arc.jumps.x_plus]
    mode: str | None = str(arc.mode[0])
    for i, (begin, end) in enumerate(pairwise(times)):
        for transition in clocks:
            asked = transition.guard.when is None and transition.name not in begins.over
            if asked and transition.source == mode:
                _check_between(case, transition, states[i], begins, begin, end)
        if i == len(arc.jumps):
            break
        jump = arc.jumps[i]
        if end > begin:
            fired.clear()
        _check_at(case, jump, begins, begin, fired)
        transition = case.transition(jump)
        if enters_anew(case.system, transition):
            stays = enters_itself(case.system, transition)
            begins.entry, begins.arrival = jump.t, begins.arrival if stays else jump.t
            begins.over = {
                each.name for each in clocks if each.name in begins.over and stays and _is_one(each)
            }
        mode = jump.target


def _check_between(
    case: Case, transition: Transition, x: np.ndarray, begins: Begins, begin: float, end: float
) -> None:
    """Fail if a clock ticks between two jumps, by more than rounding away from both."""
    assert transition.clock is not None
    numbers = _numbers(case, transition.clock, x)
    band = _band(numbers, begin, end)
    tick = _first_from(transition.clock, numbers, begins, begin, band)
    if tick < end - band:
        case.fail(
            TICKS,
            f"{transition.name!r} ticks at t = {tick:.10g}, and no jump is there: the jumps before and after "
            f"that are at t = {begin:.10g} and {end:.10g}",
            hint="a tick that is lost.",
        )


def _is_one(transition: Transition) -> bool:
    """Whether a clock ticks once from an entry from another mode on."""
    return transition.clock is not None and not transition.clock.restarts


def _check_at(
    case: Case, jump: Jump, begins: Begins, before: float, fired: set[tuple[str, int | None]]
) -> None:
    """Fail if a jump of a clock is at no tick, or has ``fired`` before at this instant.

    The jump before was at the time ``before``.
    """
    clock = case.transition(jump).clock
    if clock is None or clock.number == Delay.number:
        return
    numbers = _numbers(case, clock, jump.x_minus)
    band = _band(numbers, jump.t)
    tick = _first_from(
        clock, numbers, begins, before if clock.counts_from_entry else jump.t - 2.0 * band, band
    )
    if not abs(tick - jump.t) <= band:
        case.fail(TICKS, jump_told(case, jump), f"the next tick is at t = {tick:.10g}", hint="it is early.")
    if (jump.transition, jump.row) in fired:
        case.fail(TICKS, jump_told(case, jump), "it has fired at this instant", hint="a tick fires twice.")
    fired.add((jump.transition, jump.row))
    if clock.counts_from_entry:
        begins.over.add(jump.transition)


def _numbers(case: Case, clock: Clock, x: np.ndarray) -> np.ndarray:
    variables = case.system.variables
    return np.array(numbers_of(clock, variables.state_view(x), variables.parameter_view(case.values)), float)


def _band(numbers: np.ndarray, *times: float) -> float:
    return ROUNDING * float(np.abs([*numbers, *times]).max())


def _first_from(clock: Any, numbers: np.ndarray, begins: Begins, t: float, band: float) -> float:
    """The first tick of a clock behind ``t + band``; infinite if there is none.

    A duration that a reset has made shorter than the time that has passed is over at once, at ``t``.
    """
    if clock.counts_from_entry:
        return max(t, (begins.entry if clock.restarts else begins.arrival) + float(numbers[0]))
    t += band
    if clock.number == At.number:
        return float(np.min(numbers[numbers > t], initial=math.inf))
    period, offset = numbers
    return float(offset + (math.floor((t - offset) / period) + 1) * period)
