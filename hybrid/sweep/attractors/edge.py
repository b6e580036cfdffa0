"""An edge state: what lies on the boundary between the basins of two attractors."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from hybrid.display.tables import html_table, with_unit
from hybrid.orbits.equilibria.equilibrium import Equilibrium
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.simulation.labelled import Names, attributes
from hybrid.status import Status
from hybrid.sweep.attractors.attractor import Attractor
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    import xarray

# What an edge state may be.
EQUILIBRIUM, PERIODIC, NOT_PERIODIC, NOT_SETTLED, NO_EDGE = (
    *("equilibrium", "periodic", "not periodic", "not settled", "no edge"),
)


@attrs.frozen(eq=False, repr=False)
class EdgeState:
    """What a trajectory on the boundary between two basins settles on.

    Attributes
    ----------
    system, parameters
        The model, and the values of all its parameters, by name.
    kind
        ``"equilibrium"`` or ``"periodic"``: a saddle, in ``equilibrium`` or ``orbit``; ``"not periodic"`` if
        the trajectory wanders in a set of constant size and no orbit is found near it; ``"not settled"`` if
        the rounds ended before, or the two runs were nowhere near each other in one mode; ``"no edge"`` if
        the two starts do not lead to different attractors.
    x, mode, t0
        A state on the boundary ``(n,)``, its mode, and the time there: that of the orbit or the equilibrium
        if there is one, and the last one of the trajectory otherwise.
    orbit, equilibrium
        The saddle with its multipliers or eigenvalues, of which one is unstable; None if it is not of that
        kind.
    points, modes
        The edge trajectory: states ``(N, n)`` at the forcing periods, or at equal times, and their modes.
    bracket
        States ``(2, n)`` on the two sides of the boundary, near the end of the trajectory.
    one, other
        The attractors that the two sides lead to; None for a side from which runs end.
    rounds
        Bisections that were followed by runs.
    status
        How the search ended. It says whether starts on the far side led to a third attractor on the way.

    Examples
    --------
    >>> import hybrid, models
    >>> edge = hybrid.edge_state(models.impact_oscillator(), (0.0, 0.0), (-1.6, -0.4), parameters={"w": 2.6})
    >>> edge.kind, edge.orbit.forcing_periods, edge.orbit.multipliers.real.round(4)
    ('periodic', 2, array([2.1034, 0.1877]))
    """

    system: HybridSystem
    parameters: Mapping[str, float]
    kind: str
    x: np.ndarray
    mode: str
    t0: float
    orbit: PeriodicOrbit | None
    equilibrium: Equilibrium | None
    points: np.ndarray
    modes: np.ndarray
    bracket: np.ndarray
    one: Attractor | None
    other: Attractor | None
    rounds: int
    status: Status

    @property
    def saddle(self) -> PeriodicOrbit | Equilibrium | None:
        """The orbit or the equilibrium, whichever there is."""
        return self.orbit or self.equilibrium

    def __repr__(self) -> str:
        told = repr(self.saddle) if self.saddle else f"{self.status.code.name}, {self.rounds} rounds"
        return f"<EdgeState {self.kind}: {told}>"

    def _repr_html_(self) -> str:
        """The state for a notebook."""
        units = self.system.units
        rows = [
            [with_unit(name, units.get(name)), f"{value:.9g}"]
            for name, value in zip(self.system.state_names, self.x, strict=True)
        ]
        shown = html_table(("component", "value"), rows)
        return f"<p>{escape(repr(self))}</p>\n{shown}\n<p>{escape(str(self.status))}</p>"

    def to_xarray(self) -> xarray.Dataset:
        """The state and the trajectory, with the names of the components."""
        import xarray

        names = Names(self.system.state_names, self.system.units)
        variables: dict[str, Any] = {
            "kind": self.kind,
            "x": ("state", self.x, names.states),
            "mode": self.mode,
            "points": (("point", "state"), self.points, names.states),
            "mode_of_point": ("point", self.modes),
            "bracket": (("side", "state"), self.bracket, names.states),
        }
        facts = attributes("edge state", self.status, self.system, self.parameters)
        return xarray.Dataset(variables, names.coords(), facts)
