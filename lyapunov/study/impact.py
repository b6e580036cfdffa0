"""One impact, and what methods make of it: restitution and tangent map compared with exact ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import attrs
import numpy as np

from hybrid import DOP853, HybridSystem, Jump, Mode, Taylor, simulate
from lyapunov.directions import generic_directions
from lyapunov.study.ode23s import Ode23s
from lyapunov.study.runs import STARTS
from lyapunov.study.tangents import UNSEEN, with_tangent

EXACT = Taylor(rtol=1e-12, atol=1e-14)
SETTLED = 500
# Periods among which an impact with a free flight before and after it is looked for.
SEARCHED = 20
# Free flight before and after the impact in the window, in periods.
LEADS = tuple(np.round(np.arange(0.05, 0.41, 0.05), 2))
LAG = 0.05

Carry = Callable[["Impact"], tuple[np.ndarray, np.ndarray]]


@attrs.frozen(eq=False)
class Impact:
    """One impact of an orbit, with some free flight before and after it, by the library at 1e-12.

    Attributes
    ----------
    system, omega
        The founding system and the frequency of its drive, rad/s.
    t_span, x
        The window in time, and the state ``(4,)`` at its start.
    end
        The state ``(4,)`` at the end of the window.
    before, contact, after
        Tangent maps ``(4, 4)`` of the free flight, of the contact and of the free flight after it.
    t_impact, x_impact, t_release
        Start of the contact with the state there, and end of the contact.
    """

    system: HybridSystem
    omega: float
    t_span: tuple[float, float]
    x: np.ndarray
    end: np.ndarray
    before: np.ndarray
    contact: np.ndarray
    after: np.ndarray
    t_impact: float
    x_impact: np.ndarray
    t_release: float

    @property
    def rest_of_the_period(self) -> np.ndarray:
        """Tangent map ``(4, 4)`` from the end of the window to one period after its start."""
        return _flow(self, self.end, (self.t_span[1], self.t_span[0] + 2 * np.pi / self.omega), "free")[1]

    def relative(self, contact: np.ndarray) -> np.ndarray:
        """Map ``(2, 2)`` of the gap and its rate across the contact: near ``[[-1, 0], [shear, -1]]``."""
        m1, m2 = self.system.parameters["m1"], self.system.parameters["m2"]
        of_gap = np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]])
        apart = np.array([[m2, 0.0], [-m1, 0.0], [0.0, m2], [0.0, -m1]]) / (m1 + m2)
        return of_gap @ contact @ apart

    def halfway(self) -> np.ndarray:
        """Map ``(2, 2)`` of the gap and its rate from the start of the contact to its middle."""
        middle = 0.5 * (self.t_impact + self.t_release)
        return self.relative(_flow(self, self.x_impact, (self.t_impact, middle), "contact")[1])


@attrs.frozen(eq=False)
class Measured:
    """An impact by some method: the state at the end of the window, and the map ``(4, 4)`` of the contact."""

    impact: Impact
    end: np.ndarray
    contact: np.ndarray

    @property
    def restitution_error(self) -> float:
        """Relative error of the speed at which the bodies part."""
        speed, exact = (x[2] - x[3] for x in (self.end, self.impact.end))
        return float(speed / exact - 1)

    @property
    def map_error(self) -> float:
        """Relative error of the tangent map of the contact, in the Frobenius norm."""
        exact = self.impact.contact
        return float(np.linalg.norm(self.contact - exact) / np.linalg.norm(exact))

    @property
    def volume_error(self) -> float:
        """Relative error of the determinant of the tangent map."""
        return float(np.linalg.det(self.contact) / np.linalg.det(self.impact.contact) - 1)

    def predicted_exponents(self) -> np.ndarray:
        """Exponents ``(4,)`` of a periodic orbit with this map at its only impact and exact flights."""
        impact = self.impact
        period = impact.rest_of_the_period @ impact.after @ self.contact @ impact.before
        growth = np.log(np.abs(np.linalg.eigvals(period)))
        return np.sort(growth)[::-1] * impact.omega / (2 * np.pi)


def impacts(system: HybridSystem, omega: float, leads: tuple[float, ...] = LEADS) -> list[Impact]:
    """The same impact of the attractor of start I, after ``leads`` periods of free flight each."""
    period, parameters = 2 * np.pi / omega, {"omega": omega}
    settled = simulate(
        system, STARTS[0].x0, (0.0, (SETTLED + 0.5) * period), parameters=parameters, solver=EXACT
    )
    span = (0.5 * period, (0.5 + SEARCHED) * period)
    arc = simulate(system, settled.x[-1], span, mode="free", parameters=parameters, solver=EXACT)
    jumps = list(arc.jumps)
    for last, touch, release, following in zip(jumps, jumps[1:], jumps[2:], jumps[3:], strict=False):
        flight = min(touch.t - last.t, following.t - release.t)
        if touch.transition == "impact" and flight > (max(leads) + LAG) * period:
            return [_window(system, omega, (last, touch, release), lead * period) for lead in leads]
    raise ValueError(f"no impact with free flights around it at omega = {omega}")


def _window(system: HybridSystem, omega: float, jumps: Sequence[Jump], lead: float) -> Impact:
    last, touch, release = jumps
    a, b = touch.t - lead, release.t + LAG * 2 * np.pi / omega
    empty = np.zeros((4, 4))
    blank = Impact(
        system, omega, (a, b), touch.x_minus, touch.x_minus, empty, empty, empty,
        touch.t, touch.x_minus, release.t,
    )  # fmt: skip
    x, _ = _flow(blank, last.x_plus, (last.t, a), "free")
    # Just before the impact: the jump at the end of a run would belong to it.
    _, before = _flow(blank, x, (a, np.nextafter(touch.t, a) - 1e-13), "free")
    _, contact = _flow(blank, touch.x_plus, (touch.t, release.t), "contact")
    end, after = _flow(blank, release.x_plus, (release.t, b), "free")
    return attrs.evolve(blank, x=x, end=end, before=before, contact=contact, after=after)


def _flow(
    impact: Impact, x: np.ndarray, span: tuple[float, float], mode: str
) -> tuple[np.ndarray, np.ndarray]:
    parameters = {"omega": impact.omega}
    arc = simulate(impact.system, x, span, mode=mode, parameters=parameters, solver=EXACT, tangent=np.eye(4))
    return arc.x[-1], np.asarray(arc.fundamental)


def measure(impact: Impact, carry: Carry) -> Measured:
    """The impact by a method that carries state and four tangent vectors across the window."""
    end, fundamental = carry(impact)
    contact = np.linalg.solve(impact.after, fundamental) @ np.linalg.inv(impact.before)
    return Measured(impact, end, contact)


def by_ode23s(method: Ode23s, at_once: int = 4) -> Carry:
    """Ode23s straight through, with one tangent vector or all four as one system with the state."""
    directions = generic_directions(4, 4)

    def carry(impact: Impact) -> tuple[np.ndarray, np.ndarray]:
        parts = [
            method.carry(
                impact.system, impact.x, directions[:, c : c + at_once], impact.t_span, omega=impact.omega
            )
            for c in range(0, 4, at_once)
        ]
        return parts[0][0], np.hstack([vectors for _, vectors in parts]) @ directions.T

    return carry


def by_library(tolerance: float) -> Carry:
    """The library's default: events, and tangent vectors under the error control."""
    solver = Taylor(rtol=tolerance, atol=tolerance / 100)

    def carry(impact: Impact) -> tuple[np.ndarray, np.ndarray]:
        parameters = {"omega": impact.omega}
        arc = simulate(
            impact.system, impact.x, impact.t_span, mode="free", parameters=parameters, solver=solver,
            tangent=np.eye(4),
        )  # fmt: skip
        return arc.x[-1], np.asarray(arc.fundamental)

    return carry


