"""Exponents from tangent vectors outside the error control, and explanations of the paper's figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import attrs
import numpy as np

from hybrid import DOP853, HybridSystem, Mode, Taylor, Tsit5, periodic_orbit, simulate
from hybrid.solvers import Solver
from lyapunov.floquet import floquet_exponents
from lyapunov.spectrum import lyapunov_spectrum
from lyapunov.study.column import growths_from
from lyapunov.study.ode23s import Ode23s
from lyapunov.study.paper import DOUBTFUL
from lyapunov.study.runs import STARTS, Settings

TOLERANCES = tuple(10.0**-digits for digits in range(4, 11))
LOOSE = (1e-4, 3e-5, 1e-5, 3e-6, 1e-6)
TRAP_OMEGA = 7.40

# RelTol and AbsTol of the paper's method, MATLAB's defaults first, and how many periods the demo can afford.
STRAIGHT = {(1e-3, 1e-6): 400, (1e-4, 1e-8): 400, (1e-5, 1e-8): 400, (1e-6, 1e-7): 1000, (1e-6, 1e-8): 1000}
# The first periods add their own growth.
UNSETTLED = 100

# Far below every absolute tolerance, and far above the smallest numbers of double precision.
UNSEEN = 1e-30
# Periods between two orthonormalisations, few enough that the directions stay apart.
PERIODS_AT_ONCE = 10
# Largest numbers of periods: for an exponent to four digits, and for regular motion, which converges fast.
ENOUGH = 2000
ENOUGH_OF_REGULAR_MOTION = 500


def with_tangent(system: HybridSystem) -> HybridSystem:
    r"""Vibro-impact system with one tangent vector as a state: ``u1, u2, w1, w2`` before ``x1, x2, v1, v2``.

    The vector obeys :math:`\dot u = A u` with the Jacobian :math:`A` of the paper. The paper prints
    :math:`a_{34} = 2 \xi_2 \omega_2 \chi` without the factor :math:`\chi`; the parameter ``slip = 1`` omits
    it. Saltation matrices are the identity, so a jump does not change the vector.

    With ``u = 0`` this gives the exponents of the wrong Jacobian under error control: displacements of ``u``
    alone follow that Jacobian and do not affect the state. ``lyapunov_spectrum`` with ``k = 4`` measures
    their growth.
    """
    fields = {mode.name: mode.field for mode in system.modes}
    return HybridSystem(
        name=f"{system.name} with a tangent vector",
        state=("u1", "u2", "w1", "w2", *system.state_names),
        parameters={**system.parameters, "slip": 0.0},
        modes=[
            Mode("free", _with_variation(fields["free"], lambda x, p: 0.0)),
            Mode("contact", _with_variation(fields["contact"], _contact_stiffness)),
        ],
        transitions=system.transitions,
        period=system.period,
    )


def _with_variation(field: Callable[..., Any], stiffness: Callable[..., Any]) -> Callable[..., Any]:
    def extended(t, x, p):  # type: ignore[no-untyped-def]
        chi = p.m2 / p.m1
        chi_of_a34 = chi + p.slip * (1 - chi)
        damping = 2 * p.xi2 * p.omega2
        spring = p.omega2**2 * (x.u1 - x.u2)
        contact = stiffness(x, p) * (x.u1 - x.u2)
        main = -(p.omega1**2) * x.u1 - 2 * p.xi1 * p.omega1 * x.w1
        dw1 = main - chi * (spring + damping * x.w1) + chi_of_a34 * damping * x.w2 - contact / p.m1
        dw2 = spring + damping * (x.w1 - x.w2) + contact / p.m2
        return (x.w1, x.w2, dw1, dw2, *field(t, x, p))

    return extended


def _contact_stiffness(x: Any, p: Any) -> Any:
    """Derivative of the Hertz force, with its argument kept above zero, where the square root is singular."""
    return 1.5 * p.K * np.sqrt(np.maximum(x.x1 - x.x2, 1e-20))


@attrs.frozen(eq=False)
class Trap:
    """Exponents of the periodic regime with tangent vectors inside the error control and outside.

    Attributes
    ----------
    truth
        Floquet exponents ``(4,)``.
    tolerances
        ``rtol = atol``, ``(N,)``.
    inside, outside
        Exponents ``(N, 4)``.
    """

    truth: np.ndarray
    tolerances: np.ndarray
    inside: np.ndarray
    outside: np.ndarray


def tolerance_study(system: HybridSystem, settings: Settings) -> Trap:
    """Exponents at each tolerance with and without error control of the tangents, and the exact values.

    Without error control, steps chosen for the state alone need not be short enough for the tangents. This
    is a fault of Runge-Kutta methods, so the study uses DOP853 in place of Taylor.
    """
    x0, parameters = STARTS[0].x0, {"omega": TRAP_OMEGA}
    method = DOP853 if isinstance(settings.solver, Taylor) else type(settings.solver)
    solvers = [method(rtol=tolerance, atol=tolerance) for tolerance in TOLERANCES]
    periods = min(settings.intervals, ENOUGH_OF_REGULAR_MOTION)
    extended = with_tangent(system)
    inside = [
        lyapunov_spectrum(system, x0, parameters=parameters, intervals=periods, solver=solver).exponents
        for solver in solvers
    ]
    outside = [uncontrolled_exponents(extended, TRAP_OMEGA, solver, periods) for solver in solvers]
    truth = floquet_exponents(periodic_orbit(system, x0, parameters=parameters))
    return Trap(truth, np.array(TOLERANCES), np.array(inside), np.array(outside))


def uncontrolled_exponents(extended: HybridSystem, omega: float, solver: Solver, periods: int) -> np.ndarray:
    """Exponents ``(4,)`` from start I, by QR of tangent vectors outside the error control.

    The columns are computed one at a time. The steps follow the state alone, so all columns have the same.
    """
    span = PERIODS_AT_ONCE * 2 * np.pi / omega
    bursts = max(periods // PERIODS_AT_ONCE, 1)
    x, mode, vectors = np.array(STARTS[0].x0), "free", np.eye(4)
    growths = np.empty((bursts, 4))
    for burst in range(bursts):
        columns = []
        for vector in vectors.T:
            arc = simulate(
                extended,
                np.concatenate([UNSEEN * vector, x]),
                (0.0, span),
                mode=mode,
                parameters={"omega": omega},
                solver=solver,
                samples=[span],
            )
            columns.append(arc.x[-1, :4] / UNSEEN)
        x, mode = arc.x[-1, 4:], str(arc.mode[-1])
        vectors, r = np.linalg.qr(np.column_stack(columns))
        growths[burst] = np.log(np.abs(np.diag(r))) / span
    # The first fifth is discarded: the vectors still turn towards their directions.
    return growths[bursts // 5 :].mean(axis=0)


@attrs.frozen(eq=False)
class Candidate:
    """A possible origin of the paper's Benettin column: the exponent number ``index`` of a run."""

    text: str
    system: HybridSystem
    x0: tuple[float, ...]
    solver: Solver
    parameters: dict[str, float] = attrs.field(factory=dict)
    index: int = 0

    def exponent(self, omega: float, settings: Settings) -> float:
        """The limit of the column at one frequency if this candidate is right."""
        spectrum = lyapunov_spectrum(
            self.system,
            self.x0,
            parameters={"omega": omega, **self.parameters},
            k=self.index + 1,
            intervals=min(settings.intervals, ENOUGH),
            transient=settings.transient,
            solver=self.solver,
            progress=settings.progress,
        )
        return float(spectrum.exponents[self.index])


