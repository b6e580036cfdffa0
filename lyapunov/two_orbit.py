"""Exponents from the distance of two orbits: three formulas that saturate and one that converges."""

from __future__ import annotations

import math
from typing import Any, Unpack

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import ArgumentError, HybridSystem, Status, StatusCode, arguments
from hybrid.compiler.cache.loader import load_kernels
from hybrid.display.progress import Progress, progress_bar
from hybrid.kernels.types import codes
from hybrid.measures.averages import running_tapered_mean
from hybrid.shared import shares
from hybrid.simulation.ending import status_of
from hybrid.simulation.interrupt import Bursts
from hybrid.simulation.labelled import Names
from hybrid.simulation.trajectory import Trajectory, start
from hybrid.system.entries import has_age
from hybrid.system.graph import as_system
from hybrid.system.growth import growing
from hybrid.transform.aged import aged, with_age
from lyapunov.asked import Averaging, begun, numbers_of
from lyapunov.estimates import interval_length
from lyapunov.interval import INTERVALS_AT_ONCE, end_at

# The renormalised companion has no digits left this many roundings of the state from the orbit, or so near
# the least of all numbers.
EPSILON = float(np.finfo(float).eps)
LEAST_ROUNDINGS = 4096.0
LEAST_DISTANCE = 1e-290
# Nor is its distance small beyond this share of the largest distance of the free companion, if it has grown
# by so much.
MOST_OF_RANGE = 0.03
MOST_GROWTH = 100.0


@attrs.frozen(eq=False, repr=False)
class TwoOrbitExponents:
    r"""Estimates of the largest exponent from the distance to a companion orbit, as histories over ``M``.

    With :math:`d_0` the separation, :math:`T` the length of an interval and :math:`d_i` the distance after
    the i-th interval, formulas (7) to (9) of [1]_ are

    .. math::

        \lambda_7 = \frac{1}{M T} \ln\frac{d_M}{d_0}, \qquad
        \lambda_8 = \frac{1}{M T} \sum_{i=1}^{M} \ln\frac{d_i}{d_{i-1}}, \qquad
        \lambda_9 = \frac{1}{M T} \sum_{i=1}^{M} \ln\frac{d_i}{d_0}.

    None of these formulas converges to an exponent. The sum in (8) telescopes, so (8) equals (7). The
    distance stops growing at the size of the attractor for a chaotic orbit. For a stable orbit it stops
    shrinking at rounding or at the solver's tolerance. From then on both estimates decay like ``1 / M``.
    Formula (9) lacks a division by ``i`` in its terms. It tends to the mean of :math:`\ln(d_i / d_0)` at
    saturation, divided by :math:`T`.

    A companion that is rescaled to the separation after each interval [2]_ avoids these faults: its estimate
    converges and needs no derivatives.

    Attributes
    ----------
    distances
        ``(M,)``: distance of the free companion at the end of each interval. The phase of the forcing, a
        coordinate in [1]_, is the same for both orbits and adds nothing.
    renormalised_growths
        ``(M,)``: growth rate of the distance of the renormalised companion over each interval.
    separation, interval
        Distance at the start, and length of an interval in units of time.
    status
        How the runs ended; the histories hold the completed intervals. INDISTINCT_TANGENTS if the
        renormalised companion came within rounding of the orbit, or as far from it as two orbits can be.
    unit
        Unit of the exponents, if the system names that of the time.

    References
    ----------
    .. [1] V. A. Bazhenov, O. S. Pogorelova, T. G. Postnikova, "Lyapunov exponents estimation for strongly
       nonlinear nonsmooth discontinuous vibroimpact system", 2017.
    .. [2] G. Benettin, L. Galgani, J.-M. Strelcyn, "Kolmogorov entropy and numerical experiments", Phys.
       Rev. A 14 (1976) 2338, doi:10.1103/PhysRevA.14.2338.

    Examples
    --------
    >>> import models
    >>> from lyapunov import two_orbit_exponents
    >>> result = two_orbit_exponents(models.impact_oscillator(), (0.0, 0.0), intervals=400, transient=100)
    >>> result.single_piece.shape, round(result.renormalised_exponent, 2)
    ((400,), -0.09)
    """

    distances: np.ndarray
    renormalised_growths: np.ndarray
    separation: float
    interval: float
    status: Status
    unit: str = ""

    @property
    def intervals(self) -> int:
        """Number of completed intervals."""
        return len(self.distances)

    @property
    def single_piece(self) -> np.ndarray:
        """Formula (7), ``(M,)``; minus infinity where the orbits coincide."""
        return _log_ratio(self.distances, self.separation) / self._elapsed

    @property
    def telescoped(self) -> np.ndarray:
        """Formula (8), ``(M,)``, summed term by term; minus infinity from the first coincidence on."""
        before = np.concatenate([[self.separation], self.distances[:-1]])
        # The distance may leave zero again by rounding, but the sum stays minus infinity.
        return np.cumsum(_log_ratio(self.distances, before)) / self._elapsed

    @property
    def undivided(self) -> np.ndarray:
        """Formula (9), ``(M,)``; minus infinity from the first coincidence on."""
        return np.cumsum(_log_ratio(self.distances, self.separation)) / self._elapsed

    @property
    def renormalised(self) -> np.ndarray:
        """Plain running means ``(M,)`` of the growth rates of the renormalised companion."""
        return np.cumsum(self.renormalised_growths) / np.arange(1, self.intervals + 1)

    @property
    def renormalised_exponent(self) -> float:
        """The estimate to use: the tapered mean of ``renormalised_growths``, nan without intervals."""
        if self.intervals == 0:
            return math.nan
        return float(running_tapered_mean(self.renormalised_growths[:, None])[-1, 0])

    @property
    def _elapsed(self) -> np.ndarray:
        return self.interval * np.arange(1, self.intervals + 1)

    def __repr__(self) -> str:
        value = f"{self.renormalised_exponent:.8g}"
        return f"<TwoOrbitExponents {value} of {self.intervals} intervals, {self.status.brief}>"


