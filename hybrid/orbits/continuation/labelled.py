"""A branch as a dataset."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.orbits.labelled import table_at
from hybrid.orbits.listed import of_bifurcations
from hybrid.simulation.labelled import Names, attributes, with_outputs
from hybrid.simulation.seal import sealed

if TYPE_CHECKING:
    import xarray

KIND = "branch"
# What variables at the bifurcations have behind their names.
THERE = "_there"


def dataset_of(branch: Any) -> xarray.Dataset:
    """The numbers of a :class:`hybrid.Branch` and of its bifurcations, with names and units."""
    import xarray

    names = Names(branch.system.state_names, branch.system.units)
    found = branch.bifurcations
    orbits = [each.orbit for each in found]
    n, directions = branch.system.dimension, branch.multipliers.shape[1]
    variables: dict[str, Any] = {
        "x0": (("point", "state"), branch.x0, names.states),
        "mode": ("point", branch.mode.astype(str)),
        "t0": ("point", np.array([branch.orbit(i).t0 for i in range(len(branch))]), names.of("t")),
        "period": ("point", branch.period, names.of("t")),
        "multipliers": (("point", "multiplier"), branch.multipliers.astype(complex)),
        "stable": ("point", branch.stable),
        **of_bifurcations(found, names.of(branch.name)),
        "x0_there": (("bifurcation", "state"), np.array([each.x0 for each in orbits]).reshape(-1, n)),
        "mode_there": ("bifurcation", np.array([each.mode for each in orbits], dtype=str)),
        "t0_there": ("bifurcation", np.array([each.t0 for each in orbits], dtype=float)),
        "period_there": ("bifurcation", np.array([each.period for each in orbits], dtype=float)),
        "multipliers_there": (
            ("bifurcation", "multiplier"),
            np.array([each.multipliers for each in orbits], dtype=complex).reshape(-1, directions),
        ),
        **_coefficients(found, n),
    }
    for name, values in branch.outputs.items():
        unit = {"units": branch.output_units[name]} if name in branch.output_units else {}
        variables[name] = ("point", values, unit)
        there = np.array([each.outputs[name] for each in found], dtype=float)
        variables[f"{name}{THERE}"] = ("bifurcation", there, unit)
    coords = {branch.name: ("point", branch.parameter, names.of(branch.name)), **names.coords()}
    made_by = attributes(KIND, branch.status, branch.system, branch.orbit(0).parameters)
    asked = {"measured": json.dumps([*branch.outputs]), "events": json.dumps([*branch.events])}
    made = xarray.Dataset(variables, coords, {**made_by, "parameter": branch.name, **asked})
    tables = {
        "outputs": (("point",), branch._table(branch.system.outputs)),
        "outputs_there": (("bifurcation",), table_at(branch.system, [*branch.system.outputs], orbits)),
    }
    return sealed(with_outputs(made, branch.system, tables))


def _coefficients(found: Sequence[Any], n: int) -> dict[str, Any]:
    """Coefficients of bifurcations: numbers, and vectors of those that have one per component; else nan."""
    numbers, vectors = np.full(len(found), np.nan), np.full((len(found), n), np.nan)
    for i, each in enumerate(found):
        if isinstance(each.coefficient, np.ndarray):
            vectors[i, : len(each.coefficient)] = each.coefficient
        elif each.coefficient is not None:
            numbers[i] = each.coefficient
    return {
        "coefficient": ("bifurcation", numbers),
        "coefficients": (("bifurcation", "state"), vectors),
    }
