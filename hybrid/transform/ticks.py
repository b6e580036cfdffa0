"""Surfaces that time alone crosses, at known instants: a sawtooth of time has the ticks of a clock."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import attrs
import numpy as np

from hybrid.expression.derivatives import derivative
from hybrid.expression.evaluation import scalar
from hybrid.expression.graph import replaced
from hybrid.expression.nodes import ZERO, Expression, number
from hybrid.expression.operations import Absolute, Ceiling, Floor, Less, LessEqual, Maximum, Minimum, Select
from hybrid.expression.surfaces import Surfaces, is_negative
from hybrid.system.clocks import Every
from hybrid.system.elements import Function

# A quotient of two sums is rounded at most so often.
ROUNDING = number(4.0 * np.finfo(float).eps)


@attrs.frozen
class OfParameters:
    """A number as a function of ``p``, from a function of ``(t, x, p)`` that reads nothing else."""

    function: Function

    def __call__(self, p: Any) -> Any:
        """The number at parameters."""
        return self.function(0.0, (), p)


@attrs.frozen
class Timed:
    """A surface that time crosses where a sawtooth begins anew, and where it passes its cut.

    Attributes
    ----------
    period
        Of the sawtooth.
    ends
        By side of the surface, an instant at which time leaves it.
    height
        1 above the surface and -1 below it. The instant at which a side ends belongs to the other side.
    """

    period: Expression
    ends: dict[int, Expression]
    height: Expression

    def clock(self, side: int, names: Mapping[Any, str]) -> Every:
        """The clock that ticks where time leaves a side; ``names`` are those of the parameters."""
        return Every(_quantity(self.period, names), _quantity(self.ends[side], names))


def timed(surfaces: Surfaces, place: int) -> Timed | None:
    """A surface of the time alone that cuts a sawtooth; None for any other.

    The fraction of a growing argument leaves the part below its cut at the cut, and the part above it where
    the argument is whole; that of a falling one the other way round.
    """
    sawtooth = surfaces.sawtooth(place)
    if sawtooth is None or not surfaces.is_timed(sawtooth.argument):
        return None
    t, over, by, cut = surfaces.symbols.t, sawtooth.over, sawtooth.by, sawtooth.cut
    if is_negative(by):
        over, by, cut = -over, -by, -cut
    rate = derivative(over, t)
    # A parameter in ``by`` has to be positive, which the clock checks; one in the rate may have either sign.
    period = Absolute(by / rate) if by.is_number else by / Absolute(rate)
    # A cut beyond the sawtooth never comes: the fraction stays below it, or above it.
    within = cut if cut.is_number else Minimum(Maximum(cut, ZERO), by)
    start = replaced(over, {t: ZERO})
    above, below = ((place - start) / rate for place in (ZERO, within))
    ends = {sawtooth.above: _directed(rate, above, below), -sawtooth.above: _directed(rate, below, above)}
    # A little later, so that rounding does not make the instant at which a side ends a part of it.
    u, later = over / by, ROUNDING * (Absolute(t / period) + Absolute(over / by))
    grown, fallen = u + later - Floor(u + later), u - later - Ceiling(u - later) + 1
    exceeds = _directed(rate, LessEqual(within / by, grown), Less(within / by, fallen))
    return Timed(period, ends, sawtooth.above * (2 * exceeds - 1))


def _directed(rate: Expression, growing: Expression, falling: Expression) -> Expression:
    """One of two expressions, by the direction in which an argument passes."""
    if rate.is_number:
        return falling if rate.value < 0 else growing
    return Select(Less(rate, ZERO), falling, growing)


def _quantity(value: Expression, names: Mapping[Any, str]) -> Any:
    """A number of a clock as a user would write it."""
    if value.is_number:
        return float(value)
    return names.get(value) or OfParameters(scalar(value))
