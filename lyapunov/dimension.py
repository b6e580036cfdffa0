"""Dimension of an attractor from its Lyapunov exponents."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hybrid import ArgumentError, arguments

WANTED = "be exponents of shape (n,), one or more"


def kaplan_yorke_dimension(exponents: ArrayLike) -> float:
    r"""Lyapunov dimension by the formula of Kaplan and Yorke.

    .. math:: D = j + \frac{\lambda_1 + \dots + \lambda_j}{|\lambda_{j+1}|}, \qquad
        \lambda_1 + \dots + \lambda_j \ge 0 > \lambda_1 + \dots + \lambda_{j+1}

    The exponents need not be in order. ``D`` is 0 if all are negative, ``n`` if their sum is not negative,
    and ``j`` if :math:`\lambda_{j+1}` is minus infinity: a direction that a jump annihilates adds nothing.

    Parameters
    ----------
    exponents
        All exponents of the attractor ``(n,)``, finite or minus infinity. For a forced system without the
        zero exponent of the phase this is the dimension of a stroboscopic section; that in space and time is
        larger by one. An exponent whose exact value is zero should be given as zero.

    Raises
    ------
    ArgumentError
        If an exponent is nan or plus infinity, or there is none.

    References
    ----------
    J. L. Kaplan, J. A. Yorke, Lecture Notes in Mathematics 730 (1979) 204, doi:10.1007/BFb0064319; P.
    Frederickson, J. L. Kaplan, E. D. Yorke, J. A. Yorke, J. Differ. Equ. 49 (1983) 185, equation (2),
    doi:10.1016/0022-0396(83)90011-6.

    Examples
    --------
    >>> import numpy as np
    >>> from lyapunov import kaplan_yorke_dimension
    >>> kaplan_yorke_dimension([0.5, 0.0, -2.0])
    2.25
    >>> kaplan_yorke_dimension([0.5, 0.0, -np.inf])
    2.0
    """
    found = arguments.numbers("exponents", exponents, WANTED)
    if found.ndim != 1 or not found.size:
        raise ArgumentError(f"exponents must {WANTED}; got shape {found.shape}.")
    bad = np.flatnonzero(np.isnan(found) | (found == np.inf))
    if bad.size:
        raise ArgumentError(
            f"exponents must be finite or minus infinity; got exponents[{bad[0]}] = {found[bad[0]]}. "
            "Look at the status of the run that they come from."
        )
    ordered = np.sort(found)[::-1]
    sums = np.cumsum(ordered)
    j = int(np.sum(sums >= 0.0))
    if j == 0 or j == len(ordered):
        return float(j)
    return float(j + sums[j - 1] / -ordered[j])
