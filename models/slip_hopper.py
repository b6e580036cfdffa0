"""The spring-loaded inverted pendulum: a point mass that runs or hops on a springy leg."""

from __future__ import annotations

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition


def slip_hopper() -> HybridSystem:
    r"""Point mass on a massless spring leg that touches down at a fixed angle of attack.

    .. math::

        \text{flight: } \ddot x = 0, \ \ddot y = -g; \qquad
        \text{stance: } (\ddot x, \ddot y) = \frac{k}{m} \left(\frac{l_0}{l} - 1\right) (x, y) - (0, g),
        \quad l = \sqrt{x^2 + y^2}

    Returns
    -------
    HybridSystem
        State ``x``, ``y`` (position of the mass relative to the last foothold on level ground, m), ``vx``,
        ``vy`` (m/s); modes ``descent``, ``stance`` and ``ascent``; transitions ``touchdown``, where ``y``
        falls to ``l0 sin(alpha)`` and the foot gets a new place, so that ``x -> -l0 cos(alpha)``,
        ``takeoff``, where the leg has the length ``l0`` again, and ``apex``. The run ends if the runner takes
        off downwards (``fall``) or if its apex is below ``l0 sin(alpha)`` (``low apex``). Parameters: mass
        ``m = 80`` kg, leg stiffness ``k = 20000`` N/m, leg length at rest ``l0 = 1`` m, angle of attack
        ``alpha = 68 deg`` (in rad), ``g = 9.81`` m/s^2.
        Outputs: ``force`` of the leg (N), in stance, and ``energy`` (J).

    Notes
    -----
    - Energy is conserved. The map from one apex to the next depends only on the apex height. Its slope is one
      multiplier of a running gait; the others are ``{1, 1, 0}``, for time, energy and ``x``.
    - ``alpha = pi / 2`` with ``vx = 0`` hops in place. With ``w = sqrt(k / m)`` and the landing speed ``v``,
      a stance lasts ``2 (pi - arctan(w v / g)) / w`` and a flight ``2 v / g``.
    - At the energy of 5 m/s at the height 1 m, running is stable: apex 0.940267144380 m, period
      0.252532613818 s, multiplier -0.161307631037.

    References
    ----------
    R. Blickhan, "The spring-mass model for running and hopping", Journal of Biomechanics 22, 1217-1227, 1989.
    doi:10.1016/0021-9290(89)90224-8
    A. Seyfarth, H. Geyer, M. Günther, R. Blickhan, "A movement criterion for running", Journal of
    Biomechanics 35(5), 649-655, 2002. doi:10.1016/S0021-9290(01)00245-7

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.slip_hopper(), (0.0, 0.95, 5.1, 0.0), (0.0, 1.0), mode="descent")
    >>> [jump.transition for jump in arc.jumps][:3]
    ['touchdown', 'takeoff', 'apex']
    """
    return HybridSystem(
        name="SLIP hopper",
        state=("x", "y", "vx", "vy"),
        parameters={"m": 80.0, "k": 20e3, "l0": 1.0, "alpha": np.radians(68.0), "g": 9.81},
        units={
            "x": "m",
            "y": "m",
            "vx": "m/s",
            "vy": "m/s",
            "t": "s",
            "m": "kg",
            "k": "N/m",
            "l0": "m",
            "alpha": "rad",
            "g": "m/s^2",
            "force": "N",
            "energy": "J",
        },
        modes=[Mode("descent", _flight), Mode("stance", _stance), Mode("ascent", _flight)],
        transitions=[
            Transition(
                "descent",
                "stance",
                Guard(_foot, direction=-1),
                Reset(_foothold),
                name="touchdown",
            ),
            Transition(
                "stance",
                "ascent",
                Guard(_extension, direction=+1, when=_rises),
                name="takeoff",
            ),
            Transition("stance", None, Guard(_extension, direction=+1, when=_sinks), name="fall"),
            Transition("ascent", "descent", Guard(_climb, direction=-1, when=_is_high), name="apex"),
            Transition("ascent", None, Guard(_climb, direction=-1, when=_is_low), name="low apex"),
        ],
        outputs={
            "force": {"stance": _push},
            "energy": {"descent": _energy, "stance": _energy_on_leg, "ascent": _energy},
        },
        laws=Laws(
            invariant={
                "descent": {"height of the foot": _foot},
                "stance": {"compression of the leg": _compression},
                "ascent": {"climb": _climb},
            },
            conserved=["energy"],
            continuous=("takeoff", "apex"),
            across={"touchdown": {"length of the leg": _stretch, "velocity": _change}},
        ),
    )


def _flight(t, x, p):
    return x.vx, x.vy, 0.0, -p.g


def _stance(t, x, p):
    push = p.k / p.m * (p.l0 / np.hypot(x.x, x.y) - 1)
    return x.vx, x.vy, push * x.x, push * x.y - p.g


def _foot(t, x, p):
    return x.y - p.l0 * np.sin(p.alpha)


def _foothold(t, x, p):
    return -p.l0 * np.cos(p.alpha), x.y, x.vx, x.vy


def _extension(t, x, p):
    return np.hypot(x.x, x.y) - p.l0


def _climb(t, x, p):
    return x.vy


def _rises(t, x, p):
    return x.vy > 0


def _sinks(t, x, p):
    return x.vy <= 0


def _is_high(t, x, p):
    return _foot(t, x, p) > 0


def _is_low(t, x, p):
    return _foot(t, x, p) <= 0


def _compression(t, x, p):
    return p.l0 - np.hypot(x.x, x.y)


def _push(t, x, p):
    return p.k * _compression(t, x, p)


def _energy(t, x, p):
    return p.m * (x.vx**2 + x.vy**2) / 2 + p.m * p.g * x.y


def _energy_on_leg(t, x, p):
    return _energy(t, x, p) + p.k * _compression(t, x, p) ** 2 / 2


def _stretch(t, minus, plus, p):
    return np.hypot(plus.x, plus.y) - p.l0


def _change(t, minus, plus, p):
    return plus.vx - minus.vx, plus.vy - minus.vy
