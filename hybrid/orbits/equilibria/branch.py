"""A branch of equilibria over a parameter, and the bifurcations on it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.display.tables import counted
from hybrid.orbits.equilibria.equations import Equations
from hybrid.orbits.equilibria.equilibrium import Equilibrium, described
from hybrid.orbits.equilibria.labelled import dataset_of
from hybrid.orbits.kinds import OF_EQUILIBRIA, comes_back, of_kinds
from hybrid.simulation.quantities import Asked, table_of
from hybrid.status import Status
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    import xarray


@attrs.frozen(eq=False)
class EquilibriumBifurcation:
    """Where a branch of equilibria changes.

    Attributes
    ----------
    kind
        ``"fold"``, ``"Hopf"``, ``"branch point"``, or ``"boundary"``, where the equilibrium reaches a guard.
    parameter, value
        Name of the parameter, and its value there.
    equilibrium
        The equilibrium there.
    message
        What happens, in words: of a Hopf point which side the cycles are on and whether they attract, of a
        boundary whether the equilibrium goes on in another mode (persistence) or meets one of another mode
        and vanishes with it (nonsmooth fold).
    stable
        Whether the equilibria before and after it along the branch are stable; None where the branch ends.
    coefficient
        Of a Hopf point the first Lyapunov coefficient, of a fold ``a`` of its normal form, with eigenvectors
        of length 1 (Kuznetsov, sections 5.4 and 3.3). None for other kinds.
    period
        Of a Hopf point the period of the smallest cycles; else None.
    position
        How many points of the branch come before it.
    modes, barrier
        Of a boundary the other modes that have an equilibrium there, and the transition whose guard it is.

    Examples
    --------
    >>> import hybrid, models
    >>> rest = hybrid.equilibrium(models.relief_valve(), (2.5, 0.0, 12.5))
    >>> branch = hybrid.continue_equilibrium(rest, "q", (1.0, 10.0))
    >>> [hopf] = branch.bifurcations
    >>> hopf.kind, round(hopf.value, 6), round(hopf.period, 6)
    ('Hopf', 8.491118, 2.032927)
    """

    kind: str
    parameter: str
    value: float
    equilibrium: Equilibrium
    message: str
    stable: tuple[bool | None, bool | None]
    coefficient: float | None = None
    period: float | None = None
    position: int = 0
    modes: tuple[str, ...] = ()
    barrier: str = ""
    _place: Any = attrs.field(default=None, repr=False)

    def __str__(self) -> str:
        return f"{self.kind} at {self.parameter} = {self.value:.10g}: {self.message}"


@attrs.frozen(eq=False, repr=False)
class EquilibriumBranch(Asked):
    """Equilibria of one mode in order along a branch.

    ``branch["q"]`` is a component of the states, or an output there, ``(N,)``.

    Attributes
    ----------
    system, name
        The model, and the name of the parameter.
    mode
        The mode.
    parameter
        Values of the parameter, ``(N,)``.
    x
        The states, ``(N, n)``.
    eigenvalues
        As those of :class:`hybrid.Equilibrium`, ``(N, k)``.
    stable, admissible
        Whether no eigenvalue has a positive real part, and whether no guard of the mode excludes the state,
        ``(N,)``.
    bifurcations
        Each :class:`hybrid.EquilibriumBifurcation`, in order along the branch.
    status
        Why the branch ends where it does.

    Examples
    --------
    >>> import hybrid, models
    >>> rest = hybrid.equilibrium(models.relief_valve(), (2.5, 0.0, 12.5))
    >>> branch = hybrid.continue_equilibrium(rest, "q", (1.0, 10.0))
    >>> bool(branch.stable[branch.parameter > 8.5].all()), bool(branch.stable[branch.parameter < 8.4].any())
    (True, False)
    """

    system: HybridSystem
    name: str
    mode: str
    parameter: np.ndarray
    x: np.ndarray
    eigenvalues: np.ndarray
    stable: np.ndarray
    admissible: np.ndarray
    bifurcations: tuple[EquilibriumBifurcation, ...]
    status: Status
    _equations: Equations

    def equilibrium(self, i: int) -> Equilibrium:
        """The equilibrium of a point of the branch.

        Raises
        ------
        ArgumentError
            If there is no such point.
        """
        i = arguments.index("i", i, len(self))
        return described(self._equations, np.append(self.x[i, : self._equations.n], self.parameter[i]))

    def of(self, kinds: str | Iterable[str]) -> tuple[EquilibriumBifurcation, ...]:
        """The bifurcations of one kind or of several, in order along the branch.

        Raises
        ------
        ArgumentError
            If there is no such kind.
        """
        return of_kinds(self.bifurcations, kinds, OF_EQUILIBRIA)

    @property
    def closed(self) -> bool:
        """Whether the branch comes back to its start, as an isola does; its last point is then the first."""
        return comes_back(self.parameter, self.x)

    def __len__(self) -> int:
        return len(self.parameter)

    def _table(self, names: Iterable[str]) -> np.ndarray:
        """Components and outputs at the states, ``(N, len(names))``."""
        values = np.tile(self._equations.vector, (len(self), 1))
        values[:, self._equations.places[0]] = self.parameter
        modes = np.full(len(self), self.system.mode_index(self.mode))
        return table_of(self.system, [*names], np.zeros(len(self)), self.x, modes, values)

    def __repr__(self) -> str:
        values = self.parameter
        span = f"{self.name} = {values.min():.6g} to {values.max():.6g}"
        kinds = ", ".join(each.kind for each in self.bifurcations) or "no bifurcations"
        count = counted(len(self), "point")
        return f"<EquilibriumBranch in {self.mode!r}, {span}, {count}, {kinds}, {self.status.brief}>"

    def to_xarray(self) -> xarray.Dataset:
        """The branch over the axis ``point``, with the parameter as a coordinate, and its bifurcations.

        Eigenvalues are complex: ``.to_zarr`` saves them, netCDF cannot. :func:`hybrid.open_branch` makes a
        branch of it again.
        """
        return dataset_of(self)