@growing
@shares(Averaging, transient=0)
def two_orbit_exponents(
    system: HybridSystem,
    x0: ArrayLike,
    *,
    separation: float = 1e-8,
    direction: ArrayLike | None = None,
    progress: bool = False,
    **asked: Unpack[Averaging],
) -> TwoOrbitExponents:
    """Estimates of the largest exponent from two neighbouring orbits, without derivatives.

    Parameters
    ----------
    system, x0
        As for :func:`hybrid.simulate`.
    separation
        Distance of the companion at the start, in the units of the state. It should be small against the
        lengths over which the model is nonlinear, and well above the solver's tolerances and the rounding of
        the state. Distances near the tolerance show the steps of the two runs, not the separation of orbits.
    direction
        ``(n,)`` without counters: direction from the reference to the companion, of any length; by default
        all components are equal.
    intervals
        Number of intervals to follow the orbits.
    transient
        Number of intervals to run the reference orbit before the companion is placed.
    progress
        Whether to show a progress bar.

    Returns
    -------
    TwoOrbitExponents

    Raises
    ------
    ModelError
        If the model cannot be compiled, or an argument does not fit it (ArgumentError).

    Notes
    -----
    The companion starts in the only mode that the guards allow; if they do not allow exactly one, it starts
    in the mode of the reference orbit.

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from lyapunov import two_orbit_exponents
    >>> result = two_orbit_exponents(models.impact_oscillator(), (0.0, 0.0), intervals=400, transient=100)
    >>> bool(np.allclose(result.telescoped, result.single_piece))
    True
    >>> round(result.renormalised_exponent, 3)
    -0.086
    """
    as_system("system", system)
    transient, intervals = numbers_of(asked)
    separation = arguments.positive("separation", separation, "be a positive distance")
    progress = arguments.flag("progress", progress)
    state = with_age(system, system.variables.state_values("x0", x0))
    reference = begun(aged(system), state, asked)
    offset = separation * _direction(direction, system, reference)
    length = interval_length(reference, asked["interval"], transient + intervals)
    unit = Names(system.state_names, system.units).rate.get("units", "")
    load_kernels("lyapunov.kernels")
    with reference.stop, progress_bar(transient + intervals, "Two orbits", progress) as bar:
        code = _skip(reference, transient, length)
        bar.update(transient)
        if code != codes.DONE:
            nothing = np.empty(0)
            return TwoOrbitExponents(nothing, nothing, separation, length, status_of(reference, code), unit)
        companions = [_companion(reference, offset, asked) for _ in range(2)]
        distances, status = _follow(reference, companions, separation, length, intervals, bar)
    free, renormalised = distances.T
    growths = _log_ratio(renormalised, separation) / length
    if status.ok:
        size = float(np.linalg.norm(reference.run.scale))
        status = _judged(status, free, renormalised, separation, size)
    return TwoOrbitExponents(free.copy(), growths, separation, length, status, unit)


def _judged(
    status: Status, free: np.ndarray, renormalised: np.ndarray, separation: float, size: float
) -> Status:
    """The status, unless the renormalised companion has lost its digits or has left its neighbourhood.

    ``size`` is that of the state, whose rounding no distance resolves.
    """
    lost = int(np.sum(renormalised <= max(LEAST_ROUNDINGS * EPSILON * size, LEAST_DISTANCE)))
    if lost:
        return Status(
            StatusCode.INDISTINCT_TANGENTS,
            f"On {lost} of {len(free)} intervals the renormalised companion came within rounding of the "
            "orbit. Its growth there is that of the rounding.",
            "Give a shorter interval= or a larger separation=, or use lyapunov_spectrum.",
        )
    grown = renormalised > max(MOST_OF_RANGE * float(np.max(free)), MOST_GROWTH * separation)
    far = int(np.sum(grown))
    if far:
        return Status(
            StatusCode.INDISTINCT_TANGENTS,
            f"On {far} of {len(free)} intervals the renormalised companion came as far from the orbit as "
            "any two orbits do. Its growth there is not that of a small distance.",
            "Give a shorter interval= or a smaller separation=, or use lyapunov_spectrum.",
        )
    return status


