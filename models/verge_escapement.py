"""The verge escapement: a crown wheel under a torque and a foliot without a spring, the oldest clock."""

from __future__ import annotations

from functools import partial

import numpy as np

from hybrid import Contact, HybridSystem, Laws, arguments, mechanics


def verge_escapement(teeth: int = 15) -> HybridSystem:
    r"""Crown wheel of so many teeth that pushes one pallet of the verge, then the other one.

    A constant torque drives the wheel, and the foliot on the verge turns freely. Two pallets touch teeth on
    opposite sides of the wheel, which move in opposite directions, so that they push the foliot to and fro:

    .. math::

        I_w\, \ddot\theta = \tau + s'(\theta)\, (\lambda_2 - \lambda_1), \qquad
        I_f\, \ddot\varphi = \lambda_1 - \lambda_2, \qquad s = A \sin n \theta

    .. math::

        0 \le \lambda_1 \perp \varphi - s(\theta) + c \ge 0, \qquad
        0 \le \lambda_2 \perp s(\theta) + c - \varphi \ge 0

    The teeth are rounded: ``s`` is the angle to which a tooth brings a pallet. Once a tooth has let go of its
    pallet, the wheel drops by the play ``2 c``, until a tooth on the other side hits the other pallet.
    The foliot still turns then, and pushes the wheel back (recoil), until the torque has turned both round.

    Parameters
    ----------
    teeth
        Number ``n`` of teeth of the wheel.

    Returns
    -------
    HybridSystem
        State ``theta`` (angle of the wheel, which counts up to whole teeth, rad), ``phi`` (angle of the
        foliot, rad), ``w`` and ``nu`` (their rates, rad/s); contacts ``upper`` and ``lower`` with the modes
        ``free``, ``upper``, ``lower``. Parameters: moments of inertia of the wheel ``Iw = 1e-4`` and of the
        foliot ``If = 1e-3`` kg m^2, torque ``tau = 0.02`` N m, amplitude ``A = 0.3`` rad, play ``c = 0.25``
        rad, restitution ``e = 0``. Outputs: ``energy`` of motion (J), and ``.gap`` (rad) and ``.normal``
        (N m) of the pallets.

    Raises
    ------
    ArgumentError
        If ``teeth`` is not a positive whole number.

    Notes
    -----
    - While a tooth is in touch, :math:`\tfrac12 (I_w + I_f s'^2)\, \dot\theta^2 - \tau \theta` is constant.
      Where the flank is straight, :math:`s'' = 0` and :math:`s' = \pm A n`, the wheel has the acceleration
      :math:`\tau / (I_w + A^2 n^2 I_f)`.
    - At an impact :math:`\dot\varphi_+ - s' \dot\theta_+ = -e\, (\dot\varphi_- - s' \dot\theta_-)`, and
      :math:`I_w \dot\theta + s' I_f \dot\varphi` stays the same. If the wheel goes back with
      :math:`\dot\theta_+`, it recoils by the angle :math:`(I_w + I_f s'^2)\, \dot\theta_+^2 / (2 \tau)`.
    - Nothing but the torque sets the pace: times are proportional to :math:`\sqrt{I / \tau}`, and the path is
      the same for all torques. Such a clock keeps time no better than its torque.
    - In each period the impacts take the work of the torque, :math:`2 \pi \tau / n`.

    References
    ----------
    After A. V. Roup, D. S. Bernstein, S. G. Nersesov, W. M. Haddad, V. Chellaboina, "Limit cycle analysis of
    the verge and foliot clock escapement using impulsive differential equations and Poincare maps",
    International Journal of Control 76(17), 1685-1698, 2003.

    Examples
    --------
    >>> import models
    >>> from hybrid import periodic_orbit, simulate
    >>> clock = models.verge_escapement()
    >>> arc = simulate(clock, (0.0, 0.0, 0.0, 0.0), (0.0, 6.0))
    >>> orbit = periodic_orbit(clock, arc.x[-1], mode=arc.end.mode, period=1.24)
    >>> round(orbit.period, 4), orbit.turns["theta"]
    (1.2422, 1)
    """
    teeth = arguments.count("teeth", teeth, 1)
    return mechanics(
        name="verge escapement",
        coordinates=("theta", "phi"),
        velocities=("w", "nu"),
        parameters={"Iw": 1e-4, "If": 1e-3, "tau": 0.02, "A": 0.3, "c": 0.25, "e": 0.0},
        mass=_mass,
        forces=_forces,
        contacts=[
            Contact("upper", gap=partial(_gap, teeth, +1), restitution="e"),
            Contact("lower", gap=partial(_gap, teeth, -1), restitution="e"),
        ],
        angles={"theta": 2 * np.pi / teeth},
        units={
            **{"theta": "rad", "phi": "rad", "w": "rad/s", "nu": "rad/s", "t": "s"},
            **{"Iw": "kg m^2", "If": "kg m^2", "tau": "N m", "A": "rad", "c": "rad", "energy": "J"},
        },
        outputs={"energy": _energy},
        laws=Laws(dissipated={"energy": ("energy", _power)}),
    )


def _mass(t, x, p):
    return p.Iw, p.If


def _forces(t, x, p):
    return p.tau, 0.0


def _gap(teeth, side, t, x, p):
    return side * (x.phi - p.A * np.sin(teeth * x.theta)) + p.c


def _energy(t, x, p):
    return (p.Iw * x.w**2 + p.If * x.nu**2) / 2


def _power(t, x, p):
    return p.tau * x.w
