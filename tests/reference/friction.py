"""The forced oscillator with dry friction: symmetric motions with no or two stops per period."""

from __future__ import annotations

from itertools import pairwise

import mpmath as mp

DIGITS = 40


def dry_friction_oscillator() -> dict:
    """``x'' + x + f sgn(x') = cos(w t)``: each slip in closed form, multipliers from half a period."""
    with mp.workdps(DIGITS):
        return {
            "without stops": [
                _without_stops(f, w) for f, w in (("0.5", "0.8"), ("0.3", "1.3"), ("0.1", "0.6"))
            ],
            "two stops": [_two_stops(f, w) for f, w in (("0.7", "0.5"), ("0.8", "0.4"))],
        }


def _without_stops(f, w):
    """From a turning point at ``X``, with forcing phase ``phi``, to the one at ``-X`` half a period later.

    ``x = f + C cos(s) + D sin(s) + p cos(w s) - q sin(w s)``; the four ends are linear in ``C, D, X, q`` and
    ``p``, and ``p^2 + q^2`` is the square of the forced response.
    """
    f, w = mp.mpf(f), mp.mpf(w)
    T = mp.pi / w
    ends = mp.matrix(
        [[1, 0, -1, 0], [0, 1, 0, -w], [mp.cos(T), mp.sin(T), 1, 0], [-mp.sin(T), mp.cos(T), 0, w]]
    )
    constant = mp.lu_solve(ends, mp.matrix([-f, 0, -f, 0]))
    slope = mp.lu_solve(ends, mp.matrix([-1, 0, 1, 0]))
    response = 1 / (1 - w**2)
    square = [slope[3] ** 2 + 1, 2 * slope[3] * constant[3], constant[3] ** 2 - response**2]
    roots = mp.polyroots(square, extraprec=200)
    p = max(roots, key=lambda p: constant[2] + slope[2] * p)
    C, D, X, q = constant + slope * p
    position = lambda s: f + C * mp.cos(s) + D * mp.sin(s) + p * mp.cos(w * s) - q * mp.sin(w * s)  # noqa: E731
    assert all(mp.diff(position, T * k / 200) < 0 for k in range(1, 200))
    forcing = p / response
    after, before = forcing - X + f, forcing - X - f
    half = mp.matrix([[mp.cos(T), mp.sin(T)], [-mp.sin(T), mp.cos(T)]]) * mp.diag([1, after / before])
    multipliers, _ = mp.eig(half * half)
    middle = T / 2
    return {
        "f": float(f),
        "w": float(w),
        "amplitude": float(X),
        "t0": float((mp.atan2(q / response, p / response) / w + middle) % (2 * T)),
        "x0": [float(position(middle)), float(mp.diff(position, middle))],
        "multipliers": [[float(mp.re(m)), float(mp.im(m))] for m in multipliers],
    }


def _two_stops(f, w):
    """From the release at ``X``, where ``cos(w t) = X - f``, to the stop at ``-X``."""
    f, w = mp.mpf(f), mp.mpf(w)
    response = 1 / (1 - w**2)

    def slip(X):
        """Times of release and stop, and the position of the stop."""
        release = mp.acos(X - f) / w
        a, b = X - f - response * mp.cos(w * release), response * w * mp.sin(w * release)
        rest = lambda t: a * mp.cos(t - release) + b * mp.sin(t - release)  # noqa: E731
        position = lambda t: f + rest(t) + response * mp.cos(w * t)  # noqa: E731
        velocity = lambda t: rest(t + mp.pi / 2) - response * w * mp.sin(w * t)  # noqa: E731
        # The velocity has a double zero at the release.
        grid = [release + mp.mpf(k) / 20 for k in range(2, 400)]
        pair = next((s, t) for s, t in pairwise(grid) if velocity(s) < 0 <= velocity(t))
        stop = mp.findroot(velocity, pair, solver="anderson", tol=mp.mpf(10) ** -70)
        return release, stop, position(stop)

    X = mp.findroot(lambda X: slip(X)[2] + X, (mp.mpf("1.1"), mp.mpf("1.0")), tol=mp.mpf(10) ** -60)
    release, stop, end = slip(X)
    assert abs(mp.cos(w * stop) - end) < f
    half = -mp.diff(lambda X: slip(X)[2], X, h=mp.mpf("1e-14"))
    return {
        "f": float(f),
        "w": float(w),
        "amplitude": float(X),
        "release": float(release),
        "stop": float(stop),
        "multipliers": [float(half**2), 0.0],
    }
