"""Transitions that are there because a model is symmetric."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import attrs
import numpy as np

from hybrid.expression.reads import names_read
from hybrid.expression.values import TraceError
from hybrid.system.clocks import Clock
from hybrid.system.derivatives import evaluate
from hybrid.system.elements import Function, Transition
from hybrid.testing.case import Case

# Signs are tried for so many states and parameters at most; functions are compared at so many places.
MOST_SIGNS = 10
PLACES = 6
# Relative difference of two values that are one.
SAME = 1e-9


@attrs.frozen(eq=False)
class Mirror:
    """A symmetry that a model may have: components and parameters change their signs, and time shifts."""

    x: np.ndarray
    p: np.ndarray
    shift: float

    def takes(self, one: Transition, other: Transition, places: list[Case]) -> bool:
        """Whether it takes field, guard and condition of ``one`` to those of ``other``, at these places."""
        directions = {
            sign
            for sign in (1, -1)
            if all(self._equal(case, one.guard.function, other.guard.function, sign) for case in places)
        }
        if not any(one.guard.direction == sign * other.guard.direction for sign in directions):
            return False
        asks, also_asks = one.guard.when, other.guard.when
        if asks is None or also_asks is None:
            alike = asks is also_asks
        else:
            alike = all(self._agree(case, asks, also_asks) for case in places)
        return alike and all(
            self._equal(case, case.rates_of(one.source), case.rates_of(other.source), self.x)
            for case in places
        )

    def _values(self, case: Case, one: Function, other: Function) -> tuple[np.ndarray, np.ndarray] | None:
        variables, x = case.system.variables, np.array(case.x0)
        there = evaluate(variables, one, case.t0 + self.shift, self.x * x, self.p * case.values)
        here = evaluate(variables, other, case.t0, x, case.values)
        return None if there is None or here is None else (there, here)

    def _equal(self, case: Case, one: Function, other: Function, signs: np.ndarray | int) -> bool:
        pair = self._values(case, one, other)
        return pair is not None and np.allclose(pair[0], signs * pair[1], rtol=SAME, atol=SAME)

    def _agree(self, case: Case, one: Function, other: Function) -> bool:
        pair = self._values(case, one, other)
        return pair is not None and bool((pair[0] > 0.0) == (pair[1] > 0.0))


def is_mirrored(transition: Transition, taken: list[Transition], cases: list[Case]) -> bool:
    """Whether a symmetry of the model takes a transition to one that runs have taken.

    Then the author has written down both sides of a symmetric model, as friction in both directions, and the
    parameters may well keep runs from one of them. A wrong sign would break the symmetry.
    """
    if isinstance(transition.guard, Clock) or not cases:
        return False
    places = cases[:PLACES]
    others = [each for each in taken if not isinstance(each.guard, Clock)]
    return any(
        mirror.takes(transition, other, places)
        for other in others
        for mirror in _mirrors(transition, other, cases[0])
    )


def _mirrors(one: Transition, other: Transition, case: Case) -> Iterator[Mirror]:
    """Changes of signs of states and of parameters that the fields read, at once or half a period later."""
    system = case.system
    n, names = system.dimension, system.variables.parameter_names
    try:
        read = [names_read(system, case.rates_of(each.source)) for each in (one, other)]
    except TraceError:
        return
    free = [i for i, name in enumerate(names) if any(name in each for each in read)]
    if n + len(free) > MOST_SIGNS:
        return
    period = system.forcing_period(dict(zip(names, case.values, strict=True)))
    for signs in itertools.product((1.0, -1.0), repeat=n + len(free)):
        p = np.ones(len(names))
        p[free] = signs[n:]
        for shift in (0.0,) if period is None else (0.0, period / 2):
            yield Mirror(np.array(signs[:n]), p, shift)
