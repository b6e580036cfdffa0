"""Hybrid system from two fields on either side of a surface: crossing, sliding and their borderline cases."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Unpack

from hybrid.errors import ModelError, shown
from hybrid.shared import shares
from hybrid.system.declared import as_parameters, as_state
from hybrid.system.elements import Function, Guard, Mode, Reset, Transition
from hybrid.system.graph import HybridSystem
from hybrid.system.variables import Variables
from hybrid.system.watched import Watched
from hybrid.transform.asked import DescribedWithShifts, passed_on
from hybrid.transform.surface import SwitchingSurface


@shares(DescribedWithShifts)
def filippov(
    state: tuple[str, ...] | int,
    parameters: Mapping[str, float],
    below: Function,
    above: Function,
    switching: Function,
    *,
    start: str | None = None,
    **asked: Unpack[DescribedWithShifts],
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
    start
        As for `HybridSystem`.

    Returns
    -------
    HybridSystem
        Its transitions are named ``source->target``, with these exceptions. ``two-fold`` ends the run;
        ``two-fold at start`` ends a run that starts where the surface repels. ``below too high``,
        ``above too low``, ``sliding too high`` and ``sliding too low`` correct the mode of a start that lies
        off the surface on the wrong side for its mode: by more than rounding or, in the sliding mode, by more
        than 1e-6 of the terms of ``h``.

    Raises
    ------
    ModelError
        If a function is not callable, has the wrong number of values, or cannot be traced.

    Notes
    -----
    Where both fields are tangent to the surface (a two-fold), a solution may not be unique. A start exactly
    there follows a field that leaves the surface, if there is one; sliding may be another solution.

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

    >>> from hybrid import filippov, simulate
    >>> block = filippov(
    ...     state=("x", "v"),
    ...     parameters={"belt": 0.2, "friction": 1.0},
    ...     below=lambda t, x, p: (x.v, p.friction - x.x),
    ...     above=lambda t, x, p: (x.v, -p.friction - x.x),
    ...     switching=lambda t, x, p: x.v - p.belt,
    ... )
    >>> arc = simulate(block, x0=(0.5, 0.2), t_span=(0.0, 3.0))
    >>> str(arc.mode[0]), arc.jumps[0].transition, round(arc.jumps[0].t, 12)
    ('sliding', 'sliding->below', 2.5)
    """
    state, parameters = as_state(state), as_parameters(parameters)
    if not state:
        raise ModelError("filippov: state needs at least one component; got an empty sequence.")
    for what, function in (("below", below), ("above", above), ("switching", switching)):
        if not callable(function):
            raise ModelError(f"filippov: {what} must be a function of (t, x, p); got {shown(function)}.")
    variables = Variables(state, parameters)
    _check_traceable(variables, below, above, switching)
    surface = SwitchingSurface(variables, below, above, switching)
    modes = [Mode("below", below), Mode("above", above)]
    if surface.may_attract():
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
        start=start,
        **passed_on(asked),
        derived_from=Watched([below, above, switching]),
    )


def _entered(source: str, target: str, switching: Function, when: Function | None = None) -> Transition:
    """The transition of a start off the surface from a mode that is wrong there to the right one."""
    direction, place = (+1, "high") if target == "above" else (-1, "low")
    guard = Guard(switching, direction, at_start=True, when=when)
    return Transition(source, target, guard, name=f"{source} too {place}")


def _check_traceable(variables: Variables, below: Function, above: Function, switching: Function) -> None:
    from hybrid.expression.tracing import TraceError, trace

    n = variables.dimension
    for what, function, size in (("below", below, n), ("above", above, n), ("switching", switching, 1)):
        try:
            values = trace(function, variables.components, variables.parameter_names)
        except TraceError as error:
            raise ModelError(
                f"filippov: {what} cannot be traced, but the sliding mode is derived from it: {error}."
            ) from error
        except ModelError as error:
            raise ModelError(f"filippov: {what}: {error}") from error
        if len(values) != size:
            raise ModelError(f"filippov: {what} must return {size} values; got {len(values)}.")
