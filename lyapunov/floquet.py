"""Exponents of a periodic orbit from its multipliers: the exact answer to hold long averages against."""

from __future__ import annotations

import numpy as np

from hybrid import PeriodicOrbit, arguments


def floquet_exponents(orbit: PeriodicOrbit) -> np.ndarray:
    r"""Real parts of the Floquet exponents of a periodic orbit, its Lyapunov exponents.

    .. math:: \lambda_i = \ln|\rho_i| / T

    Parameters
    ----------
    orbit
        From :func:`hybrid.periodic_orbit`: the logarithms of its multipliers :math:`\rho_i`, which are known
        however small these are, and its period :math:`T`.

    Returns
    -------
    (n,) array
        In the order of the multipliers, in inverse units of time; minus infinity for a multiplier that is
        zero, a direction that a saltation matrix annihilates.

    References
    ----------
    R. I. Leine, H. Nijmeijer, "Dynamics and Bifurcations of Non-Smooth Mechanical Systems", Springer 2004,
    section 7.3, doi:10.1007/978-3-540-44398-8.

    Examples
    --------
    >>> import hybrid, models
    >>> orbit = hybrid.periodic_orbit(models.impact_oscillator(), (1.0, 1.0))
    >>> floquet_exponents(orbit).round(5)
    array([-0.08551, -0.08551])
    """
    arguments.instance("orbit", orbit, PeriodicOrbit, "Find one with hybrid.periodic_orbit.")
    return orbit.log_moduli / orbit.period
