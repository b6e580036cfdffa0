"""A ball that bounces on fixed ground: the simplest system with impacts and chatter."""

from __future__ import annotations

from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition


def bouncing_ball() -> HybridSystem:
    r"""Ball falling on rigid fixed ground with Newton's law of restitution.

    .. math::

        \ddot q = -g, \quad q \ge 0, \qquad v \mapsto -e\, v \text{ at } q = 0, v < 0

    Returns
    -------
    HybridSystem
        State ``q`` (height, m), ``v`` (velocity, m/s); mode ``flight``; transition ``bounce``.
        Output: ``energy`` per mass, J/kg.
        Parameters: ``g = 9.81`` m/s^2; ``e = 0.8``, the coefficient of restitution, ``0 <= e <= 1``.

    Notes
    -----
    Exact results, with ``v_minus`` the velocity just before an impact:

    - the saltation matrix is ``[[-e, 0], [g (1 + e) / abs(v_minus), -e]]``;
    - from rest at height ``h`` the impacts are at
      ``t_k = sqrt(2 h / g) (1 + 2 (e + ... + e^(k-1)))``, the k-th at the speed ``e^(k-1) sqrt(2 g h)``;
    - for ``e < 1`` the impacts accumulate at ``sqrt(2 h / g) (1 + e) / (1 - e)``; the ball is then at rest.

    References
    ----------
    R. Goebel, R. G. Sanfelice, A. R. Teel, "Hybrid dynamical systems", IEEE Control Systems Magazine
    29(2), 28-93, 2009, example 1. doi:10.1109/MCS.2008.931718

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 5.0))
    >>> round(arc.jumps[0].t, 6), round((2 / 9.81) ** 0.5, 6)
    (0.451524, 0.451524)
    >>> float(arc.t[-1].round(6)), round((2 / 9.81) ** 0.5 * 1.8 / 0.2, 6)
    (4.063713, 4.063713)
    """
    return HybridSystem(
        name="bouncing ball",
        state=("q", "v"),
        parameters={"g": 9.81, "e": 0.8},
        units={"q": "m", "v": "m/s", "t": "s", "g": "m/s^2", "energy": "J/kg"},
        modes=[Mode("flight", _flight)],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(_height, direction=-1),
                Reset(_bounce),
                name="bounce",
            )
        ],
        outputs={"energy": _energy},
        laws=Laws(
            invariant={"height": _height},
            dissipated=["energy"],
            across={"bounce": {"restitution": _restitution}},
        ),
    )


def _flight(t, x, p):
    return x.v, -p.g


def _height(t, x, p):
    return x.q


def _bounce(t, x, p):
    return 0.0, -p.e * x.v


def _energy(t, x, p):
    return x.v**2 / 2 + p.g * x.q


def _restitution(t, minus, plus, p):
    return plus.v + p.e * minus.v
