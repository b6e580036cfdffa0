"""Legged machines: gaits of the simplest walker and of the running mass on a spring, by Taylor series."""

from __future__ import annotations

import mpmath as mp

DIGITS = 40
ORDER = 40
STEP = mp.mpf("0.05")
DELTA = mp.mpf("1e-12")


def simplest_walker(gamma="0.009") -> list[dict]:
    """Gaits of period one from the paper's equations: fixed points of the step, and the step's Jacobian."""
    with mp.workdps(DIGITS):
        gamma = mp.mpf(gamma)
        return [_gait(gamma, guess) for guess in (("0.2003", "-0.1998"), ("0.1939", "-0.2039"))]


def _gait(gamma, guess):
    guess = [mp.mpf(value) for value in guess]
    misses = lambda th, u: [a - b for a, b in zip(_walker_step(gamma, th, u)[0], (th, u), strict=True)]  # noqa: E731
    theta, rate = mp.findroot(misses, guess, tol=mp.mpf(10) ** -50, J=_jacobian(misses))
    period = _walker_step(gamma, theta, rate)[1]
    step = lambda th, u: _walker_step(gamma, th, u)[0]  # noqa: E731
    multipliers, _ = mp.eig(_jacobian(step)(theta, rate))
    c = mp.cos(2 * theta)
    return {
        "gamma": float(gamma),
        "x0": [float(v) for v in (theta, 2 * theta, rate, (1 - c) * rate)],
        "period": float(period),
        "multipliers": [[float(mp.re(m)), float(mp.im(m))] for m in multipliers] + [[1.0, 0.0], [0.0, 0.0]],
    }


def _jacobian(function):
    """Central differences, whose error ``DELTA^2`` is far below the stored digits."""

    def jacobian(*x):
        matrix = mp.matrix(2)
        for j in range(2):
            ends = [function(*(x[i] + sign * DELTA * (i == j) for i in range(2))) for sign in (1, -1)]
            for i in range(2):
                matrix[i, j] = (ends[0][i] - ends[1][i]) / (2 * DELTA)
        return matrix

    return jacobian


def _walker_step(gamma, theta, rate):
    """From one heelstrike to the next: ``(theta, rate)`` after it, and its time."""
    state = (theta, 2 * theta, rate, (1 - mp.cos(2 * theta)) * rate)
    height = lambda state: state[1] - 2 * state[0]  # noqa: E731
    t, before = _until(lambda x, h: _walker_flow(gamma, x, h), height, state, skip=1)
    c = mp.cos(2 * before[0])
    return (-before[0], c * before[2]), t


def _until(flow, guard, state, skip=0):
    """Time and state where the guard rises through zero, after ``skip`` falls."""
    t, falls = mp.mpf(0), 0
    while True:
        after = flow(state, STEP)
        falls += guard(state) > 0 >= guard(after)
        if falls >= skip and guard(state) < 0 <= guard(after):
            on_guard = lambda h, state=state: guard(flow(state, h))  # noqa: E731
            h = mp.findroot(on_guard, (0, STEP), solver="anderson", tol=mp.mpf(10) ** -70)
            return t + h, flow(state, h)
        t, state = t + STEP, after


def _walker_flow(gamma, state, h):
    th, ph, u, w = ([value] for value in state)
    s, c = [mp.sin(th[0] - gamma)], [mp.cos(th[0] - gamma)]
    S, C = [mp.sin(ph[0])], [mp.cos(ph[0])]
    pull = []
    for k in range(ORDER):
        pull.append(_cauchy(u, u, k) - c[k])
        for series, rate in (
            (th, u[k]),
            (ph, w[k]),
            (s, _cauchy(c, u, k)),
            (c, -_cauchy(s, u, k)),
            (S, _cauchy(C, w, k)),
            (C, -_cauchy(S, w, k)),
            (w, s[k] + _cauchy(pull, S, k)),
            (u, s[k]),
        ):
            series.append(rate / (k + 1))
    return tuple(mp.polyval(series[::-1], h) for series in (th, ph, u, w))


def _cauchy(a, b, k):
    return mp.fdot(a[: k + 1], b[k::-1])


def slip_hopper(apex="1", speed="5", degrees="68", stiffness="20000", mass="80", g="9.81") -> dict:
    """The run with the energy of that apex: the fixed point of the apex map, its slope, the period."""
    with mp.workdps(DIGITS):
        apex, speed, g = mp.mpf(apex), mp.mpf(speed), mp.mpf(g)
        stiffness, alpha = mp.mpf(stiffness) / mp.mpf(mass), mp.radians(mp.mpf(degrees))
        energy = speed**2 / 2 + g * apex
        stride = lambda y: _stride(energy, alpha, stiffness, g, y)  # noqa: E731
        y = mp.findroot(lambda y: stride(y)[0] - y, (mp.mpf("0.94"), mp.mpf("0.9405")), tol=mp.mpf(10) ** -50)
        map_slope = (stride(y + DELTA)[0] - stride(y - DELTA)[0]) / (2 * DELTA)
        return {
            "energy": float(energy),
            "apex": float(y),
            "speed": float(mp.sqrt(2 * (energy - g * y))),
            "period": float(stride(y)[1]),
            "multiplier": float(map_slope),
        }


def _stride(energy, alpha, stiffness, g, y):
    """From an apex at height ``y`` to the next: its height and the time between; the leg is 1 m long."""
    landing = mp.sin(alpha)
    fall = mp.sqrt(2 * g * (y - landing))
    state = (-mp.cos(alpha), landing, mp.sqrt(2 * (energy - g * y)), -fall)
    length = lambda state: state[0] ** 2 + state[1] ** 2 - 1  # noqa: E731
    # The leg is also 1 m long at touchdown, so the search begins a little later.
    flow = lambda x, h: _stance_flow(stiffness, g, x, h)  # noqa: E731
    t, state = _until(flow, length, flow(state, STEP / 5))
    return state[1] + state[3] ** 2 / (2 * g), fall / g + STEP / 5 + t + state[3] / g


def _stance_flow(stiffness, g, state, h):
    """``v' = stiffness (q - 1) x - g`` with ``q = (x^2 + y^2)^(-1/2)``, so ``r q' = -r' q / 2``."""
    x, y, vx, vy = ([value] for value in state)
    r, q = [], []
    for k in range(ORDER):
        r.append(_cauchy(x, x, k) + _cauchy(y, y, k))
        total = sum(((mp.mpf(-j) / 2 - (k - j)) * r[j] * q[k - j] for j in range(1, k + 1)), mp.mpf(0))
        q.append(total / (k * r[0]) if k else 1 / mp.sqrt(r[0]))
        x.append(vx[k] / (k + 1))
        y.append(vy[k] / (k + 1))
        vx.append(stiffness * (_cauchy(q, x, k) - x[k]) / (k + 1))
        vy.append((stiffness * (_cauchy(q, y, k) - y[k]) - (g if k == 0 else 0)) / (k + 1))
    return tuple(mp.polyval(series[::-1], h) for series in (x, y, vx, vy))
