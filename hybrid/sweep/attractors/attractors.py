"""The attractors that starts lead to."""

from __future__ import annotations

from typing import Any, Unpack

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.progress import progress_bar
from hybrid.kernels.types import codes
from hybrid.shared import shares
from hybrid.simulation.ending import status_of
from hybrid.simulation.interrupt import interrupted_status
from hybrid.simulation.labelled import Names
from hybrid.status import Status, StatusCode
from hybrid.sweep.attractors.asked import AskedOfSearch
from hybrid.sweep.attractors.attractor import Attractors, unaged
from hybrid.sweep.attractors.featured import search_of
from hybrid.sweep.attractors.runs import CODE, OWNER
from hybrid.sweep.attractors.setup import Setup, setup_of
from hybrid.sweep.attractors.starts import axes_of, sample_of
from hybrid.sweep.attractors.stretches import UNMEASURED, features_in
from hybrid.sweep.local import cores
from hybrid.system.graph import HybridSystem
from hybrid.system.growth import growing
from hybrid.transform.aged import with_age


@growing
@shares(AskedOfSearch)
def attractors(
    system: HybridSystem,
    over: Any,
    *,
    starts: int = 500,
    seed: int = 0,
    executor: int | None = None,
    progress: bool | None = None,
    **asked: Unpack[AskedOfSearch],
) -> Attractors:
    """Attractors that random starts lead to, by recurrences of their runs on a section, or by features.

    The points of a run are taken once per forcing period; with ``section`` at each crossing of a surface;
    otherwise, for autonomous systems, at equal times. The first run goes on until its points come back: a
    round that repeats is a periodic orbit or an equilibrium, with the multipliers of its fundamental matrix;
    other motion is a sample of points, with exponents averaged along the run. Each later run is stopped in
    compiled code as soon as ``recurrences`` points in succession are near the points of one attractor. A run
    that is near none after ``periods`` points is followed further, and gives the next attractor.

    Recurrences suit attractors that are apart on the section. Where those of one kind lie closer together
    than ``tolerance``, lower it; where a start may wander for long before it settles, raise ``periods``.

    With ``features`` each run settles for ``periods`` points, and functions of the arc over its next points
    give numbers of it. Runs whose features lie together are one attractor, whatever their states do. Runs are
    joined nearest first (single linkage). The features are taken of three stretches of ``recurrences`` points
    each, with a half and a fifth of ``periods`` between them. Groups of runs are one attractor if in no
    feature the gap between them is wider than twice the root mean square of the largest change to the last
    stretch within one of them, than the square root of the solver's ``rtol`` times the feature, or than that
    of its ``atol``. ``together`` gives the widest gap by hand. If a run has come back to its points its
    stretches have whole rounds.
    A run that ends, or with a feature that is not finite, leads to no attractor.

    Parameters
    ----------
    system
        As for :func:`hybrid.simulate`.
    over : Mapping[str, float | tuple[float, float] | ArrayLike]
        For each component of the state a number, a range ``(low, high)``, or an array of values to draw from.
        Held components and counters may be left out: they are 0 then.
    starts, seed
        Number of random starts, and of their sequence. An attractor with a share ``f`` of the starts is
        missed with the probability ``(1 - f) ** starts``.
    executor : int, optional
        Number of threads; by default all cores.
    progress
        Whether to show a progress bar; by default in a terminal or a notebook, after two seconds.

    Returns
    -------
    Attractors
        A mapping of the labels 1, 2, ... to :class:`hybrid.Attractor`, with a status.

    Raises
    ------
    ModelError
        If the model cannot be compiled, or an argument does not fit it (ArgumentError).

    References
    ----------
    G. Datseris, A. Wagemakers, "Effortless estimation of basins of attraction", Chaos 32 (2022) 023104,
    doi:10.1063/5.0076568, is the method on a grid of cells; here distances to the points take the place of
    cells.

    M. Gelbrecht, J. Kurths, F. Hellmann, "Monte Carlo basin bifurcation analysis", New Journal of Physics 22
    (2020) 033032, doi:10.1088/1367-2630/ab7a05, and M. Stender, N. Hoffmann, "bSTAB: an open-source software
    for computing the basin stability of multi-stable dynamical systems", Nonlinear Dynamics 107 (2022) 1451,
    doi:10.1007/s11071-021-06786-5, group runs by features. P. F. Felzenszwalb, D. P. Huttenlocher, "Efficient
    graph-based image segmentation", International Journal of Computer Vision 59 (2004) 167,
    doi:10.1023/B:VISI.0000022288.19776.77, join groups by the gap between them and the differences within;
    here these are differences of a run from itself.

    Examples
    --------
    >>> import models
    >>> from hybrid import attractors
    >>> found = attractors(models.impact_oscillator(), {"x": (-1.0, 1.0), "v": (-2.0, 2.0)})
    >>> found[1].kind, found[1].jumps
    ('periodic', 1.0)
    """
    axes = axes_of(system, over)
    count = arguments.count("starts", starts, 1)
    origins = with_age(system, sample_of(system, axes, count, arguments.count("seed", seed, 0)))
    threads = cores() if executor is None else arguments.count("executor", executor, 1)
    setup = setup_of(system, origins, asked)
    search = search_of(setup, threads)
    with CTRL_C, progress_bar(count, "Attractors", as_flag(progress), "start") as bar:
        search.pilot(origins)
        rows = search.judged(origins, search.decided(origins, bar))
        stopped = CTRL_C.is_set()
    found, shown = unaged(search.ordered()[0], setup.system)
    status = (
        interrupted_status("the attractors found so far")
        if stopped
        else status_of_search(setup, origins, rows)
    )
    return Attractors(found, status, Names(shown.state_names, dict(shown.units)))


