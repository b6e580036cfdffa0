"""Two bodies on springs that collide through a Hertz contact: the model of Bazhenov and others."""

from __future__ import annotations

import numpy as np

from hybrid import HybridSystem, Laws, arguments
from models.contact import ContactLaw, Hertz, after_collision, hertz_stiffness
from models.contact_energy import Bodies


def vibroimpact(contact: ContactLaw | None = None) -> HybridSystem:
    r"""Two-body vibro-impact system, driven at the main body, with a Hertz contact or another law.

    .. math::

        \ddot x_1 &= -2 \xi_1 \omega_1 \dot x_1 - \omega_1^2 x_1 - 2 \xi_2 \omega_2 \chi (\dot x_1 - \dot x_2)
            - \omega_2^2 \chi (x_1 - x_2 + D) + (F - F_{con}) / m_1 \\
        \ddot x_2 &= -2 \xi_2 \omega_2 (\dot x_2 - \dot x_1) - \omega_2^2 (x_2 - x_1 - D) + F_{con} / m_2 \\
        F &= P \cos(\omega t + \varphi_0), \quad \chi = m_2 / m_1, \quad
        F_{con} = K \max(x_1 - x_2, 0)^{3/2}

    Parameters
    ----------
    contact
        A law of :mod:`models.contact`, which replaces :math:`F_{con}`, its parameters and its modes;
        by default ``Hertz(hertz_stiffness())``, the model of the paper.

    Returns
    -------
    HybridSystem
        State ``x1``, ``x2`` (m), ``v1``, ``v2`` (m/s); modes ``free`` and ``contact``, in contact while
        ``x1 - x2 >= 0``; transitions ``impact`` and ``release``; forcing period ``2 pi / omega``.
        Parameters (all but D are recalled from other papers of the authors and are unchecked):
        bodies ``m1 = 1000``, ``m2 = 100`` kg; ``omega1 = 6.283``, ``omega2 = 5.646`` rad/s;
        ``xi1 = xi2 = 0.036``; drive ``P = 500`` N, ``phi0 = 0``, ``omega = 7.40`` rad/s; gap at rest
        ``D = 0.05`` m; contact stiffness ``K = 1.537e11`` N/m^(3/2), from
        :func:`models.contact.hertz_stiffness`.
        Outputs: ``force`` of the contact (N), in contact; ``energy`` (J); ``drive`` (N).

    Notes
    -----
    The paper does not print its parameters. **D was inferred here**: with these masses a random scan over
    gap, stiffness and start finds the three regimes of the paper together only for D from 0.044 m to 0.057 m.
    At D = 0.05 m and omega = 7.40 the Floquet exponent is -0.0548936; the paper has -0.056.

    Errors of the printed paper, corrected above: its second equation has ``omega_1`` and ``m_1`` in place of
    ``omega_2`` and ``m_2``; it uses an undefined ``omega_3``; ``z = x2 - x1`` contradicts ``Fcon(x1 - x2)``;
    and the entry ``a34`` of its linearisation lacks ``chi``.

    Known facts:

    - The contact is undamped, so on any orbit the exponents (phase left out) sum to exactly
      ``-(2 xi1 omega1 + 2 xi2 omega2 chi + 2 xi2 omega2)``, -0.8995392 with the defaults.
    - At omega = 7.40 an orbit of one period and one impact is stable, with exponents -0.05489357 and
      -0.39487603, twice each; at 7.46 there is a torus, at 7.92 chaos, and other attractors coexist.
    - Field and state are continuous at both transitions, so the saltation matrices are the identity. But a
      contact lasts a thousandth of a period, its stiffness starts like the square root of the penetration,
      and it rotates tangent vectors as much as a rigid impact does: they need their own error control.

    References
    ----------
    V. A. Bazhenov, O. S. Pogorelova, T. G. Postnikova, "Lyapunov exponents estimation for strongly nonlinear
    nonsmooth discontinuous vibroimpact system", 2017.

    Examples
    --------
    >>> import models
    >>> from hybrid import periodic_orbit
    >>> from lyapunov import floquet_exponents
    >>> start = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
    >>> floquet_exponents(periodic_orbit(models.vibroimpact(), start)).round(5)
    array([-0.05489, -0.05489, -0.39488, -0.39488])
    """
    contact = Hertz(hertz_stiffness()) if contact is None else contact
    if isinstance(contact, type) or not isinstance(contact, ContactLaw) or not callable(contact.modes):
        wanted = "be a law of contact from models.contact, for example Rigid(e=0.8)"
        raise arguments.refusal("contact", wanted, contact)
    bodies = Bodies(_field, _penetration, _rate, _collided, _energy, _power)
    outputs = {**contact.outputs(bodies), "drive": _drive}
    units = {
        name: unit for name, unit in (("force", "N"), ("energy", "J"), ("drive", "N")) if name in outputs
    }
    laws = Laws(balance={"momentum": (_momentum, _outer_force)}, across={"impact": {"momentum": _impulse}})
    return HybridSystem(
        name="vibro-impact",
        state=("x1", "x2", "v1", "v2"),
        parameters={
            "m1": 1000.0, "omega1": 6.283, "xi1": 0.036,
            "m2": 100.0, "omega2": 5.646, "xi2": 0.036,
            "P": 500.0, "phi0": 0.0, "omega": 7.40,
            "D": 0.05, **contact.parameters,
        },
        units={
            "x1": "m", "x2": "m", "v1": "m/s", "v2": "m/s", "t": "s",
            "m1": "kg", "m2": "kg", "omega1": "rad/s", "omega2": "rad/s",
            "P": "N", "phi0": "rad", "omega": "rad/s", "D": "m", **contact.units, **units,
        },
        modes=contact.modes(bodies),
        transitions=contact.transitions(bodies),
        period=_forcing_period,
        outputs=outputs,
        laws=laws.joined(contact.laws(bodies)),
    )  # fmt: skip


