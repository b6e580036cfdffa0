"""A branch of equilibria from its dataset."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from hybrid.orbits.equilibria.branch import EquilibriumBifurcation, EquilibriumBranch
from hybrid.orbits.equilibria.curve import Spot
from hybrid.orbits.equilibria.equations import Equations, reduced
from hybrid.orbits.equilibria.equilibrium import described
from hybrid.orbits.listed import saved_sides, saved_status
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    import xarray


def equilibria_from(system: HybridSystem, saved: xarray.Dataset) -> EquilibriumBranch:
    """The branch that a dataset holds."""
    name, mode = str(saved.attrs["parameter"]), str(saved.attrs["mode"])
    values, x = np.asarray(saved[name], dtype=float), saved.x.values
    known = {**json.loads(saved.attrs["model_parameters"]), name: float(values[0])}
    equations = Equations(system, mode, (name,), x[0], system.parameter_values(known))
    return EquilibriumBranch(
        system=system,
        name=name,
        mode=mode,
        parameter=values,
        x=x,
        eigenvalues=saved.eigenvalues.values,
        stable=saved.stable.values,
        admissible=saved.admissible.values,
        bifurcations=tuple(
            _bifurcation(equations, saved.isel(bifurcation=i)) for i in range(saved.sizes["bifurcation"])
        ),
        status=saved_status(saved.attrs),
        equations=equations,
    )


def _bifurcation(equations: Equations, row: xarray.Dataset) -> EquilibriumBifurcation:
    u = np.append(row.x_there.values[: equations.n], float(row["value"]))
    spot = Spot(
        reduced(equations, u), u, row.units_there.values, row.tangent_there.values, row.scales_there.values
    )
    return EquilibriumBifurcation(
        kind=str(row["kind"].values),
        parameter=equations.names[0],
        value=float(row["value"]),
        equilibrium=described(equations, u),
        message=str(row["message"].values),
        stable=saved_sides(row),
        coefficient=_number(row["coefficient"]),
        period=_number(row["period_there"]),
        position=int(row["position"]),
        modes=tuple(json.loads(str(row["other_modes"].values))),
        barrier=str(row["barrier"].values),
        place=spot,
    )


def _number(value: xarray.DataArray) -> float | None:
    found = float(value)
    return None if np.isnan(found) else found
