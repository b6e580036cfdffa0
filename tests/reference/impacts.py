"""Impact oscillator and bouncing ball: flight in closed form, impacts by root finding at forty digits."""

from __future__ import annotations

import mpmath as mp

# k, c, A, w, d, r, n; the first is the published reference case, the others cover light and strong damping,
# a stop at the rest position, and two forcing periods per impact.
PARAMETER_SETS = [
    ((1.0, 0.1, 1.0, 1.0, 1.0, 0.8, 1), (1.7, 0.08)),
    ((1.0, 0.05, 1.0, 1.3, 0.5, 0.7, 1), None),
    ((4.0, 0.3, 2.0, 3.0, 0.2, 0.5, 1), None),
    ((1.0, 0.2, 1.0, 1.8, 0.0, 0.6, 1), None),
    ((1.0, 0.02, 1.0, 3.9, 0.05, 0.85, 2), None),
]


def impact_oscillator() -> dict:
    """Orbits with one impact, and twenty and two hundred impacts from a start at rest."""
    with mp.workdps(40):
        orbits = []
        for values, guess in PARAMETER_SETS:
            oscillator = ImpactOscillator(*values)
            for V, theta in oscillator.one_impact_orbits(guess):
                parameters = dict(zip(("k", "c", "A", "w", "d", "r", "n"), values, strict=True))
                pairs = [[float(m.real), float(m.imag)] for m in oscillator.multipliers(V, theta)]
                orbits.append(parameters | {"V": float(V), "theta": float(theta), "multipliers": pairs})
        oscillator = ImpactOscillator(*PARAMETER_SETS[0][0])
        return {
            "orbits": orbits,
            "flight": oscillator.impacts((0, 0), 20),
            "long_flight": oscillator.impacts((0, 0), 200),
        }


class ImpactOscillator:
    """``x'' + c x' + k x = A cos(w t)``, ``x <= d``, ``v -> -r v``."""

    def __init__(self, k, c, A, w, d, r, n=1):
        self.k, self.c, self.A, self.w, self.d, self.r, self.n = map(mp.mpf, (k, c, A, w, d, r, n))
        self.w_d = mp.sqrt(self.k - self.c**2 / 4)
        self.response = self.A / (self.k - self.w**2 + 1j * self.c * self.w)

    def flight(self, x, v, t0):
        """Free flight from ``(x, v)`` at ``t0``: a function of time that returns ``(x, v)``."""
        forced = lambda t: self.response * mp.expj(self.w * t)  # noqa: E731
        a = x - forced(t0).real
        b = (v - (1j * self.w * forced(t0)).real + self.c / 2 * a) / self.w_d

        def state(t):
            decay = mp.exp(-self.c * (t - t0) / 2)
            cos, sin = mp.cos(self.w_d * (t - t0)), mp.sin(self.w_d * (t - t0))
            free = decay * (a * cos + b * sin)
            free_v = decay * self.w_d * (b * cos - a * sin) - self.c / 2 * free
            return free + forced(t).real, free_v + (1j * self.w * forced(t)).real

        return state

    def next_impact(self, state, t0):
        """First time after ``t0`` at which ``x`` rises through ``d``."""
        gap = lambda t: state(t)[0] - self.d  # noqa: E731
        step = 2 * mp.pi / self.w / 400
        left = t0 + step / 1000
        while not gap(left) < 0 <= gap(left + step):
            left += step
        return mp.findroot(gap, (left, left + step), solver="illinois", tol=mp.mpf(10) ** -70)

    def impacts(self, start, count):
        """Times, speeds before and states after each of ``count`` impacts."""
        t, (x, v), t_events, v_minus = mp.mpf(0), map(mp.mpf, start), [], []
        for _ in range(count):
            state = self.flight(x, v, t)
            t = self.next_impact(state, t)
            v_minus.append(state(t)[1])
            t_events.append(t)
            x, v = self.d, -self.r * v_minus[-1]
        t_end = mp.ceil(t) + 1
        state = self.flight(x, v, t)
        assert self.next_impact(state, t) > t_end, "an impact before the end would be missed"
        return {
            "x0": list(start),
            "t": [float(s) for s in t_events],
            "v_minus": [float(s) for s in v_minus],
            "t_end": float(t_end),
            "x_end": [float(s) for s in state(t_end)],
        }

    def one_impact_orbits(self, guess=None):
        """``(V, theta)`` of every orbit that closes after one impact, found by Newton from a grid."""
        T = 2 * mp.pi * self.n / self.w

        def closing(V, theta):
            x, v = self.flight(self.d, -self.r * V, theta / self.w)(theta / self.w + T)
            return x - self.d, v - V

        scale = abs(self.response) * self.w + self.d
        grid = [(scale * a, b) for a in (0.3, 1, 2, 4) for b in (-2.5, -1, 0, 1, 2.5)]
        found = []
        for start in [guess] if guess else grid:
            try:
                V, theta = mp.findroot(closing, start, tol=1e-60)
            except (ValueError, ZeroDivisionError):
                continue
            theta = mp.arg(mp.expj(theta))
            new = all(abs(V - other) + abs(theta - angle) > 1e-9 for other, angle in found)
            if V > 0 and new and self.stays_free(V, theta, T):
                found.append((V, theta))
        return sorted(found, reverse=True)

    def stays_free(self, V, theta, T):
        """Whether the orbit's flight does not reach the stop early."""
        t0 = theta / self.w
        state = self.flight(self.d, -self.r * V, t0)
        return all(state(t0 + T * i / 2000)[0] < self.d for i in range(1, 2000))

    def multipliers(self, V, theta):
        """Multipliers by central differences of the map to the next impact, without saltation matrices."""
        T, step = 2 * mp.pi * self.n / self.w, mp.mpf(10) ** -13

        def impact_map(V, theta):
            t0 = theta / self.w
            state = self.flight(self.d, -self.r * V, t0)
            gap = lambda t: state(t)[0] - self.d  # noqa: E731
            t = mp.findroot(gap, (t0 + T * (1 - mp.mpf("1e-9")), t0 + T), tol=mp.mpf(10) ** -70)
            return mp.matrix([state(t)[1], self.w * t])

        dV = (impact_map(V + step, theta) - impact_map(V - step, theta)) / (2 * step)
        dtheta = (impact_map(V, theta + step) - impact_map(V, theta - step)) / (2 * step)
        values, _ = mp.eig(mp.matrix([[dV[0], dtheta[0]], [dV[1], dtheta[1]]]))
        return sorted((mp.mpc(m) for m in values), key=lambda m: (-round(float(abs(m)), 12), m.imag))


def bouncing_ball(h="1", g="9.81", e="0.8", count=20) -> dict:
    """Impacts of a ball dropped from rest at height ``h``."""
    with mp.workdps(40):
        h, g, e = mp.mpf(h), mp.mpf(g), mp.mpf(e)
        fall = mp.sqrt(2 * h / g)
        times = [fall * (1 + 2 * sum(e**i for i in range(1, k))) for k in range(1, count + 1)]
        speeds = [g * fall * e ** (k - 1) for k in range(1, count + 1)]
        return {
            "x0": [float(h), 0.0],
            "parameters": {"g": float(g), "e": float(e)},
            "t": [float(t) for t in times],
            "v_minus": [-float(v) for v in speeds],
            "saltation": [[[-float(e), 0.0], [float(g * (1 + e) / v), -float(e)]] for v in speeds],
            "accumulation": float(fall * (1 + e) / (1 - e)),
        }