def as_flag(progress: object) -> bool | None:
    """The argument ``progress``, which may be None."""
    return None if progress is None else arguments.flag("progress", progress)


def status_of_search(setup: Setup, origins: np.ndarray, rows: np.ndarray) -> Status:
    """What a search says of starts that lead to no attractor."""
    full = _full(setup, origins, rows)
    if full is not None:
        return full
    unmeasured = np.flatnonzero(rows[:, CODE] == UNMEASURED)
    if unmeasured.size and setup.features is not None:
        values = features_in(rows[unmeasured])[0]
        names = [name for name, each in zip(setup.features.names, values.T, strict=True) if _lacks(each)]
        return Status(
            StatusCode.NOT_CONVERGED,
            f"{len(unmeasured)} of {len(rows)} starts lead to no attractor, because of features that are not "
            f"finite: {', '.join(names)}.",
            "Let each function give a finite number of every run.",
        )
    undecided = int(np.sum((rows[:, OWNER] < 0) & (rows[:, CODE] == codes.MAX_STEPS)))
    ended = int(np.sum((rows[:, OWNER] < 0) & (rows[:, CODE] > codes.MAX_STEPS)))
    beyond = int(np.sum(rows[:, CODE] == codes.REFUSED))
    told = []
    if ended:
        told.append(f"The runs of {ended} of {len(rows)} starts end on their way.")
    if beyond:
        told.append(f"{beyond} of {len(rows)} starts violate every mode.")
    if undecided:
        return Status(
            StatusCode.NOT_CONVERGED,
            f"{undecided} of {len(rows)} starts are near no attractor after {setup.periods} points.",
            "Raise periods=, or tolerance= where an attractor is a large set.",
        )
    return Status(StatusCode.SUCCESS, " ".join(["Every start is decided.", *told]))


def _lacks(values: np.ndarray) -> bool:
    return not np.isfinite(values).all()


def _full(setup: Setup, origins: np.ndarray, rows: np.ndarray) -> Status | None:
    """The status of a start whose run ended as a delay had no place left; None if there is none."""
    ended = np.flatnonzero(rows[:, CODE] == codes.NON_FINITE) if setup.system.under_way else ()
    for i in ended:
        trajectory = setup.begin(origins[i], setup.mode)
        code = trajectory.advance(setup.t0 + setup.periods * setup.interval, trajectory.no_record())
        status = status_of(trajectory, code)
        if status.code == StatusCode.DELAY_FULL:
            return attrs.evolve(status, message=f"Of {len(ended)} of {len(rows)} starts: {status.message}")
    return None
