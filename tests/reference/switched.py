"""Systems that switch: solvable oscillator, rimless wheel, converter, friction, saltation by hand."""

from __future__ import annotations

from itertools import pairwise

import mpmath as mp

DIGITS = 40
STEP = mp.mpf("0.05")


def solvable_oscillator(b=0.5, u0=0.3, count=20) -> dict:
    """Corron, Blakely and Stahl: map at integer times, spectrum, saltation matrix of each flip."""
    with mp.workdps(DIGITS):
        b, u = mp.mpf(b), mp.mpf(u0)
        orbit, saltation = [u], []
        for _ in range(count):
            s = mp.sign(u)
            u = mp.exp(b) * u - (mp.exp(b) - 1) * s
            orbit.append(u)
            if mp.sign(u) != s:
                saltation.append([[1.0, 0.0], [0.0, float((-s - u) / (s - u))]])
        return {
            "b": float(b),
            "u": [float(u) for u in orbit],
            "flips": [i + 1 for i, (a, c) in enumerate(pairwise(orbit)) if a * c < 0],
            "saltation": saltation,
            "exponents": [float(b), 0.0],
        }


def rimless_wheel(length="1", g="9.8", alpha=None, gamma="0.08") -> dict:
    """Fixed point from the energy balance, period by quadrature."""
    with mp.workdps(DIGITS):
        length, g, gamma = mp.mpf(length), mp.mpf(g), mp.mpf(gamma)
        alpha = mp.pi / 8 if alpha is None else mp.mpf(alpha)
        omega = mp.cot(2 * alpha) * mp.sqrt(4 * g / length * mp.sin(alpha) * mp.sin(gamma))
        start = gamma - alpha
        speed = lambda th: mp.sqrt(omega**2 + 2 * g / length * (mp.cos(start) - mp.cos(th)))  # noqa: E731
        saltation = _wheel_saltation(g / length, alpha, gamma, omega)
        return {
            "theta": float(start),
            "omega": float(omega),
            "period": float(mp.quad(lambda th: 1 / speed(th), [start, 0, gamma + alpha])),
            "multipliers": [1.0, float(mp.cos(2 * alpha) ** 2)],
            "saltation": [[float(v) for v in row] for row in saltation],
        }


def _wheel_saltation(gl, alpha, gamma, omega):
    """``f_plus = Xi f_minus`` and ``Xi (0, 1) = (0, cos 2 alpha)`` fix the matrix."""
    c = mp.cos(2 * alpha)
    before = omega / c
    f_minus, f_plus = (before, gl * mp.sin(gamma + alpha)), (omega, gl * mp.sin(gamma - alpha))
    return [[f_plus[0] / f_minus[0], 0], [(f_plus[1] - c * f_minus[1]) / f_minus[0], c]]


def buck_converter(inputs=("25", "20")) -> list[dict]:
    """The orbit with one switching per ramp: matrix exponentials and one scalar equation for the duty."""
    with mp.workdps(DIGITS):
        return [_buck_orbit(mp.mpf(E)) for E in inputs]


def _buck_orbit(E):
    L, C, R, T = mp.mpf("20e-3"), mp.mpf("47e-6"), mp.mpf(22), mp.mpf("400e-6")
    A = mp.matrix([[-1 / (R * C), 1 / C], [-1 / L, 0]])
    driven = mp.matrix([0, E / L])
    rest = -mp.lu_solve(A, driven)
    ramp = lambda t: mp.mpf("3.8") + mp.mpf("4.4") * t / T  # noqa: E731

    def start(t_off):
        on = mp.expm(A * (T - t_off))
        return mp.lu_solve(mp.eye(2) - on * mp.expm(A * t_off), rest - on * rest)

    def switching(fraction):
        v = (mp.expm(A * (fraction * T)) * start(fraction * T))[0]
        return mp.mpf("8.4") * (v - mp.mpf("11.3")) - ramp(fraction * T)

    fraction = mp.findroot(switching, (mp.mpf("0.4"), mp.mpf("0.6")))
    x0 = start(fraction * T)
    at_switch = mp.expm(A * (fraction * T)) * x0
    speed = mp.mpf("8.4") * (A * at_switch)[0] - mp.mpf("4.4") / T
    saltation = mp.eye(2) + driven * mp.matrix([[mp.mpf("8.4") / speed, 0]])
    multipliers, _ = mp.eig(mp.expm(A * ((1 - fraction) * T)) * saltation * mp.expm(A * (fraction * T)))
    return {
        "E": float(E),
        "x0": [float(v) for v in x0],
        "off_fraction": float(fraction),
        "multipliers": [[float(mp.re(m)), float(mp.im(m))] for m in multipliers],
        "determinant": float(mp.exp(-T / (R * C))),
        "saltation": [[float(saltation[i, j]) for j in range(2)] for i in range(2)],
    }


