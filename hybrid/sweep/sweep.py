"""A task at every point of a grid or a table."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from datetime import UTC, datetime
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid import arguments
from hybrid.display.progress import progress_bar
from hybrid.simulation.extra import load_xarray
from hybrid.simulation.identity import attributes_of, facts_of
from hybrid.sweep.job import Job
from hybrid.sweep.local import run_in_threads
from hybrid.sweep.outcome import Part
from hybrid.sweep.points import as_points
from hybrid.sweep.remote import Target, as_executor, run_on
from hybrid.sweep.sheet import Labels, Sheet

if TYPE_CHECKING:
    import xarray


def sweep(
    task: Callable[..., Any],
    over: Any,
    *,
    store: str | PathLike[str] | None = None,
    executor: int | Executor | Any | None = None,
    progress: bool | None = None,
) -> xarray.Dataset:
    """Call ``task(point)`` at every point of a grid or a table, in parallel; labelled results.

    A point that fails does so alone: its values are nan, and its status and message say why. Ctrl-C ends the
    sweep, not the program: the completed points are returned, and the others have the status ``NOT_RUN``.
    The results are the same to the last bit for any executor on machines of one kind.

    Parameters
    ----------
    task
        Function of a mapping of names to numbers. It returns a mapping of names to numbers, arrays or texts,
        or an ``xarray.Dataset``; names, shapes and labels must be the same at all points. A value
        ``"status"`` that is a :class:`hybrid.Status` becomes the status of the point.
    over : Mapping[str, ArrayLike] | Sequence[Mapping[str, float]] | xarray.Dataset
        ``{"omega": values, "e": values}`` for a grid of any number of axes, of which the last varies fastest;
        a list of mappings, or an ``xarray.Dataset`` of one dimension, for a table of points. Values with
        attributes (``xarray.DataArray``), such as units, keep them.
    store
        Folder of a store, for instance ``"run.zarr"``. Results are written as they are made, and the same
        call again computes only the points that the store lacks. Needs the extra ``grid``.
    executor : int | Executor | Client, optional
        By default threads on all cores; a number of threads; a ``concurrent.futures.Executor``; or a
        ``dask.distributed.Client``, which needs the extra ``grid``. Workers that see the folder of the store
        write there themselves.
    progress
        Whether to show a progress bar with the time left; by default in a terminal or a notebook, after two
        seconds.

    Returns
    -------
    xarray.Dataset
        The results over the axes of ``over``, with ``status`` (codes of :class:`hybrid.StatusCode`) and
        ``message``. Attributes say what made it: the task and a hash of its code, the model, versions, date.

    Raises
    ------
    ArgumentError
        If an argument does not fit, or the store was made by another call; the text names the difference.

    Examples
    --------
    >>> import hybrid, models
    >>> ball = models.bouncing_ball()
    >>> def heights(p):
    ...     arc = hybrid.simulate(ball, (1.0, 0.0), (0.0, 1.0), parameters=p)
    ...     return {"height": arc.x[-1, 0], "jumps": len(arc.jumps)}
    >>> swept = hybrid.sweep(heights, {"e": [0.7, 0.8], "g": [1.62, 9.81]})
    >>> swept.height.dims, int(swept.jumps.sel(e=0.8, g=9.81))
    (('e', 'g'), 1)
    """
    arguments.function("task", task, "a point")
    points = as_points(over)
    progress = None if progress is None else arguments.flag("progress", progress)
    threads = None
    if isinstance(executor, bool | int | np.integer | float | str):
        threads = arguments.count("executor", executor, 1)
    elif executor is not None:
        as_executor(executor)
    along = getattr(task, "along", None)
    lines = None if along is None else points.lines(along)
    load_xarray()

    labels = getattr(task, "labels", None) or Labels()
    sheet = Sheet(points)
    date = datetime.now(UTC).isoformat(timespec="seconds")
    made_by: dict[str, Any] = {**attributes_of(task), "date": date}
    kept = None
    if store is not None:
        from hybrid.sweep.store import Store

        kept = Store(store, facts_of(task), points, along)
        made_by["date"] = kept.begin(sheet, date, labels, made_by)
    if hasattr(task, "prepare"):
        # Once, before threads need the same kernels and functions.
        task.prepare()
    job = Job(task, points, np.flatnonzero(sheet.untouched()), lines)

    def keep(part: Part) -> None:
        sheet.put(part)
        if kept is not None:
            kept.write(part)

    with progress_bar(len(points), "Sweep", progress, "point", done=len(points) - len(job.rows)) as bar:
        if not len(job.rows):
            pass
        elif executor is None or threads is not None or isinstance(executor, ThreadPoolExecutor):
            pool = executor if isinstance(executor, ThreadPoolExecutor) else None
            run_in_threads(job, keep, bar.update, stored=kept is not None, pool=pool, threads=threads)
        else:
            target = None
            if kept is not None:
                path = str(kept.path.absolute())
                target = Target(path, kept.seal(), kept.keys, partial(kept.receive, sheet=sheet))
            run_on(executor, job, keep, bar.update, target)
    if kept is not None and sheet.untouched().any():
        kept.read_into(sheet)
    found = sheet.dataset(labels, made_by)
    if kept is not None:
        kept.finish(found, len(job.rows) > 0)
    return found
