"""A branch of equilibria as a dataset."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.orbits.listed import of_bifurcations
from hybrid.simulation.labelled import Names, attributes, with_outputs
from hybrid.simulation.seal import sealed

if TYPE_CHECKING:
    import xarray

KIND = "branch of equilibria"
# What stands for a number that a bifurcation does not have.
NONE = np.nan


def dataset_of(branch: Any) -> xarray.Dataset:
    """The numbers of a :class:`hybrid.EquilibriumBranch` and of its bifurcations, with names and units."""
    import xarray

    names, found = Names(branch.system.state_names, branch.system.units), branch.bifurcations
    n, unknowns = branch.system.dimension, branch.system.variables.moving + 1
    states = np.array([each.equilibrium.x for each in found]).reshape(-1, n)
    variables: dict[str, Any] = {
        "x": (("point", "state"), branch.x, names.states),
        "eigenvalues": (("point", "eigenvalue"), branch.eigenvalues),
        "stable": ("point", branch.stable),
        "admissible": ("point", branch.admissible),
        **of_bifurcations(found, names.of(branch.name)),
        "x_there": (("bifurcation", "state"), states, names.states),
        "coefficient": ("bifurcation", np.array([_or_none(each.coefficient) for each in found], dtype=float)),
        "period_there": (
            "bifurcation",
            np.array([_or_none(each.period) for each in found], dtype=float),
            names.of("t"),
        ),
        "other_modes": ("bifurcation", np.array([json.dumps([*each.modes]) for each in found], dtype=str)),
        "barrier": ("bifurcation", np.array([each.barrier for each in found], dtype=str)),
        **{
            f"{name}_there": (
                ("bifurcation", dim),
                np.array([getattr(each._place, name) for each in found]).reshape(-1, size),
            )
            for name, dim, size in (
                ("units", "unknown", unknowns),
                ("tangent", "unknown", unknowns),
                ("scales", "equation", unknowns - 1),
            )
        },
    }
    coords = {branch.name: ("point", branch.parameter, names.of(branch.name)), **names.coords()}
    made_by = attributes(KIND, branch.status, branch.system, branch.equilibrium(0).parameters)
    made = xarray.Dataset(variables, coords, {**made_by, "parameter": branch.name, "mode": branch.mode})
    return sealed(
        with_outputs(made, branch.system, {"outputs": (("point",), branch._table(branch.system.outputs))})
    )


def _or_none(value: float | None) -> float:
    return NONE if value is None else value