def _penetration(t, x, p):
    return x.x1 - x.x2


def _rate(t, x, p):
    return x.v1 - x.v2


def _forcing_period(p):
    return 2 * np.pi / p.omega


def _drive(t, x, p):
    return p.P * np.cos(p.omega * t + p.phi0)


def _field(t, x, p, Fcon):
    chi = p.m2 / p.m1
    F = p.P * np.cos(p.omega * t + p.phi0)
    main = -2 * p.xi1 * p.omega1 * x.v1 - p.omega1**2 * x.x1
    coupling = 2 * p.xi2 * p.omega2 * (x.v1 - x.v2) + p.omega2**2 * (x.x1 - x.x2 + p.D)
    return x.v1, x.v2, main - chi * coupling + (F - Fcon) / p.m1, coupling + Fcon / p.m2


def _collided(t, x, p, e):
    return (x.x1, x.x1, *after_collision(p.m1, p.m2, x.v1, x.v2, e))


def _momentum(t, x, p):
    return p.m1 * x.v1 + p.m2 * x.v2


def _outer_force(t, x, p):
    # The force between the bodies and that of the spring between them do not change the momentum.
    return p.P * np.cos(p.omega * t + p.phi0) - p.m1 * p.omega1 * (2 * p.xi1 * x.v1 + p.omega1 * x.x1)


def _impulse(t, minus, plus, p):
    return _momentum(t, plus, p) - _momentum(t, minus, p)


def _energy(t, x, p):
    springs = p.m1 * (p.omega1 * x.x1) ** 2 + p.m2 * (p.omega2 * (x.x1 - x.x2 + p.D)) ** 2
    return (p.m1 * x.v1**2 + p.m2 * x.v2**2 + springs) / 2


def _power(t, x, p):
    driven = p.P * np.cos(p.omega * t + p.phi0) * x.v1
    damped = p.m1 * p.xi1 * p.omega1 * x.v1**2 + p.m2 * p.xi2 * p.omega2 * (x.v1 - x.v2) ** 2
    return driven - 2 * damped
