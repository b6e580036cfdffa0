"""A branch from its dataset."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING

import attrs
import numpy as np

from hybrid.orbits.continuation.branch import Bifurcation, Branch
from hybrid.orbits.continuation.labelled import THERE
from hybrid.orbits.listed import saved_sides, saved_status
from hybrid.orbits.orbit import PeriodicOrbit, shift_over, turns_over
from hybrid.simulation.simulate import simulate
from hybrid.solvers import Taylor
from hybrid.status import SUCCESS
from hybrid.system.graph import HybridSystem
from hybrid.system.periodicity import unclosed

if TYPE_CHECKING:
    import xarray


def orbits_from(system: HybridSystem, saved: xarray.Dataset) -> Branch:
    """The branch of orbits that a dataset holds; each of its orbits is run once when it is asked for."""
    name = str(saved.attrs["parameter"])
    known = json.loads(saved.attrs["model_parameters"])
    measured = json.loads(saved.attrs["measured"])
    return Branch(
        system=system,
        name=name,
        parameter=np.asarray(saved[name], dtype=float),
        x0=saved.x0.values,
        mode=saved["mode"].values.astype(str),
        t0=saved.t0.values,
        period=saved.period.values,
        multipliers=saved.multipliers.values,
        stable=saved.stable.values,
        bifurcations=tuple(
            _bifurcation(system, known, name, saved.isel(bifurcation=i), measured)
            for i in range(saved.sizes["bifurcation"])
        ),
        status=saved_status(saved.attrs),
        outputs={each: saved[each].values for each in measured},
        output_units={each: saved[each].attrs["units"] for each in measured if "units" in saved[each].attrs},
        events=tuple(json.loads(saved.attrs["events"])),
        orbit=_SavedOrbit(system, known, name, saved),
    )


@attrs.frozen(eq=False)
class _SavedOrbit:
    """The orbit of a point of a saved branch; a class, so that the branch can be pickled."""

    system: HybridSystem
    known: Mapping[str, float]
    name: str
    saved: xarray.Dataset

    def __call__(self, i: int) -> PeriodicOrbit:
        row = self.saved.isel(point=i)
        return _orbit(self.system, {**self.known, self.name: float(row[self.name])}, row, "")


def _bifurcation(
    system: HybridSystem, known: Mapping[str, float], name: str, row: xarray.Dataset, measured: list[str]
) -> Bifurcation:
    value = float(row["value"])
    return Bifurcation(
        kind=str(row["kind"].values),
        parameter=name,
        value=value,
        orbit=_orbit(system, {**known, name: value}, row, "_there"),
        message=str(row["message"].values),
        stable=saved_sides(row),
        coefficient=_coefficient(row),
        position=int(row["position"]),
        outputs={each: float(row[f"{each}{THERE}"]) for each in measured},
    )


def _coefficient(row: xarray.Dataset) -> float | np.ndarray | None:
    vector, number = row["coefficients"].values, float(row["coefficient"])
    vector = vector[np.isfinite(vector)]
    if len(vector):
        return np.asarray(vector)
    return None if np.isnan(number) else number


def _orbit(
    system: HybridSystem, parameters: dict[str, float], row: xarray.Dataset, suffix: str
) -> PeriodicOrbit:
    """One orbit: its numbers are known, and a run shows its way and its fundamental matrix."""
    x0, mode = row[f"x0{suffix}"].values, str(row[f"mode{suffix}"].values)
    t0, period = float(row[f"t0{suffix}"]), float(row[f"period{suffix}"])
    multipliers = row[f"multipliers{suffix}"].values
    arc = simulate(
        system,
        x0,
        (t0, t0 + period),
        mode=mode,
        parameters=parameters,
        solver=Taylor(rtol=1e-12, atol=1e-14),
        tangent=True,
    )
    assert arc.fundamental is not None
    change = (arc.x[-1] - x0)[: system.tangent_dimension]
    with np.errstate(divide="ignore"):
        moduli = np.log(np.abs(multipliers))
    return PeriodicOrbit(
        system=system,
        parameters=parameters,
        x0=x0,
        mode=mode,
        t0=t0,
        period=period,
        multipliers=multipliers.real if np.all(multipliers.imag == 0.0) else multipliers,
        log_moduli=moduli,
        fundamental=arc.fundamental,
        residual=float(np.linalg.norm(unclosed(system, change))),
        iterations=0,
        signature=(mode, *(str(jump.target) for jump in arc.jumps)),
        transitions=tuple(map(str, arc.jumps.transition)),
        status=SUCCESS,
        turns=turns_over(system, change),
        shift=shift_over(system, change),
    )
