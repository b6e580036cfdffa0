"""Growth rates of tangent vectors along several runs, summed in rounds of intervals."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import attrs
import numpy as np

from hybrid import ArgumentError, Status, arguments
from hybrid.compiler.cache.loader import load_kernels
from hybrid.display.progress import Progress
from hybrid.kernels.types import codes
from hybrid.kernels.types.entries import COUNTERS
from hybrid.measures.averages import (
    TaperedMean,
    standard_error_from_batches,
    taper_inflation,
)
from hybrid.simulation.ending import has_tangents, status_of
from hybrid.simulation.interrupt import Bursts
from hybrid.simulation.pace import time_scale
from hybrid.simulation.periods import check_time
from hybrid.simulation.trajectory import Trajectory
from hybrid.status import SUCCESS
from hybrid.transform.aged import least_dimension
from lyapunov.batches import EMPTY, closed_batch_means
from lyapunov.directions import (
    generic_directions,
    orthonormal_at_start,
)
from lyapunov.interval import INTERVALS_AT_ONCE, growths_layout

# Rounding of the time may be at most this share of an interval.
FINEST_INTERVAL = 2.0**-10

JUMPS_AND_STEPS = [COUNTERS.index("jumps"), COUNTERS.index("steps")]


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
