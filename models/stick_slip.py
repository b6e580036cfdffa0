"""A block on a spring, carried by a moving belt until it breaks loose: friction-induced vibration."""

from __future__ import annotations

import numpy as np

from hybrid import HybridSystem, Laws, filippov


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
        Outputs: ``friction`` on the block, and ``energy`` as seen from the belt.

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
        outputs={
            "friction": {"below": _pull_on, "above": _hold_back, "sliding": _position},
            "energy": _energy,
        },
        laws=Laws(
            invariant={
                "below": {"slip backwards": _slip_back},
                "above": {"slip forwards": _slip},
                "sliding": {"friction in reserve": _hold},
            },
            equal={"sliding": {"slip": _slip}},
            balance={"energy seen from the belt": ("energy", _power)},
        ),
    )


def _friction(p, speed):
    return p.Fs / (1 + p.delta * speed)


def _pull_on(t, x, p):
    return _friction(p, p.belt - x.v)


def _hold_back(t, x, p):
    return -_friction(p, x.v - p.belt)


def _position(t, x, p):
    # While the block sticks, friction balances the spring.
    return x.x


def _behind(t, x, p):
    return x.v, _friction(p, p.belt - x.v) - x.x


def _ahead(t, x, p):
    return x.v, -_friction(p, x.v - p.belt) - x.x


def _slip(t, x, p):
    return x.v - p.belt


def _slip_back(t, x, p):
    return p.belt - x.v


def _hold(t, x, p):
    return p.Fs - np.abs(x.x)


def _energy(t, x, p):
    return ((x.v - p.belt) ** 2 + x.x**2) / 2


def _power(t, x, p):
    speed = np.abs(x.v - p.belt)
    return p.belt * x.x - _friction(p, speed) * speed
