"""A surface with a field on either side: crossing, sliding and their borderline cases, by Filippov."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Any

import attrs
import numpy as np

from hybrid.system.elements import Function
from hybrid.system.variables import Variables

# A start in the sliding mode does not slide if it is further from the surface than this fraction of the
# terms of ``h``. The drift during sliding is far smaller, so a run can be continued from any of its states.
SLIDING_BAND = 1e-6
# A surface that both fields cross with the same speed does not attract.
SLOWEST = 1e-300
# An orbit that reaches the surface slower than this fraction of its speed and turns back only touches it.
TOUCH = 3e-8


@attrs.frozen(eq=False)
class SwitchingSurface:
    """The model functions derived from two fields and a switching function."""

    variables: Variables
    below: Function
    above: Function
    switching: Function

    @cached_property
    def gradient(self) -> Function:
        """``(D_x h, D_t h)``."""
        return _derived_gradient(self.variables, self.switching)

    @cached_property
    def speed_below(self) -> Function:
        """``L_b``, the rate of the switching function along the field below."""
        return _rate(self.variables, self.gradient, self.below)

    @cached_property
    def speed_above(self) -> Function:
        """``L_a``."""
        return _rate(self.variables, self.gradient, self.above)

    @cached_property
    def turn_below(self) -> Function:
        """Rate of ``L_b`` along the field below."""
        return _rate(self.variables, _derived_gradient(self.variables, self.speed_below), self.below)

    @cached_property
    def turn_above(self) -> Function:
        """Rate of ``L_a`` along the field above."""
        return _rate(self.variables, _derived_gradient(self.variables, self.speed_above), self.above)

    def may_attract(self) -> bool:
        """Whether sliding is possible: False if the two speeds are proved equal everywhere."""
        from hybrid.expression.polynomials import is_zero
        from hybrid.expression.tracing import trace

        L_b, L_a = trace(self.speeds, self.variables.components, self.variables.parameter_names)
        return not is_zero(L_b - L_a)

    def speeds(self, t: Any, x: Any, p: Any) -> tuple[Any, ...]:
        """``(L_b, L_a)``."""
        return self.speed_below(t, x, p), self.speed_above(t, x, p)

    @cached_property
    def sliding_field(self) -> Function:
        """The equivalent field, along which the switching function is constant."""
        from hybrid.expression.evaluation import expressed
        from hybrid.expression.tracing import trace

        def field(t: Any, x: Any, p: Any) -> list[Any]:
            L_b, L_a = self.speeds(t, x, p)
            attraction = self._difference_of_speeds(t, x, p)
            return [
                b if _is_zero(a - b) else (L_b * a - L_a * b) / attraction
                for b, a in zip(self.below(t, x, p), self.above(t, x, p), strict=True)
            ]

        traced = trace(field, self.variables.components, self.variables.parameter_names)
        return expressed([_cancelled(each) for each in traced])

    def arrives_from_below(self, t: Any, x: Any, p: Any) -> Any:
        """Whether an orbit that comes from below stays on the surface."""
        return self._goes_on(t, x, p, +1.0) & (self.speed_above(t, x, p) <= 0.0)

    def arrives_from_above(self, t: Any, x: Any, p: Any) -> Any:
        """Whether an orbit that comes from above stays on the surface."""
        return self._goes_on(t, x, p, -1.0) & (self.speed_below(t, x, p) >= 0.0)

    def crosses_up(self, t: Any, x: Any, p: Any) -> Any:
        """Whether an orbit that comes from below crosses the surface."""
        return self._goes_on(t, x, p, +1.0) & (self.speed_above(t, x, p) > 0.0)

    def crosses_down(self, t: Any, x: Any, p: Any) -> Any:
        """Whether an orbit that comes from above crosses the surface."""
        return self._goes_on(t, x, p, -1.0) & (self.speed_below(t, x, p) < 0.0)

    def _goes_on(self, t: Any, x: Any, p: Any, side: float) -> Any:
        """Whether an orbit that reaches the surface rising (side +1) or falling (-1) does not just touch it.

        An orbit that leaves the sliding mode at a fold starts on the surface with a speed through it that is
        zero up to rounding, and accelerates back into its own side. That is not an arrival. The speed is
        compared with those of both fields, because the field at the fold may be at rest, as for a mass that
        is about to slip.
        """
        if side > 0:
            speed, turn = self.speed_below(t, x, p), self.turn_below(t, x, p)
        else:
            speed, turn = self.speed_above(t, x, p), self.turn_above(t, x, p)
        return (side * turn >= 0.0) | (side * speed > TOUCH * self._through(t, x, p))

    def attraction(self, t: Any, x: Any, p: Any) -> Any:
        """``L_b - L_a``: positive where the surface attracts."""
        return self._difference_of_speeds(t, x, p) - SLOWEST

    def _difference_of_speeds(self, t: Any, x: Any, p: Any) -> Any:
        """``L_b - L_a`` from the jump of the field: what both speeds have in common is not rounded."""
        slope = self.gradient(t, x, p)[:-1]
        jump = [b - a for b, a in zip(self.below(t, x, p), self.above(t, x, p), strict=True)]
        return _dot(slope, jump, 0.0)

    def _through(self, t: Any, x: Any, p: Any) -> Any:
        """The rate of ``h`` if the terms of both fields' rates added up, as the root of their squares.

        Terms of one unit only: what a field does along the surface, in units of its own, does not count.
        """
        *slope, own = self.gradient(t, x, p)
        total = own * own
        for field in (self.below, self.above):
            rates = [a * b for a, b in zip(slope, field(t, x, p), strict=True)]
            total = _dot(rates, rates, total)
        return np.sqrt(total)

    def is_off(self, t: Any, x: Any, p: Any) -> Any:
        """Whether a state is too far from the surface to slide, in any units of the states.

        Near is what is near relative to the terms ``D_x h x``. Near is also what is so near that the fields
        reach the surface before any state that ``h`` does not depend on has changed: the state may lie on
        ``h = x_0 = 0`` up to rounding, and then only other states have a size.
        """
        *slope, _ = self.gradient(t, x, p)
        h = np.abs(self.switching(t, x, p))
        terms = [abs(a * b) for a, b in zip(slope, x, strict=True)]
        L_b, L_a = self.speeds(t, x, p)
        speed = np.abs(L_b) + np.abs(L_a)
        far, compared = False, False
        for a, value, *rates in zip(slope, x, self.below(t, x, p), self.above(t, x, p), strict=True):
            rate = np.abs(rates[0]) + np.abs(rates[1])
            other = (a == 0.0) & (rate * np.abs(value) > 0.0)
            far = far | (other & (h * rate > SLIDING_BAND**2 * speed * np.abs(value)))
            compared = compared | other
        return (h > SLIDING_BAND * _dot(terms, [1.0] * len(terms), 0.0)) & (far | np.logical_not(compared))

    def projection(self, t: Any, x: Any, p: Any) -> list[Any]:
        """The nearest point of the surface, to first order."""
        normal = self.gradient(t, x, p)[:-1]
        share = self.switching(t, x, p) / _dot(normal, normal, 0.0)
        return [value - share * slope for value, slope in zip(x, normal, strict=True)]


def _derived_gradient(variables: Variables, function: Function) -> Function:
    """``(D_x, D_t)`` of a scalar function as a model function, which can itself be traced."""
    from hybrid.expression.derivatives import jacobian_of
    from hybrid.expression.evaluation import expressed
    from hybrid.expression.tracing import model_symbols, trace

    names = variables.parameter_names
    symbols = model_symbols(variables.dimension, len(names))
    [row] = jacobian_of(trace(function, variables.components, names), symbols.variables)
    return expressed(row)


def _rate(variables: Variables, gradient: Function, field: Function) -> Function:
    """``D_t g + D_x g f``, the rate of a function along a field, as a model function."""
    from hybrid.expression.evaluation import scalar
    from hybrid.expression.tracing import trace

    def rate(t: Any, x: Any, p: Any) -> Any:
        *normal, own = gradient(t, x, p)
        return _dot(normal, field(t, x, p), own)

    [expression] = trace(rate, variables.components, variables.parameter_names)
    return scalar(expression)


def _dot(a: Iterable[Any], b: Iterable[Any], total: Any) -> Any:
    """``total`` plus the dot product; terms whose first factor is zero are skipped."""
    for factor, other in zip(a, b, strict=True):
        if not _is_zero(factor):
            total = total + factor * other
    return total


def _cancelled(expression: Any) -> Any:
    """The expression without what cancels in its sums: what both fields share, such as a forcing.

    A difference of two equal terms is zero but for rounding, and its series is rounding alone.
    """
    from hybrid.expression.graph import MOST_EXPANDED, is_larger_than, nodes_of, replaced
    from hybrid.expression.nodes import Sum
    from hybrid.expression.polynomials import expanded

    if is_larger_than(MOST_EXPANDED, expression):
        return expression
    sums = {each: expanded(each) for each in nodes_of(Sum, expression)}
    return replaced(expression, {each: made for each, made in sums.items() if made.mask != each.mask})


def _is_zero(value: Any) -> bool:
    """Whether a number is zero; a traced number counts as zero if its expression is."""
    return bool(getattr(value, "expression", value) == 0)
