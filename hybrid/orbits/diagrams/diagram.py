"""Branches that bifurcations join, as one result."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import attrs

from hybrid.orbits.continuation.branch import Bifurcation, Branch
from hybrid.orbits.diagrams.joined import dataset_of
from hybrid.orbits.equilibria.branch import EquilibriumBifurcation, EquilibriumBranch
from hybrid.orbits.kinds import KINDS, of_kinds
from hybrid.status import Status
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    import xarray


@attrs.frozen(eq=False)
class Origin:
    """Where a branch of a diagram was switched to: the number of the branch there, and the bifurcation."""

    branch: int
    bifurcation: Bifurcation | EquilibriumBifurcation


@attrs.frozen(eq=False, repr=False)
class Diagram:
    """Branches of orbits and equilibria over one parameter, each with the bifurcation that it was found at.

    It is a sequence of branches: ``diagram[0]`` is that of the first start.

    Attributes
    ----------
    system, name
        The model, and the name of the parameter.
    branches
        Each :class:`hybrid.Branch` or :class:`hybrid.EquilibriumBranch`, parents before children.
    origins
        For each branch where it was switched to; None for the branch of a start.
    outputs
        The functions of an arc whose values the branches of orbits have, by name.
    notes
        What was not followed, in words.
    status
        Whether all was followed that the call asks for.
    sweep
        What was given as ``sweep=``, within the span, with the number of the ``branch`` on which each
        attractor lies, -1 if on none, and with what it has ``reached``: the values of ``outputs``. None if no
        sweep was given.

    Examples
    --------
    >>> import hybrid, models
    >>> rest = hybrid.equilibrium(models.relief_valve(), (2.5, 0.0, 12.5))
    >>> diagram = hybrid.continue_all(rest, "q", (7.0, 10.0))
    >>> [type(branch).__name__ for branch in diagram], diagram.origins[1].bifurcation.kind
    (['EquilibriumBranch', 'Branch'], 'Hopf')
    """

    system: HybridSystem
    name: str
    branches: tuple[Branch | EquilibriumBranch, ...]
    origins: tuple[Origin | None, ...]
    outputs: Mapping[str, Any]
    notes: tuple[str, ...]
    status: Status
    sweep: xarray.Dataset | None

    @property
    def bifurcations(self) -> tuple[Bifurcation | EquilibriumBifurcation, ...]:
        """Those of all branches, in order."""
        return tuple(each for branch in self.branches for each in branch.bifurcations)

    def of(self, kinds: str | Iterable[str]) -> tuple[Bifurcation | EquilibriumBifurcation, ...]:
        """The bifurcations of one kind or of several on all branches.

        Raises
        ------
        ArgumentError
            If there is no such kind.
        """
        return of_kinds(self.bifurcations, kinds, KINDS)

    def __len__(self) -> int:
        return len(self.branches)

    def __iter__(self) -> Iterator[Branch | EquilibriumBranch]:
        return iter(self.branches)

    def __getitem__(self, i: int) -> Branch | EquilibriumBranch:
        return self.branches[i]

    def __repr__(self) -> str:
        low = min(float(each.parameter.min()) for each in self.branches)
        high = max(float(each.parameter.max()) for each in self.branches)
        kinds: dict[str, int] = {}
        for each in self.bifurcations:
            kinds[each.kind] = kinds.get(each.kind, 0) + 1
        found = ", ".join(f"{count} {kind}" for kind, count in kinds.items()) or "no bifurcations"
        many = f"{len(self)} branches" if len(self) != 1 else "1 branch"
        closed = sum(each.closed for each in self.branches)
        many += f", {closed} closed" if closed else ""
        return f"<Diagram of {many}, {self.name} = {low:.6g} to {high:.6g}, {found}, {self.status.brief}>"

    def to_xarray(self) -> xarray.Dataset:
        """All points over the axis ``point``, with the number of their branch, and all bifurcations.

        ``period`` is nan for equilibria, and so are values of ``outputs=``, which are numbers of orbits. What
        was seen in a sweep has ``sweep.`` before its names.

        Multipliers are complex: ``.to_zarr`` saves them, netCDF cannot. :func:`hybrid.open_diagram` makes a
        diagram of it again.
        """
        return dataset_of(self)
