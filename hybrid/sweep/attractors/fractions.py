"""Shares of starts that lead to each attractor, at one set of parameters or followed along one of them."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import TYPE_CHECKING, Any, Unpack

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compiler.interrupts import CTRL_C
from hybrid.errors import ArgumentError
from hybrid.kernels.types import codes
from hybrid.shared import shares
from hybrid.simulation.extra import load_xarray
from hybrid.simulation.interrupt import interrupted_status
from hybrid.simulation.labelled import Names, attributes
from hybrid.status import Status, StatusCode
from hybrid.sweep.attractors.asked import AskedOfSearch
from hybrid.sweep.attractors.attractor import Attractor
from hybrid.sweep.attractors.attractors import as_flag, status_of_search
from hybrid.sweep.attractors.featured import search_of
from hybrid.sweep.attractors.follow import followed
from hybrid.sweep.attractors.runs import CODE, OWNER
from hybrid.sweep.attractors.setup import Setup, digest, setup_of
from hybrid.sweep.attractors.starts import axes_of, sample_of
from hybrid.sweep.attractors.text import read, written
from hybrid.sweep.sweep import sweep
from hybrid.system.graph import HybridSystem
from hybrid.system.growth import growing
from hybrid.transform.aged import original_of, with_age

if TYPE_CHECKING:
    import xarray

# Points of an attractor in the dataset, at most.
SHOWN = 128
# What is kept of the features of an attractor.
FEATURES = "features", "lowest_feature", "highest_feature"
# Random starts that are decided together: an interrupt loses those of one batch.
BATCH = 512
WANTED = 'be None, or map one parameter to its values, as {"w": np.linspace(0.8, 1.2, 41)}'


@growing
@shares(AskedOfSearch)
def basin_fractions(
    system: HybridSystem,
    over: Any,
    *,
    along: Mapping[str, Any] | None = None,
    starts: int = 1000,
    seed: int = 0,
    store: str | PathLike[str] | None = None,
    executor: Any = None,
    progress: bool | None = None,
    **asked: Unpack[AskedOfSearch],
) -> xarray.Dataset:
    r"""Shares of random starts that lead to each attractor, with standard errors; also over a parameter.

    A share :math:`f` of :math:`N` independent starts has the standard error
    :math:`\sqrt{f (1 - f) / N}`. After Ctrl-C the shares are those of the starts that were decided until
    then, which are a random sample too, and the message says how many they are.

    Over a parameter, each value has a search of its own, with the same starts. Attractors are then followed
    from value to value by their own points: the attractor to which a run from a point of the old one leads
    at the new value has its label. Of two that lead to the same, the nearer keeps its label and the other
    one dies. An attractor that no start has found, but to which an old one leads, is followed too.

    Parameters
    ----------
    system
        As for :func:`hybrid.simulate`.
    over : Mapping[str, float | tuple[float, float] | ArrayLike]
        For each component of the state a number, a range ``(low, high)``, or an array of values to draw from.
        Held components and counters may be left out: they are 0 then.
    along
        None, or one parameter with its values in order, ``{"w": values}``.
    starts, seed
        Number of random starts, and of their sequence.
    store, executor, progress
        As for :func:`hybrid.sweep`, over the values of the parameter.

    Returns
    -------
    xarray.Dataset
        Over the axis ``label`` (-1: violates every mode, 0: no attractor, 1, 2, ...): ``fraction`` and its
        ``standard_error``, ``kind``, ``round``, ``period`` and ``jumps`` of the attractors, and up to 128 of
        their ``points`` with the modes there, as in :class:`hybrid.Attractor`; with
        features also these, over the axis ``feature``. With ``along`` also over the
        axis of the parameter: there the labels count attractors in the order in which they appear; ``first``
        and ``last`` are the values between which each of them lives. :func:`hybrid.continue_all` compares
        such a dataset with branches.

    Raises
    ------
    ModelError
        If the model cannot be compiled, or an argument does not fit it (ArgumentError).

    Examples
    --------
    >>> import models
    >>> from hybrid import basin_fractions
    >>> shares = basin_fractions(models.impact_oscillator(), {"x": (-1.0, 1.0), "v": (-2.0, 2.0)}, starts=50)
    >>> float(shares.fraction.sel(label=1))
    1.0
    """
    load_xarray()

    axes = axes_of(system, over)
    count = arguments.count("starts", starts, 1)
    origins = with_age(system, sample_of(system, axes, count, arguments.count("seed", seed, 0)))
    name, values = _along(system, along, asked["parameters"])
    setup = setup_of(system, origins, asked)
    task = FractionsAt(setup, origins, name)
    shown = as_flag(progress)
    if name is None:
        with CTRL_C:
            found = task({})
            stopped = CTRL_C.is_set()
        alone, status = read(found["found"]), found["status"]
        if stopped:
            status = interrupted_status(f"the shares of the first {alone['starts']} of {count} random starts")
        alone["labels"] = list(range(1, len(alone["found"]) + 1))
        return _dataset(setup, [alone], None, None, status)
    swept = sweep(task, {name: values}, store=store, executor=executor, progress=shown)
    failed = np.flatnonzero(swept.status.values == StatusCode.FAILED)
    if failed.size == len(values):
        raise ArgumentError(str(swept.message.values[0]))
    made = swept["found"].values.tolist() if "found" in swept else [""] * len(values)
    result = _dataset(setup, followed(task, values, made), name, values, _status(swept))
    return result.assign_attrs({**swept.attrs, **result.attrs})


def _along(
    system: HybridSystem, along: object, parameters: Mapping[str, float] | None
) -> tuple[str | None, np.ndarray]:
    if along is None:
        return None, np.empty(0)
    given = arguments.mapping("along", along, WANTED)
    if len(given) != 1:
        raise arguments.refusal("along", WANTED, along)
    [(key, value)] = given.items()
    name = arguments.known("along: Parameter", key, system.parameters, "Parameters")
    system.parameter_values(parameters)
    if name in system.variables.overrides(parameters):
        raise ArgumentError(f"along: Parameter {name!r} is given twice: in along and in parameters.")
    values = arguments.numbers(f"along[{name!r}]", value, "be values in order")
    if values.ndim != 1 or not values.size or not np.isfinite(values).all():
        raise arguments.refusal(f"along[{name!r}]", "be finite values of shape (N,)", value)
    return name, values


def _status(swept: xarray.Dataset) -> Status:
    bad = np.flatnonzero(swept.status.values != StatusCode.SUCCESS)
    if not bad.size:
        return Status(StatusCode.SUCCESS, "Every start is decided at every value.")
    worst = bad[0]
    code = StatusCode(int(swept.status.values[worst]))
    return Status(code, f"{len(bad)} of {len(swept.status)} values: {swept.message.values[worst]}")


@attrs.frozen(eq=False)
class FractionsAt:
    """The task of a sweep: the attractors at one value of a parameter, and their shares of the starts."""

    setup: Setup
    origins: np.ndarray
    name: str | None

    def __call__(self, point: Mapping[str, float]) -> dict[str, Any]:
        """Attractors with their shares as text, and a status."""
        search = self.search(point)
        search.pilot(self.origins)
        rows = search.decided(self.origins[:0])
        for begin in range(0, len(self.origins), BATCH):
            batch = search.decided(self.origins[begin : begin + BATCH])
            # A batch that was interrupted holds the starts that are decided soon: it is no fair sample.
            if CTRL_C.is_set():
                break
            rows = np.vstack([rows, batch])
        rows = search.judged(self.origins[: len(rows)], rows)
        counts = [int(np.sum(rows[:, OWNER] == i)) for i in range(len(search.found))]
        beyond = int(np.sum(rows[:, CODE] == codes.REFUSED))
        text = written(search, counts, beyond, len(rows))
        return {"found": text, "status": status_of_search(search.setup, self.origins, rows)}

    def search(self, point: Mapping[str, float]) -> Any:
        """A search at a value of the parameter."""
        setup = attrs.evolve(self.setup, parameters={**self.setup.parameters, **point})
        if setup.forced:
            period = setup.system.forcing_period(setup.parameters)
            setup = attrs.evolve(setup, interval=float(period or setup.interval))
        return search_of(setup, 1)

    @property
    def system(self) -> HybridSystem:
        """The model."""
        return original_of(self.setup.system)

    @property
    def facts(self) -> dict[str, Any]:
        """What decides the results."""
        return {**self.setup.facts(), "starts": digest(self.origins)}


def _dataset(
    setup: Setup, found: list[dict[str, Any] | None], name: str | None, values: Any, status: Status
) -> xarray.Dataset:
    """Shares over labels, and over the values of a parameter if there is one."""
    import xarray

    most = max((max(each["labels"], default=0) for each in found if each is not None), default=0)
    labels = np.arange(-1, most + 1)
    asked = () if setup.features is None else setup.features.names
    columns = {
        **_shares(found, labels),
        **_attractors(found, labels, setup.system.dimension),
        **_features(found, labels, len(asked)),
    }
    names = Names(setup.system.state_names, dict(setup.system.units))
    used = {**setup.system.parameters, **setup.parameters}
    made_by = {**attributes("fractions", status, setup.system, used), "t0": setup.t0}
    inner = {
        "points": ("point", "state"),
        "mode_of_point": ("point",),
        **dict.fromkeys(FEATURES, ("feature",)),
    }
    units = {"period": names.of("t"), "points": names.states}
    coords: dict[str, Any] = {"label": labels, **names.coords()}
    if asked:
        coords["feature"] = [*asked]
    if name is None:
        return xarray.Dataset(
            {key: (("label", *inner.get(key, ())), each[0], units.get(key)) for key, each in columns.items()},
            coords,
            made_by,
        )
    coords[name] = (name, values, names.of(name))
    variables: dict[str, Any] = {
        key: ((name, "label", *inner.get(key, ())), each, units.get(key)) for key, each in columns.items()
    }
    lives = [values[columns["kind"][:, i] != ""] for i in range(len(labels))]
    for key, end in (("first", 0), ("last", -1)):
        variables[key] = ("label", np.array([each[end] if len(each) else np.nan for each in lives]))
    return xarray.Dataset(variables, coords, made_by)


def _shares(found: list[dict[str, Any] | None], labels: np.ndarray) -> dict[str, np.ndarray]:
    """Shares of the starts ``(N, labels)`` with their errors."""
    fraction, error = (np.full((len(found), len(labels)), np.nan) for _ in range(2))
    for i, each in enumerate(found):
        if each is None or not each["starts"]:
            continue
        counts = dict(zip(each["labels"], each["counts"], strict=True)) | {-1: each["beyond"]}
        counts[0] = each["starts"] - sum(counts.values())
        fraction[i] = [counts.get(int(label), 0) / each["starts"] for label in labels]
        error[i] = np.sqrt(fraction[i] * (1 - fraction[i]) / each["starts"])
    return {"fraction": fraction, "standard_error": error}


def _known(found: list[dict[str, Any] | None]) -> list[tuple[int, int, Attractor]]:
    """The attractors, each with its place among the values and among the labels."""
    return [
        (i, label + 1, one.attractor)
        for i, each in enumerate(found)
        if each is not None
        for label, one in zip(each["labels"], each["found"], strict=True)
    ]


def _features(found: list[dict[str, Any] | None], labels: np.ndarray, count: int) -> dict[str, np.ndarray]:
    """Features of the attractors ``(N, labels, count)`` and their ranges; nothing if none are asked for."""
    if not count:
        return {}
    made = {name: np.full((len(found), len(labels), count), np.nan) for name in FEATURES}
    for i, j, attractor in _known(found):
        values = [*attractor.features.values()], *np.transpose([*attractor.ranges.values()])
        for name, each in zip(FEATURES, values, strict=True):
            made[name][i, j] = each
    return made


def _attractors(
    found: list[dict[str, Any] | None], labels: np.ndarray, dimension: int
) -> dict[str, np.ndarray]:
    """What is known of the attractors ``(N, labels)``, and some of their points, filled up with nan."""
    there = _known(found)
    shape, most = (len(found), len(labels)), max((len(each.points[:SHOWN]) for *_, each in there), default=0)
    made: dict[str, np.ndarray] = {
        "kind": np.full(shape, "", dtype=object),
        "round": np.zeros(shape, dtype=np.int64),
        "period": np.full(shape, np.nan),
        "jumps": np.full(shape, np.nan),
        "points": np.full((*shape, most, dimension), np.nan),
        "mode_of_point": np.full((*shape, most), "", dtype=object),
    }
    for i, j, attractor in there:
        for name in ("kind", "round", "period", "jumps"):
            made[name][i, j] = getattr(attractor, name)
        shown = attractor.points[:SHOWN]
        made["points"][i, j, : len(shown)] = shown
        made["mode_of_point"][i, j, : len(shown)] = attractor.mode[:SHOWN]
    return made