def by_straight_dop853(tolerance: float) -> Carry:
    """DOP853 without events; the tangent vectors are under the error control."""
    solver = DOP853(rtol=tolerance, atol=tolerance / 100)

    def carry(impact: Impact) -> tuple[np.ndarray, np.ndarray]:
        parameters = {"omega": impact.omega}
        arc = simulate(
            straight_through(impact.system), impact.x, impact.t_span, parameters=parameters, solver=solver,
            tangent=np.eye(4),
        )  # fmt: skip
        return arc.x[-1], np.asarray(arc.fundamental)

    return carry


def by_uncontrolled_dop853(tolerance: float) -> Carry:
    """DOP853 with events, where only the state is under the error control."""
    solver = DOP853(rtol=tolerance, atol=tolerance / 100)

    def carry(impact: Impact) -> tuple[np.ndarray, np.ndarray]:
        extended, parameters = with_tangent(impact.system), {"omega": impact.omega}
        ends = [
            simulate(
                extended, np.concatenate([UNSEEN * vector, impact.x]), impact.t_span, mode="free",
                parameters=parameters, solver=solver,
            ).x[-1]
            for vector in np.eye(4)
        ]  # fmt: skip
        return ends[0][4:], np.column_stack([end[:4] / UNSEEN for end in ends])

    return carry


def straight_through(system: HybridSystem) -> HybridSystem:
    """The founding system in one mode without events, whose contact force is zero at an open gap."""
    free = next(mode.field for mode in system.modes if mode.name == "free")

    def everywhere(t, x, p):  # type: ignore[no-untyped-def]
        v1, v2, a1, a2 = free(t, x, p)
        force = p.K * np.maximum(x.x1 - x.x2, 0.0) ** 1.5
        return v1, v2, a1 - force / p.m1, a2 + force / p.m2

    return HybridSystem(
        name=f"{system.name} straight through",
        state=system.state_names,
        parameters=system.parameters,
        modes=[Mode("everywhere", everywhere)],
        period=system.period,
    )
