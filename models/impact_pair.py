"""A mass that rattles between the two walls of a shaken box."""

from __future__ import annotations

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition


def impact_pair() -> HybridSystem:
    r"""Free mass between rigid walls ``d`` apart in a box at ``A cos(w t)``, seen from the box.

    .. math::

        \ddot x = A w^2 \cos(w t), \quad |x| \le d / 2, \qquad v \mapsto -r\, v \text{ at } x = \pm d / 2

    Returns
    -------
    HybridSystem
        State ``x`` (displacement from the middle of the box), ``v`` (velocity relative to the box); mode
        ``flight``; transitions ``left``, ``right``; forcing period ``2 pi / w``. Dimensionless parameters:
        amplitude ``A = 1`` and frequency ``w = 1`` of the box, clearance ``d = 4``, restitution ``r = 0.8``.
        Output: ``energy``, as seen from the box.

    Notes
    -----
    - Symmetric orbits with two impacts per period cross the box at the absolute speed ``u`` and hit the right
      wall at the phase :math:`\varphi`:

      .. math::

          \left( \frac{\pi u / w - d}{2 A} \right)^2
          + \left( \frac{u}{A w} \frac{1 - r}{1 + r} \right)^2 = 1, \quad
          \cos \varphi = \frac{\pi u / w - d}{2 A}, \quad
          \sin \varphi = \frac{u}{A w} \frac{1 - r}{1 + r}

    - Their multipliers are the squares of two numbers with the product :math:`r^2` and the sum
      :math:`2 r - \pi A w (1 + r)^2 \cos(\varphi) / (2 u)`.
    - On any orbit the exponents (phase left out) sum to ``2 ln(r)`` times the impacts per unit time.
    - If impacts accumulate at a wall, the run ends: the mass would stay at the wall for a while.

    References
    ----------
    C. N. Bapat, N. Popplewell, K. McLachlan, "Stable periodic motions of an impact-pair", Journal of Sound
    and Vibration 87(1), 19-40, 1983.

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.impact_pair(), (0.0, 1.0), (0.0, 50.0))
    >>> sorted({jump.transition for jump in arc.jumps})
    ['left', 'right']
    """
    rebound = Reset(_rebound)
    return HybridSystem(
        name="impact pair",
        state=("x", "v"),
        parameters={"A": 1.0, "w": 1.0, "d": 4.0, "r": 0.8},
        modes=[Mode("flight", _flight)],
        transitions=[
            Transition("flight", "flight", Guard(_from_left, direction=-1), rebound, name="left"),
            Transition("flight", "flight", Guard(_from_right, direction=+1), rebound, name="right"),
        ],
        period=_forcing_period,
        outputs={"energy": _energy},
        laws=Laws(
            invariant={"distance to the walls": _gap},
            balance={"energy": ("energy", _power)},
            across={"left": {"restitution": _restitution}, "right": {"restitution": _restitution}},
        ),
    )


def _flight(t, x, p):
    return x.v, p.A * p.w**2 * np.cos(p.w * t)


def _from_left(t, x, p):
    return x.x + p.d / 2


def _from_right(t, x, p):
    return x.x - p.d / 2


def _rebound(t, x, p):
    return x.x, -p.r * x.v


def _forcing_period(p):
    return 2 * np.pi / p.w


def _gap(t, x, p):
    return p.d / 2 - np.abs(x.x)


def _energy(t, x, p):
    return x.v**2 / 2


def _power(t, x, p):
    return p.A * p.w**2 * np.cos(p.w * t) * x.v


def _restitution(t, minus, plus, p):
    return plus.v + p.r * minus.v
