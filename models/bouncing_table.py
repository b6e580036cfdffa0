"""A ball that bounces on a vibrating table: period doublings to chaos, chatter and locking."""

from __future__ import annotations

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition


def bouncing_table() -> HybridSystem:
    r"""Ball on a heavy table at height ``A sin(w t)``, seen from the table.

    .. math::

        \ddot q = -g + A w^2 \sin(w t), \quad q \ge 0, \qquad v \mapsto -e\, v \text{ at } q = 0, v < 0

    When its bounces accumulate, the ball locks onto the table. It lifts off when the downward acceleration of
    the table reaches that of free fall, at :math:`A w^2 \sin(w t) = g`.

    Returns
    -------
    HybridSystem
        State ``q`` (height above the table, m), ``v`` (velocity relative to the table, m/s); modes
        ``flight``, ``rest``; transitions ``bounce``, ``liftoff``; forcing period ``2 pi / w``. Parameters:
        ``g = 9.81`` m/s^2; ``e = 0.5``, the coefficient of restitution; amplitude ``A = 0.01`` m and
        frequency ``w = 36`` rad/s of the table, with accelerations up to 1.32 g.
        Outputs, both per mass: ``energy`` (J/kg), and ``force`` of the table on a ball at rest (N/kg).

    Notes
    -----
    With :math:`\Gamma = A w^2 / g`, exactly (without the high-bounce approximation):

    - orbits with one bounce every ``n`` periods leave the table at the absolute velocity
      :math:`\pi n g / w`, at the phase :math:`\cos \varphi = \pi n (1 - e) / (\Gamma (1 + e))`;
    - their multipliers have the product :math:`e^2` and the sum
      :math:`1 + e^2 - (1 + e)^2 \Gamma \sin \varphi`, so they are stable for
      :math:`0 < \Gamma \sin \varphi < 2 (1 + e^2) / (1 + e)^2`; for ``n = 1`` and the defaults from
      :math:`\Gamma = 1.047` to ``1.527``. At the upper limit their period doubles;
    - for :math:`\Gamma \le 1` a ball at rest stays at rest.

    The model is written by hand in the frame of the table, which is what its exact orbits and sweeps ask for.
    `hybrid.mechanics` with the gap ``y - A sin(w t)`` gives the same runs, with the force in ``normal``.

    References
    ----------
    P. J. Holmes, "The dynamics of repeated impacts with a sinusoidally vibrating table", Journal of Sound and
    Vibration 84(2), 173-189, 1982. J. M. Luck, A. Mehta, "Bouncing ball with a finite restitution:
    Chattering, locking, and chaos", Physical Review E 48(5), 3988-3997, 1993. doi:10.1103/PhysRevE.48.3988

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> still = {"A": 0.005}
    >>> arc = simulate(models.bouncing_table(), (0.001, 0.0), (0.0, 1.0), mode="flight", parameters=still)
    >>> str(arc.mode[-1]), abs(float(arc["q"][-1])) < 1e-12
    ('rest', True)
    """
    return HybridSystem(
        name="bouncing ball on a vibrating table",
        state=("q", "v"),
        parameters={"g": 9.81, "e": 0.5, "A": 0.01, "w": 36.0},
        units={
            "q": "m",
            "v": "m/s",
            "t": "s",
            "g": "m/s^2",
            "A": "m",
            "w": "rad/s",
            "energy": "J/kg",
            "force": "N/kg",
        },
        modes=[Mode("flight", _flight), Mode("rest", _rest)],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(_height, direction=-1),
                Reset(_bounce),
                accumulates_to="rest",
                name="bounce",
            ),
            Transition(
                "rest",
                "flight",
                Guard(_weight, direction=-1),
                # At the limit of chatter the ball is on the table up to rounding, which must not bounce.
                Reset(_rest),
                name="liftoff",
            ),
        ],
        period=_forcing_period,
        outputs={"energy": _energy, "force": {"rest": _weight}},
        laws=Laws(
            invariant={"flight": {"height": _height}, "rest": {"force of the table": "force"}},
            equal={"rest": {"height": _height, "velocity": _velocity}},
            dissipated={"energy": ("energy", _power)},
            across={"bounce": {"restitution": _restitution}},
        ),
    )


def _weight(t, x, p):
    """The force of the table on a ball at rest, per mass."""
    return p.g - p.A * p.w**2 * np.sin(p.w * t)


def _flight(t, x, p):
    return x.v, -_weight(t, x, p)


def _rest(t, x, p):
    return 0.0, 0.0


def _height(t, x, p):
    return x.q


def _bounce(t, x, p):
    return 0.0, -p.e * x.v


def _forcing_period(p):
    return 2 * np.pi / p.w


def _velocity(t, x, p):
    return x.v


def _energy(t, x, p):
    return x.v**2 / 2 + p.g * x.q


def _power(t, x, p):
    return p.A * p.w**2 * np.sin(p.w * t) * x.v


def _restitution(t, minus, plus, p):
    return plus.v + p.e * minus.v