@attrs.frozen(eq=False)
class StraightCandidate:
    """The paper's method as a candidate: ode23s straight through the impacts with one tangent vector."""

    text: str
    system: HybridSystem
    method: Ode23s
    periods: int

    def exponent(self, omega: float, settings: Settings) -> float:
        """The limit of the column at one frequency if this candidate is right."""
        periods = min(settings.intervals, self.periods)
        growths = growths_from(self.system, self.method, omega, STARTS[0], periods)
        return float(growths[min(UNSETTLED, periods // 2) :].mean())


@attrs.frozen(eq=False)
class Explanation:
    """Text of a candidate, the exponent it gives at each frequency, and whether the paper had this method."""

    text: str
    exponents: dict[float, float]
    papers_method: bool = False

    @property
    def misfit(self) -> float:
        """Largest distance from the paper's two doubtful figures; nan unless both were computed."""
        if not DOUBTFUL.keys() <= self.exponents.keys():
            return float("nan")
        return max(abs(self.exponents[omega] - value) for omega, value in DOUBTFUL.items())


def candidates(system: HybridSystem, solver: Solver) -> list[Candidate]:
    """The true exponent first, then each fault that might explain the paper's figures."""
    first, other = STARTS[0].x0, STARTS[2].x0
    loose = [
        Candidate(
            f"(b) loose tangents, {method.__name__} {value:.0e}",
            system,
            first,
            method(rtol=value, atol=value),
        )
        for method in (Tsit5, DOP853)
        for value in LOOSE
    ]
    return [
        Candidate("the exponent as it is", system, first, solver),
        Candidate("(a) a34 without chi", with_tangent(system), (0.0,) * 4 + first, solver, {"slip": 1.0}),
        *loose,
        Candidate("(c) the attractor of start III", system, other, solver),
        Candidate("(d) the second exponent", system, first, solver, index=1),
    ]


def straight_candidates(system: HybridSystem) -> list[StraightCandidate]:
    """The paper's method at each pair of tolerances."""
    return [
        StraightCandidate(f"(e) ode23s, {rtol:.0e}, {atol:.0e}", system, Ode23s(rtol, atol), periods)
        for (rtol, atol), periods in STRAIGHT.items()
    ]


def explanations(system: HybridSystem, omegas: Sequence[float], settings: Settings) -> list[Explanation]:
    """The exponents of each candidate at the frequencies."""
    found = [
        Explanation(candidate.text, {omega: candidate.exponent(omega, settings) for omega in omegas})
        for candidate in candidates(system, settings.solver)
    ]
    straight = straight_candidates(system)
    tasks = [(candidate, omega) for candidate in straight for omega in omegas]
    with ThreadPoolExecutor() as pool:
        values = iter(list(pool.map(lambda task: task[0].exponent(task[1], settings), tasks)))
    return found + [
        Explanation(candidate.text, {omega: next(values) for omega in omegas}, papers_method=True)
        for candidate in straight
    ]
