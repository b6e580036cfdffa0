"""The curve of a bifurcation of equilibria over two parameters, and what is special on it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import attrs
import numpy as np

from hybrid import arguments
from hybrid.orbits.equilibria.equations import Equations
from hybrid.orbits.equilibria.equilibrium import Equilibrium, described
from hybrid.orbits.over_two import OverTwo, SpecialPoint
from hybrid.simulation.labelled import Names, attributes
from hybrid.status import Status
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    import xarray


@attrs.frozen(eq=False)
class SpecialEquilibrium(SpecialPoint):
    """Where two things happen at once on a curve of bifurcations of an equilibrium.

    Attributes
    ----------
    kind
        On a curve of folds ``"cusp"`` or ``"Bogdanov-Takens"``, of Hopf points ``"generalized Hopf"``,
        ``"zero-Hopf"`` or ``"Bogdanov-Takens"``, of boundaries ``"boundary-fold"`` or ``"boundary-Hopf"``.
    values
        The two parameters by name.
    equilibrium, message
        The equilibrium there, and what happens, in words.

    Examples
    --------
    >>> import hybrid
    >>> cubic = hybrid.HybridSystem(
    ...     state=("x",),
    ...     parameters={"a": -2.0, "b": 1.0},
    ...     modes=[hybrid.Mode("flow", lambda t, x, p: (p.a + p.b * x.x - x.x**3,))],
    ... )
    >>> fold = hybrid.continue_equilibrium(hybrid.equilibrium(cubic, (-1.5,)), "a", (-2.0, 2.0)).of("fold")[0]
    >>> [cusp] = hybrid.continue_bifurcation(fold, {"a": (-2.0, 2.0), "b": (-1.0, 2.0)}).points
    >>> cusp.kind, abs(cusp.values["b"]) < 1e-10
    ('cusp', True)
    """

    kind: str
    values: Mapping[str, float]
    equilibrium: Equilibrium
    message: str


@attrs.frozen(eq=False, repr=False)
class EquilibriumCurve(OverTwo):
    """A bifurcation of an equilibrium over two parameters; ``curve["q"]`` are the values of one.

    Attributes
    ----------
    system, mode, kind, names
        The model, the mode, the kind of the bifurcation, and the names of the two parameters.
    values
        Their values ``(N, 2)``, in order along the curve.
    x
        The states ``(N, n)``.
    eigenvalues
        As those of :class:`hybrid.Equilibrium`, ``(N, k)``.
    coefficient
        The first Lyapunov coefficient along a curve of Hopf points, ``a`` of the normal form along one of
        folds, ``(N,)``; nan for boundaries.
    points
        Each :class:`hybrid.SpecialEquilibrium` on the curve, in order.
    status
        Why the curve ends where it does.

    Examples
    --------
    >>> import hybrid, models
    >>> rest = hybrid.equilibrium(models.relief_valve(), (2.5, 0.0, 12.5))
    >>> branch = hybrid.continue_equilibrium(rest, "q", (1.0, 10.0))
    >>> curve = hybrid.continue_bifurcation(branch.of("Hopf")[0], {"q": (1.0, 20.0), "kappa": (1.0, 1.5)})
    >>> [bautin] = curve.points
    >>> bautin.kind, {name: round(value, 4) for name, value in bautin.values.items()}
    ('generalized Hopf', {'q': 9.6103, 'kappa': 1.0731})
    """

    system: HybridSystem
    mode: str
    kind: str
    names: tuple[str, str]
    values: np.ndarray
    x: np.ndarray
    eigenvalues: np.ndarray
    coefficient: np.ndarray
    points: tuple[SpecialEquilibrium, ...]
    status: Status
    _equations: Equations

    def __getitem__(self, name: str) -> np.ndarray:
        arguments.known("curve: Parameter", name, self.names, "Parameters")
        return self.values[:, self.names.index(name)]

    def equilibrium(self, i: int) -> Equilibrium:
        """The equilibrium of a point of the curve.

        Raises
        ------
        ArgumentError
            If there is no such point.
        """
        i = arguments.index("i", i, len(self))
        return described(self._equations, np.concatenate([self.x[i, : self._equations.n], self.values[i]]))

    def to_xarray(self) -> xarray.Dataset:
        """The curve over the axis ``point``, with both parameters as coordinates."""
        import xarray

        names = Names(self.system.state_names, self.system.units)
        variables = {
            "x": (("point", "state"), self.x, names.states),
            "eigenvalues": (("point", "eigenvalue"), self.eigenvalues),
            "coefficient": ("point", self.coefficient),
        }
        coords = {name: ("point", self[name], names.of(name)) for name in self.names}
        made_by = attributes(f"curve of {self.kind} of equilibria", self.status, self.system)
        return xarray.Dataset(variables, {**coords, **names.coords()}, {**made_by, "mode": self.mode})
