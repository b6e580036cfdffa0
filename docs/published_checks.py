"""Independent values for the page of published numbers: no solver of the library takes part in them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from types import SimpleNamespace
from typing import Any

import mpmath as mp
import numpy as np
from numba import njit
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve, root_scalar

DIGITS = 30
mp.mp.dps = DIGITS + 10
ORDER = 36
Vector = list[mp.mpf]


def walker_series(theta: Vector, gamma: mp.mpf) -> list[Vector]:
    """Taylor coefficients of the simplest walker from ``(theta, phi, dtheta, dphi)``."""
    angle, leg, rate, swing = ([each] for each in theta)
    sine, cosine = [mp.sin(angle[0] - gamma)], [mp.cos(angle[0] - gamma)]
    leg_sine, leg_cosine = [mp.sin(leg[0])], [mp.cos(leg[0])]
    force: Vector = []
    for k in range(ORDER):
        force.append(sum(rate[j] * rate[k - j] for j in range(k + 1)) - cosine[k])
        pull = sum(force[j] * leg_sine[k - j] for j in range(k + 1))
        angle.append(rate[k] / (k + 1))
        leg.append(swing[k] / (k + 1))
        rate.append(sine[k] / (k + 1))
        swing.append((sine[k] + pull) / (k + 1))
        for turn, one, other in ((angle, sine, cosine), (leg, leg_sine, leg_cosine)):
            slopes = [(j + 1) * turn[j + 1] for j in range(k + 1)]
            one.append(sum(slopes[j] * other[k - j] for j in range(k + 1)) / (k + 1))
            other.append(-sum(slopes[j] * one[k - j] for j in range(k + 1)) / (k + 1))
    return [angle, leg, rate, swing]


def walker_step(theta: mp.mpf, dtheta: mp.mpf, gamma: mp.mpf, guess: float) -> tuple[mp.mpf, mp.mpf, mp.mpf]:
    """Angle and rate after the next heelstrike, and the time of it near a guess."""

    def state_at(coefficients: list[Vector], h: mp.mpf) -> Vector:
        return [mp.polyval(each[::-1], h) for each in coefficients]

    x = [theta, 2 * theta, dtheta, dtheta * (1 - mp.cos(2 * theta))]
    length, steps = mp.mpf(guess) / 16, 15
    for _ in range(steps):
        x = state_at(walker_series(x, gamma), length)
    last = walker_series(x, gamma)
    height = lambda h: mp.polyval(last[1][::-1], h) - 2 * mp.polyval(last[0][::-1], h)  # noqa: E731
    h = mp.findroot(height, length)
    angle, _, rate, _ = state_at(last, h)
    return -angle, mp.cos(2 * angle) * rate, steps * length + h


@cache
def walker_gait(theta: float, dtheta: float, period: float) -> tuple[mp.mpf, mp.mpf, mp.mpf, Vector]:
    """Angle, rate and period of the gait near a guess, and its two free multipliers."""
    gamma = mp.mpf(9) / 1000
    x = mp.matrix([mp.mpf(theta), mp.mpf(dtheta)])
    change = mp.inf
    while change > mp.mpf(10) ** -DIGITS:
        *image, time = walker_step(x[0], x[1], gamma, period)
        slopes = _slopes(lambda a, b: walker_step(a, b, gamma, period)[:2], x)
        step = mp.lu_solve(mp.eye(2) - slopes, mp.matrix(image) - x)
        x, change = x + step, mp.norm(step)
    return x[0], x[1], time, mp.eig(slopes)[0]


def _slopes(function: Callable[..., tuple[mp.mpf, ...]], x: mp.matrix) -> mp.matrix:
    """Derivatives ``(2, 2)`` by central differences, which lose a third of the digits."""
    h = mp.mpf(10) ** (-mp.mp.dps // 3)
    columns = []
    for i in range(2):
        ahead, behind = (function(*(x[j] + s * h * (i == j) for j in range(2))) for s in (1, -1))
        columns.append([(a - b) / (2 * h) for a, b in zip(ahead, behind, strict=True)])
    return mp.matrix(columns).T


def hopper_gap(speed: float, height: float, given: Mapping[str, float]) -> float:
    """How far one hop moves the apex: flight in closed form, the stance by Taylor series."""
    g, length = mp.mpf(10), mp.mpf(1)
    stiffness, angle = mp.mpf(given["k"]) / mp.mpf(given["m"]), mp.mpf(given["alpha"])
    vx0, y0, low = mp.mpf(speed), mp.mpf(height), length * mp.sin(angle)
    start = [-length * mp.cos(angle), low, vx0, -mp.sqrt(2 * g * (y0 - low))]

    def field(t: mp.mpf, z: Vector) -> Vector:
        push = stiffness * (length / mp.hypot(z[0], z[1]) - 1)
        return [z[2], z[3], push * z[0], push * z[1] - g]

    solution = mp.odefun(field, 0, start, tol=mp.mpf(10) ** -25)
    stretch = lambda t: mp.hypot(*solution(t)[:2]) - length  # noqa: E731
    # The leg is compressed for half a period of the spring and a little longer.
    half = mp.pi / mp.sqrt(stiffness)
    end = mp.findroot(stretch, (half, 1.4 * half), "anderson")
    _, y1, vx1, vy1 = solution(end)
    return float(mp.hypot(vx1 - vx0, y1 + vy1**2 / (2 * g) - y0))


def wheel_speed() -> mp.mpf:
    """Speed of the rimless wheel after a step: energy between steps, and ``u -> mu u`` at a step."""
    mu, stiffness = mp.mpf(2) / 3, mp.mpf(2) / 3
    gained = 4 * stiffness * mp.sin(mp.pi / 6) * mp.sin(mp.mpf(2) / 10)
    return mp.sqrt(mu**2 * gained / (1 - mu**2))


def converter_flip(guess: tuple[float, float]) -> mp.mpf:
    """Input voltage at which the multiplier of the buck converter's orbit is -1, by matrix exponentials.

    The switch is open for a time ``d`` and then closed until the end of the ramp. ``guess`` holds ``d`` and
    the voltage.
    """
    inductor, capacitor, load, period = (mp.mpf(x) for x in ("20e-3", "47e-6", "22", "400e-6"))
    low, high, reference, gain = (mp.mpf(x) for x in ("3.8", "8.2", "11.3", "8.4"))
    a = mp.matrix([[-1 / (load * capacitor), 1 / capacitor], [-1 / inductor, 0]])

    def parts(d: mp.mpf, voltage: mp.mpf) -> tuple[mp.mpf, mp.mpf]:
        open_, closed = mp.expm(a * d), mp.expm(a * (period - d))
        b = mp.matrix([0, voltage / inductor])
        driven = mp.lu_solve(a, (closed - mp.eye(2)) * b)
        x = open_ * mp.lu_solve(mp.eye(2) - closed * open_, driven)
        slope = gain * (a * x)[0] - (high - low) / period
        saltation = mp.eye(2) + b * mp.matrix([[gain, 0]]) / slope
        whole = closed * saltation * open_
        height = gain * (x[0] - reference) - low - (high - low) * d / period
        return height, mp.det(whole + mp.eye(2))

    return mp.findroot(parts, guess)[1]


def compass_flip(field: Callable[..., Any], strike: Callable[..., Any], given: Mapping[str, float]) -> float:
    """Slope at which a multiplier of the compass gait is -1: SciPy's DOP853, differences of the step map."""

    def step(free: np.ndarray, slope: float) -> np.ndarray:
        """One step on the section of heelstrikes, where the two angles add up to minus twice the slope."""
        ground = -2.0 * np.radians(slope)
        start = [ground - free[0], free[0], free[1], free[2]]
        p = SimpleNamespace(**given)

        def rates(t: float, x: np.ndarray) -> Any:
            return field(t, SimpleNamespace(n=x[0], s=x[1], dn=x[2], ds=x[3]), p)

        def height(t: float, x: np.ndarray) -> float:
            return x[0] + x[1] - ground

        height.terminal, height.direction = True, -1  # type: ignore[attr-defined]
        # The swing foot has passed the ground near mid-stance by then.
        first = solve_ivp(rates, (0.0, 0.4), start, "DOP853", rtol=1e-13, atol=1e-14)
        last = solve_ivp(rates, (0.4, 2.0), first.y[:, -1], "DOP853", events=height, rtol=1e-13, atol=1e-14)
        n, s, dn, ds = last.y_events[0][0]
        return np.array(strike(0.0, SimpleNamespace(n=n, s=s, dn=dn, ds=ds), p)[1:])

    gait = [np.array([0.22, -0.38, -1.1])]

    def distance(slope: float) -> float:
        gait[0] = fsolve(lambda free: step(free, slope) - free, gait[0], xtol=1e-13)
        h = 1e-4 * np.eye(3)
        # Two differences, of the steps h and h / 2, without their error of second order.
        coarse, fine = (
            np.transpose(
                [(step(gait[0] + e, slope) - step(gait[0] - e, slope)) / (2 * e.sum()) for e in each]
            )
            for each in (h, h / 2)
        )
        return float(np.linalg.det((4 * fine - coarse) / 3 + np.eye(3)))

    return float(root_scalar(distance, x0=4.3, x1=4.4, xtol=1e-10).root)


