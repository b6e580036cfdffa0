"""Lyapunov spectra by orthonormalisation, with a saltation matrix at every jump."""

from __future__ import annotations

from functools import partial
from html import escape
from typing import TYPE_CHECKING, Any, Unpack

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import HybridSystem, Status, arguments
from hybrid.compiler.cache.loader import load_kernels
from hybrid.display.progress import progress_bar
from hybrid.display.tables import counted, html_table
from hybrid.measures.averages import (
    running_tapered_mean,
)
from hybrid.shared import shares
from hybrid.simulation.labelled import Names, attributes
from hybrid.system.growth import growing
from hybrid.transform.aged import original_of, without_age
from lyapunov.asked import Averaging, begun, numbers_of
from lyapunov.directions import (
    first_vectors,
    number_of_exponents,
    orthonormal_at_start,
)
from lyapunov.estimates import Estimates, Flight, interval_length
from lyapunov.per_transition import JumpRates, PerTransition

if TYPE_CHECKING:
    import xarray


@attrs.frozen(eq=False, repr=False)
class LyapunovSpectrum:
    """Lyapunov exponents of one orbit, largest first for a generic start, in inverse units of time.

    Attributes
    ----------
    exponents
        ``(k,)``. Tapered means of the growth rates (see :class:`hybrid.measures.averages.TaperedMean`). On
        periodic and quasi-periodic motion their error falls like ``M^-3``; the error of the plain mean falls
        like ``1 / M``. Minus infinity for a direction that a saltation matrix annihilates.
    standard_error
        ``(k,)``. Exponent plus and minus two standard errors contains the true exponent of this attractor
        in 95 % of runs. Too wide on regular motion.
    sum_rule
        Required sum of the exponents if ``k = n``: the time average of div f plus the mean log-determinant
        of the saltation matrices per unit time, along the same orbit and with the same weights. nan where
        nothing is left to compare: where some modes have an `hybrid.After` and others have none, since
        entries forget the age, and where the last exponent is taken from this sum, with an implicit solver.
    growths
        ``(intervals, k)``: growth rate of each direction over each interval; empty with ``history=False``.
    interval, intervals
        Length of an interval in units of time, and number of completed intervals.
    jumps_per_interval, steps_per_interval
        Mean numbers of jumps and of solver steps per interval, including rejected steps.
    mode, x
        End of the orbit: name of the mode, and state ``(n,)``.
    status
        How the run ended.
    names
        Names of the state's components, and units where the system has them.
    jump_rates
        How often each transition fires, beside the growth rates, for `per`.

    Examples
    --------
    >>> import models
    >>> from lyapunov import lyapunov_spectrum
    >>> spectrum = lyapunov_spectrum(models.impact_oscillator(), (0.0, 0.0), intervals=500)
    >>> spectrum.exponents.shape, spectrum.growths.shape
    ((2,), (500, 2))
    >>> round(spectrum.sum_rule, 4), spectrum.status.ok
    (-0.171, True)
    """

    exponents: np.ndarray
    standard_error: np.ndarray
    sum_rule: float
    growths: np.ndarray
    interval: float
    intervals: int
    jumps_per_interval: float
    steps_per_interval: float
    mode: str
    x: np.ndarray
    status: Status
    names: Names
    jump_rates: JumpRates

    def per(self, transition: str) -> PerTransition:
        """Exponents per jump of a transition instead of per unit time: ``.exponents``, ``.standard_error``.

        They are the exponents times the mean time between its jumps. The errors are smaller than those of the
        two factors where growth and jumps come together.

        Parameters
        ----------
        transition
            Name of the transition. Jumps that only the limit of a chatter stands for are not counted.

        Raises
        ------
        ArgumentError
            If there is no such transition, or it did not fire.
        """
        return self.jump_rates.per(transition)

    @property
    def history(self) -> np.ndarray:
        """Estimates ``(intervals, k)`` after each interval; the last row is ``exponents``."""
        return running_tapered_mean(self.growths)

    @property
    def benettin_history(self) -> np.ndarray:
        """Plain running means ``(intervals, k)`` of the growth rates: formula (10) of the paper."""
        return np.cumsum(self.growths, axis=0) / np.arange(1, len(self.growths) + 1)[:, None]

    @property
    def sum_defect(self) -> float:
        """Sum of the exponents minus the sum rule; it does not detect most errors of the tangents.

        It is zero if both are minus infinity.
        """
        total = float(self.exponents.sum())
        return 0.0 if total == self.sum_rule else total - self.sum_rule

    def to_xarray(self) -> xarray.Dataset:
        """The spectrum with the names of a chart; with a history also ``growths`` over the axis ``time``."""
        import xarray

        variables: dict[str, Any] = {
            "exponents": ("exponent", self.exponents, self.names.rate),
            "standard_error": ("exponent", self.standard_error, self.names.rate),
            "sum_rule": ((), self.sum_rule, self.names.rate),
            "interval": ((), self.interval, self.names.of("t")),
            "intervals": self.intervals,
            "jumps_per_interval": self.jumps_per_interval,
            "steps_per_interval": self.steps_per_interval,
            "x_end": ("state", self.x, self.names.states),
            "mode_end": self.mode,
        }
        coords = {"exponent": np.arange(1, len(self.exponents) + 1), **self.names.coords()}
        if len(self.growths):
            variables["growths"] = (("time", "exponent"), self.growths, self.names.rate)
            ends = self.interval * np.arange(1, len(self.growths) + 1)
            coords["time"] = ("time", ends, self.names.of("t"))
        return xarray.Dataset(variables, coords, attributes("spectrum", self.status))

    def __repr__(self) -> str:
        pairs = zip(self.exponents, self.standard_error, strict=True)
        values = ", ".join(f"{value:.8g} +- {error:.1g}" for value, error in pairs)
        if not self.intervals:
            return f"<LyapunovSpectrum without a complete interval, {self.status}>"
        return f"<LyapunovSpectrum [{values}] of {counted(self.intervals, 'interval')}, {self.status.brief}>"

    def _repr_html_(self) -> str:
        """The exponents as a table for a notebook, with the sum rule and the status."""
        unit = self.names.rate.get("units", "")
        names = ("", f"exponent {unit}".rstrip(), "standard error")
        pairs = zip(self.exponents, self.standard_error, strict=True)
        rows = [[str(i), f"{value:.8g}", f"{error:.1g}"] for i, (value, error) in enumerate(pairs, start=1)]
        rows.append(["sum rule", f"{self.sum_rule:.8g}", ""])
        told = f"{counted(self.intervals, 'interval')} of {self.interval:.6g}. {self.status}"
        return f"{html_table(names, rows)}\n<p>{escape(told)}</p>"


