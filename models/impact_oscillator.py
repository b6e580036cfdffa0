"""A harmonically forced linear oscillator that hits one rigid stop, and its closed-form orbits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid import Guard, HybridSystem, Mode, Reset, Transition


def impact_oscillator() -> HybridSystem:
    r"""Forced linear oscillator of unit mass with a rigid stop at ``x = d``.

    .. math::

        \ddot x + c\, \dot x + k\, x = A \cos(w t), \quad x \le d, \qquad v \mapsto -r\, v \text{ at } x = d

    Returns
    -------
    HybridSystem
        State ``x`` (displacement), ``v`` (velocity); mode ``flight``; transition ``impact``; forcing
        period ``2 pi / w``. Dimensionless parameters: stiffness ``k = 1``, damping ``c = 0.1``, forcing
        amplitude ``A = 1`` and frequency ``w = 1``, stop ``d = 1``, restitution ``r = 0.8``.

    Notes
    -----
    - With the defaults one orbit with one impact a period is stable; :func:`one_impact_orbits` has it.
    - On any orbit the exponents (phase left out) sum to ``-c + 2 ln(r)`` times the impacts per unit time,
      since the flow contracts areas by ``exp(-c t)`` and an impact by ``r^2``.
    - The map is not differentiable where an orbit grazes the stop, its derivative growing like one over
      the square root of the distance (Nordmark 1991, doi:10.1016/0022-460X(91)90592-8).

    References
    ----------
    S. W. Shaw, P. J. Holmes, "A periodically forced piecewise linear oscillator", Journal of Sound and
    Vibration 90(1), 129-155, 1983. doi:10.1016/0022-460X(83)90407-8
    """
    return HybridSystem(
        name="impact oscillator",
        state=("x", "v"),
        parameters={"k": 1.0, "c": 0.1, "A": 1.0, "w": 1.0, "d": 1.0, "r": 0.8},
        modes=[Mode("flight", lambda t, x, p: (x.v, p.A * np.cos(p.w * t) - p.c * x.v - p.k * x.x))],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.x - p.d, direction=+1),
                Reset(lambda t, x, p: (p.d, -p.r * x.v)),
                name="impact",
            )
        ],
        period=lambda p: 2 * np.pi / p.w,
    )


class OneImpactOrbit(NamedTuple):
    """Speed before impact ``V``, forcing phase there ``theta`` in (-pi, pi], the two multipliers."""

    V: float
    theta: float
    multipliers: np.ndarray


def one_impact_orbits(
    k: float, c: float, A: float, w: float, d: float, r: float, n: int = 1
) -> list[OneImpactOrbit]:
    r"""Orbits of :func:`impact_oscillator` with one impact every ``n`` forcing periods, in closed form.

    With :math:`x_p = R \cos(\varphi)`, :math:`\varphi = w t - \psi`, the forced response and :math:`\Phi` the
    free flow over :math:`T = 2 \pi n / w`, the orbit closes if
    :math:`(\Phi - I)(d - x_p, -\dot x_p)^\top = V\, (\Phi\, (0, r)^\top + (0, 1)^\top)`. So
    :math:`d - x_p = a V`, :math:`-\dot x_p = b V`, and :math:`\cos^2 \varphi + \sin^2 \varphi = 1` leaves a
    quadratic in :math:`V`. Roots with ``V <= 0`` or that pass the stop between impacts are left out.

    Parameters
    ----------
    k, c, A, w, d, r
        As in :func:`impact_oscillator`.
    n
        Forcing periods between impacts.

    Returns
    -------
    list of OneImpactOrbit
        None, one or two orbits, the fastest first, stable or not.
    """
    T = 2 * np.pi * n / w
    R = A / np.hypot(k - w**2, c * w)
    psi = np.arctan2(c * w, k - w**2)
    phi_T = _free_flow(k, c, T)
    a, b = np.linalg.solve(phi_T - np.eye(2), phi_T @ (0.0, r) + (0.0, 1.0))

    orbits = []
    for V in np.roots([a**2 + (b / w) ** 2, -2 * a * d, d**2 - R**2]):
        if V.imag != 0 or V.real <= 0:
            continue
        V = float(V.real)
        theta = np.arctan2(b * V / w, d - a * V) + psi
        free = np.array([a * V, b * V - r * V])  # the state after impact, less the forced response
        flight = _Flight(k, c, w, R, theta - psi, free)
        if _highest_top(flight, np.linspace(0.0, T, 1000 * n)) <= d + 1e-12 * (abs(d) + R):
            s = (1 + r) * (A * np.cos(theta) - k * d) / V
            M = phi_T @ np.array([[-r, 0.0], [s, -r]])
            orbits.append(OneImpactOrbit(V, float(np.angle(np.exp(1j * theta))), np.linalg.eigvals(M)))
    return sorted(orbits, key=lambda orbit: -orbit.V)


class _Flight(NamedTuple):
    """Motion between impacts: the free flow of ``free`` and the response ``R cos(w t + phase)``."""

    k: float
    c: float
    w: float
    R: float
    phase: float
    free: np.ndarray

    def at(self, t: np.ndarray) -> np.ndarray:
        """Displacement and velocity at the times, ``(2, len(t))``."""
        turn = self.w * t + self.phase
        response = np.array([self.R * np.cos(turn), -self.R * self.w * np.sin(turn)])
        return (_free_flow(self.k, self.c, t) @ self.free).T + response


def _highest_top(flight: _Flight, times: np.ndarray) -> float:
    """Largest displacement where the velocity turns from up to down.

    The tops are placed between the times by the secant: a grid alone would overlook a shallow one.
    """
    v = flight.at(times)[1]
    i = np.flatnonzero((v[:-1] > 0) & (v[1:] <= 0))
    tops = times[i] + (times[i + 1] - times[i]) * v[i] / (v[i] - v[i + 1])
    return float(flight.at(tops)[0].max(initial=-np.inf))


def _free_flow(k: float, c: float, t: float | np.ndarray) -> np.ndarray:
    """``expm(t [[0, 1], [-k, -c]])``, ``t.shape + (2, 2)``; critically damped too: ``sinc`` has no pole."""
    w_d = np.sqrt(complex(k - c**2 / 4))
    t = np.asarray(t)[..., None, None]
    sine = t * np.sinc(w_d * t / np.pi)
    traceless = np.array([[c / 2, 1.0], [-k, -c / 2]])
    return (np.exp(-c * t / 2) * (np.cos(w_d * t) * np.eye(2) + sine * traceless)).real
