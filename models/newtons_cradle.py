"""Newton's cradle: pendulums in a row whose balls touch, or hang a small gap apart."""

from __future__ import annotations

from functools import partial

import numpy as np

from hybrid import Contact, HybridSystem, Laws, arguments, mechanics


def newtons_cradle(balls: int = 3, impacts: str = "newton") -> HybridSystem:
    r"""Newton's cradle: equal balls on pendulums of equal length, for small swings.

    .. math::

        \ddot x_i = -w^2 x_i, \qquad x_{i+1} - x_i + d \ge 0

    Parameters
    ----------
    balls
        Their number, 2 or more.
    impacts
        The law of impacts of several balls at once, as for `hybrid.mechanics`: ``"newton"``, ``"poisson"`` or
        ``"sequential"``.

    Returns
    -------
    HybridSystem
        State ``x1``, ``x2``, ... (displacements, m) and ``v1``, ``v2``, ... (m/s); contacts ``1-2``, ``2-3``
        and so on. Parameters: ``w = 2 pi`` rad/s, restitution ``e = 1``, and the gap ``d = 1e-10`` m between
        balls at rest. Balls no more than 1e-9 m apart take part in each other's impacts. Keep ``d`` above 0:
        balls that touch exactly and swing alike neither press nor part, and runs end with ``STUCK``.
        Output: ``energy`` per mass of a ball (J/kg).

    Notes
    -----
    Let the first ball arrive at the bottom with speed 1, the others at rest.

    - With ``d`` above 1e-9 the balls hit one after another, each hands its speed on, and the last one flies.
      By ``impacts="sequential"`` touching balls do the same.
    - Where all ``n`` touch, all impulses act at once. By Newton's law the first ball leaves at
      ``2 / n - 1`` and the others together at ``2 / n``: momentum and energy are kept, and of the
      many outcomes that keep them the law picks this one. Half a swing later they meet again, and the first
      ball flies as it came: the period is ``2 pi / w``.
    - With restitution ``e`` the speeds are ``(1 + e) / n - e`` and ``(1 + e) / n``. The balls end swinging
      together, with ``1 / n`` of the momentum each.

    References
    ----------
    F. Herrmann, M. Seitz, "How does the ball-chain work?", American Journal of Physics 50(11), 977-981, 1982.
    doi:10.1119/1.12936. C. Glocker, Set-Valued Force Laws, Springer, 2001.
    doi:10.1007/978-3-540-44479-4

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import simulate
    >>> pulled = (-0.1, 0.0, 0.0, 0.0, 0.0, 0.0)
    >>> touching = simulate(models.newtons_cradle(), pulled, (0.0, 0.4))
    >>> apart = simulate(models.newtons_cradle(), pulled, (0.0, 0.4), parameters={"d": 1e-6})
    >>> speed = 0.1 * 2 * np.pi
    >>> bool(np.allclose(touching.jumps[0].x_plus[3:] / speed, [-1 / 3, 2 / 3, 2 / 3]))
    True
    >>> bool(np.allclose(apart.jumps[-1].x_plus[3:] / speed, [0.0, 0.0, 1.0], atol=1e-4))
    True
    """
    number = arguments.count("balls", balls, 2)
    places, rates = ([f"{each}{i + 1}" for i in range(number)] for each in "xv")
    return mechanics(
        name="Newton's cradle",
        coordinates=places,
        velocities=rates,
        parameters={"w": 2 * np.pi, "e": 1.0, "d": 1e-10},
        units={
            **dict.fromkeys(places, "m"),
            **dict.fromkeys(rates, "m/s"),
            **{"t": "s", "w": "rad/s", "d": "m", "energy": "J/kg"},
        },
        mass=partial(_mass, number),
        forces=partial(_forces, number),
        contacts=[
            Contact(f"{i + 1}-{i + 2}", gap=partial(_gap, i), restitution="e") for i in range(number - 1)
        ],
        impacts=impacts,
        outputs={"energy": partial(_energy, number)},
        laws=Laws(dissipated={"energy": "energy"}),
    )


def _mass(balls, t, x, p):
    return (1.0,) * balls


def _forces(balls, t, x, p):
    return tuple(-(p.w**2) * x[i] for i in range(balls))


def _gap(i, t, x, p):
    return x[i + 1] - x[i] + p.d


def _energy(balls, t, x, p):
    return sum((x[balls + i] ** 2 + (p.w * x[i]) ** 2) / 2 for i in range(balls))