@growing
@shares(Averaging)
def lyapunov_spectrum(
    system: HybridSystem,
    x0: ArrayLike,
    *,
    k: int | None = None,
    history: bool = True,
    progress: bool = False,
    **asked: Unpack[Averaging],
) -> LyapunovSpectrum:
    """Lyapunov exponents by repeated orthonormalisation of tangent vectors.

    The variational equation carries the vectors in a mode, and the saltation matrix carries them across a
    jump (Mueller 1995). The error control includes the vectors. They are orthonormalised at the end of each
    interval, and around jumps whose saltation matrices nearly annihilate a direction.

    An implicit solver carries no vector along the last of all ``n`` directions. In a stiff mode that vector
    shrinks at the fast rate, and steps would have to follow it. Its exponent is what the others leave of the
    sum rule.

    Parameters
    ----------
    system, x0
        As for :func:`hybrid.simulate`.
    k
        Number of exponents, 1 to n; all by default, since only all of them have a sum rule. If every mode has
        an `hybrid.After`, the time since the entry is one more direction.
    history
        Whether to keep the growth rates of each interval. If False, memory does not grow with ``intervals``.
    progress
        Whether to show a progress bar.

    Returns
    -------
    LyapunovSpectrum

    Raises
    ------
    ModelError
        If the model cannot be compiled, or an argument does not fit it (ArgumentError).

    References
    ----------
    G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn, Meccanica 15 (1980) 9, doi:10.1007/BF02128236, part
    2; P. Mueller, Chaos, Solitons and Fractals 5 (1995) 1671, doi:10.1016/0960-0779(94)00170-U.

    Examples
    --------
    >>> import models
    >>> from lyapunov import lyapunov_spectrum
    >>> spectrum = lyapunov_spectrum(models.impact_oscillator(), (0.0, 0.0), intervals=500)
    >>> bool(abs(spectrum.sum_defect) < 1e-9)
    True
    """
    k = number_of_exponents(system, k)
    vectors = first_vectors(system, k, asked["solver"])
    transient, intervals = numbers_of(asked)
    history, progress = arguments.flag("history", history), arguments.flag("progress", progress)
    trajectory = begun(system, x0, asked, vectors)
    orthonormal_at_start(trajectory)
    length = interval_length(trajectory, asked["interval"], transient + intervals)
    load_kernels("lyapunov.kernels")
    estimates = Estimates([Flight(trajectory, length)], k, len(trajectory.system.transitions))
    with trajectory.stop, progress_bar(transient + intervals, "Lyapunov spectrum", progress) as bar:
        means = estimates.means(transient, intervals, history, partial(estimates.alone, bar))
    system = original_of(trajectory.system)
    found: dict[str, Any] = {name: each[0] for name, each in means._asdict().items()}
    jump_rates = JumpRates.of(system, k, found.pop("values"), *estimates.batches([0]))
    spectrum = LyapunovSpectrum(
        **found,
        interval=length,
        mode=trajectory.mode,
        x=without_age(system, trajectory.x),
        status=estimates.status(0),
        names=Names(system.state_names, dict(system.units)),
        jump_rates=jump_rates,
    )
    estimates.release()
    return spectrum