def woodpecker_inertia(p: Mapping[str, float]) -> np.ndarray:
    """The inverse of the mass matrix of the woodpecker toy: the bird hangs on the arms of all coordinates."""
    arms = np.array([[1.0, p["l_M"], p["l_G"]]])
    return np.linalg.inv(p["m_S"] * arms.T @ arms + np.diag([p["m_M"], p["J_M"], p["J_S"]]))


def woodpecker_frequency(p: Mapping[str, float]) -> float:
    """The frequency at which bird and sleeve swing against each other in flight, in Hz."""
    twist = np.array([0.0, 1.0, -1.0])
    return float(np.sqrt(p["c"] * twist @ woodpecker_inertia(p) @ twist) / (2 * np.pi))


def woodpecker_pecks(
    x: np.ndarray, p: Mapping[str, float], seconds: float, step: float
) -> tuple[float, float]:
    """The mean time between pecks of the woodpecker toy by Moreau's scheme, and how far the bird turns back.

    Contacts are impulses of Gauss-Seidel rounds: nothing is located, and nothing is known of modes.
    """
    m_S, l_M, l_G, r_M, h_M, h_S = (p[name] for name in ("m_S", "l_M", "l_G", "r_M", "h_M", "h_S"))
    normals = np.array([[0.0, 0.0, -h_S], [0.0, h_M, 0.0], [0.0, -h_M, 0.0]])
    slips = np.array([[1.0, l_M, l_G - p["l_S"]], [1.0, r_M, 0.0], [1.0, r_M, 0.0]])
    play = np.array([l_M + l_G - p["l_S"] - p["r_0"], r_M - p["r_0"], r_M - p["r_0"]])
    weight = -p["g"] * np.array([m_S + p["m_M"], m_S * l_M, m_S * l_G])
    given = woodpecker_inertia(p), normals, slips, play, weight, p["c"], p["mu"], np.array([p["e"], 0.0, 0.0])
    first, last, count, back = _stepped(x[:3].copy(), x[3:].copy(), round(seconds / step), step, given)
    return (last - first) * step / (count - 1), back


