"""Two fields on either side of a surface, as a hybrid system: crossing, sliding, and what lies between."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import attrs
import numpy as np

from hybrid.errors import ModelError
from hybrid.system import Guard, HybridSystem, Mode, ModelFunction, Reset, Transition

# A state further from the surface than this share of its size does not slide, and is in the mode of its
# side. What the integration lets the state drift while it slides is far less.
SLIDING_BAND = 1e-6
# Whether the surface is crossed or slid along is only asked this near it, in the same measure.
NEAR = 1e-3
# A field that moves through the surface slower than this share of the speed of both is tangent to it.
TANGENT = 1e-9


def filippov(
    state: tuple[str, ...] | int,
    parameters: Mapping[str, float],
    below: ModelFunction,
    above: ModelFunction,
    switching: ModelFunction,
    *,
    period: float | ModelFunction | None = None,
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
    run ends (status NON_FINITE, with the jump ``undecided`` last) where an orbit slides to a point at which
    both fields are tangent to the surface, a two-fold.

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
        Its transitions are named ``source->target``. The others are ``undecided``, and four that leave a mode
        further than 1e-6 on the wrong side of the surface, relative to ``1 + |x|``: ``sliding too high``,
        ``sliding too low``, ``below too high``, ``above too low``. They tell a start where it belongs.

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
    for what, function in (("below", below), ("above", above), ("switching", switching)):
        if not callable(function):
            raise ModelError(f"filippov: {what} must be a function of (t, x, p); got {function!r}.")
    surface = _Surface(
        below, above, switching, _derived_gradient(below, above, switching, state, tuple(parameters))
    )
    modes = [Mode("below", below), Mode("above", above)]
    if surface.may_attract(state, tuple(parameters)):
        modes.append(Mode("sliding", surface.sliding_field))
        transitions = [
            Transition("below", "sliding", Guard(surface.arrives_from_below, +1)),
            Transition("below", "above", Guard(surface.crosses_up, +1)),
            Transition("above", "sliding", Guard(surface.arrives_from_above, +1)),
            Transition("above", "below", Guard(surface.crosses_down, +1)),
            Transition("sliding", "above", Guard(surface.attraction, -1), Reset(_nowhere), name="undecided"),
            Transition("sliding", "above", Guard(surface.above_tangent, +1), Reset(surface.projection)),
            Transition("sliding", "below", Guard(surface.below_tangent, -1), Reset(surface.projection)),
            Transition("sliding", "above", Guard(surface.excess_above, +1), name="sliding too high"),
            Transition("sliding", "below", Guard(surface.excess_below, -1), name="sliding too low"),
            Transition("below", "above", Guard(surface.excess_above, +1), name="below too high"),
            Transition("above", "below", Guard(surface.excess_below, -1), name="above too low"),
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


@attrs.frozen(eq=False)
class _Surface:
    """The model functions that follow from two fields and a switching function."""

    below: ModelFunction
    above: ModelFunction
    switching: ModelFunction
    gradient: ModelFunction  # (D_x h, D_t h)

    def may_attract(self, state: tuple[str, ...] | int, parameters: tuple[str, ...]) -> bool:
        """Whether the two speeds are not proved to be the same everywhere."""
        from hybrid.trace import trace

        L_b, L_a = trace(self.speeds, state, parameters)
        return (L_b - L_a).expand() != 0

    def speeds(self, t: Any, x: Any, p: Any) -> tuple[Any, ...]:
        """``(L_b, L_a)``, the rates of ``h`` along the fields."""
        *normal, rate = self.gradient(t, x, p)
        return tuple(_dot(normal, field(t, x, p), rate) for field in (self.below, self.above))

    def sliding_field(self, t: Any, x: Any, p: Any) -> list[Any]:
        L_b, L_a = self.speeds(t, x, p)
        attraction = L_b - L_a
        return [
            b if _is_zero(a - b) else (L_b * a - L_a * b) / attraction
            for b, a in zip(self.below(t, x, p), self.above(t, x, p), strict=True)
        ]

    # The conditional guards. In the mode below h < 0, so that the smaller of h and another function cannot
    # be zero before h is, and is zero with h only where the other is positive. Of two equal ones the
    # comparison takes h and its gradient. The condition is cut off at -band and so does not show before h
    # itself is above it: the other field need not exist far from its own side. Above is the mirror image.
    # No orbit arrives with a speed that is zero up to rounding: that one leaves the sliding mode at a fold.

    def crosses_up(self, t: Any, x: Any, p: Any) -> Any:
        L_b, L_a = self.speeds(t, x, p)
        return self._conditional(t, x, p, self.switching(t, x, p), L_b, L_a)

    def arrives_from_below(self, t: Any, x: Any, p: Any) -> Any:
        L_b, L_a = self.speeds(t, x, p)
        condition = np.where(L_a <= 0.0, L_b, -L_a)
        return self._conditional(t, x, p, self.switching(t, x, p), L_b, condition)

    def crosses_down(self, t: Any, x: Any, p: Any) -> Any:
        L_b, L_a = self.speeds(t, x, p)
        return self._conditional(t, x, p, -self.switching(t, x, p), -L_a, -L_b)

    def arrives_from_above(self, t: Any, x: Any, p: Any) -> Any:
        L_b, L_a = self.speeds(t, x, p)
        condition = np.where(L_b >= 0.0, -L_a, L_b)
        return self._conditional(t, x, p, -self.switching(t, x, p), -L_a, condition)

    def _conditional(self, t: Any, x: Any, p: Any, h: Any, speed: Any, condition: Any) -> Any:
        """A function that has the zero of a rising ``h`` if the condition is positive there, else none."""
        faster = speed - self._hardly_moving(t, x, p)
        both = np.where(faster <= condition, faster, condition)
        band = NEAR * self._size(t, x, p)
        cut = np.where(both >= -band, both, -band)
        return np.where((h <= -band) | (h <= cut), h, cut)

    def above_tangent(self, t: Any, x: Any, p: Any) -> Any:
        return np.where(self._slides(t, x, p), self.speeds(t, x, p)[1], -1.0)

    def below_tangent(self, t: Any, x: Any, p: Any) -> Any:
        return np.where(self._slides(t, x, p), self.speeds(t, x, p)[0], 1.0)

    def attraction(self, t: Any, x: Any, p: Any) -> Any:
        L_b, L_a = self.speeds(t, x, p)
        return np.where(self._slides(t, x, p), L_b - L_a - self._hardly_moving(t, x, p), 1.0)

    def _hardly_moving(self, t: Any, x: Any, p: Any) -> Any:
        """A speed through the surface that is next to none."""
        slope = _total(self.gradient(t, x, p)[:-1])
        return TANGENT * slope * (_total(self.below(t, x, p)) + _total(self.above(t, x, p)))

    def excess_above(self, t: Any, x: Any, p: Any) -> Any:
        return self.switching(t, x, p) - SLIDING_BAND * self._size(t, x, p)

    def excess_below(self, t: Any, x: Any, p: Any) -> Any:
        return self.switching(t, x, p) + SLIDING_BAND * self._size(t, x, p)

    def _slides(self, t: Any, x: Any, p: Any) -> Any:
        return np.abs(self.switching(t, x, p)) <= 2.0 * SLIDING_BAND * self._size(t, x, p)

    def _size(self, t: Any, x: Any, p: Any) -> Any:
        """How much ``h`` changes over distances of the size of the state."""
        normal = self.gradient(t, x, p)[:-1]
        return _dot([np.abs(slope) for slope in normal], [1.0 + np.abs(value) for value in x], 0.0)

    def projection(self, t: Any, x: Any, p: Any) -> list[Any]:
        """The nearest point of the surface, to first order."""
        normal = self.gradient(t, x, p)[:-1]
        share = self.switching(t, x, p) / _dot(normal, normal, 0.0)
        return [value - share * slope for value, slope in zip(x, normal, strict=True)]


def _derived_gradient(
    below: ModelFunction,
    above: ModelFunction,
    switching: ModelFunction,
    state: tuple[str, ...] | int,
    parameters: tuple[str, ...],
) -> ModelFunction:
    """``(D_x h, D_t h)`` as a model function, which can be traced in turn; all three are tried first."""
    # SymPy is slow to import, and importing the library must not wait for it.
    from sympy.core.parameters import distribute

    from hybrid.derivative import symbolic_jacobian
    from hybrid.printer import IMPORTS, assignments
    from hybrid.trace import Traced, TraceError, model_symbols, trace

    n = state if isinstance(state, int) else len(state)
    for what, function, size in (("below", below, n), ("above", above, n), ("switching", switching, 1)):
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
    symbols = model_symbols(n, len(parameters))
    [row] = symbolic_jacobian(values, symbols.variables)
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
            return [Traced(entry.xreplace(values)) for entry in row]

    return gradient


def _nowhere(t: Any, x: Any, p: Any) -> list[Any]:
    """Both ways and every mixture of them lead on: no state is the one after this."""
    return [np.inf for _ in x]


def _dot(a: Iterable[Any], b: Iterable[Any], total: Any) -> Any:
    """``total`` and the sum of the products whose first factor is not zero."""
    for factor, other in zip(a, b, strict=True):
        if not _is_zero(factor):
            total = total + factor * other
    return total


def _total(values: Iterable[Any]) -> Any:
    """Sum of the magnitudes."""
    return sum((np.abs(value) for value in values if not _is_zero(value)), 0.0)


def _is_zero(value: Any) -> bool:
    """Whether a number is zero, or is proved to be while it is traced."""
    return bool(getattr(value, "expression", value) == 0)
