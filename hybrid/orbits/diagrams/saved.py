"""Branches and diagrams from their datasets."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.branch import Branch
from hybrid.orbits.continuation.labelled import KIND as OF_ORBITS
from hybrid.orbits.continuation.saved import orbits_from
from hybrid.orbits.diagrams.diagram import Diagram, Origin
from hybrid.orbits.diagrams.joined import KIND as OF_DIAGRAMS
from hybrid.orbits.diagrams.joined import measures_of, part_of, sweep_of
from hybrid.orbits.diagrams.store import diagram_in
from hybrid.orbits.equilibria.branch import EquilibriumBranch
from hybrid.orbits.equilibria.labelled import KIND as OF_EQUILIBRIA
from hybrid.orbits.equilibria.saved import equilibria_from
from hybrid.orbits.listed import saved_status
from hybrid.simulation.seal import check_seal, read_file, read_folder
from hybrid.system.graph import HybridSystem, as_system
from hybrid.transform.aged import aged, original_of

if TYPE_CHECKING:
    import xarray


def open_branch(
    system: HybridSystem, saved: xarray.Dataset | str | os.PathLike[str]
) -> Branch | EquilibriumBranch:
    """A branch from what its `to_xarray` gave, to look at it, to draw it and to take it further.

    Parameters
    ----------
    system
        The model, which is not saved.
    saved
        The dataset, or the folder of zarr (or the file) where it is.

    Returns
    -------
    Branch or EquilibriumBranch
        Each orbit of a branch of orbits is run once when it is asked for.

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
    found = _read(saved, "branch", (OF_ORBITS, OF_EQUILIBRIA))
    return branch_from(as_system("system", system), found)


def open_diagram(system: HybridSystem, saved: xarray.Dataset | str | os.PathLike[str]) -> Diagram:
    """A diagram from what its `to_xarray` gave, to look at it, to draw it and to take its branches further.

    Parameters
    ----------
    system
        The model, which is not saved.
    saved
        The dataset, or the folder of zarr (or the file) where it is; or the store of `continue_all`.

    Returns
    -------
    Diagram
        With its branches as `open_branch` gives them. Of ``outputs`` the measures are known again; other
        functions are None, and their values along the branches are there.

    Raises
    ------
    ArgumentError
        If it is no diagram, or one of another system; if the save is incomplete or damaged, or the dataset
        was changed.

    Examples
    --------
    >>> import hybrid, models
    >>> valve = models.relief_valve()
    >>> rest = hybrid.equilibrium(valve, (2.5, 0.0, 12.5))
    >>> diagram = hybrid.continue_all(rest, "q", (7.0, 10.0))
    >>> again = hybrid.open_diagram(valve, diagram.to_xarray())
    >>> len(again), again.origins[1].bifurcation.kind
    (2, 'Hopf')
    """
    as_system("system", system)
    if isinstance(saved, str | os.PathLike):
        saved = diagram_in(saved)
    found = _read(saved, "diagram", (OF_DIAGRAMS,))
    _check_states(system, "diagram", [str(each) for each in found.state.values])
    branches = tuple(
        branch_from(system, part_of(found, i, _states(system, int(count))))
        for i, count in enumerate(found.states.values)
    )
    places = zip(found.parent.values.tolist(), found.parent_bifurcation.values.tolist(), strict=True)
    return Diagram(
        system=original_of(system),
        name=str(found.attrs["parameter"]),
        branches=branches,
        origins=tuple(
            None if parent < 0 else Origin(parent, branches[parent].bifurcations[j]) for parent, j in places
        ),
        outputs=measures_of(found),
        notes=tuple(json.loads(found.attrs["notes"])),
        status=saved_status(found.attrs),
        sweep=sweep_of(found),
    )


def branch_from(system: HybridSystem, saved: xarray.Dataset) -> Branch | EquilibriumBranch:
    """The branch that a dataset holds, of either kind."""
    states = [str(each) for each in saved.state.values]
    if len(states) > system.dimension:
        # Points of the branch lie in modes where the time since the entry counts.
        system = aged(system)
    _check_states(system, "branch", states)
    return (
        equilibria_from(system, saved) if saved.attrs["kind"] == OF_EQUILIBRIA else orbits_from(system, saved)
    )


def _states(system: HybridSystem, count: int) -> tuple[str, ...]:
    """Names of the states of the system, or of the aged one."""
    return (system if count == system.dimension else aged(system)).state_names


def _check_states(system: HybridSystem, what: str, states: Sequence[str]) -> None:
    if tuple(states) not in (system.state_names, aged(system).state_names):
        raise ArgumentError(
            f"saved is a {what} of a system with the states {', '.join(states)}; got a system with "
            f"{', '.join(system.state_names)}."
        )


def _read(saved: object, what: str, kinds: Sequence[str]) -> xarray.Dataset:
    """The dataset, from its place if that is given, with its kind and its checksums compared."""
    import xarray

    place = ""
    if isinstance(saved, str | os.PathLike) and os.path.exists(saved):
        place = os.fspath(saved)
        saved = read_folder("saved", Path(place)) if os.path.isdir(place) else read_file("saved", Path(place))
    # A save that was killed early has no kind yet: its seal is missing, too.
    if not isinstance(saved, xarray.Dataset) or saved.attrs.get("kind", kinds[0]) not in kinds:
        wanted = f"be the dataset of a {what}, or a folder or file where it is"
        raise arguments.refusal("saved", wanted, saved)
    check_seal("saved", saved, place)
    return saved
