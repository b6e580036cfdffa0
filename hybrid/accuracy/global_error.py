"""How far the end of a run and its events may be from the truth, judged by tighter runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import arguments
from hybrid.compiler.compiled import compile_system
from hybrid.compiler.interrupts import CTRL_C
from hybrid.errors import ArgumentError
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.interrupt import interrupted_status
from hybrid.simulation.plan import check_solver
from hybrid.simulation.simulate import simulate
from hybrid.solvers import Solver
from hybrid.solvers.solver import LEAST_RTOL
from hybrid.status import Status, StatusCode
from hybrid.system.graph import HybridSystem, as_system

TIGHTER = (10.0, 100.0)
EPSILON = float(np.finfo(float).eps)
# Rounding of a run in units in the last place of its start, over the root of the number of its steps.
ROUNDING = 16.0
# The error changes sign along a run, and the tighter runs with it: the bare sum would fail now and then.
SAFETY = 1.5


@attrs.frozen(eq=False, repr=False)
class GlobalError:
    """A run and how far it may be from the exact solution.

    Attributes
    ----------
    arc
        The run at the tolerances asked for.
    x
        ``(n,)``: estimated bounds of the absolute errors of the last state, in its units.
    jumps
        ``(jumps,)``: those of the times of the jumps; infinite from the first jump on which the runs differ.
    status
        That of the arc, which says if a pulse may have been stepped over: the bounds do not cover that. Or
        ``NOT_CONVERGED`` if tighter runs jump differently: then the tolerances do not decide which events
        occur.

    Examples
    --------
    >>> import hybrid, models
    >>> found = hybrid.global_error(models.impact_oscillator(), (0.0, 0.0), (0.0, 20.0))
    >>> found.status.ok, bool(found.x.max() < 1e-6), len(found.jumps) == len(found.arc.jumps)
    (True, True, True)
    """

    arc: HybridArc
    x: np.ndarray
    jumps: np.ndarray
    status: Status

    def __repr__(self) -> str:
        times = f", {self.jumps.max():.1e} in time of jumps" if len(self.jumps) else ""
        return f"<GlobalError {self.x.max():.1e} in the last state{times}, {self.status.brief}>"


@arguments.without_tolerances
def global_error(
    system: HybridSystem,
    x0: ArrayLike,
    t_span: tuple[float, float],
    *,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    solver: Solver | None = None,
    max_jumps: int = 100_000,
) -> GlobalError:
    r"""Simulate, and estimate the global error by a ladder of tolerances.

    With :math:`x` at the tolerances asked for and :math:`x', x''` at a tenth and a hundredth of them,

    .. math:: E = \tfrac32 \left( |x - x''| + |x' - x''| \right) + 2 \epsilon\, |x|,

    The first difference is the error itself if the tolerances control the error. The second difference guards
    against a first one that is small by chance. The starts of the tighter runs are shifted by the rounding of
    a run, :math:`16 \epsilon \sqrt{\text{steps}}` times the largest values of the components, so that the
    growth of rounding errors is seen, which no tolerance reduces.

    On cases with exact answers where tolerances control the error, the estimate is 1.6 times the error and
    bounds it in 97 to 100 of 100 cases. At the level of rounding, about 1e-14, the estimate is ten times the
    error with :class:`hybrid.Tsit5` and bounds it in nine of ten cases; with :class:`hybrid.DOP853` it is
    twenty times the error and nearly always a bound; where :class:`hybrid.Taylor` is exact it is twenty to
    two hundred times the error.

    The two additional runs cost three times the first run with :class:`hybrid.DOP853`, and four times with
    methods of order 5. Where orbits separate exponentially, the estimate grows with the error until the runs
    have different jumps.

    Parameters
    ----------
    system, x0, t_span, mode, parameters, solver, max_jumps
        As for :func:`hybrid.simulate`. The estimate does not include the uncertainty of these numbers.

    Returns
    -------
    GlobalError

    Raises
    ------
    ArgumentError
        If ``rtol`` is below 1e-13, so that no tighter run is possible, or an argument does not fit.

    Examples
    --------
    >>> import models
    >>> from hybrid import global_error
    >>> found = global_error(models.bouncing_ball(), (1.0, 0.0), (0.0, 2.0))
    >>> exact = (2 * 1.0 / 9.81) ** 0.5
    >>> bool(abs(found.arc.jumps[0].t - exact) <= found.jumps[0] < 1e-13)
    True
    """
    as_system("system", system)
    solver = check_solver(solver)
    if solver.rtol < 10 * LEAST_RTOL:
        raise ArgumentError(
            f"global_error compares with runs at tighter tolerances, so rtol must be at least "
            f"{10 * LEAST_RTOL:.0e}; got {solver.rtol:.0e}."
        )

    def run(at: Solver, start: ArrayLike, mode: str | None) -> HybridArc:
        return simulate(
            system, start, t_span, mode=mode, parameters=parameters, solver=at, max_jumps=max_jumps
        )

    compile_system(system)
    with CTRL_C:
        return _estimated(system, solver, run, x0, mode)


def _estimated(
    system: HybridSystem, solver: Solver, run: Callable[..., HybridArc], x0: ArrayLike, mode: str | None
) -> GlobalError:
    arc = run(solver, x0, mode)
    rungs = [solver.tightened(factor) for factor in TIGHTER]
    aside = ROUNDING * EPSILON * np.sqrt(1 + arc.steps) * np.abs(arc.x).max(axis=0)
    aside[system.tangent_dimension :] = 0.0
    # Two directions, so that no component has a difference of zero in both runs.
    signs = np.ones(system.dimension), (-1.0) ** np.arange(system.dimension)
    begin = str(arc.mode[0])

    def moved(rung: Solver, sign: np.ndarray) -> HybridArc:
        # A shifted start may lie beyond a guard, or off the surface on which its mode stays.
        others = []
        for side in (sign, -sign):
            others.append(run(rung, arc.x[0] + side * aside, begin))
            if _alike(arc, others[-1]):
                return others[-1]
        near = (other for other in others if _starts_alike(arc, other))
        return next(near, None) or run(rung, arc.x[0], begin)

    found = _compare(arc, *map(moved, rungs, signs))
    if not CTRL_C.is_set():
        return found
    return attrs.evolve(found, status=interrupted_status("the run up to there, without an estimate"))


def _starts_alike(one: HybridArc, other: HybridArc) -> bool:
    """Whether the first jumps of two runs are the same, at nearly the same time."""
    if not (len(one.jumps) and len(other.jumps)):
        return len(one.jumps) == len(other.jumps)
    near = abs(one.jumps.t[0] - other.jumps.t[0]) <= 1e-6 * (one.t[-1] - one.t[0])
    return bool(near and one.jumps.transition_index[0] == other.jumps.transition_index[0])


def _alike(one: HybridArc, other: HybridArc) -> bool:
    """Whether two runs made the same jumps and ended alike."""
    same = len(one.jumps) == len(other.jumps) == _agreement(one, other)
    return same and one.status.code == other.status.code


def _compare(arc: HybridArc, tighter: HybridArc, tightest: HybridArc) -> GlobalError:
    runs = (arc, tighter, tightest)
    x = _bound(*(run.x[-1] for run in runs))
    common = min(_agreement(arc, other) for other in (tighter, tightest))
    times = np.full(len(arc.jumps), np.inf)
    times[:common] = _bound(*(run.jumps.t[:common] for run in runs))
    status = arc.status
    if not all(_alike(arc, other) for other in (tighter, tightest)):
        if any(run.mode[-1] != arc.mode[-1] for run in runs):
            x[:] = np.inf
        status = Status(
            StatusCode.NOT_CONVERGED,
            f"Runs at tighter tolerances agree on the first {common} of {len(arc.jumps)} jumps, ending with "
            f"{', '.join(run.status.code.name for run in runs)}.",
            "Tighten rtol and atol, or shorten the run. A chaotic run loses its digits at any tolerance.",
        )
    return GlobalError(arc, x, times, status)


def _bound(value: np.ndarray, tighter: np.ndarray, tightest: np.ndarray) -> np.ndarray:
    spread: np.ndarray = np.abs(value - tightest) + np.abs(tighter - tightest)
    return SAFETY * spread + 2 * EPSILON * np.abs(value)


def _agreement(one: HybridArc, other: HybridArc) -> int:
    """How many jumps from the first on are the same: in their transitions, and by and large in their times.

    Times that differ by more than the mean time between jumps may belong to any two of them.
    """
    length = min(len(one.jumps), len(other.jumps))
    transitions = one.jumps.transition_index[:length] != other.jumps.transition_index[:length]
    apart = np.abs(one.jumps.t[:length] - other.jumps.t[:length])
    differ = np.flatnonzero(transitions | (apart * length > one.t[-1] - one.t[0]))
    return int(differ[0]) if len(differ) else length
