"""A branch of periodic orbits over a parameter, and the bifurcations on it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING

import attrs
import numpy as np

from hybrid import arguments
from hybrid.display.tables import counted
from hybrid.orbits.continuation.change import Change
from hybrid.orbits.continuation.event import OfThisProcess
from hybrid.orbits.continuation.labelled import dataset_of
from hybrid.orbits.continuation.place import Place
from hybrid.orbits.kinds import OF_ORBITS, comes_back, of_kinds
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.simulation.quantities import Asked, mode_indices, quantity, table_of
from hybrid.status import Status
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    import xarray


@attrs.frozen(eq=False)
class Bifurcation:
    """Where a branch changes.

    Attributes
    ----------
    kind
        Smooth ones: ``"fold"``, ``"flip"`` (period doubling), ``"torus"`` (Neimark-Sacker),
        ``"branch point"``, ``"Hopf"`` (the orbits of an autonomous system shrink to an equilibrium).
        Where the sequence of transitions changes: ``"grazing"`` (a guard is touched without speed),
        ``"corner"`` (two guards are met at one point, or the condition of a guard changes where it is
        reached), ``"border"`` (the same, and the orbit is in some mode on one side alone),
        ``"crossing-sliding"``, ``"grazing-sliding"``, ``"switching-sliding"``,
        ``"adding-sliding"``.
        A zero of a function in ``events=`` has its name.
    parameter, value
        Name of the parameter, and its value there.
    orbit
        The orbit there.
    message
        What happens, in words.
    stable
        Whether the orbits before and after it along the branch are stable; None where the branch ends.
    coefficient
        Of a fold, ``c`` of ``p = p0 + c s^2``, ``s`` being the largest change of a state in units of its
        size; of a flip the same for the orbits of twice the period, whose halves differ by ``2 s``.
        Of a grazing with a jump of finite size, the vector ``C (n,)`` of the zero-time discontinuity map: an
        orbit that would go beyond the guard by ``H`` is moved by ``C sqrt(H)`` where it would be farthest
        (Nordmark 1991). Of a Hopf point the first Lyapunov coefficient. None for other kinds.
    position
        How many orbits of the branch come before it.
    outputs
        What the functions in ``outputs=`` make of the orbit, by name; nan where the orbit is too singular.

    Examples
    --------
    >>> import hybrid, models
    >>> orbit = hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    >>> fold = hybrid.continue_orbit(orbit, "w", (0.9, 1.8)).bifurcations[0]
    >>> fold.kind, fold.parameter, round(fold.value, 6)
    ('fold', 'w', 1.750143)
    """

    kind: str
    parameter: str
    value: float
    orbit: PeriodicOrbit
    message: str
    stable: tuple[bool | None, bool | None]
    coefficient: np.ndarray | float | None = None
    position: int = 0
    outputs: Mapping[str, float] = attrs.field(factory=dict)
    _place: Place | None = attrs.field(default=None, repr=False)
    _change: Change | None = attrs.field(default=None, repr=False)
    # Of a bifurcation with a name from ``events=``.
    _zero_of: OfThisProcess = attrs.field(default=OfThisProcess(), repr=False)

    def __str__(self) -> str:
        return f"{self.kind} at {self.parameter} = {self.value:.10g}: {self.message}"


@attrs.frozen(eq=False, repr=False)
class Branch(Asked):
    """Periodic orbits in order along a branch; the sequence of transitions may change at its bifurcations.

    ``branch["q"]`` is a component of the orbits' points, or an output at them; ``branch["peak"]`` is what a
    function in ``outputs=`` of :func:`hybrid.continue_orbit` makes of the orbits. Where ``y`` is cyclic
    ``branch["shift of y"]`` is by how much it is larger after each orbit.

    Attributes
    ----------
    system, name
        The model, as in :class:`hybrid.PeriodicOrbit`, and the name of the parameter.
    parameter
        Values of the parameter, ``(N,)``.
    x0, mode, t0
        Points of the orbits ``(N, n)``, and the modes and times there ``(N,)``. The points of a forced system
        are all at the same phase.
    period
        Periods, ``(N,)``.
    multipliers
        Floquet multipliers, ``(N, n)``, largest first.
    stable
        Whether no multiplier is outside the unit circle, ``(N,)``, without those that are 1 on every orbit:
        of an autonomous system the one along the orbit, and one for each conserved quantity that is held and
        for each cyclic component.
    bifurcations
        Each :class:`Bifurcation`, in order along the branch.
    status
        Why the branch ends where it does.
    outputs
        Values ``(N,)`` of the functions in ``outputs=``, by name.
    output_units
        Units of these as far as they are known, by name.
    events
        Names of the functions in ``events=``.

    Examples
    --------
    >>> import hybrid, models
    >>> orbit = hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    >>> branch = hybrid.continue_orbit(orbit, "w", (0.9, 1.1))
    >>> bool(branch.stable.all()), branch.bifurcations
    (True, ())
    >>> branch.x0.shape == (len(branch.parameter), 2)
    True
    """

    system: HybridSystem
    name: str
    parameter: np.ndarray
    x0: np.ndarray
    mode: np.ndarray
    t0: np.ndarray
    period: np.ndarray
    multipliers: np.ndarray
    stable: np.ndarray
    bifurcations: tuple[Bifurcation, ...]
    status: Status
    outputs: Mapping[str, np.ndarray]
    output_units: Mapping[str, str]
    events: tuple[str, ...]
    _orbit: Callable[[int], PeriodicOrbit]

    def __getitem__(self, name: str) -> np.ndarray:
        """A component of the state or an output at the points, or one of ``outputs``, ``(N,)``.

        Raises
        ------
        ArgumentError
            If there is none of that name.
        """
        return self._table([self._asked("", name)])[:, 0]

    def _asked(self, title: str, name: object) -> str:
        """The name of what the branch can be asked for, or an ArgumentError that begins with ``title``."""
        if isinstance(name, str) and name in self.outputs:
            return name
        if not self.outputs:
            return quantity(title, name, self.system)
        allowed = [*self.system.quantity_names, *self.outputs]
        return arguments.known(f"{title}Component or output", name, allowed, "Components and outputs")

    def of(self, kinds: str | Iterable[str]) -> tuple[Bifurcation, ...]:
        """The bifurcations of one kind or of several, in order along the branch.

        Parameters
        ----------
        kinds
            Such as ``"flip"`` or ``("fold", "flip")``, or names of functions in ``events=``.

        Raises
        ------
        ArgumentError
            If there is no such kind.
        """
        return of_kinds(self.bifurcations, kinds, (*OF_ORBITS, *self.events))

    @cached_property
    def orbits(self) -> tuple[PeriodicOrbit, ...]:
        """All orbits, in order."""
        return tuple(self.orbit(i) for i in range(len(self)))

    @property
    def signature(self) -> tuple[str, ...]:
        """Names of the modes of the first orbit, in order."""
        return self.orbit(0).signature

    @property
    def transitions(self) -> tuple[str, ...]:
        """Names of the transitions of the first orbit, in order."""
        return self.orbit(0).transitions

    def orbit(self, i: int) -> PeriodicOrbit:
        """The orbit of a point of the branch.

        Raises
        ------
        ArgumentError
            If there is no such point.
        """
        return self._orbit(arguments.index("i", i, len(self)))

    @property
    def closed(self) -> bool:
        """Whether the branch comes back to its start, as an isola does; its last point is then the first."""
        return comes_back(self.parameter, self.x0)

    def __len__(self) -> int:
        return len(self.parameter)

    def _table(self, names: Iterable[str]) -> np.ndarray:
        """Components and outputs at the points of the orbits, ``(N, len(names))``."""
        own = self.system.parameter_values(self.orbit(0).parameters)
        values = np.tile(own, (len(self), 1))
        values[:, [*self.system.parameters].index(self.name)] = self.parameter
        modes = mode_indices(self.system, self.mode)
        names = [*names]
        own_names = [name for name in names if name not in self.outputs]
        table = table_of(self.system, own_names, self.t0, self.x0, modes, values)
        columns = {**dict(zip(own_names, table.T, strict=True)), **self.outputs}
        return np.column_stack([columns[name] for name in names]) if names else table

    def __repr__(self) -> str:
        values = self.parameter
        span = f"{self.name} = {values.min():.6g} to {values.max():.6g}"
        kinds = ", ".join(each.kind for each in self.bifurcations) or "no bifurcations"
        return f"<Branch {span}, {counted(len(self), 'orbit')}, {kinds}, {self.status.brief}>"

    def to_xarray(self) -> xarray.Dataset:
        """The branch over the axis ``point``, with the parameter as a coordinate, and its bifurcations.

        If the system has outputs they are in ``outputs`` (axes ``point`` and ``output``). Each function in
        ``outputs=`` has a variable of its name over ``point``, and one over ``bifurcation`` with ``_there``
        behind the name.

        Multipliers are complex: ``.to_zarr`` saves them, netCDF cannot. :func:`hybrid.open_branch` makes a
        branch of it again.
        """
        return dataset_of(self)
