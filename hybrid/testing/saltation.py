"""Properties of saltation matrices and tangent vectors."""

from __future__ import annotations

import numpy as np

from hybrid.compiler.compiled import compile_system
from hybrid.errors import ArgumentError
from hybrid.simulation.jumps import Jump
from hybrid.system.functions import field_function, guard_function, reset_function
from hybrid.testing.case import Case, as_case
from hybrid.testing.errors import discard
from hybrid.testing.run import mode_after
from hybrid.testing.variants import altered
from hybrid.testing.window import Window, guard_slope
from hybrid.testing.words import jump_told, matrix_told

SALTATION = "The saltation matrix is the derivative of the flow across the event"
EXTENSION = "The saltation matrix does not depend on how the reset goes on off the guard"
CONTINUITY = "The saltation matrix is the identity where field and state are continuous"
FLOW_DIRECTION = "The saltation matrix takes the field before the event to the field after it"
SUM_RULE = "The exponents sum to the divergence of the fields and the determinants of the jumps"

# A share of the terms of a field by which rounding may change its values.
ROUNDING = 1e-14
GAUSS_NODES, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(5)


def check_saltation(case: Case) -> None:
    """Saltation and fundamental matrix equal central differences of the flow across an event.

    The differences are extrapolated (Richardson). Their convergence and the speed at which the guard is
    crossed set the tolerance.

    Raises
    ------
    PropertyError
        If an entry is wrong.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_saltation
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_saltation(case)
    """
    as_case(case)
    jump = case.the_jump()
    window = Window(case, jump)
    differences, tolerance = window.differences()
    hint = (
        "a saltation matrix without its rank-one term, with a wrong sign or without a time term; or a wrong "
        "derivative given by hand."
    )
    found = [
        ("fundamental matrix of the run across the event", window.fundamental(), "simulate(tangent=True)")
    ]
    # A run that starts just after a passable transition would fire the transition again.
    if not any(jump.transition in case.passable for jump in window.jumps):
        if len(window.jumps) == 1:
            xi = _saltation(case, jump)
            found.append(
                (
                    "saltation matrix, between the tangent maps before and after",
                    window.through(xi),
                    matrix_told(xi),
                )
            )
        if window.invertible():
            product = window.product()
            found.append(("saltation matrix of the jump", window.through(product), matrix_told(product)))
    for name, tangents, source in found:
        if not np.all(np.abs(window.scaled(tangents) - window.scaled(differences)) <= tolerance):
            case.fail(
                SALTATION,
                *(jump_told(case, jump) for jump in window.jumps),
                f"{name}: {source}",
                f"wanted {matrix_told(differences)}, finite differences of the flow",
                f"got {matrix_told(tangents)}",
                hint=hint,
            )


def check_extension(case: Case) -> None:
    """Adding a multiple of the guard to a reset does not change a saltation matrix: it is zero on the guard.

    Raises
    ------
    PropertyError
        If a saltation matrix changes.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_extension
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_extension(case)
    """
    as_case(case)
    jump = case.the_jump()
    transition = case.transition(jump)
    if transition.is_marker:
        discard("the event only marks a crossing")
    if case.follows_at_once(jump):
        discard("the state has landed beyond the guard")
    variant = altered(case.system)
    if variant.resets_stay:
        discard("a model function cannot be traced, so it cannot be changed")
    slope = guard_slope(case, jump)
    k = case.system.tangent_dimension
    x_scale = case.run.scale[:k]
    size = np.sum(np.abs(slope) * x_scale)
    if not size > 0.0:
        discard("the guard does not depend on the state")
    signs = np.where(np.arange(len(x_scale)) % 2, -1.0, 1.0)
    added = signs * (0.5 + case.fraction) * x_scale / size
    wanted = _saltation(case, jump)
    got = case.engine.saltation_matrix(
        variant.system,
        jump.transition,
        jump.t,
        jump.x_minus,
        {**case.parameters, **variant.extension(np.append(added, np.zeros(case.system.dimension - k)))},
    )
    field = case.evaluate(case.rates_of(jump.source), jump.t, jump.x_minus)[:k]
    # Terms of this size cancel.
    terms = np.abs(wanted) + np.abs(np.outer(added, slope)) * (
        1.0 + np.abs(slope) @ np.abs(field) / abs(jump.transversality)
    )
    if not np.all(np.abs(got - wanted) <= 1e-9 * (terms + x_scale[:, None] / x_scale)):
        case.fail(
            EXTENSION,
            jump_told(case, jump),
            f"wanted {matrix_told(wanted)}",
            f"got {matrix_told(got)} with {matrix_told(added)} times the guard added to the reset",
            hint="a saltation matrix that is only the derivative of the reset or lacks a time term.",
        )


