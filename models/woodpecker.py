"""The woodpecker toy: a sleeve with play jams and slips on a pole while the bird on it pecks its way down."""

from __future__ import annotations

from functools import partial

from hybrid import Contact, HybridSystem, Laws, mechanics

LOWER, UPPER = 1.0, -1.0


def woodpecker() -> HybridSystem:
    r"""Woodpecker toy: a sleeve on a pole, a spring, and a bird whose beak hits the pole.

    With :math:`q = (y, \varphi_M, \varphi_S)`, the height of the sleeve and the small rotations of sleeve and
    bird, equations (6) to (8) of the paper are

    .. math::

        \begin{pmatrix} m_S + m_M & m_S l_M & m_S l_G \\ m_S l_M & J_M + m_S l_M^2 & m_S l_M l_G \\
        m_S l_G & m_S l_M l_G & J_S + m_S l_G^2 \end{pmatrix} \ddot q = \begin{pmatrix} -(m_S + m_M) g \\
        -c (\varphi_M - \varphi_S) - m_S g\, l_M \\ -c (\varphi_S - \varphi_M) - m_S g\, l_G \end{pmatrix}
        + \text{contacts}, \\
        g_1 = l_M + l_G - l_S - r_0 - h_S \varphi_S, \qquad g_{2, 3} = r_M - r_0 \pm h_M \varphi_M.

    The slip of the beak is :math:`\dot y + l_M \dot \varphi_M + (l_G - l_S) \dot \varphi_S`, that of both
    edges of the sleeve :math:`\dot y + r_M \dot \varphi_M`, equation (10).

    Returns
    -------
    HybridSystem
        State ``y`` (m), ``phi_M``, ``phi_S`` (rad) and their rates ``v`` (m/s), ``omega_M``, ``omega_S``
        (rad/s); contacts ``beak``, ``lower`` and ``upper`` (edge of the sleeve); ``y`` is cyclic. Parameters
        of the paper: ``m_M = 3e-4``, ``m_S = 4.5e-3`` kg; ``J_M = 5e-9``, ``J_S = 7e-7`` kg m^2;
        ``c = 5.6e-3`` Nm/rad, ``g = 9.81`` m/s^2; ``r_0 = 2.5e-3``, ``r_M = 3.1e-3``, ``h_M = 5.8e-3``,
        ``l_M = 0.010``, ``l_G = 0.015``, ``h_S = 0.02``, ``l_S = 0.0201`` m; restitution of the beak
        ``e = 0.5``, friction ``mu = 0.3``. Output: ``energy`` (J).

    Notes
    -----
    - The bird may hang at rest on the jammed sleeve, at ``phi_M = -(r_M - r_0) / h_M = -0.1034`` and
      ``phi_S = phi_M - m_S g l_G / c = -0.2217``, if
      ``mu >= (m_S + m_M) h_M / (m_S (l_M + l_G) - (m_S + m_M) r_M) = 0.285``.
    - In flight bird and sleeve swing against each other at 72.91 Hz.
    - Pecking is periodic but for the fall: the period is 0.1460 s (0.1452 s in the paper, 0.1460 s by time
      stepping), the bird turns back to -0.53 rad, the toy is 19.4 mm lower after each peck, and a
      multiplier of -0.839 says how fast pecks become alike.

    The state of the examples is that of the start in the paper of 2005.

    References
    ----------
    R. I. Leine, C. Glocker, D. H. van Campen, "Nonlinear dynamics of the woodpecker toy", ASME Design
    Engineering Technical Conferences, VIB-21608, 2001; the same, "Nonlinear dynamics and modeling of various
    wooden toys with impact and friction", Journal of Vibration and Control 9(1-2), 25-78, 2003,
    doi:10.1177/1077546303009001741. C. Glocker, C. Studer, "Formulation and preparation for numerical
    evaluation of linear complementarity systems in dynamics", Multibody System Dynamics 13, 447-463, 2005,
    doi:10.1007/s11044-005-2519-6.

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> start = (0.0, -0.1034, -0.2788, -0.3411, 0.0, -7.4583)
    >>> arc = simulate(models.woodpecker(), start, (0.0, 0.5))
    >>> len(arc.jumps["beak"]), bool(-0.07 < arc["y"][-1] < -0.05)
    (3, True)
    """
    return mechanics(
        name="woodpecker toy",
        coordinates=("y", "phi_M", "phi_S"),
        velocities=("v", "omega_M", "omega_S"),
        parameters={
            **{"m_M": 3e-4, "J_M": 5e-9, "m_S": 4.5e-3, "J_S": 7e-7, "c": 5.6e-3, "g": 9.81},
            **{"r_0": 2.5e-3, "r_M": 3.1e-3, "h_M": 5.8e-3, "l_M": 0.010, "l_G": 0.015},
            **{"h_S": 0.02, "l_S": 0.0201, "e": 0.5, "mu": 0.3},
        },
        units={
            **{"y": "m", "phi_M": "rad", "phi_S": "rad", "t": "s"},
            **{"v": "m/s", "omega_M": "rad/s", "omega_S": "rad/s"},
            **{"m_M": "kg", "m_S": "kg", "J_M": "kg*m^2", "J_S": "kg*m^2", "c": "N*m/rad", "g": "m/s^2"},
            **dict.fromkeys(("r_0", "r_M", "h_M", "l_M", "l_G", "h_S", "l_S"), "m"),
            **{"energy": "J"},
        },
        mass=_mass,
        forces=_forces,
        contacts=[
            Contact("beak", gap=_beak_gap, restitution="e", friction="mu", slip=_beak_slip),
            Contact("lower", gap=partial(_edge_gap, LOWER), friction="mu", slip=_sleeve_slip),
            Contact("upper", gap=partial(_edge_gap, UPPER), friction="mu", slip=_sleeve_slip),
        ],
        cyclic=("y",),
        outputs={"energy": _energy},
        laws=Laws(dissipated={"energy": "energy"}),
    )


def _mass(t, x, p):
    return (
        (p.m_S + p.m_M, p.m_S * p.l_M, p.m_S * p.l_G),
        (p.m_S * p.l_M, p.J_M + p.m_S * p.l_M**2, p.m_S * p.l_M * p.l_G),
        (p.m_S * p.l_G, p.m_S * p.l_M * p.l_G, p.J_S + p.m_S * p.l_G**2),
    )


def _forces(t, x, p):
    spring = p.c * (x.phi_M - x.phi_S)
    return -(p.m_S + p.m_M) * p.g, -spring - p.m_S * p.g * p.l_M, spring - p.m_S * p.g * p.l_G


def _beak_gap(t, x, p):
    return p.l_M + p.l_G - p.l_S - p.r_0 - p.h_S * x.phi_S


def _beak_slip(t, x, p):
    return x.v + p.l_M * x.omega_M + (p.l_G - p.l_S) * x.omega_S


def _edge_gap(side, t, x, p):
    return p.r_M - p.r_0 + side * p.h_M * x.phi_M


def _sleeve_slip(t, x, p):
    return x.v + p.r_M * x.omega_M


def _energy(t, x, p):
    bird = x.v + p.l_M * x.omega_M + p.l_G * x.omega_S
    kinetic = p.m_M * x.v**2 + p.J_M * x.omega_M**2 + p.m_S * bird**2 + p.J_S * x.omega_S**2
    weight = p.m_M * x.y + p.m_S * (x.y + p.l_M * x.phi_M + p.l_G * x.phi_S)
    return kinetic / 2 + p.c * (x.phi_M - x.phi_S) ** 2 / 2 + p.g * weight
