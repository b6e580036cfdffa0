"""Basins of attraction: which attractor each start of a grid leads to."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any, Unpack

import attrs
import numpy as np

from hybrid.compiler.interrupts import CTRL_C
from hybrid.errors import ArgumentError
from hybrid.kernels.types import codes
from hybrid.shared import shares
from hybrid.simulation.extra import load_xarray
from hybrid.simulation.interrupt import interrupted_status
from hybrid.simulation.labelled import Names
from hybrid.status import Status, StatusCode
from hybrid.sweep.attractors.asked import AskedOfSearch
from hybrid.sweep.attractors.attractor import Attractors, unaged
from hybrid.sweep.attractors.attractors import as_flag, status_of_search
from hybrid.sweep.attractors.featured import search_of
from hybrid.sweep.attractors.find import Found
from hybrid.sweep.attractors.runs import CODE, COLUMNS, NONE, OWNER, POINTS, runs_of
from hybrid.sweep.attractors.search import FIRST_POINTS, known_of
from hybrid.sweep.attractors.setup import Setup, digest, setup_of
from hybrid.sweep.attractors.starts import Grid, axes_of, grid_of
from hybrid.sweep.attractors.stretches import features_in, measured, untouched
from hybrid.sweep.local import cores
from hybrid.sweep.sheet import flags
from hybrid.sweep.sweep import sweep
from hybrid.system.graph import HybridSystem, starting_mode
from hybrid.system.growth import growing
from hybrid.transform.aged import original_of, with_age

if TYPE_CHECKING:
    import xarray

RESERVED = (
    *("label", "steps", "status", "message", "attractor", "exponent", "point", "state", "kind", "round"),
    *("period", "jumps", "exponents", "standard_error", "points", "mode_of_point", "fraction", "unit"),
)
# Names of results that searches by features have besides.
OF_FEATURES = ("feature", "features", "lowest_feature", "highest_feature", "features_of_start")
VIOLATES = -1


@growing
@shares(AskedOfSearch)
def basins(
    system: HybridSystem,
    over: Any,
    *,
    store: str | PathLike[str] | None = None,
    executor: Any = None,
    progress: bool | None = None,
    **asked: Unpack[AskedOfSearch],
) -> xarray.Dataset:
    """Which attractor each start of a grid leads to, with the attractors.

    The method is that of :func:`hybrid.attractors`. The labels depend neither on the order of the starts nor
    on the number of threads. Ctrl-C ends the call, not the program: lines of the grid that are not complete
    have the label 0 and the status ``NOT_RUN``.

    Parameters
    ----------
    system
        As for :func:`hybrid.simulate`.
    over : Mapping[str, float | tuple[float, float] | ArrayLike]
        For each component of the state a number, which all starts have; an array of values; or a range
        ``(low, high)``, of which 100 values are taken. Each array or range is an axis of the grid. Held
        components and counters may be left out: they are 0 then.
    store, executor, progress
        As for :func:`hybrid.sweep`: the points of the sweep are the lines of the grid along its first axis.
        Lines that a store holds are not run again.

    Returns
    -------
    xarray.Dataset
        Over the axes of the grid: ``label``, 1, 2, ... for an attractor, 0 for none (see ``status``: the run
        ended, or was near no attractor after ``periods`` points), -1 for a start that violates every mode, or
        the mode that the call or the system names: it lies beyond a guard of each. The attribute
        ``violated_modes`` names these. ``steps`` is the number of points until the decision. With the
        attractors over the axis ``attractor``, as ``Attractors.to_xarray`` gives them, and their share of the
        grid, ``fraction``; after Ctrl-C, of the lines that are complete. With features also those of each
        start, ``features_of_start``, over the axes of the grid and the axis ``feature``.

    Raises
    ------
    ModelError
        If the model cannot be compiled, or an argument does not fit it (ArgumentError).

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import basins
    >>> found = basins(models.impact_oscillator(), {"x": np.linspace(-1, 1.5, 6), "v": [-1.0, 1.0]})
    >>> found.label.values.tolist()
    [[1, 1], [1, 1], [1, 1], [1, 1], [1, 1], [-1, -1]]
    """
    load_xarray()

    axes = axes_of(system, over, RESERVED if asked["features"] is None else (*RESERVED, *OF_FEATURES))
    shown = as_flag(progress)
    grid = grid_of(system, axes)
    grid = attrs.evolve(grid, origins=with_age(system, grid.origins))
    setup = setup_of(system, grid.origins, asked)
    threads = executor if isinstance(executor, int) and not isinstance(executor, bool) else None
    search = search_of(setup, max(1, threads or cores()))
    with CTRL_C:
        search.pilot(grid.origins)
        lines = Lines(setup, grid, tuple(search.found))
        rows = lines.not_run()
        if not CTRL_C.is_set():
            rows = _rows(lines, store=store, executor=executor, progress=shown)
        if not CTRL_C.is_set():
            rows = search.decided(grid.origins, found=rows)
        rows = search.judged(grid.origins, rows)
        stopped = CTRL_C.is_set()
    status = (
        interrupted_status("the lines that were complete")
        if stopped
        else status_of_search(setup, grid.origins, rows)
    )
    return _dataset(setup, grid, search, rows, status)


def _rows(lines: Lines, **options: Any) -> np.ndarray:
    """What is found of each start with the attractors known so far, by a sweep over lines of the grid."""
    grid = lines.grid
    if not grid.axes:
        return lines.rows(grid.origins)
    first = grid.axes[0]
    # The values of an axis may occur twice, and need not be in order.
    swept = sweep(lines, {first.name: first.points()}, **options)
    rows = lines.not_run()
    if "rows" in swept:
        made = swept["rows"].values.reshape(rows.shape)
        done = np.isfinite(made[:, 0])
        rows[done] = made[done]
    failed = np.flatnonzero(swept.status.values == StatusCode.FAILED)
    if failed.size:
        raise ArgumentError(str(swept.message.values[failed[0]]))
    return rows


@attrs.frozen(eq=False)
class Lines:
    """The task of a sweep: the starts of a grid that have one value along its first axis.

    They are decided by the attractors ``found`` so far, or their features are taken.
    """

    setup: Setup
    grid: Grid
    found: tuple[Found, ...]

    def not_run(self) -> np.ndarray:
        """Rows of starts that have not been run."""
        if self.setup.features is not None:
            return untouched(len(self.grid.origins), self.setup.features)
        rows = np.zeros((len(self.grid.origins), COLUMNS), dtype=np.int64)
        rows[:, OWNER], rows[:, CODE] = NONE, StatusCode.NOT_RUN
        return rows

    def __call__(self, point: Mapping[str, float]) -> dict[str, np.ndarray]:
        """What is found of each start of the line."""
        [found] = self.together([point], [None])
        return found

    def together(
        self, points: Sequence[Mapping[str, float]], _: Sequence[None]
    ) -> list[dict[str, np.ndarray]]:
        """What is found of each start of several lines; runs take their steps together."""
        length = len(self.grid.origins) // self.grid.shape[0]
        origins = np.tile(self.grid.origins[:length], (len(points), 1))
        for i, point in enumerate(points):
            [(name, value)] = point.items()
            column = self.setup.system.state_names.index(name)
            origins[i * length : (i + 1) * length, column] = value
        rows = self.rows(origins).astype(float)
        return [{"rows": each} for each in rows.reshape(len(points), length, -1)]

    def rows(self, origins: np.ndarray) -> np.ndarray:
        """What is found of starts."""
        if self.setup.features is not None:
            return measured(self.setup, self.setup.features, origins)
        most = min(FIRST_POINTS, self.setup.periods) if self.found else 0
        return runs_of(self.setup).settle(origins, known_of(self.setup, list(self.found)), most)

    def prepare(self) -> None:
        """Load what the runs need."""
        runs_of(self.setup)

    @property
    def system(self) -> HybridSystem:
        """The model."""
        return original_of(self.setup.system)

    @property
    def facts(self) -> dict[str, Any]:
        """What decides the results: the setup, the other axes, the attractors."""
        length = len(self.grid.origins) // self.grid.shape[0]
        others = np.delete(
            self.grid.origins[:length], self.setup.system.state_names.index(self.grid.dims[0]), axis=1
        )
        found = [digest(np.vstack([each.radius, each.attractor.points])) for each in self.found]
        return {**self.setup.facts(), "starts": digest(others), "attractors": found}


def _dataset(setup: Setup, grid: Grid, search: Any, rows: np.ndarray, status: Status) -> xarray.Dataset:
    system, shape, dims = setup.system, grid.shape, grid.dims
    features = features_in(rows)[0]
    rows = rows[:, :COLUMNS].astype(np.int64)
    found, labels = search.ordered()
    label = np.where(rows[:, OWNER] >= 0, labels[rows[:, OWNER]], 0)
    label[rows[:, CODE] == codes.REFUSED] = VIOLATES
    named = starting_mode(system, setup.mode)
    violated = list(system.mode_names) if named is None else [named]
    code = np.where(rows[:, CODE] == codes.REFUSED, StatusCode.FAILED, rows[:, CODE])
    code = np.where(rows[:, CODE] == codes.MAX_STEPS, StatusCode.NOT_CONVERGED, code)
    found, shown = unaged(found, system)
    names = Names(shown.state_names, dict(shown.units))
    made = Attractors(found, status, names).to_xarray()
    told = {"0": "no attractor", "-1": f"violates {', '.join(violated)}"}
    made["label"] = (dims, label.reshape(shape), {f"meaning of {key}": text for key, text in told.items()})
    made["steps"] = (dims, rows[:, POINTS].reshape(shape))
    if setup.features is not None:
        made = made.assign_coords(feature=[*setup.features.names])
        made["features_of_start"] = ((*dims, "feature"), features.reshape(*shape, -1))
    made["status"] = (dims, code.reshape(shape).astype(np.int16), flags())
    run = rows[:, CODE] != StatusCode.NOT_RUN
    shares = [float(np.sum(label == i)) / max(1, int(run.sum())) for i in range(1, len(found) + 1)]
    made["fraction"] = ("attractor", np.array(shares))
    for axis in grid.axes:
        made = made.assign_coords(
            {axis.name: (axis.name, axis.points(), {**names.of(axis.name), **axis.attrs})}
        )
    fixed = {name: float(grid.origins[0, i]) for i, name in enumerate(system.state_names) if name not in dims}
    used = {**system.parameters, **setup.parameters}
    return made.assign_attrs(
        kind="basins",
        model=system.name or "unnamed",
        model_parameters=json.dumps({name: float(value) for name, value in used.items()}),
        fixed=json.dumps(fixed),
        violated_modes=json.dumps(violated) if (label == VIOLATES).any() else "[]",
    )
