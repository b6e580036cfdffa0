"""A block on a spring, carried by a moving belt with Coulomb's friction: stick and slip in closed form."""

from __future__ import annotations

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition


def coulomb_stick_slip() -> HybridSystem:
    r"""Block of unit mass and stiffness on a belt, with static and smaller kinetic friction (Coulomb).

    .. math::

        \text{stick: } \dot x = b \text{ until } x = F_s; \qquad
        \text{slip: } \ddot x + x = F_k \text{ until } \dot x = b

    Returns
    -------
    HybridSystem
        State ``x`` (displacement), ``v`` (velocity); modes ``stick`` and ``slip``; transitions ``release``
        and ``catch``. Dimensionless parameters: belt speed ``belt = 0.2``, static friction ``Fs = 1`` and
        kinetic friction ``Fk = 0.5``.
        Outputs: ``friction`` on the block, and ``energy`` as seen from the belt.

    Notes
    -----
    - After a stick the block never slips ahead of the belt, nor does a block that slips with
      ``hypot(x - Fk, v) < Fs + Fk``. The model does not describe slip ahead of the belt.
    - With ``D = Fs - Fk`` the slip is ``x = Fk + D cos(s) + belt sin(s)``, lasts
      ``2 (pi - arctan(D / belt))`` and ends at ``Fk - D``; the stick lasts ``2 D / belt``.
    - The saltation of the release is ``[[1, 0], [-D / belt, 1]]``, that of the catch ``[[1, 0], [0, 0]]``;
      the multipliers of the limit cycle are ``{1, 0}``.

    References
    ----------
    As for :func:`models.stick_slip`.

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.coulomb_stick_slip(), (0.5, 0.2), (0.0, 10.0), mode="stick")
    >>> arc.jumps[0].transition, round(float(arc.jumps[0].x_minus[0]), 9)
    ('release', 1.0)
    """
    return HybridSystem(
        name="stick-slip with Coulomb's friction",
        state=("x", "v"),
        parameters={"belt": 0.2, "Fs": 1.0, "Fk": 0.5},
        modes=[
            Mode("stick", _stick),
            Mode("slip", _slipping),
        ],
        transitions=[
            Transition("stick", "slip", Guard(_pull, direction=+1), name="release"),
            Transition("slip", "stick", Guard(_slip, direction=+1), Reset(_caught), name="catch"),
        ],
        outputs={"friction": {"stick": _position, "slip": _kinetic}, "energy": _energy},
        laws=Laws(
            invariant={
                "stick": {"friction in reserve": _hold},
                "slip": {"slip backwards": _slip_back, "friction in reserve when caught": _hold_later},
            },
            equal={"stick": {"slip": _slip}},
            balance={"energy seen from the belt": ("energy", _power)},
            across={"catch": {"displacement": _displacement}},
        ),
    )


def _stick(t, x, p):
    return p.belt, 0.0


def _slipping(t, x, p):
    return x.v, p.Fk - x.x


def _pull(t, x, p):
    return x.x - p.Fs


def _caught(t, x, p):
    return x.x, p.belt


def _position(t, x, p):
    # While the block sticks, friction balances the spring.
    return x.x


def _kinetic(t, x, p):
    return p.Fk


def _slip(t, x, p):
    return x.v - p.belt


def _slip_back(t, x, p):
    return p.belt - x.v


def _hold(t, x, p):
    return p.Fs - np.abs(x.x)


def _hold_later(t, x, p):
    # A block that slips is caught at x = Fk - sqrt((x - Fk)^2 + v^2 - belt^2), which must be above -Fs.
    return (p.Fs + p.Fk) ** 2 - (x.x - p.Fk) ** 2 - x.v**2 + p.belt**2


def _energy(t, x, p):
    return ((x.v - p.belt) ** 2 + x.x**2) / 2


def _power(t, x, p):
    return p.belt * x.x - p.Fk * np.abs(x.v - p.belt)


def _displacement(t, minus, plus, p):
    return plus.x - minus.x
