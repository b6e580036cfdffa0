"""A block on a spring, carried by a moving belt until it breaks loose: friction-induced vibration."""

from __future__ import annotations

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition, filippov


def stick_slip() -> HybridSystem:
    r"""Block of unit mass and stiffness on a belt; friction falls with the sliding speed (Stribeck).

    .. math::

        \ddot x + x = -F_s \frac{\operatorname{sgn}(\dot x - b)}{1 + \delta |\dot x - b|}

    Returns
    -------
    HybridSystem
        State ``x`` (displacement), ``v`` (velocity). The modes are those of :func:`hybrid.filippov` with the
        switching function ``v - belt``: ``below`` slips behind the belt, ``above`` ahead of it, ``sliding``
        sticks to it. Dimensionless parameters: belt speed ``belt = 0.2``, friction at rest ``Fs = 1``, decay
        of the friction with speed ``delta = 3``.

    Notes
    -----
    - The block breaks loose at ``x = Fs``, where the spring force equals the largest friction; its
      acceleration there is zero.
    - The limit cycle slips for 4.295999525 and sticks for 7.705031769, with the period 12.001031295; its
      largest displacement is 1.133944674. While the block sticks, differences in velocity are lost: the
      multipliers are ``{1, 0}``, and the second exponent is minus infinity, exactly.

    References
    ----------
    R. I. Leine, D. H. van Campen, A. de Kraker, L. van den Steen, "Stick-slip vibrations induced by alternate
    friction models", Nonlinear Dynamics 16(1), 41-54, 1998. doi:10.1023/A:1008289604683

    Examples
    --------
    >>> import models
    >>> from hybrid import periodic_orbit
    >>> round(periodic_orbit(models.stick_slip(), (0.5, 0.2), period=12.0).period, 5)
    12.00103
    """
    return filippov(
        name="stick-slip",
        state=("x", "v"),
        parameters={"belt": 0.2, "delta": 3.0, "Fs": 1.0},
        below=_behind,
        above=_ahead,
        switching=_slip,
        laws=Laws(
            invariant={
                "below": {"slip backwards": _slip_back},
                "above": {"slip forwards": _slip},
                "sliding": {"friction in reserve": _hold},
            },
            equal={"sliding": {"slip": _slip}},
            balance={"energy seen from the belt": (_energy, _power)},
        ),
    )


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
    As for :func:`stick_slip`.

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
        laws=Laws(
            invariant={
                "stick": {"friction in reserve": _hold},
                "slip": {"slip backwards": _slip_back, "friction in reserve when caught": _hold_later},
            },
            equal={"stick": {"slip": _slip}},
            balance={"energy seen from the belt": (_energy, _coulomb_power)},
            across={"catch": {"displacement": _displacement}},
        ),
    )


def _friction(p, speed):
    return p.Fs / (1 + p.delta * speed)


def _behind(t, x, p):
    return x.v, _friction(p, p.belt - x.v) - x.x


def _ahead(t, x, p):
    return x.v, -_friction(p, x.v - p.belt) - x.x


def _slip(t, x, p):
    return x.v - p.belt


def _stick(t, x, p):
    return p.belt, 0.0


def _slipping(t, x, p):
    return x.v, p.Fk - x.x


def _pull(t, x, p):
    return x.x - p.Fs


def _caught(t, x, p):
    return x.x, p.belt


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
    speed = np.abs(x.v - p.belt)
    return p.belt * x.x - _friction(p, speed) * speed


def _coulomb_power(t, x, p):
    return p.belt * x.x - p.Fk * np.abs(x.v - p.belt)


def _displacement(t, minus, plus, p):
    return plus.x - minus.x
