"""The 0-1 test for chaos, on a series of numbers."""

from __future__ import annotations

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import ArgumentError, arguments

# Frequencies near the resonances 0, pi and 2 pi are left out (section 3.1 of the paper).
LOWEST, HIGHEST = np.pi / 5, 4 * np.pi / 5
# Share of the series over which the displacement is followed (section 2 of the paper).
SHARE = 10
EPSILON = float(np.finfo(float).eps)
WANTED = "be a series of finite numbers of shape (N,)"


@attrs.frozen(eq=False, repr=False)
class ZeroOneTest:
    """Result of the 0-1 test.

    Attributes
    ----------
    K
        Median of the growth rates: near 1 for a chaotic series, near 0 for a regular one.
    frequencies, growth
        The frequencies ``c (M,)``, and the growth rate ``K_c (M,)`` at each, between -1 and 1.

    Examples
    --------
    >>> import numpy as np
    >>> from lyapunov import zero_one_test
    >>> result = zero_one_test(np.cos(np.arange(2000.0)))
    >>> bool(abs(result.K) < 0.05), result.growth.shape == result.frequencies.shape
    (True, True)
    """

    K: float
    frequencies: np.ndarray
    growth: np.ndarray

    def __repr__(self) -> str:
        return f"<ZeroOneTest K = {self.K:.4g} of {len(self.growth)} frequencies>"


def zero_one_test(series: ArrayLike, *, frequencies: int = 100) -> ZeroOneTest:
    r"""Test for chaos by Gottwald and Melbourne: the improved test, with the correlation method.

    The series :math:`\phi` drives a rotation in the plane at each frequency :math:`c`,

    .. math:: p_c(n) + \mathrm{i}\, q_c(n) = \sum_{j=1}^{n} \phi(j)\, e^{\mathrm{i} j c},

    which stays bounded if the series is regular and wanders like a random walk if it is chaotic. The mean
    square displacement :math:`M_c(n)`, without its oscillating part, is

    .. math:: D_c(n) = M_c(n) - \bar\phi^2\, \frac{1 - \cos n c}{1 - \cos c}, \quad n = 1, \dots, N/10,

    and :math:`K_c` is the correlation of :math:`D_c(n)` with :math:`n`. ``K`` is the median of :math:`K_c`
    over frequencies drawn, always the same, between :math:`\pi/5` and :math:`4 \pi/5`.

    **Oversampling hides chaos.** A series that is sampled many times per oscillation of the system has no
    power at these frequencies, so ``K`` is near 0 even if the system is chaotic. Give one number per forcing
    period, from :func:`hybrid.stroboscopic_section`, or one per crossing, from
    :func:`hybrid.poincare_section`. The test needs a few thousand numbers, and weak chaos more; noise counts
    as chaos.

    Parameters
    ----------
    series
        The numbers ``(N,)``, 100 or more, at equal distances in time or from a section.
    frequencies
        How many frequencies to try.

    Returns
    -------
    ZeroOneTest
        ``K`` is 0 for a constant series.

    Raises
    ------
    ArgumentError
        If the series is too short, or has a number that is not finite.

    References
    ----------
    G. A. Gottwald, I. Melbourne, "On the implementation of the 0-1 test for chaos", SIAM J. Appl. Dyn. Syst.
    8 (2009) 129, doi:10.1137/080718851: section 2 (the displacement), section 3 (frequencies, the oscillating
    part, correlation, oversampling).

    Examples
    --------
    >>> import numpy as np
    >>> from lyapunov import zero_one_test
    >>> x = [0.3]
    >>> for _ in range(2000):
    ...     x.append(4.0 * x[-1] * (1.0 - x[-1]))
    >>> bool(zero_one_test(x).K > 0.98)
    True
    >>> bool(abs(zero_one_test(np.cos(np.arange(2000.0))).K) < 0.05)
    True
    """
    values = arguments.numbers("series", series, WANTED)
    if values.ndim != 1 or len(values) < SHARE**2:
        raise ArgumentError(
            f"series must be {SHARE**2} numbers or more, of shape (N,); got shape {values.shape}. "
            "Give one component of a section: section.x[:, 0]."
        )
    if not np.isfinite(values).all():
        bad = int(np.flatnonzero(~np.isfinite(values))[0])
        raise ArgumentError(f"series must {WANTED}; got series[{bad}] = {values[bad]}.")
    count = arguments.count("frequencies", frequencies, 1)
    tried = np.sort(np.random.default_rng(0).uniform(LOWEST, HIGHEST, count))
    # In units in which no square leaves the range of floats.
    size = np.abs(values).max()
    growth = np.array([_growth(values / (size or 1.0), c) for c in tried])
    return ZeroOneTest(float(np.median(growth)), tried, growth)


def _growth(values: np.ndarray, c: float) -> float:
    """Correlation of ``D_c(n)`` with ``n``; 0 where the displacement is only rounding."""
    length = len(values) // SHARE
    lags = np.arange(1, length + 1)
    place = np.cumsum(values * np.exp(1j * c * np.arange(1, len(values) + 1)))
    oscillating = values.mean() ** 2 * (1 - np.cos(lags * c)) / (1 - np.cos(c))
    place -= place.mean()
    moved = _displacement(place, length) - oscillating
    rounding = len(values) * EPSILON * np.mean(np.abs(place) ** 2)
    if not np.ptp(moved) > rounding:
        return 0.0
    return float(np.corrcoef(lags, moved)[0, 1])


def _displacement(place: np.ndarray, length: int) -> np.ndarray:
    """Mean of ``|z(j + n) - z(j)|^2`` over the first ``N - length`` places, for lags 1 to ``length``."""
    first = len(place) - length
    squares = np.concatenate([[0.0], np.cumsum(np.abs(place) ** 2)])
    lags = np.arange(1, length + 1)
    size = 1 << (2 * len(place) - 1).bit_length()
    spectrum = np.fft.fft(place, size) * np.conj(np.fft.fft(place[:first], size))
    product = np.fft.ifft(spectrum)[1 : length + 1].real
    return np.asarray((squares[first + lags] - squares[lags] + squares[first] - 2 * product) / first)
