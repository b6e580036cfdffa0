"""What a grazing does to orbits nearby: the zero-time discontinuity map, and what Nordmark's map says."""

from __future__ import annotations

import numpy as np

from hybrid.orbits.continuation.measures import Key, extremum
from hybrid.orbits.continuation.passing import Pass
from hybrid.orbits.continuation.place import moment
from hybrid.system.functions import reset_function

# The guard's acceleration is the slope of its speed over this share of the stretch, by a polynomial.
WINDOW = 1e-3
SPEEDS = 5
# A reset that moves the state by less than this share of its size where the guard has no speed is continuous.
CONTINUOUS = 1e-6


def square_root_coefficient(orbit: Pass, key: Key) -> np.ndarray | None:
    """The vector ``C (n,)`` of the zero-time discontinuity map ``x -> x + C sqrt(H)``.

    ``x`` is where an orbit nearby would be farthest beyond the guard without the jump, by ``H > 0``. It comes
    to the guard with the speed ``sqrt(2 a H)``, ``a`` being the guard's acceleration, and jumps there: with
    the field ``f`` and the reset ``R``, ``C = -(D_x R f + D_t R - f) sqrt(2 / a)``. None where the touched
    transition leads to another mode or moves the state: the map has another leading order.

    A. B. Nordmark, "Non-periodic motion caused by grazing incidence in an impact oscillator", Journal of
    Sound and Vibration 145 (1991) 279; M. di Bernardo, C. Budd, A. Champneys, P. Kowalczyk, Piecewise-smooth
    Dynamical Systems, Springer 2008, section 6.2.
    """
    system, share = orbit.family.system, share_of_touch(orbit, key)
    transition = system.transitions[system.transition_index(key.name)]
    t, x = moment(orbit, key.stretch, share)
    found = kick(orbit, key)
    if transition.target != transition.source or found is None or _jumps(orbit, key, t, x):
        return None
    return -found * np.sqrt(2.0 / abs(_acceleration(orbit, key, share)))


def share_of_touch(orbit: Pass, key: Key) -> float:
    """Where in its stretch a guard is touched: at an extremum, or at the end."""
    return extremum(key, orbit)[0] % 1.0 if key.kind == "top" else 1.0


def kick(orbit: Pass, key: Key) -> np.ndarray | None:
    """``D_x R f + D_t R - f (n,)`` at a touch, what a jump does to a slow passage; None without a reset."""
    family, n = orbit.family, orbit.loop.x.shape[1]
    system = family.extended
    index = system.transition_index(key.name)
    reset = reset_function(system.transitions[index], system.state)
    if reset is None:
        return None
    t, x = moment(orbit, key.stretch, share_of_touch(orbit, key))
    rate = family.rate(system.transitions[index].source, t, x, orbit.loop.values)
    fixed = system.parameter_values(family.fixed)
    slopes = family.compiled.derivative(reset, index, t, np.append(x, orbit.loop.values), fixed)[:n]
    found = slopes[:, :n] @ rate + slopes[:, -1] - rate
    return None if np.all(np.abs(found) <= CONTINUOUS * np.abs(rate).max()) else found


def _jumps(orbit: Pass, key: Key, t: float, x: np.ndarray) -> bool:
    """Whether the reset moves the state at a touch."""
    family, system = orbit.family, orbit.family.extended
    index = system.transition_index(key.name)
    reset = reset_function(system.transitions[index], system.state)
    assert reset is not None
    fixed = system.parameter_values(family.fixed)
    after = family.compiled.value(reset, index, t, np.append(x, orbit.loop.values), fixed)
    return bool(np.any(np.abs(after[: len(x)] - x) > CONTINUOUS * orbit.scale))


def _acceleration(orbit: Pass, key: Key, share: float) -> float:
    """The second derivative of the guard along the motion, at a share of a stretch."""
    family, i = orbit.family, key.stretch
    begin, end = orbit.loop.times[i : i + 2]
    shares = np.clip(share + WINDOW * np.linspace(-1.0, 1.0, SPEEDS), 0.0, 1.0)
    shares = np.linspace(shares[0], shares[-1], SPEEDS)
    speeds = []
    for each in shares:
        t, x = moment(orbit, i, float(each))
        *slope, own = family.gradient(key.name, t, x, orbit.loop.values)
        rate = family.rate(family.route[i].mode, t, x, orbit.loop.values)
        speeds.append(float(np.array(slope) @ rate + own))
    fitted = np.polynomial.Polynomial.fit(shares, speeds, SPEEDS - 1)
    return float(fitted.deriv()(share) / (end - begin))


def what_follows(multipliers: np.ndarray) -> str:
    """What Nordmark's map leaves of an orbit beyond its grazing; empty if it does not say.

    W. Chin, E. Ott, H. E. Nusse, C. Grebogi, "Grazing bifurcations in impact oscillators", Physical Review E
    50 (1994) 4427: the largest multiplier decides, if both are real, positive and less than 1.
    """
    if len(multipliers) != 2 or np.any(multipliers.imag != 0.0):
        return ""
    largest, least = multipliers.real
    if not 0.0 < least <= largest < 1.0:
        return ""
    if largest > 2.0 / 3.0:
        return "chaos at once"
    if largest > 0.25:
        return "windows of periodic orbits between chaos"
    return "a cascade of periodic orbits, each with one more pass"