def check_continuity(case: Case) -> None:
    """The saltation matrix is the identity where there is no reset and both fields are equal.

    Raises
    ------
    PropertyError
        If a saltation matrix there is not the identity.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_continuity
    >>> circuit = models.chua_circuit()
    >>> case = Case(circuit, circuit.parameters, "inner", (0.5, 0.0, 0.0), 0.0, 5.0)
    >>> check_continuity(case)
    """
    as_case(case)
    looked_at = 0
    for jump in case.run.arc.jumps:
        if case.transition(jump).reset is not None or case.follows_at_once(jump):
            continue
        before, after = _fields(case, jump)
        slope = np.abs(guard_slope(case, jump))
        kick = np.abs(after - before)[:, None] * slope / abs(jump.transversality)
        if not np.all(np.abs(after - before) <= 1e-9 * _terms(case, jump)):
            continue
        looked_at += 1
        for xi in (_saltation(case, jump), jump.saltation):
            if not np.all(np.abs(xi - np.eye(len(xi))) <= 1e-9 + 2.0 * kick):
                case.fail(
                    CONTINUITY,
                    jump_told(case, jump),
                    f"got {matrix_told(xi)}",
                    hint="a term of the saltation matrix that does not vanish where the field is continuous.",
                )
    if not looked_at:
        discard("the field or the state jumps at every event")


def check_flow_direction(case: Case) -> None:
    """``f_plus = Xi f_minus`` at every event whose guard and reset do not depend on time.

    Raises
    ------
    PropertyError
        If the two sides differ.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_flow_direction
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_flow_direction(case)
    """
    as_case(case)
    looked_at = 0
    for jump in case.run.arc.jumps:
        # A state that has landed beyond a guard has not crossed it.
        if case.follows_at_once(jump):
            continue
        transition = case.transition(jump)
        felt = [guard_function(transition), reset_function(transition, case.system.variables)]
        slopes = [
            case.slope(function, jump.transition, jump.t, jump.x_minus)
            for function in felt
            if function is not None
        ]
        if any(np.any(slope[:, -1] != 0.0) for slope in slopes):
            continue
        looked_at += 1
        before, after = _fields(case, jump)
        for xi in (_saltation(case, jump), jump.saltation):
            got, terms = xi @ before, np.abs(xi) @ np.abs(before) + np.abs(after)
            rounding = ROUNDING * _terms(case, jump)
            if not np.all(np.abs(got - after) <= 1e-9 * (terms + terms.max()) + rounding):
                case.fail(
                    FLOW_DIRECTION,
                    jump_told(case, jump),
                    f"wanted {matrix_told(after)}, the field after",
                    f"got {matrix_told(got)}, saltation matrix {matrix_told(xi)} times the field before",
                    hint="a rank-one term of the saltation matrix that is missing or has the wrong sign.",
                )
    if not looked_at:
        discard("no event whose guard and reset are independent of time")


