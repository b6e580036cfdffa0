"""A harmonically forced linear oscillator that hits one rigid stop."""

from __future__ import annotations

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition


def impact_oscillator() -> HybridSystem:
    r"""Forced linear oscillator of unit mass with a rigid stop at ``x = d``.

    .. math::

        \ddot x + c\, \dot x + k\, x = A \cos(w t), \quad x \le d, \qquad v \mapsto -r\, v \text{ at } x = d

    Returns
    -------
    HybridSystem
        State ``x`` (displacement), ``v`` (velocity); mode ``flight``; transition ``impact``; forcing
        period ``2 pi / w``. Dimensionless parameters: stiffness ``k = 1``, damping ``c = 0.1``, forcing
        amplitude ``A = 1`` and frequency ``w = 1``, stop ``d = 1``, restitution ``r = 0.8``.
        Output: ``energy``.

    Notes
    -----
    - With the defaults one orbit with one impact per period is stable;
      :func:`models.one_impact.one_impact_orbits` finds it.
    - On any orbit the exponents (phase left out) sum to ``-c + 2 ln(r)`` times the impacts per unit time,
      since the flow contracts areas by ``exp(-c t)`` and an impact by ``r^2``.
    - The map is not differentiable where an orbit grazes the stop: its derivative grows like the inverse
      square root of the distance (Nordmark 1991, doi:10.1016/0022-460X(91)90592-8).

    References
    ----------
    S. W. Shaw, P. J. Holmes, "A periodically forced piecewise linear oscillator", Journal of Sound and
    Vibration 90(1), 129-155, 1983. doi:10.1016/0022-460X(83)90407-8

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import periodic_orbit
    >>> from models.one_impact import one_impact_orbits
    >>> system = models.impact_oscillator()
    >>> orbit = periodic_orbit(system, (0.9, 1.0))
    >>> (exact, *_) = one_impact_orbits(**system.parameters)
    >>> bool(np.allclose(np.abs(orbit.multipliers), np.abs(exact.multipliers)))
    True
    """
    return HybridSystem(
        name="impact oscillator",
        state=("x", "v"),
        parameters={"k": 1.0, "c": 0.1, "A": 1.0, "w": 1.0, "d": 1.0, "r": 0.8},
        modes=[Mode("flight", _flight)],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(_overlap, direction=+1),
                Reset(_rebound),
                name="impact",
            )
        ],
        period=_forcing_period,
        outputs={"energy": _energy},
        laws=Laws(
            invariant={"distance to the stop": _gap},
            balance={"energy": ("energy", _power)},
            across={"impact": {"restitution": _restitution}},
        ),
    )


def _flight(t, x, p):
    return x.v, p.A * np.cos(p.w * t) - p.c * x.v - p.k * x.x


def _overlap(t, x, p):
    return x.x - p.d


def _rebound(t, x, p):
    return p.d, -p.r * x.v


def _forcing_period(p):
    return 2 * np.pi / p.w


def _gap(t, x, p):
    return p.d - x.x


def _energy(t, x, p):
    return (x.v**2 + p.k * x.x**2) / 2


def _power(t, x, p):
    return (p.A * np.cos(p.w * t) - p.c * x.v) * x.v


def _restitution(t, minus, plus, p):
    return plus.v + p.r * minus.v
