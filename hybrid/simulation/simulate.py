"""From a model and a start to a hybrid arc."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.simulation.arc import HybridArc, without_component
from hybrid.simulation.end import ArcEnd
from hybrid.simulation.periods import check_time
from hybrid.simulation.recorder import Recorder
from hybrid.simulation.sensitivity import with_sensitivities
from hybrid.simulation.trajectory import start
from hybrid.solvers import Solver
from hybrid.system.graph import HybridSystem, as_system
from hybrid.system.growth import growing


@growing
def simulate(
    system: HybridSystem,
    x0: ArrayLike | ArcEnd,
    t_span: tuple[float, float],
    *,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    solver: Solver | None = None,
    tangent: ArrayLike | bool | None = None,
    samples: ArrayLike | None = None,
    keep_jumps: bool | None = None,
    max_jumps: int = 100_000,
    sensitivities: Iterable[str] = (),
) -> HybridArc:
    """Solve a hybrid system from ``x0`` over ``t_span``.

    Parameters
    ----------
    system
        The model.
    x0
        State ``(n,)`` at the start, in order or by name: ``{"q": 1.0, "v": 0.0}``. A Series of pandas or a
        DataArray of xarray that is labelled with the names is read by these, in any order. Held components
        and counters come last and may be left out: they are 0 then. The end of a run, ``arc.end``, goes on
        from there with the mode, the parameters, the clocks and the memory of that run.
    t_span
        ``(t0, t1)`` with ``t0 <= t1``. Events at ``t1`` belong to the run.
    mode
        Mode to start in; by default the only one, or the ``start`` of the system, or the only one whose
        guards allow ``x0``. In a mode that is known so, a guard that ``x0`` lies beyond counts as crossed,
        and the status says so.
    parameters
        Values that override the system's.
    solver
        Method and tolerances, by default ``Taylor(rtol=1e-10, atol=1e-12)``: what fits each mode.
    tangent
        True for the fundamental matrix, or an ``(n, k)`` matrix of tangent vectors to carry, with a row for
        every component but the counters; their error is controlled with the state's.
    samples
        Increasing times at which to store the state; only these states are then stored, so the memory of a
        run does not grow with its length.
    keep_jumps
        Whether the arc holds its jumps; by default it does without ``samples``, and not with them.
        ``arc.jump_count`` is their number in any case.
    max_jumps
        The run ends with a status at this many jumps.
    sensitivities
        Names of parameters: the arc then has the derivatives of its end, its samples and the times of its
        jumps in these parameters and in the start, at fixed times; see :class:`HybridArc`.

    Returns
    -------
    HybridArc
        With a status; a run that ends early keeps its results up to there. Ctrl-C ends a run that takes
        longer than a few milliseconds with the status ``INTERRUPTED``.

    Raises
    ------
    ModelError
        If the model cannot be compiled, or an argument does not fit it (ArgumentError).

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.bouncing_ball(), x0=(1.0, 0.0), t_span=(0.0, 1.0))
    >>> round(arc.jumps[0].t, 4)
    0.4515
    """
    as_system("system", system)
    t0, t1 = arguments.time_span("t_span", t_span)
    times = None if samples is None else arguments.increasing_times("samples", samples, t0, t1)
    vectors = None if tangent is None or tangent is False else _tangent_matrix(tangent, system)
    most = arguments.count("max_jumps", max_jumps, 0)
    if keep_jumps is None:
        keep_jumps = times is None
    elif not arguments.flag("keep_jumps", keep_jumps) and times is None:
        raise ArgumentError(
            "keep_jumps=False needs samples=: the points of an arc are made of its jumps too."
        )
    names = _parameter_names(system, sensitivities)
    if names and isinstance(x0, ArcEnd) and system.aging:
        raise ArgumentError(
            "sensitivities= needs a start at which the mode is entered, because an After counts from there; "
            "x0 is the end of a run. Give x0=end.x and mode=end.mode."
        )
    trajectory = start(
        system,
        x0,
        t0,
        mode=mode,
        parameters=parameters,
        solver=solver,
        tangent=vectors,
        time="t_span",
        horizon=t1 - t0,
    )
    check_time("t_span", t1, trajectory.model.period)
    begun = (trajectory.x, trajectory.mode) if names else None
    arc = Recorder(trajectory, times, t1, bool(keep_jumps)).run(t1, most)
    trajectory.release()
    age = arc.system.age
    if age is not None and system.age is None:
        # The age was there for the tangent vectors alone.
        arc = without_component(arc, age, system)
        begun = None if begun is None else (np.delete(begun[0], age), begun[1])
    if begun is None:
        return arc
    return with_sensitivities(
        arc, names, *begun, (t0, t1), solver=solver, max_jumps=most, samples=times, simulate=simulate
    )


def _parameter_names(system: HybridSystem, given: Any) -> tuple[str, ...]:
    if isinstance(given, tuple) and not given:
        return ()
    names = arguments.items("sensitivities", given, "be names of parameters")
    for name in names:
        arguments.known("sensitivities: Parameter", name, system.parameters, "Parameters")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ArgumentError(f"sensitivities: {twice[0]!r} is given twice. Give each name once.")
    return tuple(names)


def _tangent_matrix(tangent: Any, system: HybridSystem) -> np.ndarray:
    n = system.tangent_dimension
    if tangent is True:
        return np.eye(n)
    wanted = f"be True or a finite matrix of shape ({n}, k), one tangent vector per column"
    matrix = arguments.numbers("tangent", tangent, wanted)
    if matrix.ndim == 1:
        matrix = matrix[:, None]
    if matrix.ndim != 2 or matrix.shape[0] != n or matrix.shape[1] == 0 or not np.all(np.isfinite(matrix)):
        raise arguments.refusal("tangent", wanted, matrix)
    return matrix
