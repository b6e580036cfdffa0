"""A driven oscillator with one stiffness for each sign of its displacement."""

from __future__ import annotations

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Transition


def bilinear_oscillator() -> HybridSystem:
    r"""Forced oscillator of unit mass whose stiffness is ``k1`` for ``x < 0`` and ``k2`` for ``x > 0``.

    .. math::

        \ddot x + c\, \dot x + k\, x = A \cos(w t), \quad k = k_1 \text{ if } x < 0 \text{ else } k_2

    Returns
    -------
    HybridSystem
        State ``x`` (displacement), ``v`` (velocity); modes ``soft`` (``x < 0``), ``stiff``; transitions
        ``touch``, ``leave``; forcing period ``2 pi / w``. Dimensionless parameters: stiffnesses ``k1 = 1``
        and ``k2 = 10``, damping ``c = 0.1``, forcing amplitude ``A = 1`` and frequency ``w = 1``.
        Outputs: ``energy``, and the force ``spring``.

    Notes
    -----
    With :math:`\omega_i = \sqrt{k_i - c^2 / 4}`:

    - free motion crosses zero after :math:`\pi / \omega_1` and :math:`\pi / \omega_2` in turn, whatever its
      amplitude, and shrinks by :math:`\exp(-c T / 2)` per natural period
      :math:`T = \pi / \omega_1 + \pi / \omega_2`;
    - the force is continuous, so every saltation matrix is the identity, and the exponents (phase left out)
      sum to ``-c``;
    - all motions are proportional to ``A``, so no bifurcation depends on ``A``.

    References
    ----------
    S. W. Shaw, P. J. Holmes, "A periodically forced piecewise linear oscillator", Journal of Sound and
    Vibration 90(1), 129-155, 1983. doi:10.1016/0022-460X(83)90407-8

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import simulate
    >>> free = {"A": 0.0, "c": 0.0}
    >>> arc = simulate(models.bilinear_oscillator(), (0.0, 1.0), (0.0, 10.0), mode="stiff", parameters=free)
    >>> bool(np.isclose(arc.jumps[1].t, np.pi / np.sqrt(10.0) + np.pi))
    True
    """
    return HybridSystem(
        name="bilinear oscillator",
        state=("x", "v"),
        parameters={"k1": 1.0, "k2": 10.0, "c": 0.1, "A": 1.0, "w": 1.0},
        modes=[Mode("soft", _soft), Mode("stiff", _stiff)],
        transitions=[
            Transition("soft", "stiff", Guard(_displacement, direction=+1), name="touch"),
            Transition("stiff", "soft", Guard(_displacement, direction=-1), name="leave"),
        ],
        period=_forcing_period,
        outputs={"energy": _energy, "spring": {"soft": _soft_spring, "stiff": _stiff_spring}},
        laws=Laws(
            invariant={
                "soft": {"displacement to the left": _to_the_left},
                "stiff": {"displacement to the right": _displacement},
            },
            balance={"energy": ("energy", _power)},
            continuous=("touch", "leave"),
        ),
    )


def _soft(t, x, p):
    return _field(t, x, p, p.k1)


def _stiff(t, x, p):
    return _field(t, x, p, p.k2)


def _field(t, x, p, k):
    return x.v, p.A * np.cos(p.w * t) - p.c * x.v - k * x.x


def _soft_spring(t, x, p):
    return -p.k1 * x.x


def _stiff_spring(t, x, p):
    return -p.k2 * x.x


def _displacement(t, x, p):
    return x.x


def _forcing_period(p):
    return 2 * np.pi / p.w


def _to_the_left(t, x, p):
    return -x.x


def _energy(t, x, p):
    return (x.v**2 + p.k1 * np.minimum(x.x, 0.0) ** 2 + p.k2 * np.maximum(x.x, 0.0) ** 2) / 2


def _power(t, x, p):
    return (p.A * np.cos(p.w * t) - p.c * x.v) * x.v
