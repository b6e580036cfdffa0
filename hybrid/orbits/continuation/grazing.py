"""What a grazing does to orbits nearby: the zero-time discontinuity map, and what Nordmark's map says."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.orbits.continuation.clearances import Key, extremum
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
    transition leads to another mode or moves the state, or the guard has no acceleration: the map has another
    leading order.

    A. B. Nordmark, "Non-periodic motion caused by grazing incidence in an impact oscillator", Journal of
    Sound and Vibration 145 (1991) 279; M. di Bernardo, C. Budd, A. Champneys, P. Kowalczyk, Piecewise-smooth
    Dynamical Systems, Springer 2008, section 6.2.
    """
    touch = _touch_of(orbit, key)
    if touch is None or not touch.stays or touch.kick is None:
        return None
    acceleration = abs(_acceleration(orbit, key, touch.share))
    return -touch.kick * np.sqrt(2.0 / acceleration) if acceleration > 0.0 else None


def kick(orbit: Pass, key: Key) -> np.ndarray | None:
    """``D_x R f + D_t R - f (n,)`` at a touch, what a jump does to a slow passage; None if nothing."""
    touch = _touch_of(orbit, key)
    return None if touch is None else touch.kick


@attrs.frozen(eq=False)
class _Touch:
    """The reset where its guard is touched.

    ``share`` is where in the stretch that is, ``kick (n,)`` what the reset does to a slow passage, None if it
    is nothing. ``stays`` says whether the mode and the state at the touch are as before.
    """

    share: float
    kick: np.ndarray | None
    stays: bool


def _touch_of(orbit: Pass, key: Key) -> _Touch | None:
    """The reset of a touched transition; None if it has none."""
    family, values = orbit.family, orbit.loop.values
    system = family.extended
    index = system.transition_index(key.name)
    transition = system.transitions[index]
    reset = reset_function(transition, system.variables)
    if reset is None:
        return None
    share = extremum(key, orbit)[0] % 1.0 if key.kind == "top" else 1.0
    t, x = moment(orbit, key.stretch, share)
    n, state, fixed = family.n, family.extended_state(x, values), system.parameter_values(family.fixed)
    rate = family.rate(transition.source, t, x, values)
    slopes = family.compiled.derivative(reset, index, t, state, fixed)[:n]
    after = family.compiled.value(reset, index, t, state, fixed)[:n]
    found = slopes[:, :n] @ rate + slopes[:, -1] - rate
    nothing = bool(np.all(np.abs(found) <= CONTINUOUS * np.abs(rate).max()))
    moved = bool(np.any(np.abs(after - x[:n]) > CONTINUOUS * orbit.scale))
    stays = transition.target == transition.source and not moved
    return _Touch(share, None if nothing else found, stays)


def _acceleration(orbit: Pass, key: Key, share: float) -> float:
    """The second derivative of the guard along the motion, at a share of a stretch."""
    family, i = orbit.family, key.stretch
    begin, end = orbit.loop.times[i : i + 2]
    shares = np.clip(share + WINDOW * np.linspace(-1.0, 1.0, SPEEDS), 0.0, 1.0)
    shares = np.linspace(shares[0], shares[-1], SPEEDS)
    mode, values = family.route[i].mode, orbit.loop.values
    speeds = [
        float(family.speed_terms(key.name, mode, *moment(orbit, i, float(each)), values).sum())
        for each in shares
    ]
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