def check_sum_rule(case: Case) -> None:
    """``log|det Phi|`` equals the integral of ``div f`` plus the sum of ``log|det Xi|`` (Liouville).

    Divided by the length of a long run, the left side is the sum of the Lyapunov exponents.

    Raises
    ------
    PropertyError
        If the two sides differ.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_sum_rule
    >>> system = models.impact_oscillator()
    >>> case = Case(system, system.parameters, "flight", (0.0, 0.0), 0.0, 20.0)
    >>> check_sum_rule(case)
    """
    as_case(case)
    run = case.run
    # Tangent vectors stay on what a mode holds at zero: one that holds all states leaves rounding alone.
    if any(case.mode_of(str(mode)).holds is not None for mode in np.unique(run.arc.mode)):
        discard("a mode of the run holds a surface, and directions across it are lost")
    determinants = [np.linalg.det(jump.saltation) for jump in run.arc.jumps]
    arc = case.simulate(run.t1, tangent=True)
    assert arc.fundamental is not None
    if not arc.status.ok:
        discard(str(arc.status))
    scale = run.scale[: case.system.tangent_dimension]
    sizes = np.linalg.svd(arc.fundamental / scale[:, None] * scale, compute_uv=False)
    if not sizes[-1] > 1e-6 * sizes[0] or not np.all(np.abs(determinants) > 1e-9):
        discard("a direction is lost, or nearly so, along the run")
    jumps, flow, size = float(np.sum(np.log(np.abs(determinants)))), *_divergence(case)
    got = float(np.linalg.slogdet(arc.fundamental).logabsdet)
    tolerance = 1e-8 * (1.0 + abs(jumps) + size) + 1e-10 * sizes[0] / sizes[-1]
    if not abs(got - jumps - flow) <= tolerance:
        case.fail(
            SUM_RULE,
            f"wanted {jumps + flow:.10g}: {flow:.10g} from the divergence, {jumps:.10g} from "
            f"{len(determinants)} jumps",
            f"got {got:.10g}, the logarithm of the determinant of the fundamental matrix",
            hint="tangent vectors that miss a jump, or a wrong derivative of a field.",
        )


def _divergence(case: Case) -> tuple[float, float]:
    """Integrals of ``div f`` and of its magnitude along the run, by Gauss quadrature over each step."""
    arc, system = case.run.arc, case.system
    compiled, parameters = compile_system(system), system.parameter_values(case.parameters)
    total = size = 0.0
    for i in range(len(arc.t) - 1):
        h = arc.t[i + 1] - arc.t[i]
        if arc.j[i] != arc.j[i + 1] or h <= 0.0:
            continue
        mode = system.mode_index(str(arc.mode[i]))
        function = field_function(system.modes[mode], system.variables)
        times = arc.t[i] + 0.5 * h * (1.0 + GAUSS_NODES)
        for t, x, weight in zip(times, arc(times), GAUSS_WEIGHTS, strict=True):
            term = 0.5 * h * weight * np.trace(compiled.derivative(function, mode, t, x, parameters))
            total += term
            size += abs(term)
    return float(total), float(size)


def _fields(case: Case, jump: Jump) -> tuple[np.ndarray, np.ndarray]:
    k = case.system.tangent_dimension
    return (
        case.evaluate(case.rates_of(jump.source), jump.t, jump.x_minus)[:k],
        case.evaluate(case.rates_of(mode_after(jump)), jump.t, jump.x_plus)[:k],
    )


def _saltation(case: Case, jump: Jump) -> np.ndarray:
    try:
        return case.engine.saltation_matrix(
            case.system, jump.transition, jump.t, jump.x_minus, case.parameters
        )
    except ArgumentError as error:
        discard(str(error))


def _terms(case: Case, jump: Jump) -> np.ndarray:
    """Sizes of the terms of both fields at a jump, ``(n,)``: a rate may be zero because they cancel."""
    sizes = np.zeros(case.system.dimension)
    for name, x in ((jump.source, jump.x_minus), (mode_after(jump), jump.x_plus)):
        mode = case.mode_of(name)
        slope = np.abs(case.slope(field_function(mode, case.system.variables), name, jump.t, x))
        sizes += slope[:, :-1] @ case.run.scale + slope[:, -1] * case.duration
        sizes += np.abs(case.evaluate(case.rates_of(mode.name), jump.t, x))
    return sizes[: case.system.tangent_dimension]
