"""A wheel without a rim that rolls down a slope on its spokes: the simplest passive walking."""

from __future__ import annotations

from functools import partial

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition


def rimless_wheel() -> HybridSystem:
    r"""Point mass with massless spokes, ``2 alpha`` apart, on a slope ``gamma``; impacts are plastic.

    .. math::

        \ddot\theta = (g / l) \sin\theta, \qquad
        (\theta, \omega) \mapsto (\theta \mp 2 \alpha,\ \omega \cos 2 \alpha)
        \text{ at } \theta = \gamma \pm \alpha, \ \pm\omega > 0

    Returns
    -------
    HybridSystem
        State ``theta`` (angle of the stance spoke to the vertical, rad, downhill positive), ``omega``
        (rad/s); mode ``stance``; transitions ``step``, onto the next spoke downhill, and ``step back``.
        Parameters: ``g = 9.8`` m/s^2, spoke ``l = 1`` m, half angle between spokes ``alpha = pi / 8`` and
        slope ``gamma = 0.08``, in rad.
        Output: ``force`` along the spoke per mass (N/kg); where it is negative the spoke pulls.

    Notes
    -----
    - An impact conserves the angular momentum about the new foot: saltation
      ``[[c, 0], [(g / l) (sin(theta_plus) - c sin(theta_minus)) / omega_minus, c]]``, ``c = cos(2 alpha)``.
    - Between steps ``omega^2 + 2 (g / l) cos(theta)`` is constant. The speeds after steps obey
      ``omega^2 -> c^2 (omega^2 + 4 (g / l) sin(alpha) sin(gamma))``, with the fixed point
      ``cot(2 alpha) sqrt(4 (g / l) sin(alpha) sin(gamma))`` and the multipliers ``{1, c^2}``.
    - The wheel rolls if that speed carries it over the top, ``omega^2 > 2 (g / l) (1 - cos(gamma - alpha))``.
      A slower wheel rocks between two spokes: its steps back and forth accumulate, and it comes to rest.

    References
    ----------
    T. McGeer, "Passive dynamic walking", International Journal of Robotics Research 9(2), 62-82, 1990.
    doi:10.1177/027836499000900206

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import periodic_orbit
    >>> gait = periodic_orbit(models.rimless_wheel(), (0.0, 0.6), period=1.0)
    >>> np.abs(gait.multipliers).round(6)
    array([1. , 0.5])
    """
    onto_a_foot = {"both feet on the ground": _both_feet, "angular momentum about the new foot": _momentum}
    return HybridSystem(
        name="rimless wheel",
        state=("theta", "omega"),
        parameters={"g": 9.8, "l": 1.0, "alpha": np.pi / 8, "gamma": 0.08},
        units={
            "theta": "rad",
            "omega": "rad/s",
            "t": "s",
            "g": "m/s^2",
            "l": "m",
            "alpha": "rad",
            "gamma": "rad",
            "force": "N/kg",
        },
        modes=[Mode("stance", _stance)],
        transitions=[
            Transition(
                "stance",
                "stance",
                Guard(partial(_beyond_spoke, +1), direction=+1),
                Reset(partial(_onto, +1)),
                name="step",
            ),
            Transition(
                "stance",
                "stance",
                Guard(partial(_beyond_spoke, -1), direction=-1),
                Reset(partial(_onto, -1)),
                name="step back",
            ),
        ],
        outputs={"force": _push},
        laws=Laws(
            invariant={"angle to the next contact": _way},
            balance={"energy between steps": (_energy, _no_power)},
            across={"step": onto_a_foot, "step back": onto_a_foot},
        ),
    )


def _stance(t, x, p):
    return x.omega, p.g / p.l * np.sin(x.theta)


def _push(t, x, p):
    return p.g * np.cos(x.theta) - p.l * x.omega**2


def _beyond_spoke(side, t, x, p):
    return x.theta - p.gamma - side * p.alpha


def _onto(side, t, x, p):
    return p.gamma - side * p.alpha, np.cos(2 * p.alpha) * x.omega


def _way(t, x, p):
    return p.alpha - np.abs(x.theta - p.gamma)


def _energy(t, x, p):
    return x.omega**2 / 2 + p.g / p.l * np.cos(x.theta)


def _no_power(t, x, p):
    return 0.0


def _both_feet(t, minus, plus, p):
    return plus.theta - p.gamma + minus.theta - p.gamma


def _momentum(t, minus, plus, p):
    return plus.omega - np.cos(minus.theta - plus.theta) * minus.omega
