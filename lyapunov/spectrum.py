"""Lyapunov spectra by orthonormalisation, with a saltation matrix at every jump."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import ArgumentError, HybridSystem, Status, arguments
from hybrid.compiler.cache.loader import load_kernels
from hybrid.display.progress import Progress, progress_bar
from hybrid.display.tables import counted, html_table
from hybrid.kernels.types import codes
from hybrid.kernels.types.entries import COUNTERS
from hybrid.measures.averages import (
    TaperedMean,
    running_tapered_mean,
    standard_error_from_batches,
    taper_inflation,
)
from hybrid.shared import shares
from hybrid.simulation.ending import has_tangents, status_of
from hybrid.simulation.interrupt import Bursts
from hybrid.simulation.labelled import Names, attributes
from hybrid.simulation.pace import time_scale
from hybrid.simulation.periods import check_time
from hybrid.simulation.trajectory import Trajectory
from hybrid.status import SUCCESS
from hybrid.system.growth import growing
from hybrid.transform.aged import least_dimension, original_of, without_age
from lyapunov.asked import Averaging, begun, numbers_of
from lyapunov.batches import EMPTY, closed_batch_means
from lyapunov.directions import (
    first_vectors,
    generic_directions,
    number_of_exponents,
    orthonormal_at_start,
)
from lyapunov.interval import INTERVALS_AT_ONCE, growths_layout
from lyapunov.per_transition import JumpRates, PerTransition

if TYPE_CHECKING:
    import xarray

# Rounding of the time may be at most this share of an interval.
FINEST_INTERVAL = 2.0**-10
JUMPS_AND_STEPS = [COUNTERS.index("jumps"), COUNTERS.index("steps")]


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


def interval_length(trajectory: Trajectory, interval: float | None, intervals: int) -> float:
    """The given interval, or the forcing period, or the time scale of the field at the start.

    The interval must be long compared with the rounding of the time after ``intervals`` intervals.
    """
    period = float(trajectory.model.period)
    if interval is not None:
        length = arguments.positive("interval", interval, "be a positive time")
    elif period > 0:
        return period
    else:
        length = time_scale(trajectory)
    check_time("interval", length, period)
    latest = period or max(abs(trajectory.t), abs(trajectory.t + length * intervals))
    if not math.ulp(latest) <= FINEST_INTERVAL * length:
        where = f"a period of {period}" if period else f"t0 = {trajectory.t} and {intervals} intervals"
        raise ArgumentError(
            f"interval must be long enough to advance the clock; got {length}, and with {where} times are "
            f"{math.ulp(latest):.2g} apart. Lengthen it, or start nearer to time zero."
        )
    return length


class Flight(NamedTuple):
    """A run at its start, and the length of its intervals."""

    trajectory: Trajectory
    length: float


class Means(NamedTuple):
    """What is found of several orbits, each over so many ``intervals``, as in a `LyapunovSpectrum`.

    ``values`` are the means of all columns of the growth rates.
    """

    exponents: np.ndarray
    standard_error: np.ndarray
    sum_rule: list[float]
    growths: Sequence[np.ndarray]
    intervals: list[int]
    jumps_per_interval: list[float]
    steps_per_interval: list[float]
    values: np.ndarray


class Estimates:
    """Advances runs of one plan and accumulates their growth rates, which a kernel returns in rounds.

    The trajectories carry a vector for each of the ``k`` exponents, or for all but the last of ``k = n``. The
    ``codes (R,)`` tell how the runs have ended, or are DONE for those that are under way. ``counted`` is the
    number of transitions whose jumps are counted: none, or for a run alone all of them.
    """

    def __init__(self, flights: Sequence[Flight], k: int, counted: int = 0) -> None:
        self.trajectories, lengths = zip(*flights, strict=True)
        self.k, self.first = k, self.trajectories[0]
        self.tasks = [each.task(each.no_record(), orthonormal=True) for each in self.trajectories]
        self.layout = growths_layout(len(flights), self.first.tangents, counted)
        growths = self.growths = self.layout.unwritten()
        growths.cycles[:] = [each.run.cycle for each in self.trajectories]
        growths.phases[:] = [each.run.phase for each in self.trajectories]
        growths.lengths[:] = lengths
        growths.batch_states[:] = EMPTY
        growths.plain[:] = 0
        self.codes = np.full(len(flights), codes.DONE)
        self.counts = np.zeros(len(flights), dtype=np.int64)

    def release(self) -> None:
        """Let the next runs have the memory of these, which nobody may look at any more."""
        self.layout.take_back(self.growths)
        for each in self.trajectories:
            each.release()

    def means(self, transient: int, intervals: int, history: bool, go: Callable[[], None]) -> Means:
        """What is found over ``intervals`` intervals, after ``transient`` intervals.

        ``go()`` takes the runs that are under way through the intervals of the next round.
        """
        growths, k, runs, system = self.growths, self.k, len(self.codes), self.first.system
        if transient:
            for _ in self._rounds(transient, go):
                pass
            growths.batch_states[:] = EMPTY
            for each in self.trajectories:
                # A vector of which only rounding was left is by now a new direction, like those at the start.
                each.run.indistinct, each.run.ill_conditioned_growth = 0, 0.0
            for i in np.flatnonzero(~self._stacked("y")[:, self.first.model.dimension :].all(axis=1)):
                _replace_annihilated(self.trajectories[i])
        mean = TaperedMean((runs, growths.rates.shape[-1]))
        kept, before = [np.empty((runs, 0, k))], self._made()
        for rates in self._rounds(intervals, go):
            mean.add(rates)
            self.counts += growths.done
            if history:
                kept.append(self._completed(rates)[..., :k].copy())
        values = self._completed(mean.value(self.counts))
        error = np.empty((runs, k))
        for places in self._alike():
            error[places] = standard_error_from_batches(self.batches(places)[..., :k]) * taper_inflation()
        jumps, steps = ((self._made() - before) / np.maximum(self.counts, 1)).tolist()
        compares = k == self.first.tangents and least_dimension(system) == system.tangent_dimension
        return Means(
            values[:, :k],
            error,
            values[:, k].tolist() if compares else [math.nan] * runs,
            [each[:count] for each, count in zip(np.concatenate(kept, axis=1), self.counts, strict=True)],
            self.counts.tolist(),
            jumps,
            steps,
            values,
        )

    def batches(self, places: list[int]) -> np.ndarray:
        """The means ``(..., b, columns)`` of the batches of runs that have the same number of batches."""
        growths = self.growths
        means = closed_batch_means(growths.batches, growths.batch_states[places[0]])
        return self._completed(means[places])

    def _stacked(self, name: str) -> np.ndarray:
        """An array of each run ``(R, ...)``."""
        return np.array([getattr(each.run, name) for each in self.trajectories])

    def _made(self) -> np.ndarray:
        """The jumps and the steps of the runs so far ``(2, R)``."""
        return self._stacked("counters")[:, JUMPS_AND_STEPS].T

    def _rounds(self, intervals: int, go: Callable[[], None]) -> Iterator[np.ndarray]:
        """The rates ``(R, m, columns)`` of intervals, round by round; zero after the end of a run."""
        growths, total = self.growths, 0
        while total < intervals and (self.codes == codes.DONE).any():
            count = growths.count = min(INTERVALS_AT_ONCE, intervals - total)
            growths.done[:] = 0
            go()
            rates = growths.rates[:, :count]
            for i in np.flatnonzero(growths.done < count):
                rates[i, growths.done[i] :] = 0.0
            yield rates
            total += count

    def _alike(self) -> Iterable[list[int]]:
        """The runs whose batches are of one number and size: all of them, unless some end early."""
        found: dict[bytes, list[int]] = {}
        for i, state in enumerate(self.growths.batch_states):
            found.setdefault(state.tobytes(), []).append(i)
        return found.values()

    def alone(self, bar: Progress) -> None:
        """Take the only run through a round, in bursts."""
        kernel, advance = load_kernels("lyapunov.kernels").growth_rates, load_kernels().advance
        trajectory, growths, [task] = self.first, self.growths, self.tasks
        resumed, code = False, int(codes.DONE)
        bursts = Bursts([trajectory])
        while growths.done[0] < growths.count and code in (codes.DONE, codes.GO_ON):
            most, before = bursts.most(), int(growths.done[0])

            def more(parts: Any, resumed: bool = resumed, most: int = most) -> int:
                return kernel(advance, parts, task, growths, most, resumed)

            code = trajectory.plan.called(more, trajectory.run, trajectory.work, growths)
            bar.update(int(growths.done[0]) - before)
            code = bursts.judged(code)
            resumed = code == codes.GO_ON
        self.codes[0] = code

    def _completed(self, rates: np.ndarray) -> np.ndarray:
        """Rates ``(..., columns)`` with the last growth: what the others leave of the sum, if not carried."""
        carried = self.first.tangents
        if self.k == carried:
            return rates
        total = rates[..., carried]
        with np.errstate(invalid="ignore"):
            last = np.where(total == -np.inf, total, total - rates[..., :carried].sum(axis=-1))
        return np.insert(rates, carried, last, axis=-1)

    def status(self, i: int) -> Status:
        """How run ``i`` has ended."""
        trajectory = self.trajectories[i]
        plain = self.codes[i] == codes.DONE and self.growths.plain[i] == 1
        if plain and not trajectory.beyond and has_tangents(trajectory):
            return SUCCESS
        status = status_of(trajectory, int(self.codes[i]))
        run = trajectory.run
        if not status.ok or not run.ill_conditioned:
            return status
        share = run.ill_conditioned_growth / (self.growths.lengths[i] * max(self.counts[i], 1))
        return attrs.evolve(
            status, message=f"{status.message} They contribute {share:.3g} to the first exponent."
        )


def _replace_annihilated(trajectory: Trajectory) -> None:
    """Give a new direction to each tangent vector that a jump has annihilated.

    A direction that is annihilated again and again has the exponent minus infinity. Annihilation during the
    transient alone does not mean that.
    """
    n = trajectory.model.dimension
    vectors = trajectory.run.y[n:].reshape(-1, n)[:, : trajectory.system.tangent_dimension]
    n = vectors.shape[1]
    gone = ~vectors.any(axis=1)
    if gone.any():
        kept = vectors[~gone]
        basis, _ = np.linalg.qr(np.vstack([kept, generic_directions(n, n)]).T)
        vectors[gone] = basis[:, len(kept) : len(vectors)].T
        orthonormal_at_start(trajectory)
