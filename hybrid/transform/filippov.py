"""Hybrid system from two fields on either side of a surface: crossing, sliding and their borderline cases."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import attrs
import numpy as np

from hybrid.errors import ModelError
from hybrid.system.elements import Function, Guard, Mode, Reset, Transition
from hybrid.system.graph import HybridSystem
from hybrid.system.variables import as_parameters, as_state

# A start in the sliding mode does not slide if it is further from the surface than this fraction of the
# state. The drift during sliding is far smaller, so a run can be continued from any of its states.
SLIDING_BAND = 1e-6
# The two fields count as tangent to the surface if both cross it slower than this fraction of their speeds.
TANGENT = 1e-9
# An orbit that reaches the surface slower than this fraction of its speed and turns back only touches it.
TOUCH = 3e-8


def filippov(
    state: tuple[str, ...] | int,
    parameters: Mapping[str, float],
    below: Function,
    above: Function,
    switching: Function,
    *,
    period: float | Function | None = None,
    name: str = "",
) -> HybridSystem:
    """The Filippov system ``f_b`` where ``h < 0``, ``f_a`` where ``h > 0``, with its sliding mode derived.

    The two fields move through the surface ``h = 0`` with the speeds ``L_b = D_t h + D_x h f_b`` and
    ``L_a = D_t h + D_x h f_a``. An orbit from below crosses the surface if ``L_a > 0`` and stays on it if
    ``L_a <= 0``. On the surface it follows the equivalent field

        ``f_s = f_b + alpha (f_a - f_b)``,  ``alpha = L_b / (L_b - L_a)``,

    along which ``h`` is constant, until one of the fields becomes tangent to the surface: the orbit leaves
    above at ``alpha = 1`` and below at ``alpha = 0``. From below, a crossing has the saltation matrix
    ``I + (f_a - f_b) D_x h / L_b``. The entry into sliding has ``I + (f_s - f_b) D_x h / L_b``, of rank
    ``n - 1``.

    The modes are ``below``, ``above`` and ``sliding``; if ``L_b`` and ``L_a`` are equal everywhere, there is
    no sliding mode. A run that starts on the surface finds its mode by itself, unless both fields point away
    from the surface: the orbit may then leave on either side, and the call must name ``below`` or ``above``.
    For the same reason a run ends (status TERMINAL, last jump ``two-fold``) where an orbit slides to a point
    at which both fields are tangent to the surface.

    Parameters
    ----------
    state, parameters
        As for `HybridSystem`.
    below, above
        Fields ``f(t, x, p)`` where the switching function is negative and where it is positive. Each must be
        smooth slightly beyond the surface, and must be traceable.
    switching
        Scalar function ``h(t, x, p)``, which must be traceable. Its gradient must not vanish where ``h = 0``.
        The sliding mode needs ``h`` to be twice differentiable.
    period, name
        As for `HybridSystem`.

    Returns
    -------
    HybridSystem
        Its transitions are named ``source->target``, with these exceptions. ``two-fold`` ends the run;
        ``two-fold at start`` ends a run that starts where the surface repels. ``below too high``,
        ``above too low``, ``sliding too high`` and ``sliding too low`` correct the mode of a start that lies
        off the surface on the wrong side for its mode: by more than rounding or, in the sliding mode, by more
        than 1e-6 of the state's largest component.

    Raises
    ------
    ModelError
        If a function is not callable, has the wrong number of values, or cannot be traced.

    Notes
    -----
    Sliding is not stabilised: ``h`` is an invariant of ``f_s``. It is kept to rounding if ``h`` is affine in
    the state, and to the solver's tolerance otherwise. The transitions out of the sliding mode project the
    state onto the surface.

    References
    ----------
    A. F. Filippov, Differential Equations with Discontinuous Righthand Sides, Kluwer, 1988, section 4;
    M. di Bernardo et al., Piecewise-smooth Dynamical Systems, Springer, 2008, sections 2.2.3 and 2.5,
    doi:10.1007/978-1-84628-708-4.

    Examples
    --------
    A block on a belt, with dry friction. The belt carries the block along until the spring pulls it loose.

    >>> block = filippov(
    ...     state=("x", "v"),
    ...     parameters={"belt": 0.2, "friction": 1.0},
    ...     below=lambda t, x, p: (x.v, p.friction - x.x),
    ...     above=lambda t, x, p: (x.v, -p.friction - x.x),
    ...     switching=lambda t, x, p: x.v - p.belt,
    ... )
    >>> from hybrid import simulate
    >>> arc = simulate(block, x0=(0.5, 0.2), t_span=(0.0, 3.0))
    >>> str(arc.mode[0]), arc.jumps[0].transition, round(arc.jumps[0].t, 12)
    ('sliding', 'sliding->below', 2.5)
    """
    state, parameters = as_state(state), as_parameters(parameters)
    for what, function in (("below", below), ("above", above), ("switching", switching)):
        if not callable(function):
            raise ModelError(f"filippov: {what} must be a function of (t, x, p); got {function!r}.")
    surface = _surface(below, above, switching, state, tuple(parameters))
    modes = [Mode("below", below), Mode("above", above)]
    if surface.may_attract(state, tuple(parameters)):
        modes.append(Mode("sliding", surface.sliding_field))
        transitions = [
            _entered("below", "above", switching),
            _entered("above", "below", switching),
            _entered("sliding", "above", switching, surface.is_off),
            _entered("sliding", "below", switching, surface.is_off),
            Transition("below", "sliding", Guard(switching, +1, when=surface.arrives_from_below)),
            Transition("below", "above", Guard(switching, +1, when=surface.crosses_up)),
            Transition("above", "sliding", Guard(switching, -1, when=surface.arrives_from_above)),
            Transition("above", "below", Guard(switching, -1, when=surface.crosses_down)),
            Transition(
                "sliding", None, Guard(surface.attraction, -1, at_start=True), name="two-fold at start"
            ),
            Transition("sliding", None, Guard(surface.attraction, -1), name="two-fold"),
            Transition("sliding", "above", Guard(surface.speed_above, +1), Reset(surface.projection)),
            Transition("sliding", "below", Guard(surface.speed_below, -1), Reset(surface.projection)),
        ]
    else:
        transitions = [
            Transition("below", "above", Guard(switching, +1)),
            Transition("above", "below", Guard(switching, -1)),
        ]
    return HybridSystem(
        state=state,
        parameters=parameters,
        modes=modes,
        transitions=transitions,
        period=period,
        name=name,
    )


def _surface(
    below: Function,
    above: Function,
    switching: Function,
    state: tuple[str, ...] | int,
    parameters: tuple[str, ...],
) -> _Surface:
    n = state if isinstance(state, int) else len(state)
    functions = (("below", below, n), ("above", above, n), ("switching", switching, 1))
    _check_traceable(functions, state, parameters)
    gradient = _derived_gradient(switching, state, parameters)
    speeds = [_rate(gradient, field) for field in (below, above)]
    turns = [
        _rate(_derived_gradient(speed, state, parameters), field)
        for speed, field in zip(speeds, (below, above), strict=True)
    ]
    return _Surface(below, above, switching, gradient, *speeds, *turns)


@attrs.frozen(eq=False)
class _Surface:
    """The model functions derived from two fields and a switching function."""

    below: Function
    above: Function
    switching: Function
    gradient: Function  # (D_x h, D_t h)
    speed_below: Function  # L_b and L_a, the rates of h along the fields
    speed_above: Function
    turn_below: Function  # rate of L_b along the field below, and of L_a along the field above
    turn_above: Function

    def may_attract(self, state: tuple[str, ...] | int, parameters: tuple[str, ...]) -> bool:
        """Whether sliding is possible: False if the two speeds are proved equal everywhere."""
        from hybrid.symbolic.tracing import trace

        L_b, L_a = trace(self.speeds, state, parameters)
        return (L_b - L_a).expand() != 0

    def speeds(self, t: Any, x: Any, p: Any) -> tuple[Any, ...]:
        """``(L_b, L_a)``."""
        return self.speed_below(t, x, p), self.speed_above(t, x, p)

    def sliding_field(self, t: Any, x: Any, p: Any) -> list[Any]:
        L_b, L_a = self.speeds(t, x, p)
        attraction = L_b - L_a
        return [
            b if _is_zero(a - b) else (L_b * a - L_a * b) / attraction
            for b, a in zip(self.below(t, x, p), self.above(t, x, p), strict=True)
        ]

    # The conditions of the crossings of h = 0.

    def arrives_from_below(self, t: Any, x: Any, p: Any) -> Any:
        return self._goes_on(t, x, p, +1.0) & (self.speed_above(t, x, p) <= 0.0)

    def arrives_from_above(self, t: Any, x: Any, p: Any) -> Any:
        return self._goes_on(t, x, p, -1.0) & (self.speed_below(t, x, p) >= 0.0)

    def crosses_up(self, t: Any, x: Any, p: Any) -> Any:
        return self._goes_on(t, x, p, +1.0) & (self.speed_above(t, x, p) > 0.0)

    def crosses_down(self, t: Any, x: Any, p: Any) -> Any:
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
        return (side * turn >= 0.0) | (side * speed > TOUCH * self._steepest(t, x, p))

    def attraction(self, t: Any, x: Any, p: Any) -> Any:
        L_b, L_a = self.speeds(t, x, p)
        return L_b - L_a - self._hardly_moving(t, x, p)

    def _hardly_moving(self, t: Any, x: Any, p: Any) -> Any:
        """A speed through the surface that counts as zero.

        It is as smooth as the fields, so the sliding mode has a Taylor series if they do.
        """
        return TANGENT * self._steepest(t, x, p)

    def _steepest(self, t: Any, x: Any, p: Any) -> Any:
        """The rate of ``h`` if all velocities of both fields were normal to the surface."""
        slope, speed = self.gradient(t, x, p)[:-1], [*self.below(t, x, p), *self.above(t, x, p)]
        return np.sqrt(_dot(slope, slope, 0.0) * _dot(speed, speed, 0.0))

    def is_off(self, t: Any, x: Any, p: Any) -> Any:
        """Whether a state is too far from the surface to slide, relative to its largest component."""
        largest = np.abs(x[0])
        for value in x[1:]:
            largest = np.maximum(largest, np.abs(value))
        slope = _dot([np.abs(each) for each in self.gradient(t, x, p)[:-1]], [1.0] * len(x), 0.0)
        return np.abs(self.switching(t, x, p)) > SLIDING_BAND * slope * largest

    def projection(self, t: Any, x: Any, p: Any) -> list[Any]:
        """The nearest point of the surface, to first order."""
        normal = self.gradient(t, x, p)[:-1]
        share = self.switching(t, x, p) / _dot(normal, normal, 0.0)
        return [value - share * slope for value, slope in zip(x, normal, strict=True)]


def _check_traceable(
    functions: Iterable[tuple[str, Function, int]],
    state: tuple[str, ...] | int,
    parameters: tuple[str, ...],
) -> None:
    from hybrid.symbolic.tracing import TraceError, trace

    for what, function, size in functions:
        try:
            values = trace(function, state, parameters)
        except TraceError as error:
            raise ModelError(
                f"filippov: {what} cannot be traced, but the sliding mode is derived from it: {error}."
            ) from error
        except ModelError as error:
            raise ModelError(f"filippov: {what}: {error}") from error
        if len(values) != size:
            raise ModelError(f"filippov: {what} must return {size} values; got {len(values)}.")


def _derived_gradient(
    function: Function, state: tuple[str, ...] | int, parameters: tuple[str, ...]
) -> Function:
    """``(D_x, D_t)`` of a scalar function as a model function, which can itself be traced."""
    # SymPy is slow to import, so it is not imported with the library.
    from sympy.core.parameters import distribute

    from hybrid.symbolic.derivatives import jacobian_of
    from hybrid.symbolic.nodes import replaced
    from hybrid.symbolic.printer import IMPORTS, assignments
    from hybrid.symbolic.tracing import Traced, model_symbols, trace

    symbols = model_symbols(state if isinstance(state, int) else len(state), len(parameters))
    [row] = jacobian_of(trace(function, state, parameters), symbols.variables)
    statements = assignments([f"out[{i}]" for i in range(len(row))], row)
    namespace: dict[str, Any] = {}
    exec("\n    ".join((f"{IMPORTS}\ndef gradient(t, x, p, out):", *statements)), namespace)

    def gradient(t: Any, x: Any, p: Any) -> list[Any]:
        if not isinstance(t, Traced):
            out = [0.0] * len(row)
            namespace["gradient"](t, x, p, out)
            return out
        known = (symbols.t, *symbols.x, *symbols.p)
        values = {symbol: value.expression for symbol, value in zip(known, (t, *x, *p), strict=True)}
        with distribute(False):  # 3*(a - b) must not become 3*a - 3*b, which rounds where a - b is exact
            return [Traced(replaced(entry, values)) for entry in row]

    return gradient


def _rate(gradient: Function, field: Function) -> Function:
    """``D_t g + D_x g f``, the rate of a function along a field, as a model function."""

    def rate(t: Any, x: Any, p: Any) -> Any:
        *normal, own = gradient(t, x, p)
        return _dot(normal, field(t, x, p), own)

    return rate


def _entered(source: str, target: str, switching: Function, when: Function | None = None) -> Transition:
    """The transition of a start off the surface from a mode that is wrong there to the right one."""
    direction, place = (+1, "high") if target == "above" else (-1, "low")
    guard = Guard(switching, direction, at_start=True, when=when)
    return Transition(source, target, guard, name=f"{source} too {place}")


def _dot(a: Iterable[Any], b: Iterable[Any], total: Any) -> Any:
    """``total`` plus the dot product; terms whose first factor is zero are skipped."""
    for factor, other in zip(a, b, strict=True):
        if not _is_zero(factor):
            total = total + factor * other
    return total


def _is_zero(value: Any) -> bool:
    """Whether a number is zero; a traced number counts as zero if its expression is."""
    return bool(getattr(value, "expression", value) == 0)
