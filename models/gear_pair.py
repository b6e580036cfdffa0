"""A pair of spur gears with backlash: contact on either side of the teeth, or on none."""

from __future__ import annotations

from functools import partial

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Transition

# Where the teeth touch: the modes, and the side of the gap.
SIDES = {"drive": +1, "apart": 0, "back": -1}


def gear_pair() -> HybridSystem:
    r"""Dynamic transmission error of a loaded spur gear pair with backlash.

    .. math::

        \ddot x + 2 \zeta\, \dot x + (1 + \kappa \cos w t)\, g(x) = F + e\, w^2 \cos w t, \qquad
        g = \begin{cases} x - 1 & x > 1 \\ 0 & |x| < 1 \\ x + 1 & x < -1 \end{cases}

    ``x`` is the difference between dynamic and static transmission error along the line of action, in units
    of half the backlash, and time is in units of ``sqrt(m / k)``, with the equivalent mass and the mean
    stiffness of the mesh. The mean load ``F`` presses the teeth together. The static transmission error of
    amplitude ``e`` and the change ``kappa`` of the stiffness, both once per tooth, separate them near the
    resonance.

    Returns
    -------
    HybridSystem
        State ``x``, ``v`` (its rate); modes ``drive`` (the driving sides of the teeth touch), ``apart`` (none
        do), ``back`` (the back sides do); transitions named ``separate``, ``mesh``, ``strike back``,
        ``leave back``; forcing period ``2 pi / w``. Dimensionless parameters: damping ratio ``zeta = 0.05``,
        load ``F = 0.1``, error ``e = 0.05``, change of stiffness ``kappa = 0``, mesh frequency ``w = 1``.
        Outputs: ``force`` of the mesh, which has no damping part, and ``energy``.

    Notes
    -----
    - The force is continuous, so every saltation matrix is the identity, and the exponents (phase left out)
      sum to ``-2 zeta``.
    - With ``kappa = 0`` the teeth stay in contact where the linear response is smaller than the load,

      .. math::

          \frac{e\, w^2}{\sqrt{(1 - w^2)^2 + (2 \zeta w)^2}} < F;

      there ``x`` oscillates with this amplitude about ``1 + F``.
    - Free undamped motion (``zeta = e = kappa = 0``) that leaves the driving sides at the speed
      ``V < 2 sqrt(F)`` comes back to them and has the period

      .. math::

          T = 2 \pi - 2 \arctan \frac{V}{F} + \frac{2 V}{F},

      which grows with ``V``: the resonance bends to lower frequencies. Without load it strikes both sides,
      and :math:`T = 2 \pi + 4 / V`.

    References
    ----------
    After A. Kahraman, R. Singh, "Non-linear dynamics of a spur gear pair", Journal of Sound and Vibration
    142(1), 49-75, 1990. doi:10.1016/0022-460X(90)90582-K

    The changing stiffness: after G. W. Blankenship, A. Kahraman, "Steady state forced response of a
    mechanical oscillator with combined parametric excitation and clearance type non-linearity", Journal of
    Sound and Vibration 185(5), 743-765, 1995. doi:10.1006/jsvi.1995.0416

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import simulate
    >>> free = {"zeta": 0.0, "F": 0.0, "e": 0.0}
    >>> arc = simulate(models.gear_pair(), (0.0, 0.5), (0.0, 20.0), parameters=free)
    >>> [str(name) for name in arc.jumps.transition[:4]]
    ['mesh', 'separate', 'strike back', 'leave back']
    >>> bool(np.isclose(arc.jumps.t[4] - arc.jumps.t[0], 2 * np.pi + 4 / 0.5))
    True
    """
    return HybridSystem(
        name="gear pair",
        state=("x", "v"),
        parameters={"zeta": 0.05, "F": 0.1, "e": 0.05, "kappa": 0.0, "w": 1.0},
        modes=[Mode(mode, partial(_field, side)) for mode, side in SIDES.items()],
        transitions=[
            Transition("drive", "apart", Guard(_at_drive, direction=-1), name="separate"),
            Transition("apart", "drive", Guard(_at_drive, direction=+1), name="mesh"),
            Transition("apart", "back", Guard(_at_back, direction=-1), name="strike back"),
            Transition("back", "apart", Guard(_at_back, direction=+1), name="leave back"),
        ],
        period=_forcing_period,
        outputs={
            "force": {
                side: partial(_force, sign) for side, sign in (("drive", +1), ("apart", 0), ("back", -1))
            },
            "energy": _energy,
        },
        laws=Laws(
            invariant={
                "drive": {"compression of the driving sides": _at_drive},
                "apart": {"distance to either side": _gap},
                "back": {"compression of the back sides": _pressed_back},
            },
            balance={"energy": ("energy", _power)},
            continuous=("separate", "mesh", "strike back", "leave back"),
        ),
    )


def _field(side, t, x, p):
    return x.v, p.F + p.e * p.w**2 * np.cos(p.w * t) - 2 * p.zeta * x.v - _force(side, t, x, p)


def _force(side, t, x, p):
    return _stiffness(t, p) * (x.x - side) if side else 0.0


def _stiffness(t, p):
    return 1.0 + p.kappa * np.cos(p.w * t)


def _at_drive(t, x, p):
    return x.x - 1.0


def _at_back(t, x, p):
    return x.x + 1.0


def _gap(t, x, p):
    return 1.0 - np.abs(x.x)


def _pressed_back(t, x, p):
    return -_at_back(t, x, p)


def _forcing_period(p):
    return 2 * np.pi / p.w


def _energy(t, x, p):
    return (x.v**2 + _stiffness(t, p) * _given(x) ** 2) / 2


def _given(x):
    """Compression of the teeth, on either side."""
    return np.maximum(np.abs(x.x) - 1.0, 0.0)


def _power(t, x, p):
    load = (p.F + p.e * p.w**2 * np.cos(p.w * t) - 2 * p.zeta * x.v) * x.v
    return load - p.kappa * p.w * np.sin(p.w * t) * _given(x) ** 2 / 2
