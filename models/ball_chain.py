"""Three balls in a line that collide: Newton's cradle, many collisions, inelastic collapse."""

from __future__ import annotations

from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition


def ball_chain() -> HybridSystem:
    r"""Three balls in a line that move freely and collide with Newton's law of restitution.

    .. math::

        v_k \mapsto v_k - \frac{(1 + e)\, m_{k+1}}{m_k + m_{k+1}} (v_k - v_{k+1}), \quad
        v_{k+1} \mapsto v_{k+1} + \frac{(1 + e)\, m_k}{m_k + m_{k+1}} (v_k - v_{k+1})
        \quad \text{at } q_k = q_{k+1}

    Returns
    -------
    HybridSystem
        State ``q1 <= q2 <= q3``, positions minus the diameters of the balls to the left, and velocities
        ``v1``, ``v2``, ``v3``; mode ``flight``; transitions ``left`` (balls 1 and 2) and ``right`` (2 and 3).
        Parameters: masses ``m1 = m2 = m3 = 1``, restitution ``e = 1``, ``0 <= e <= 1``; any consistent units.
        Outputs: ``energy`` and ``momentum``.

    Notes
    -----
    - Elastic balls are a billiard in the coordinates ``sqrt(m_k) q_k``. Without the motion of the centre of
      mass, a point moves in a wedge of angle ``phi``, ``cos(phi)^2 = m1 m3 / ((m1 + m2) (m2 + m3))``.
      Unfolded, its path is a straight line through copies of the wedge. The path crosses at most
      ``ceil(pi / phi)`` sides; each crossing is a collision.
    - If ``pi / phi`` is an integer, as for equal masses, and ``e = 1``, a collision of all three balls has
      the same outcome in either order. Otherwise the order matters, and the status is ``AMBIGUOUS_ORDER``.
    - Equal balls with ``e < 7 - 4 sqrt(3) = 0.0718`` can collapse: infinitely many collisions, ``left`` and
      ``right`` in turn, in finite time. A run follows them down to rounding; after that the balls move
      together.

    References
    ----------
    S. McNamara, W. R. Young, "Inelastic collapse and clumping in a one-dimensional granular medium",
    Physics of Fluids A 4, 496-504, 1992. doi:10.1063/1.858323

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.ball_chain(), (-1.0, 0.0, 1.0, 1.0, 0.0, 0.0), (0.0, 3.0))
    >>> [jump.transition for jump in arc.jumps], arc.x[-1, 3:].round(9)
    (['left', 'right'], array([0., 0., 1.]))
    """
    return HybridSystem(
        name="three balls in a line",
        state=("q1", "q2", "q3", "v1", "v2", "v3"),
        parameters={"m1": 1.0, "m2": 1.0, "m3": 1.0, "e": 1.0},
        modes=[Mode("flight", _flight)],
        transitions=[
            _collision("left", _left_gap, _left),
            _collision("right", _right_gap, _right),
        ],
        outputs={"energy": _energy, "momentum": _momentum},
        laws=Laws(
            invariant={"gap on the left": _left_gap, "gap on the right": _right_gap, "1 - e": _loss},
            conserved=["momentum"],
            dissipated=["energy"],
            across={
                "left": {"momentum": _left_momentum, "restitution": _left_restitution},
                "right": {"momentum": _right_momentum, "restitution": _right_restitution},
            },
        ),
    )


def _collision(name, gap, reset):
    return Transition("flight", "flight", Guard(gap, direction=-1), Reset(reset), name=name)


def _flight(t, x, p):
    return x.v1, x.v2, x.v3, 0.0, 0.0, 0.0


def _left_gap(t, x, p):
    return x.q2 - x.q1


def _right_gap(t, x, p):
    return x.q3 - x.q2


def _left(t, x, p):
    v1, v2 = _collided(p.m1, x.v1, p.m2, x.v2, p.e)
    return x.q1, x.q2, x.q3, v1, v2, x.v3


def _right(t, x, p):
    v2, v3 = _collided(p.m2, x.v2, p.m3, x.v3, p.e)
    return x.q1, x.q2, x.q3, x.v1, v2, v3


def _collided(m, v, M, V, e):
    change = (1 + e) * (v - V) / (m + M)
    return v - M * change, V + m * change


def _loss(t, x, p):
    return 1 - p.e


def _momentum(t, x, p):
    return p.m1 * x.v1 + p.m2 * x.v2 + p.m3 * x.v3


def _energy(t, x, p):
    return (p.m1 * x.v1**2 + p.m2 * x.v2**2 + p.m3 * x.v3**2) / 2


def _left_momentum(t, minus, plus, p):
    return p.m1 * (plus.v1 - minus.v1) + p.m2 * (plus.v2 - minus.v2)


def _right_momentum(t, minus, plus, p):
    return p.m2 * (plus.v2 - minus.v2) + p.m3 * (plus.v3 - minus.v3)


def _left_restitution(t, minus, plus, p):
    return plus.v1 - plus.v2 + p.e * (minus.v1 - minus.v2)


def _right_restitution(t, minus, plus, p):
    return plus.v2 - plus.v3 + p.e * (minus.v2 - minus.v3)
