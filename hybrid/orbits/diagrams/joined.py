"""A diagram as one dataset: the datasets of its branches one behind the other, and each of them back."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.measures.measure import Measure
from hybrid.orbits.equilibria.labelled import KIND as OF_EQUILIBRIA
from hybrid.orbits.equilibria.labelled import NONE
from hybrid.simulation.labelled import Names, attributes
from hybrid.simulation.seal import SEAL, sealed

if TYPE_CHECKING:
    import xarray

KIND = "diagram"
ROWS = ("point", "bifurcation")
# Axes of which a branch may have fewer entries than another one.
DIRECTIONS = ("multiplier", "eigenvalue")
# Variables that branches of equilibria call by another name.
RENAMED = {"x": "x0", "x_there": "x0_there"}
# What stands where a branch has no value, by the kind of numbers; before the names of what the sweep saw.
FILL: dict[str, Any] = {"f": np.nan, "c": np.nan, "b": False, "i": 0, "U": ""}
SWEEP = "sweep."


def dataset_of(diagram: Any) -> xarray.Dataset:
    """The numbers of a :class:`hybrid.Diagram`."""
    import xarray

    parts = [_renamed(each.to_xarray()) for each in diagram.branches]
    widest = max(diagram.branches, key=lambda each: each.system.dimension).system
    names, parameter = Names(widest.state_names, widest.units), diagram.name
    variables = _joined(parts, [*widest.state_names])
    counts = {rows: [each.sizes[rows] for each in parts] for rows in ROWS}
    numbers = np.arange(len(parts))
    variables |= {
        "branch": ("point", np.repeat(numbers, counts["point"])),
        "branch_there": ("bifurcation", np.repeat(numbers, counts["bifurcation"])),
        "parent": ("family", np.array([-1 if each is None else each.branch for each in diagram.origins])),
        "parent_bifurcation": ("family", np.array([_place(each, diagram) for each in diagram.origins])),
        "states": ("family", np.array([each.sizes["state"] for each in parts])),
        "directions": ("family", np.array([max(each.sizes.get(d, 0) for d in DIRECTIONS) for each in parts])),
        "made_by": ("family", np.array([_made_by(each) for each in parts])),
    }
    values = np.concatenate([each[parameter].values for each in parts])
    coords = {parameter: ("point", values, names.of(parameter)), **names.coords()}
    for each in parts[:1]:
        coords |= {name: each[name] for name in ("output", "output_unit") if name in each.coords}
    made_by = {
        **attributes(KIND, diagram.status, diagram.system),
        "parameter": parameter,
        "notes": json.dumps([*diagram.notes]),
        "measured": json.dumps({name: _measure(each) for name, each in diagram.outputs.items()}),
    }
    made = xarray.Dataset(variables, coords, made_by)
    if diagram.sweep is not None:
        seen = diagram.sweep.rename({name: f"{SWEEP}{name}" for name in _names_in(diagram.sweep)})
        told = json.dumps({str(key): value for key, value in seen.attrs.items()}, default=str)
        made = made.merge(seen.drop_attrs(deep=False)).assign_attrs({**made_by, "sweep": told})
    return sealed(made)


def part_of(saved: xarray.Dataset, i: int, states: Sequence[str]) -> xarray.Dataset:
    """The dataset of a branch of a saved diagram, whose system has these states."""
    at = saved.branch.values == i, saved.branch_there.values == i
    own = dict(zip(ROWS, map(np.flatnonzero, at), strict=True))
    few = {each: slice(int(saved.directions[i])) for each in DIRECTIONS if each in saved.sizes}
    found = saved.isel({**own, **few}).sel(state=[*states])
    found = found.assign_attrs(json.loads(str(saved.made_by.values[i])))
    if found.attrs["kind"] == OF_EQUILIBRIA:
        found = found.rename({new: old for old, new in RENAMED.items()})
    return found


def sweep_of(saved: xarray.Dataset) -> xarray.Dataset | None:
    """The sweep of a saved diagram."""
    if "sweep" not in saved.attrs:
        return None
    names = [name for name in saved.variables if str(name).startswith(SWEEP)]
    found = saved[names].drop_vars([name for name in saved.coords if name not in names], errors="ignore")
    found = found.rename({name: str(name).removeprefix(SWEEP) for name in _names_in(found)})
    return found.drop_attrs(deep=False).assign_attrs(json.loads(saved.attrs["sweep"]))


def measures_of(saved: xarray.Dataset) -> dict[str, Measure | None]:
    """The outputs of a saved diagram: measures are known by their names, other functions are not."""
    known: Mapping[str, Any] = json.loads(saved.attrs["measured"])
    return {name: None if each is None else Measure(*each) for name, each in known.items()}


def _names_in(dataset: xarray.Dataset) -> list[str]:
    return [*dict.fromkeys([*map(str, dataset.variables), *map(str, dataset.dims)])]


def _made_by(part: xarray.Dataset) -> str:
    """The attributes of a branch as text; the diagram has checksums of its own."""
    return json.dumps({key: value for key, value in part.attrs.items() if key != SEAL})


def _measure(given: Any) -> list[str] | None:
    return [given.kind, given.name] if isinstance(given, Measure) else None


def _place(origin: Any, diagram: Any) -> int:
    """The number of the bifurcation at which a branch was found, among those of its parent."""
    if origin is None:
        return -1
    parent = diagram.branches[origin.branch].bifurcations
    return next(i for i, each in enumerate(parent) if each is origin.bifurcation)


def _renamed(part: xarray.Dataset) -> xarray.Dataset:
    """The dataset of a branch with the names that all branches have in common."""
    if part.attrs["kind"] != OF_EQUILIBRIA:
        return part
    found = part.rename({old: new for old, new in RENAMED.items() if old in part})
    modes = np.full(part.sizes["point"], part.attrs["mode"])
    nothing = np.full(part.sizes["point"], NONE)
    return found.assign({"mode": ("point", modes), "period": ("point", nothing)})


def _joined(parts: Sequence[xarray.Dataset], states: Sequence[str]) -> dict[str, Any]:
    """The variables of all branches, one branch behind the other; what a branch lacks is filled up."""
    names = dict.fromkeys(
        str(name) for each in parts for name, values in each.data_vars.items() if {*values.dims} & {*ROWS}
    )
    return {name: _one(name, parts, states) for name in names}


def _one(name: str, parts: Sequence[xarray.Dataset], states: Sequence[str]) -> tuple[Any, ...]:
    """A variable over all branches: axes, values, attributes."""
    known = [each[name] for each in parts if name in each]
    rows, *inner = map(str, known[0].dims)
    lengths = [
        len(states) if dim == "state" else max(each.sizes[dim] for each in known if dim in each.dims)
        for dim in inner
    ]
    kind = known[0].dtype.kind
    # Texts of any length.
    dtype = object if kind == "U" else known[0].dtype
    pieces = []
    for part in parts:
        filled = np.full((part.sizes[rows], *lengths), FILL[kind], dtype=dtype)
        if name in part:
            values = part[name].values
            places = [
                [states.index(str(each)) for each in part.state.values] if dim == "state" else range(size)
                for dim, size in zip(inner, values.shape[1:], strict=True)
            ]
            filled[np.ix_(range(len(values)), *places)] = values
        pieces.append(filled)
    joined = np.concatenate(pieces)
    return ((rows, *inner), joined.astype(str) if kind == "U" else joined, known[0].attrs)
