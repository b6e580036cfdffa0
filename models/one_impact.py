"""Orbits of the impact oscillator with one impact every ``n`` forcing periods, in closed form."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid import ArgumentError, arguments

# Of a matrix with a smaller singular value, as a share of its terms, rounding leaves less than six digits.
SINGULAR = 1e-10


class OneImpactOrbit(NamedTuple):
    """Speed ``V`` and forcing phase ``theta`` in (-pi, pi] at impact, and the two multipliers."""

    V: float
    theta: float
    multipliers: np.ndarray


def one_impact_orbits(
    k: float, c: float, A: float, w: float, d: float, r: float, n: int = 1
) -> list[OneImpactOrbit]:
    r"""Orbits of :func:`models.impact_oscillator` with one impact every ``n`` forcing periods.

    With the forced response :math:`x_p = R \cos(\varphi)`, :math:`\varphi = w t - \psi`, and the free flow
    :math:`\Phi` over :math:`T = 2 \pi n / w`, the orbit closes if
    :math:`(\Phi - I)(d - x_p, -\dot x_p)^\top = V\, (\Phi\, (0, r)^\top + (0, 1)^\top)`. So
    :math:`d - x_p = a V`, :math:`-\dot x_p = b V`, and :math:`\cos^2 \varphi + \sin^2 \varphi = 1` gives a
    quadratic equation for :math:`V`. Roots with ``V <= 0`` are left out, as are orbits that pass the stop
    between impacts.

    Parameters
    ----------
    k, c, A, w, d, r
        As in :func:`models.impact_oscillator`.
    n
        Forcing periods between impacts.

    Returns
    -------
    list of OneImpactOrbit
        Zero, one or two orbits, the fastest first; unstable orbits are included.
    """
    k, c, A, d = (arguments.number(*each) for each in (("k", k), ("c", c), ("A", A), ("d", d)))
    w, r, n = arguments.positive("w", w), arguments.not_negative("r", r), arguments.count("n", n, 1, 1000)
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            return _orbits(k, c, A, w, d, r, n)
    except (ArithmeticError, ValueError) as error:  # a LinAlgError is a ValueError
        raise ArgumentError(
            f"one_impact_orbits: the closed form does not exist, or leaves the range of floating point, at "
            f"k = {k}, c = {c}, A = {A}, w = {w}, d = {d}, r = {r}, n = {n}: {error}."
        ) from error


def _orbits(k: float, c: float, A: float, w: float, d: float, r: float, n: int) -> list[OneImpactOrbit]:
    T = 2 * np.pi * n / w
    R = A / np.hypot(k - w**2, c * w)
    psi = np.arctan2(c * w, k - w**2)
    phi_T = _free_flow(k, c, T)
    closing = phi_T - np.eye(2)
    scaled = closing * np.array([[1.0, w], [1 / w, 1.0]])
    if not np.linalg.svd(scaled, compute_uv=False)[-1] > SINGULAR * np.abs(scaled + np.eye(2)).max():
        raise np.linalg.LinAlgError("the free motion returns to its start, so that the matrix is singular")
    a, b = np.linalg.solve(closing, phi_T @ (0.0, r) + (0.0, 1.0))

    orbits = []
    for V in np.roots([a**2 + (b / w) ** 2, -2 * a * d, d**2 - R**2]):
        if V.imag != 0 or V.real <= 0:
            continue
        V = float(V.real)
        theta = np.arctan2(b * V / w, d - a * V) + psi
        free = np.array([a * V, b * V - r * V])  # the state after impact, minus the forced response
        flight = _Flight(k, c, w, R, theta - psi, free)
        if _highest_top(flight, np.linspace(0.0, T, 1000 * n)) <= d + 1e-12 * (abs(d) + R):
            s = (1 + r) * (A * np.cos(theta) - k * d) / V
            M = phi_T @ np.array([[-r, 0.0], [s, -r]])
            orbits.append(OneImpactOrbit(V, float(np.angle(np.exp(1j * theta))), np.linalg.eigvals(M)))
    return sorted(orbits, key=lambda orbit: -orbit.V)


class _Flight(NamedTuple):
    """Motion between impacts: the free flow from ``free`` plus the response ``R cos(w t + phase)``."""

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
    """Largest of the local maxima of the displacement.

    The secant locates each maximum between two times: the grid alone would miss a shallow one.
    """
    v = flight.at(times)[1]
    i = np.flatnonzero((v[:-1] > 0) & (v[1:] <= 0))
    tops = times[i] + (times[i + 1] - times[i]) * v[i] / (v[i] - v[i + 1])
    return float(flight.at(tops)[0].max(initial=-np.inf))


def _free_flow(k: float, c: float, t: float | np.ndarray) -> np.ndarray:
    """``expm(t [[0, 1], [-k, -c]])``, ``t.shape + (2, 2)``; valid also for critical damping."""
    t = np.asarray(t)[..., None, None]
    traceless = np.array([[c / 2, 1.0], [-k, -c / 2]])
    squared = k - c**2 / 4
    if squared >= 0:
        w_d = np.sqrt(squared)
        decay = np.exp(-c * t / 2)
        cosine, sine = decay * np.cos(w_d * t), decay * t * np.sinc(w_d * t / np.pi)
    else:
        # The larger of the two real exponents; the hyperbolic functions alone may be too large for a float.
        q = np.sqrt(-squared)
        far = -(c / 2 + np.copysign(q, c))
        slow = np.exp(max(far, k / far) * t)
        cosine, sine = slow * (1 + np.exp(-2 * q * t)) / 2, -slow * np.expm1(-2 * q * t) / (2 * q)
    return cosine * np.eye(2) + sine * traceless
