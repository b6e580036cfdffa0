"""A slider-crank mechanism whose slider has clearance in its guide: four corners that hit, slip and stick."""

from __future__ import annotations

from functools import partial

import numpy as np

from hybrid import Contact, HybridSystem, Laws, mechanics

# The corners of the slider: the sides along the guide and across it on which they lie.
CORNERS = {"rear top": (-1, +1), "front top": (+1, +1), "rear bottom": (-1, -1), "front bottom": (+1, -1)}
PARAMETERS = {
    **{"l1": 0.153, "l2": 0.306, "a": 0.05, "b": 0.025, "c": 0.001},
    **{"m1": 0.038, "m2": 0.038, "m3": 0.076, "J1": 7.4e-5, "J2": 5.9e-4, "J3": 2.7e-6},
    **{"g": 9.81, "e": 0.4, "mu": 0.01},
}
UNITS = {
    "rad": "theta1 theta2 theta3",
    "rad/s": "w1 w2 w3",
    "m": "l1 l2 a b c height",
    "kg": "m1 m2 m3",
    "kg m^2": "J1 J2 J3",
    "m/s^2": "g",
    "s": "t",
    "J": "energy",
}


def slider_crank() -> HybridSystem:
    r"""Crank, connecting rod, and a slider with two degrees of freedom more than without clearance.

    Angles are absolute, the slider is hinged to the rod in its centre of mass, and the centres of crank and
    rod are halfway. With :math:`\theta_{21} = \theta_2 - \theta_1`:

    .. math::

        T &= \tfrac12 \left( J_1 + (\tfrac14 m_1 + m_2 + m_3)\, l_1^2 \right) \omega_1^2
            + \tfrac12 \left( J_2 + (\tfrac14 m_2 + m_3)\, l_2^2 \right) \omega_2^2
            + \tfrac12 J_3\, \omega_3^2
            + (\tfrac12 m_2 + m_3)\, l_1 l_2 \cos\theta_{21}\, \omega_1 \omega_2 \\
        V &= g\, (\tfrac12 m_1 + m_2 + m_3)\, l_1 \sin\theta_1
            + g\, (\tfrac12 m_2 + m_3)\, l_2 \sin\theta_2

    The slider of the length ``2 a`` and the height ``2 b`` lies in a guide of the height ``2 (b + c)``. Its
    corners at :math:`(\pm a, \pm b)` have the gaps

    .. math::

        g = b + c \mp \left( l_1 \sin\theta_1 + l_2 \sin\theta_2 \pm a \sin\theta_3 \right) - b \cos\theta_3

    with Newton's restitution and Coulomb's friction.

    Returns
    -------
    HybridSystem
        State ``theta1``, ``theta2``, ``theta3`` (angles of crank, rod and slider, rad) and ``w1``, ``w2``,
        ``w3`` (rad/s); contacts ``rear top``, ``front top``, ``rear bottom``, ``front bottom``, the front
        being away from the crank. Parameters of the paper: lengths ``l1 = 0.153``, ``l2 = 0.306``,
        ``a = 0.05``, ``b = 0.025`` m, clearance ``c = 0.001`` m, masses ``m1 = m2 = 0.038``, ``m3 = 0.076``
        kg, moments of inertia ``J1 = 7.4e-5``, ``J2 = 5.9e-4``, ``J3 = 2.7e-6`` kg m^2, ``g = 9.81`` m/s^2,
        restitution ``e = 0.4``, friction ``mu = 0.01``. Outputs: ``energy`` (J), ``height`` of the slider's
        centre (m), and of each corner ``.gap`` (m), ``.normal``, ``.tangential`` (N).

    Notes
    -----
    The paper starts on the line, at ``(0, 0, 0, 150, -75, 0)``: the crank turns at 150 rad/s. Both corners of
    a side then hit at once, and the slider does not tilt: after an impact both gap rates are ``-e`` times the
    same rate. A slider that is tilted by a little shows impacts of single corners. Between impacts the energy
    stays the same, and the tilt grows uniformly in time. Without any tilt, rounding alone decides which
    corner bounces last: such a run may end with the status STUCK, after some turns of the crank. Runs that
    start with a tilt of 0.002 rad or more go on.

    References
    ----------
    P. Flores, R. Leine, C. Glocker, "Modeling and analysis of planar rigid multibody systems with
    translational clearance joints based on the non-smooth dynamics approach", Multibody System Dynamics 23,
    165-190, 2010. doi:10.1007/s11044-009-9178-y

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.slider_crank(), (0.0, 0.0, 0.01, 150.0, -75.0, 0.0), (0.0, 0.004))
    >>> bool(arc.jumps["front top"][0].t < arc.jumps["rear top"][0].t)
    True
    """
    return mechanics(
        name="slider-crank with clearance",
        coordinates=("theta1", "theta2", "theta3"),
        velocities=("w1", "w2", "w3"),
        parameters=PARAMETERS,
        mass=_mass,
        forces=_forces,
        contacts=[
            Contact(
                name, gap=partial(_gap, *side), slip=partial(_slip, *side), restitution="e", friction="mu"
            )
            for name, side in CORNERS.items()
        ],
        units={each: unit for unit, names in UNITS.items() for each in names.split()},
        outputs={"energy": _energy, "height": _height},
        laws=Laws(dissipated=["energy"]),
    )


def _inertias(p):
    """The entries of the mass matrix of crank and rod, that of both less its cosine."""
    crank = p.J1 + (p.m1 / 4 + p.m2 + p.m3) * p.l1**2
    return crank, p.J2 + (p.m2 / 4 + p.m3) * p.l2**2, (p.m2 / 2 + p.m3) * p.l1 * p.l2


def _mass(t, x, p):
    crank, rod, both = _inertias(p)
    both = both * np.cos(x.theta2 - x.theta1)
    return (crank, both, 0.0), (both, rod, 0.0), (0.0, 0.0, p.J3)


def _weights(p):
    """Weight times length that the crank and the rod lift."""
    return p.g * (p.m1 / 2 + p.m2 + p.m3) * p.l1, p.g * (p.m2 / 2 + p.m3) * p.l2


def _forces(t, x, p):
    crank, rod = _weights(p)
    gyroscopic = _inertias(p)[2] * np.sin(x.theta2 - x.theta1)
    return (
        gyroscopic * x.w2**2 - crank * np.cos(x.theta1),
        -gyroscopic * x.w1**2 - rod * np.cos(x.theta2),
        0.0,
    )


def _height(t, x, p):
    return p.l1 * np.sin(x.theta1) + p.l2 * np.sin(x.theta2)


def _gap(along, up, t, x, p):
    corner = up * (_height(t, x, p) + along * p.a * np.sin(x.theta3))
    return p.b + p.c - corner - p.b * np.cos(x.theta3)


def _slip(along, up, t, x, p):
    centre = -p.l1 * np.sin(x.theta1) * x.w1 - p.l2 * np.sin(x.theta2) * x.w2
    return centre - (along * p.a * np.sin(x.theta3) + up * p.b * np.cos(x.theta3)) * x.w3


def _energy(t, x, p):
    crank, rod, both = _inertias(p)
    kinetic = (crank * x.w1**2 + rod * x.w2**2 + p.J3 * x.w3**2) / 2
    kinetic = kinetic + both * np.cos(x.theta2 - x.theta1) * x.w1 * x.w2
    lifted, raised = _weights(p)
    return kinetic + lifted * np.sin(x.theta1) + raised * np.sin(x.theta2)
