"""A follower that a spring presses onto a rotating cam: it detaches above a critical speed, and bounces."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hybrid import Contact, HybridSystem, Laws, mechanics

PARAMETERS = {"m": 1.0, "k": 400.0, "c": 2.0, "g": 9.81, "d": 0.03, "a": 0.02, "e": 0.6, "w": 60.0}


def cam_follower() -> HybridSystem:
    r"""Flat-faced follower on a circular cam with the eccentricity ``a``, at the angular velocity ``w``.

    .. math::

        m \ddot q = -k\, (q + d) - c\, \dot q - m g + N, \qquad
        0 \le N \perp q - a \cos w t \ge 0, \qquad \dot q_+ - \dot s = -e\, (\dot q_- - \dot s)

    The flat face rests on the top of the cam, whose height is :math:`s = a \cos w t` above the mean. The
    spring is compressed by ``d`` at ``q = 0``. The contact stays closed up to the critical speed, above which
    the follower jumps, impacts, and bounces until it rests on the cam once more. At higher speeds the cam
    throws it up again before: once per turn, in windows of the speed, once in several turns, or chaotically.

    Returns
    -------
    HybridSystem
        State ``q`` (height of the follower, m), ``v`` (m/s); contact ``cam`` with modes ``free`` and ``cam``
        (the follower rests on the cam); forcing period ``2 pi / w``. Parameters: mass ``m = 1`` kg, stiffness
        ``k = 400`` N/m, damping ``c = 2`` N s/m, ``g = 9.81`` m/s^2, preload ``d = 0.03`` m, eccentricity
        ``a = 0.02`` m, restitution ``e = 0.6``, speed ``w = 60`` rad/s.
        Outputs: ``energy`` (J) and those of the contact, ``cam.gap`` (m) and ``cam.normal`` (N).

    Notes
    -----
    On the cam :math:`N = k d + m g + a (k - m w^2) \cos w t - a c w \sin w t`. Its minimum is zero at the
    critical speed, which `critical_speed` solves for:

    .. math::

        a^2 \left[ (k - m w^2)^2 + c^2 w^2 \right] = (k d + m g)^2, \qquad
        w^2 = \frac{k (d + a) + m g}{m a} \text{ for } c = 0

    Orbits with one impact per turn have multipliers with the product :math:`e^2 \exp(-2 \pi c / (m w))`.

    References
    ----------
    R. Alzate, M. di Bernardo, U. Montanaro, S. Santini, "Experimental and numerical verification of
    bifurcations and chaos in cam-follower impacting systems", Nonlinear Dynamics 50, 409-429, 2007.

    G. Osorio, M. di Bernardo, S. Santini, "Corner-impact bifurcations: a novel class of discontinuity-induced
    bifurcations in cam-follower systems", SIAM Journal on Applied Dynamical Systems 7(1), 18-38, 2008.
    arXiv:0711.1008

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> from models.cam_follower import critical_speed
    >>> round(critical_speed(), 3)
    38.572
    >>> start = (0.02, 0.0)
    >>> slow, fast = (
    ...     simulate(models.cam_follower(), start, (0.0, 1.0), mode="cam", parameters={"w": w})
    ...     for w in (38.5, 38.6)
    ... )
    >>> len(slow.jumps), str(fast.jumps[0].target)
    (0, 'free')
    """
    return mechanics(
        name="cam and follower",
        coordinates=("q",),
        velocities=("v",),
        parameters=PARAMETERS,
        mass=_mass,
        forces=_forces,
        contacts=[Contact("cam", gap=_gap, restitution="e")],
        period=_turn,
        units={
            "q": "m",
            "v": "m/s",
            "t": "s",
            "m": "kg",
            "k": "N/m",
            "c": "N s/m",
            "g": "m/s^2",
            "d": "m",
            "a": "m",
            "w": "rad/s",
            "energy": "J",
        },
        outputs={"energy": _energy},
        laws=Laws(balance={"free": {"energy": ("energy", _power)}}),
    )


def critical_speed(parameters: Mapping[str, float] | None = None) -> float:
    """The least angular velocity (rad/s) at which the follower leaves the cam; infinite if there is none.

    Parameters
    ----------
    parameters
        Those that differ from the defaults.

    Examples
    --------
    >>> from models.cam_follower import critical_speed
    >>> round(critical_speed({"c": 0.0}) ** 2, 6)
    1490.5
    """
    p = {**PARAMETERS, **({} if parameters is None else parameters)}
    press = (p["k"] * p["d"] + p["m"] * p["g"]) / p["a"]
    squares = np.roots([p["m"] ** 2, p["c"] ** 2 - 2 * p["k"] * p["m"], p["k"] ** 2 - press**2])
    speeds = [float(np.sqrt(root.real)) for root in squares if root.imag == 0.0 and root.real > 0.0]
    return min(speeds, default=np.inf)


def _mass(t, x, p):
    return (p.m,)


def _forces(t, x, p):
    return (-p.k * (x.q + p.d) - p.c * x.v - p.m * p.g,)


def _gap(t, x, p):
    return x.q - p.a * np.cos(p.w * t)


def _turn(p):
    return 2 * np.pi / p.w


def _energy(t, x, p):
    return p.m * x.v**2 / 2 + p.k * (x.q + p.d) ** 2 / 2 + p.m * p.g * x.q


def _power(t, x, p):
    return -p.c * x.v**2
