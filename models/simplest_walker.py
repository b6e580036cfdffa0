"""Two straight legs that walk down a slope without power: the simplest walking model."""

from __future__ import annotations

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition


def simplest_walker() -> HybridSystem:
    r"""Point mass on two massless legs with feet of vanishing mass, walking down a slope ``gamma``.

    .. math::

        \ddot\theta &= \sin(\theta - \gamma) \\
        \ddot\phi &= \ddot\theta + \dot\theta^2 \sin\phi - \cos(\theta - \gamma) \sin\phi

    and at heelstrike, ``phi = 2 theta``, the legs exchange their roles:

    .. math::

        \theta \mapsto -\theta, \quad \dot\theta \mapsto \cos(2 \theta)\, \dot\theta, \quad
        \phi \mapsto -2 \theta, \quad \dot\phi \mapsto \cos(2 \theta) (1 - \cos(2 \theta))\, \dot\theta

    Returns
    -------
    HybridSystem
        State ``theta`` (angle of the stance leg to the slope's normal, rad, uphill positive), ``phi`` (angle
        between the legs, rad) and the rates ``dtheta``, ``dphi``; modes ``behind`` and ``ahead``, named after
        the position of the swing foot; transitions ``passing`` and ``heelstrike``. Parameter: the slope
        ``gamma = 0.009`` rad. Time is in units of ``sqrt(l / g)``.
        Outputs: ``energy``, and ``force`` of the stance leg, in units of the weight.

    Notes
    -----
    - The swing foot meets the ground twice per step: where ``phi - 2 theta`` falls through zero near
      mid-stance, and where it rises. As in the paper, the first contact is ignored (no foot scuffing).
    - At ``gamma = 0.009`` there are two gaits of period one. The long gait is stable: after heelstrike
      ``theta = 0.200310900544``, ``dtheta = -0.199832473005``; multipliers
      ``{1, -0.190099841066 +- 0.557598776682i, 0}``. The short gait is unstable: ``theta = 0.193937369810``,
      ``dtheta = -0.203866927442``; multipliers ``{4.003864358930, 1, 0.459589589798, 0}``.
    - The long gait is stable for slopes below 0.015, then doubles its period repeatedly and becomes chaotic.
      Above about ``gamma = 0.019`` the walker falls. From most starts it falls at any slope. The model has no
      ground for the hip, so the run is meaningless after a fall.

    References
    ----------
    M. Garcia, A. Chatterjee, A. Ruina, M. Coleman, "The simplest walking model: stability, complexity, and
    scaling", Journal of Biomechanical Engineering 120(2), 281-288, 1998, equations 1 to 4.
    doi:10.1115/1.2798313

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import periodic_orbit
    >>> start = (0.2003, 0.4006, -0.1998, -0.0158)
    >>> gait = periodic_orbit(models.simplest_walker(), start, mode="behind", period=3.9)
    >>> np.abs(gait.multipliers[:3]).round(4)
    array([1.    , 0.5891, 0.5891])
    """
    return HybridSystem(
        name="simplest walker",
        state=("theta", "phi", "dtheta", "dphi"),
        parameters={"gamma": 0.009},
        modes=[Mode("behind", _swing), Mode("ahead", _swing)],
        transitions=[
            Transition("behind", "ahead", Guard(_height, direction=-1), name="passing"),
            Transition("ahead", "behind", Guard(_height, direction=+1), Reset(_exchange), name="heelstrike"),
        ],
        outputs={"energy": _energy, "force": _push},
        laws=Laws(
            invariant={"behind": {"swing foot behind": _height}, "ahead": {"swing foot ahead": _depth}},
            balance={"energy between steps": ("energy", _no_power)},
            continuous=("passing",),
            across={
                "heelstrike": {
                    "both feet on the ground": _both_feet,
                    "angular momentum about the new foot": _momentum,
                    "angular momentum of the swing leg": _swing_momentum,
                }
            },
        ),
    )


def _swing(t, x, p):
    turn = np.sin(x.theta - p.gamma)
    return x.dtheta, x.dphi, turn, turn + (x.dtheta**2 - np.cos(x.theta - p.gamma)) * np.sin(x.phi)


def _push(t, x, p):
    return np.cos(x.theta - p.gamma) - x.dtheta**2


def _height(t, x, p):
    return x.phi - 2 * x.theta


def _exchange(t, x, p):
    c = np.cos(2 * x.theta)
    return -x.theta, -2 * x.theta, c * x.dtheta, c * (1 - c) * x.dtheta


def _depth(t, x, p):
    return -_height(t, x, p)


def _energy(t, x, p):
    return x.dtheta**2 / 2 + np.cos(x.theta - p.gamma)


def _no_power(t, x, p):
    return 0.0


def _both_feet(t, minus, plus, p):
    return plus.theta + minus.theta, plus.phi + minus.phi


def _momentum(t, minus, plus, p):
    return plus.dtheta - np.cos(minus.phi) * minus.dtheta


def _swing_momentum(t, minus, plus, p):
    # The foot that leaves the ground was at rest: across its leg it still is, since the leg has no mass.
    return plus.dtheta - plus.dphi - np.cos(plus.phi) * plus.dtheta
