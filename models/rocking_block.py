"""A rigid block that rocks on shaking ground."""

from __future__ import annotations

from functools import partial

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition


def rocking_block() -> HybridSystem:
    r"""Rigid block that rocks about its two lower corners; the ground accelerates by ``A g cos(w t)``.

    .. math::

        \ddot \theta = -p^2 \left( \operatorname{sgn}(\theta) \sin(\alpha - |\theta|)
        + A \cos(w t) \cos(\alpha - |\theta|) \right), \qquad \omega \mapsto e\, \omega \text{ at } \theta = 0

    Returns
    -------
    HybridSystem
        State ``theta`` (tilt, rad), ``omega`` (angular velocity, rad/s); modes ``right`` (``theta > 0``,
        about the right corner) and ``left``; transitions ``impact left``, ``impact right`` onto these
        corners; forcing period ``2 pi / w``. Parameters: angle ``alpha = 0.25`` rad of a diagonal to a side;
        ``p = 2`` rad/s, ``p^2 = 3 g / (4 R)`` with half the diagonal ``R``; restitution ``e = 0.9``; ground
        acceleration ``A = 0``, in units of g, and frequency ``w = 2 pi`` rad/s.
        Output: ``energy`` per moment of inertia (1/s^2).

    Notes
    -----
    - A block that keeps its angular momentum about the new corner has :math:`e = 1 - 1.5 \sin^2 \alpha`:
      0.908 for the default ``alpha``.
    - Without forcing the block overturns if it moves outwards with :math:`|\theta| > \alpha`; no event marks
      this.
    - The amplitudes of free rocking obey
      :math:`\cos(\alpha - \theta_{k+1}) - \cos \alpha = e^2 (\cos(\alpha - \theta_k) - \cos \alpha)`, and a
      slender block takes :math:`\operatorname{arcosh}(1 / (1 - \theta_k / \alpha)) / p` from the largest tilt
      to the impact (Housner). So impacts accumulate, on the two corners in turn, and the run ends when the
      block comes to rest.
    - On any orbit the exponents (phase left out) sum to ``2 ln(e)`` times the impacts per unit time.

    References
    ----------
    G. W. Housner, "The behavior of inverted pendulum structures during earthquakes", Bulletin of the
    Seismological Society of America 53(2), 403-417, 1963. P. D. Spanos, A.-S. Koh, "Rocking of rigid blocks
    due to harmonic shaking", Journal of Engineering Mechanics 110(11), 1627-1642, 1984.
    doi:10.1061/(ASCE)0733-9399(1984)110:11(1627)

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.rocking_block(), (0.1, 0.0), (0.0, 3.0))
    >>> first = arc.jumps[0]
    >>> bool(np.isclose(first.x_plus[1], 0.9 * first.x_minus[1]))
    True
    """
    loss = Reset(_impact)
    return HybridSystem(
        name="rocking block",
        state=("theta", "omega"),
        parameters={"alpha": 0.25, "p": 2.0, "e": 0.9, "A": 0.0, "w": 2 * np.pi},
        units={
            "theta": "rad",
            "omega": "rad/s",
            "t": "s",
            "alpha": "rad",
            "p": "rad/s",
            "w": "rad/s",
            "energy": "1/s^2",
        },
        modes=[Mode("right", partial(_about, +1)), Mode("left", partial(_about, -1))],
        transitions=[
            Transition("right", "left", Guard(_tilt, direction=-1), loss, name="impact left"),
            Transition("left", "right", Guard(_tilt, direction=+1), loss, name="impact right"),
        ],
        period=_forcing_period,
        outputs={"energy": _energy},
        laws=Laws(
            invariant={"right": {"tilt to the right": _tilt}, "left": {"tilt to the left": _tilt_left}},
            balance={"energy": ("energy", _power)},
            across={
                "impact left": {"restitution": _restitution},
                "impact right": {"restitution": _restitution},
            },
        ),
    )


def _about(side, t, x, p):
    angle = p.alpha - side * x.theta
    return x.omega, -(p.p**2) * (side * np.sin(angle) + p.A * np.cos(p.w * t) * np.cos(angle))


def _tilt(t, x, p):
    return x.theta


def _impact(t, x, p):
    return 0.0, p.e * x.omega


def _forcing_period(p):
    return 2 * np.pi / p.w


def _tilt_left(t, x, p):
    return -x.theta


def _energy(t, x, p):
    return x.omega**2 / 2 + p.p**2 * np.cos(p.alpha - np.abs(x.theta))


def _power(t, x, p):
    return -(p.p**2) * p.A * np.cos(p.w * t) * np.cos(p.alpha - np.abs(x.theta)) * x.omega


def _restitution(t, minus, plus, p):
    return plus.omega - p.e * minus.omega
