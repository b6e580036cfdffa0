"""A rigid block on shaking ground, which rocks on its two lower corners, slides and lifts off."""

from __future__ import annotations

from functools import partial

import numpy as np

from hybrid import Contact, HybridSystem, Laws, mechanics

# The corners, by the sides of the centre on which they are.
LEFT, RIGHT = -1.0, 1.0


def rocking_block() -> HybridSystem:
    r"""Rigid block with two corners and dry friction, on ground that accelerates by ``A g cos(w t)``.

    In the frame of the ground the centre of mass is at ``(x, y)``, and :math:`\theta` is the tilt to the
    left. In flight their accelerations are :math:`-A g \cos(w t)`, :math:`-g` and 0. Per mass, the moment of
    inertia is ``R^2 / 3``. The gaps of the right and the left corner, and their slips, are

    .. math::

        y - R \cos(\alpha \pm \theta), \qquad u + R \cos(\alpha \pm \theta)\, \omega.

    While a corner sticks, the block turns about it by Housner's equation, and where the other corner hits it
    keeps its angular momentum about that one:

    .. math::

        \ddot \theta = -p^2 \left( \operatorname{sgn}(\theta) \sin(\alpha - |\theta|)
        - A \cos(w t) \cos(\alpha - |\theta|) \right), \qquad
        \omega \mapsto \left(1 - \tfrac{3}{2} \sin^2 \alpha\right) \omega.

    Returns
    -------
    HybridSystem
        State ``x``, ``y`` (centre of mass, m), ``theta`` (rad) and their rates ``u``, ``v`` (m/s),
        ``omega`` (rad/s); contacts ``left`` and ``right``; forcing period ``2 pi / w``. Parameters: half the
        diagonal ``R = 1`` m, its angle ``alpha = 0.25`` rad to a side, ``g = 9.81`` m/s^2, friction
        ``mu = 1``, restitution ``e = 0``; ground acceleration ``A = 0``, in units of g, and frequency
        ``w = 2 pi`` rad/s. Forces and the output ``energy`` are per mass (N/kg, J/kg).

    Notes
    -----
    With :math:`p^2 = 3 g / (4 R)`:

    - A block with both corners on the ground stays there for :math:`A \le \tan \alpha` and
      :math:`A \le \mu`. It begins to rock where the acceleration passes :math:`g \tan \alpha`, or to slide
      where it passes :math:`\mu g`, if that is less.
    - From rest at the tilt :math:`\theta_0` a slender block takes
      :math:`\operatorname{arcosh}(1 / (1 - \theta_0 / \alpha)) / p` to its impact, a quarter of a period.
    - Without forcing each impact leaves the factor squared of the energy, which gives the next amplitude:
      :math:`\cos(\alpha - \theta_{k+1}) - \cos \alpha
      = (1 - \frac{3}{2} \sin^2 \alpha)^2 (\cos(\alpha - \theta_k) - \cos \alpha)`. Impacts accumulate, and
      the block comes to rest on both corners.
    - It overturns if it is released beyond :math:`|\theta| = \alpha`; a face is no contact, so nothing stops
      it then.

    A start that stands on a corner has ``y = R cos(alpha - abs(theta))``.

    References
    ----------
    G. W. Housner, "The behavior of inverted pendulum structures during earthquakes", Bulletin of the
    Seismological Society of America 53(2), 403-417, 1963, equations (3) to (10). P. D. Spanos, A.-S. Koh,
    "Rocking of rigid blocks due to harmonic shaking", Journal of Engineering Mechanics 110(11), 1627-1642,
    1984. doi:10.1061/(ASCE)0733-9399(1984)110:11(1627)

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import simulate
    >>> tilted = (0.0, np.cos(0.25 - 0.1), 0.1, 0.0, 0.0, 0.0)
    >>> arc = simulate(models.rocking_block(), tilted, (0.0, 1.0))
    >>> first = arc.jumps["right"][0]
    >>> bool(np.isclose(first.x_plus[5], (1 - 1.5 * np.sin(0.25) ** 2) * first.x_minus[5]))
    True
    """
    return mechanics(
        name="rocking block",
        coordinates=("x", "y", "theta"),
        velocities=("u", "v", "omega"),
        parameters={"R": 1.0, "alpha": 0.25, "g": 9.81, "mu": 1.0, "e": 0.0, "A": 0.0, "w": 2 * np.pi},
        units={
            **{"x": "m", "y": "m", "theta": "rad", "u": "m/s", "v": "m/s", "omega": "rad/s", "t": "s"},
            **{"R": "m", "alpha": "rad", "g": "m/s^2", "w": "rad/s", "energy": "J/kg"},
        },
        mass=_mass,
        forces=_forces,
        contacts=[_corner("left", LEFT), _corner("right", RIGHT)],
        period=_forcing_period,
        cyclic=("x",),
        outputs={"energy": _energy},
        laws=Laws(dissipated={"energy": ("energy", _power)}),
    )


def _corner(name, side):
    return Contact(name, gap=partial(_gap, side), restitution="e", friction="mu", slip=partial(_slip, side))


def _gap(side, t, x, p):
    return x.y - p.R * np.cos(p.alpha + side * x.theta)


def _slip(side, t, x, p):
    return x.u + p.R * np.cos(p.alpha + side * x.theta) * x.omega


def _mass(t, x, p):
    return 1.0, 1.0, p.R**2 / 3


def _forces(t, x, p):
    return -p.A * p.g * np.cos(p.w * t), -p.g, 0.0


def _forcing_period(p):
    return 2 * np.pi / p.w


def _energy(t, x, p):
    return (x.u**2 + x.v**2 + (p.R * x.omega) ** 2 / 3) / 2 + p.g * x.y


def _power(t, x, p):
    return -p.A * p.g * np.cos(p.w * t) * x.u
