"""A stack of boxes on a table that shakes sideways: each sticks or slips on what it stands on."""

from __future__ import annotations

from functools import partial

import numpy as np

from hybrid import Contact, HybridSystem, Laws, arguments, mechanics


def shaken_stack(boxes: int = 2) -> HybridSystem:
    r"""Boxes on each other, with dry friction, on a table that accelerates by ``-A g sin(w t)``.

    Seen from the table, with the heights ``y_i`` of the boxes above their places,

    .. math::

        m_i \ddot x_i = m_i A g \sin(w t) + T_i - T_{i+1}, \qquad m_i \ddot y_i = -m_i g + N_i - N_{i+1},

    where the friction :math:`|T_i| \le \mu_i N_i` opposes the slip of box ``i`` on what is below it.

    Parameters
    ----------
    boxes
        Their number, 1 or more, counted from below.

    Returns
    -------
    HybridSystem
        State ``x1``, ``x2``, ... , ``y1``, ``y2``, ... (m) and their rates ``u1``, ... , ``v1``, ... (m/s);
        contacts ``1``, ``2``, ... below each box; forcing period ``2 pi / w``. Parameters: masses ``m1``, ...
        of 1 kg; friction ``mu1 = 0.3`` on the table, ``mu2 = 0.2``, ``mu3 = 0.15``, ... on the boxes;
        restitution ``e = 0``; ``g = 9.81`` m/s^2; acceleration ``A = 0.4``, in units of g, and frequency
        ``w = 2 pi`` rad/s of the table. Output: ``energy`` (J).

    Notes
    -----
    Masses do not matter to a stack that sticks: the friction at contact ``i`` accelerates all boxes above it,
    which press on it with their weight, so it slips where the acceleration passes ``mu_i g``.

    - From rest at ``t = 0`` nothing slips for ``A`` up to the smallest ``mu_i``. Above that, the contact with
      the smallest one slips first, at ``sin(w t) = mu_i / A``. Boxes above it move with its own.
    - While the second box slides, the first one feels ``mu2 m2 g`` and begins to slip where
      ``m1 A sin(w t) = mu1 (m1 + m2) - mu2 m2``, if that is reached before the second one stops.
    - A single box on the table slips from ``t1`` on by
      ``u = A g / w (cos(w t1) - cos(w t)) - mu1 g (t - t1)``. In the long run it slides without a stop where
      ``A / mu1 > sqrt(1 + pi^2 / 4) = 1.862``, and sticks twice per period below.

    Three equal coefficients reach their bounds at one instant, and what slips there is rounding: runs may end
    with ``STUCK``. Choose coefficients that differ.

    References
    ----------
    N. M. Newmark, "Effects of earthquakes on dams and embankments", Géotechnique 15(2), 139-160, 1965.
    doi:10.1680/geot.1965.15.2.139. B. Westermo, F. Udwadia, "Periodic response of a sliding oscillator system
    to harmonic excitation", Earthquake Engineering & Structural Dynamics 11(1), 135-146, 1983.
    doi:10.1002/eqe.4290110111

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.shaken_stack(), np.zeros(8), (0.0, 0.1))
    >>> slip = arc.jumps["2 slips"][0]
    >>> bool(np.isclose(np.sin(2 * np.pi * slip.t), 0.2 / 0.4)), str(arc.mode[-1])
    (True, '1 sticks, 2 slips +')
    """
    number = arguments.count("boxes", boxes, 1)
    numbers = range(1, number + 1)
    places = [f"{each}{i}" for each in "xy" for i in numbers]
    rates = [f"{each}{i}" for each in "uv" for i in numbers]
    masses = {f"m{i}": 1.0 for i in numbers}
    return mechanics(
        name="shaken stack",
        coordinates=places,
        velocities=rates,
        parameters={
            **masses,
            **{f"mu{i}": 0.6 / (i + 1) for i in numbers},
            **{"e": 0.0, "g": 9.81, "A": 0.4, "w": 2 * np.pi},
        },
        units={
            **dict.fromkeys(places, "m"),
            **dict.fromkeys(rates, "m/s"),
            **dict.fromkeys(masses, "kg"),
            **{"t": "s", "g": "m/s^2", "w": "rad/s", "energy": "J"},
        },
        mass=partial(_mass, number),
        forces=partial(_forces, number),
        contacts=[
            Contact(
                f"{i + 1}",
                gap=partial(_above, number + i, i > 0),
                slip=partial(_above, 2 * number + i, i > 0),
                friction=f"mu{i + 1}",
                restitution="e",
            )
            for i in range(number)
        ],
        period=_forcing_period,
        outputs={"energy": partial(_energy, number)},
        laws=Laws(dissipated={"energy": ("energy", partial(_power, number))}),
    )


def _masses(boxes, p):
    return [getattr(p, f"m{i + 1}") for i in range(boxes)]


def _mass(boxes, t, x, p):
    return (*_masses(boxes, p), *_masses(boxes, p))


def _forces(boxes, t, x, p):
    sideways = p.A * p.g * np.sin(p.w * t)
    return (*(m * sideways for m in _masses(boxes, p)), *(-m * p.g for m in _masses(boxes, p)))


def _above(component, on_a_box, t, x, p):
    """A component of a box less that of the box below; the table is at rest."""
    return x[component] - x[component - 1] if on_a_box else x[component]


def _forcing_period(p):
    return 2 * np.pi / p.w


def _energy(boxes, t, x, p):
    heights, rates = x[boxes : 2 * boxes], x[2 * boxes :]
    kinetic = sum(m * rate**2 for m, rate in zip(_mass(boxes, t, x, p), rates, strict=True)) / 2
    return kinetic + p.g * sum(m * y for m, y in zip(_masses(boxes, p), heights, strict=True))


def _power(boxes, t, x, p):
    sideways = p.A * p.g * np.sin(p.w * t)
    return sideways * sum(m * x[2 * boxes + i] for i, m in enumerate(_masses(boxes, p)))