@njit
def _stepped(q, u, steps, h, given):  # type: ignore[no-untyped-def]
    """Steps of the first and the last peck, the number of pecks, and the smallest angle of the bird."""
    inverse, normals, slips, play, weight, c, mu, e = given
    first, last, count, back, was_closed = 0, 0, 0, 0.0, False
    for k in range(steps):
        q += 0.5 * h * u
        twist = c * (q[1] - q[2])
        before, gaps = normals @ u, play + normals @ q
        u += h * (inverse @ (weight + np.array([0.0, -twist, twist])))
        pushes, rubs, change = np.zeros(3), np.zeros(3), 1.0
        while change > 1e-15:
            change = 0.0
            for i in range(3):
                if gaps[i] <= 0.0:
                    pull = inverse @ normals[i]
                    push = max(pushes[i] - (normals[i] @ u + e[i] * before[i]) / (normals[i] @ pull), 0.0)
                    u += pull * (push - pushes[i])
                    pull = inverse @ slips[i]
                    most = mu * push
                    rub = min(max(rubs[i] - slips[i] @ u / (slips[i] @ pull), -most), most)
                    u += pull * (rub - rubs[i])
                    change = max(change, abs(push - pushes[i]), abs(rub - rubs[i]))
                    pushes[i], rubs[i] = push, rub
        if pushes[0] > 0.0 and not was_closed:
            first = k if count == 0 else first
            last, count = k, count + 1
        was_closed, back = pushes[0] > 0.0, min(back, q[2])
        q += 0.5 * h * u
    return first, last, count, back