def switched_linear(starts=((0, 1), (0.1, 0.9), (-0.4, 0.7)), t_end="0.125") -> list[dict]:
    """Hiskens and Pai: switching times and sensitivities, all from matrix exponentials and scalar roots."""
    with mp.workdps(DIGITS):
        return [_switched_run(mp.matrix(start), mp.mpf(t_end)) for start in starts]


def _switched_run(x0, t_end):
    fields = {1: mp.matrix([[1, -100], [10, 1]]), 2: mp.matrix([[1, 10], [-100, 1]])}
    normals = {1: mp.matrix([["-2.75", 1]]), 2: mp.matrix([["-0.36", 1]])}
    x, t, mode, sensitivity, times = x0, mp.mpf(0), 1, mp.eye(2), []
    while True:
        A, normal = fields[mode], normals[mode]
        guard = lambda s, A=A, normal=normal, x=x, t=t: (normal * mp.expm(A * (s - t)) * x)[0]  # noqa: E731
        grid = [t + mp.mpf("1e-4") * (i + mp.mpf("0.01")) for i in range(int((t_end - t) * 10**4))] + [t_end]
        hit = next(((a, b) for a, b in pairwise(grid) if guard(a) * guard(b) <= 0), None)
        until = t_end if hit is None else mp.findroot(guard, hit, solver="illinois", tol=mp.mpf(10) ** -70)
        flow = mp.expm(A * (until - t))
        x, t, sensitivity = flow * x, until, flow * sensitivity
        if hit is None:
            break
        times.append(t)
        mode = 3 - mode
        jump = (fields[mode] - A) * x
        sensitivity = (mp.eye(2) + jump * normal / (normal * A * x)[0]) * sensitivity
    return {
        "x0": [float(v) for v in x0],
        "t_end": float(t_end),
        "switching_times": [float(s) for s in times],
        "x_end": [float(v) for v in x],
        "sensitivity": [[float(sensitivity[i, j]) for j in range(2)] for i in range(2)],
    }


def stick_slip(belt="0.2", delta="3") -> dict:
    """Block on a belt: slip by Taylor series from the release at ``x = 1``, stick in closed form."""
    with mp.workdps(30):
        belt, delta = mp.mpf(belt), mp.mpf(delta)
        slip = [(mp.mpf(0), mp.mpf(1), belt)]
        while slip[-1][2] <= belt:
            t, x, v = slip[-1]
            slip.append((t + STEP, *_slip_step(x, v, STEP, belt, delta)))
        _, x_largest = _slip_until(slip, 0, -1, belt, delta)
        t_slip, x_restick = _slip_until(slip, belt, +1, belt, delta)
        t_stick = (1 - x_restick) / belt
        return {
            "slip": float(t_slip),
            "stick": float(t_stick),
            "period": float(t_slip + t_stick),
            "x_largest": float(x_largest),
            "x_restick": float(x_restick),
            "multipliers": [1.0, 0.0],
        }


def _slip_until(slip, target, direction, belt, delta):
    """Time at which ``v`` passes ``target`` in the given direction, and ``x`` there."""
    t, x, v = next(
        left
        for left, right in pairwise(slip)
        if direction * (left[2] - target) < 0 <= direction * (right[2] - target)
    )
    h = mp.findroot(lambda h: _slip_step(x, v, h, belt, delta)[1] - target, (0, STEP), solver="illinois")
    return t + h, _slip_step(x, v, h, belt, delta)[0]


def _slip_step(x, v, h, belt, delta, order=60):
    """Taylor series of ``x'' = 1 / (1 + delta (belt - x')) - x`` over one step."""
    xs, vs, denominator, friction = [x], [v], [], []
    for k in range(order):
        denominator.append((1 + delta * belt if k == 0 else 0) - delta * vs[k])
        rest = mp.fdot(denominator[1:], friction[::-1])
        friction.append(((1 if k == 0 else 0) - rest) / denominator[0])
        xs.append(vs[k] / (k + 1))
        vs.append((friction[k] - xs[k]) / (k + 1))
    return mp.polyval(xs[::-1], h), mp.polyval(vs[::-1], h)


def saltation(angle="0.4") -> dict:
    """Saltation matrices in closed form."""
    with mp.workdps(DIGITS):
        c, s = mp.cos(mp.mpf(angle)), mp.sin(mp.mpf(angle))
        P = [[c * c, -c * s], [-c * s, s * s]]
        blocks = [[*P[0], 0, 0], [*P[1], 0, 0], [0, 0, *P[0]], [0, 0, *P[1]]]
        return {
            "constant_fields": [[1.0, 0.0], [2.0, 1.0]],
            "incline": {"angle": float(angle), "saltation": [[float(v) for v in row] for row in blocks]},
        }
