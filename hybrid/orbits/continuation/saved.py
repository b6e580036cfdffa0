"""A branch from its dataset."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.branch import Bifurcation, Branch
from hybrid.orbits.continuation.labelled import KIND, SIDES, THERE
from hybrid.orbits.orbit import PeriodicOrbit, turns_over
from hybrid.simulation.seal import check_seal, read_file, read_folder
from hybrid.simulation.simulate import simulate
from hybrid.solvers import Taylor
from hybrid.status import SUCCESS, Status, StatusCode
from hybrid.system.graph import HybridSystem, as_system
from hybrid.system.periodicity import closed_change
from hybrid.transform.aged import aged

if TYPE_CHECKING:
    import xarray


def open_branch(system: HybridSystem, saved: xarray.Dataset | str | os.PathLike[str]) -> Branch:
    """A branch from what its `to_xarray` gave, to look at it, to draw it and to take it further.

    Parameters
    ----------
    system
        The model, which is not saved.
    saved
        The dataset, or the folder of zarr (or the file) where it is.

    Returns
    -------
    Branch
        Each of its orbits is run once when it is asked for.

    Raises
    ------
    ArgumentError
        If it is no branch, or one of another system; if the save is incomplete or damaged, or the dataset was
        changed.

    Examples
    --------
    >>> import numpy as np
    >>> import hybrid, models
    >>> system = models.impact_oscillator()
    >>> branch = hybrid.continue_orbit(hybrid.periodic_orbit(system, (0.9, 1.0)), "w", (0.9, 1.1))
    >>> again = hybrid.open_branch(system, branch.to_xarray())
    >>> bool(np.all(again.x0 == branch.x0))
    True
    """
    import xarray

    as_system("system", system)
    place = ""
    if isinstance(saved, str | os.PathLike) and os.path.exists(saved):
        place = os.fspath(saved)
        saved = read_folder("saved", Path(place)) if os.path.isdir(place) else read_file("saved", Path(place))
    # A save that was killed early has no kind yet: its seal is missing, too.
    if not isinstance(saved, xarray.Dataset) or saved.attrs.get("kind", KIND) != KIND:
        raise arguments.refusal("saved", "be the dataset of a branch, or a folder or file where it is", saved)
    check_seal("saved", saved, place)
    if len(saved.state) > system.dimension:
        # Points of the branch lie in modes where the time since the entry counts.
        system = aged(system)
    if tuple(map(str, saved.state.values)) != system.state_names:
        raise ArgumentError(
            f"saved is a branch of a system with the states {', '.join(map(str, saved.state.values))}; got a "
            f"system with {', '.join(system.state_names)}."
        )
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
        status=Status(StatusCode[saved.attrs["status"]], saved.attrs["message"]),
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
    stable = [next(key for key, number in SIDES.items() if number == int(side)) for side in row.stable_beside]
    return Bifurcation(
        kind=str(row["kind"].values),
        parameter=name,
        value=value,
        orbit=_orbit(system, {**known, name: value}, row, "_there"),
        message=str(row["message"].values),
        stable=(stable[0], stable[1]),
        position=int(row["position"]),
        outputs={each: float(row[f"{each}{THERE}"]) for each in measured},
    )


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
        residual=float(np.linalg.norm(closed_change(change, system.turn_lengths[: len(change)]))),
        iterations=0,
        signature=(mode, *(str(jump.target) for jump in arc.jumps)),
        transitions=tuple(map(str, arc.jumps.transition)),
        status=SUCCESS,
        turns=turns_over(system, change),
    )
