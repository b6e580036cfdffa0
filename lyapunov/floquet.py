"""Exponents of a periodic orbit from its multipliers: an exact reference for long averages."""

from __future__ import annotations

import numpy as np

from hybrid import ArgumentError, PeriodicOrbit, arguments


def floquet_exponents(orbit: PeriodicOrbit) -> np.ndarray:
    r"""Lyapunov exponents of a periodic orbit: the real parts of its Floquet exponents.

    .. math:: \lambda_i = \ln|\rho_i| / T

    Parameters
    ----------
    orbit
        From :func:`hybrid.periodic_orbit`. It holds the period :math:`T` and the logarithms of the
        multipliers :math:`\rho_i`, so that even very small multipliers have finite exponents.

    Returns
    -------
    (n,) array
        In the order of the multipliers, in inverse units of time; minus infinity for a zero multiplier, a
        direction that a saltation matrix annihilates.

    Raises
    ------
    ArgumentError
        If the orbit has not converged; its ``log_moduli`` are those of the best point that was reached.

    References
    ----------
    R. I. Leine, H. Nijmeijer, "Dynamics and Bifurcations of Non-Smooth Mechanical Systems", Springer 2004,
    section 7.3, doi:10.1007/978-3-540-44398-8.

    Examples
    --------
    >>> import hybrid, models
    >>> from lyapunov import floquet_exponents
    >>> orbit = hybrid.periodic_orbit(models.impact_oscillator(), (1.0, 1.0))
    >>> floquet_exponents(orbit).round(5)
    array([-0.08551, -0.08551])
    """
    arguments.instance("orbit", orbit, PeriodicOrbit, "Find one with hybrid.periodic_orbit.")
    if not orbit.closes:
        raise ArgumentError(f"orbit has not converged: {orbit.status.message}")
    return orbit.log_moduli / orbit.period
