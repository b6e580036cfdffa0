"""Two fields on either side of a surface, as a hybrid system: crossing, sliding, and what lies between."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import attrs
import numpy as np

from hybrid.errors import ModelError
from hybrid.system.elements import Function, Guard, Mode, Reset, Transition
from hybrid.system.graph import HybridSystem
from hybrid.system.variables import as_parameters, as_state

# A start in the sliding mode that is further from the surface than this share of the state does not slide.
# What the integration lets the state drift while it slides is far less, so that a run can be taken up again.
SLIDING_BAND = 1e-6
# Two fields that both move through the surface slower than this share of their speeds are tangent to it.
TANGENT = 1e-9
# An orbit that comes to the surface slower than this share of its speed, and turns back, only touches it.
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

    With the speeds ``L_b = D_t h + D_x h f_b`` and ``L_a = D_t h + D_x h f_a`` at which the two fields move
    through the surface ``h = 0``, an orbit that comes from below crosses where ``L_a > 0`` and stays in
    the surface where ``L_a <= 0``. There it follows the equivalent field

        ``f_s = f_b + alpha (f_a - f_b)``,  ``alpha = L_b / (L_b - L_a)``,

    which keeps ``h`` as it is, until one of the fields becomes tangent to the surface: ``alpha = 1`` leads
    above, ``alpha = 0`` below. A crossing is one jump with the saltation ``I + (f_a - f_b) D_x h / L_b``, the
    entry into sliding is one with ``I + (f_s - f_b) D_x h / L_b``, which has lost a rank.

    Modes are ``below``, ``above`` and ``sliding``; where ``L_b`` and ``L_a`` are the same everywhere nothing
    slides and there are only two. A start in the surface finds its mode by itself, unless both fields point
    away from it: then it may go either way, and ``below`` or ``above`` must be named. For the same reason a
    run ends (status TERMINAL, with the jump ``two-fold`` last) where an orbit slides to a point at which both
    fields are tangent to the surface.

    Parameters
    ----------
    state, parameters
        As for `HybridSystem`.
    below, above
        Fields ``f(t, x, p)`` where the switching function is negative and where it is positive. Each must be
        smooth a little beyond the surface, and one that tracing can follow.
    switching
        Scalar function ``h(t, x, p)``, traced likewise; its gradient must not vanish where it is zero. The
        sliding mode needs it twice differentiable.
    period, name
        As for `HybridSystem`.

    Returns
    -------
    HybridSystem
        Its transitions are named ``source->target``. The others are ``two-fold``, which ends the run,
        ``two-fold at start``, which ends a run that starts where the surface repels, and
        ``below too high``, ``above too low``, ``sliding too high`` and ``sliding too low``: a start takes one
        of them if it lies off the surface where its mode does not belong, by more than rounding, or, in the
        sliding mode, by more than 1e-6 of the state's largest component.

    Raises
    ------
    ModelError
        If a function is not callable, has the wrong number of values, or cannot be traced.

    Notes
    -----
    Sliding is not stabilised: ``h`` is an invariant of ``f_s``, kept to rounding if it is affine in the state
    and to the tolerance of the solver if not. Leaving projects the state onto the surface.

    References
    ----------
    A. F. Filippov, Differential Equations with Discontinuous Righthand Sides, Kluwer, 1988, section 4;
    M. di Bernardo et al., Piecewise-smooth Dynamical Systems, Springer, 2008, sections 2.2.3 and 2.5,
    doi:10.1007/978-1-84628-708-4.

    Examples
    --------
    A block on a belt, with dry friction; it is carried along until the spring breaks it loose.

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
    """The model functions that follow from two fields and a switching function."""

    below: Function
    above: Function
    switching: Function
    gradient: Function  # (D_x h, D_t h)
    speed_below: Function  # L_b and L_a, the rates of h along the fields
    speed_above: Function
    turn_below: Function  # the rate of L_b along the field below, of L_a along that above
    turn_above: Function

    def may_attract(self, state: tuple[str, ...] | int, parameters: tuple[str, ...]) -> bool:
        """Whether the two speeds are not proved to be the same everywhere."""
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
        """Whether an orbit that reaches the surface rising (side +1) or falling (-1) does more than touch it.

        One that leaves the sliding mode at a fold starts on the surface, with a speed that is zero up to
        rounding and an acceleration back to where it belongs: it has arrived nowhere. The speed is compared
        with those of both fields: the one at the fold may be at rest, as a mass that is about to slip.
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
        """A speed through the surface that is next to none.

        It is as smooth as the fields, so that the sliding mode has a Taylor series where they do.
        """
        return TANGENT * self._steepest(t, x, p)

    def _steepest(self, t: Any, x: Any, p: Any) -> Any:
        """The rate of ``h`` if all of the velocities of both fields were normal to the surface."""
        slope, speed = self.gradient(t, x, p)[:-1], [*self.below(t, x, p), *self.above(t, x, p)]
        return np.sqrt(_dot(slope, slope, 0.0) * _dot(speed, speed, 0.0))

    def is_off(self, t: Any, x: Any, p: Any) -> Any:
        """Whether a state is too far from the surface to slide, measured by its own size."""
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
                f"filippov: {what} cannot be traced, and the sliding mode is derived from it: {error}."
            ) from error
        except ModelError as error:
            raise ModelError(f"filippov: {what}: {error}") from error
        if len(values) != size:
            raise ModelError(f"filippov: {what} must return {size} values; it returns {len(values)}.")


def _derived_gradient(
    function: Function, state: tuple[str, ...] | int, parameters: tuple[str, ...]
) -> Function:
    """``(D_x, D_t)`` of a scalar function as a model function, which can be traced in turn."""
    # SymPy is slow to import, and importing the library must not wait for it.
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
    """Where a start off the surface goes that names a mode which does not belong there."""
    direction, place = (+1, "high") if target == "above" else (-1, "low")
    guard = Guard(switching, direction, at_start=True, when=when)
    return Transition(source, target, guard, name=f"{source} too {place}")


def _dot(a: Iterable[Any], b: Iterable[Any], total: Any) -> Any:
    """``total`` and the sum of the products whose first factor is not zero."""
    for factor, other in zip(a, b, strict=True):
        if not _is_zero(factor):
            total = total + factor * other
    return total


def _is_zero(value: Any) -> bool:
    """Whether a number is zero, or is proved to be while it is traced."""
    return bool(getattr(value, "expression", value) == 0)