def _log_ratio(distances: np.ndarray, before: np.ndarray | float) -> np.ndarray:
    """Logarithms of quotients, which may leave the range of numbers; minus infinity where either is zero."""
    known = (distances > 0) & (np.asarray(before) > 0)
    with np.errstate(divide="ignore"):
        logs = np.log(distances)
        return np.subtract(logs, np.log(before), out=np.full_like(logs, -np.inf), where=known)


def _direction(direction: ArrayLike | None, system: HybridSystem, reference: Trajectory) -> np.ndarray:
    """The unit vector from the reference to its companion: none of its parts is along a counter."""
    whole, n = reference.system, system.tangent_dimension
    found = np.zeros(whole.dimension)
    if direction is not None:
        found[:n] = _unit_vector(direction, n)
        return found
    moves = whole.age is not None and has_age(whole, reference.mode)
    n += 1 if moves and system.age is None else 0
    found[:n] = 1.0 / math.sqrt(n)
    return found


def _unit_vector(direction: ArrayLike, n: int) -> np.ndarray:
    vector = arguments.numbers("direction", direction, f"be a finite vector of shape ({n},), not zero")
    largest = np.abs(vector).max(initial=0.0)
    if vector.shape != (n,) or not 0.0 < largest < math.inf:
        raise ArgumentError(
            f"direction must be a finite vector of shape ({n},), not zero; got {arguments.shown(direction)}."
        )
    # The squares of its components may leave the range of numbers.
    shares = vector / largest
    return shares / np.linalg.norm(shares)


def _skip(trajectory: Trajectory, intervals: int, interval: float) -> int:
    """Run a number of intervals, exactly if they are forcing periods; return the driver's code."""
    record = trajectory.no_record()
    if interval == trajectory.model.period:
        cycle, phase = trajectory.run.cycle, trajectory.run.phase
        return trajectory.advance_to(int(cycle) + intervals, float(phase), record)
    return trajectory.advance(trajectory.t + intervals * interval, record)


def _companion(
    reference: Trajectory,
    offset: np.ndarray,
    asked: Averaging,
) -> Trajectory:
    """A trajectory that starts beside the current point of the reference, at exactly the same time."""
    place = (reference.system, reference.x + offset, reference.t)
    parameters, solver = asked["parameters"], asked["solver"]
    try:
        companion = start(*place, parameters=parameters, solver=solver, by_guards=True)
    except ArgumentError:
        companion = start(*place, mode=reference.mode, parameters=parameters, solver=solver)
    if companion.mode == reference.mode:
        # It is as if the companion had come from the reference, and had crossed any guard between the two.
        companion.goes_on_from(reference)
    else:
        companion.run.cycle = reference.run.cycle
        companion.run.phase, companion.run.phase_low = reference.run.phase, reference.run.phase_low
    return companion


def _follow(
    reference: Trajectory,
    companions: list[Trajectory],
    separation: float,
    interval: float,
    intervals: int,
    bar: Progress,
) -> tuple[np.ndarray, Status]:
    """Distances ``(M, 2)`` of the free and the renormalised companion, and how the runs ended."""
    kernel = load_kernels("lyapunov.kernels").distances
    advance = load_kernels().advance
    runs: list[Any] = [reference, *companions]
    end = end_at(reference.run)
    tasks = [run.task(run.no_record()) for run in runs]
    kept, total, code = [np.empty((0, 2))], 0, codes.DONE
    bursts = Bursts(runs)
    memory = [end.counters, end.numbers, *(part for run in runs for part in (run.run, run.work))]
    while total < intervals and code in (codes.DONE, codes.GO_ON):
        bursts.most()
        out = np.empty((min(INTERVALS_AT_ONCE, intervals - total), 2))
        resumed, end.done = code == codes.GO_ON, 0

        def more(parts: Any, resumed: bool = resumed, out: np.ndarray = out) -> int:
            most = reference.max_steps, bursts.steps
            return kernel(advance, parts, *tasks, end, interval, separation, *most, resumed, out)

        code = reference.plan.called(more, *memory)
        done = int(end.done)
        code = bursts.judged(code)
        kept.append(out[:done])
        total += done
        bar.update(done)
    unfinished = (run for run in runs if (run.run.cycle, run.run.phase) != (end.cycle, end.phase))
    return np.concatenate(kept), status_of(next(unfinished, reference), code)
