"""The curve of a bifurcation of orbits over two parameters, and what is special on it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.orbits.kinds import plural
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.over_two import OverTwo, SpecialPoint
from hybrid.simulation.labelled import Names, attributes
from hybrid.status import Status
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    import xarray


@attrs.frozen(eq=False)
class CodimensionTwo(SpecialPoint):
    """Where two things happen at once on a curve of bifurcations.

    Attributes
    ----------
    kind
        ``"cusp"``, ``"fold-flip"``, ``"1:1 resonance"``, ``"1:2 resonance"``, ``"1:3 resonance"``,
        ``"1:4 resonance"``, a kind and the fold or flip that it meets, such as ``"grazing-fold"``, or a kind
        ``"... at a change"``: the transitions of the orbit change.
    values
        The two parameters by name.
    orbit, message
        The orbit there, and what happens, in words.

    Examples
    --------
    >>> import hybrid, models
    >>> orbit = hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    >>> fold = hybrid.continue_orbit(orbit, "w", (0.68, 1.0)).bifurcations[0]
    >>> curve = hybrid.continue_bifurcation(fold, {"w": (0.6, 1.0), "r": (0.3, 0.9)})
    >>> [(each.kind, round(each.values["r"], 4)) for each in curve.points]
    [('fold at a change', 0.355)]
    """

    kind: str
    values: Mapping[str, float]
    orbit: PeriodicOrbit
    message: str


@attrs.frozen(eq=False, repr=False)
class BifurcationCurve(OverTwo):
    """A bifurcation over two parameters; ``curve["omega"]`` are the values of one.

    ``curve["peak"]`` is what a function in ``outputs=`` of :func:`hybrid.continue_bifurcation` makes of the
    orbits.

    Attributes
    ----------
    system, kind, names
        The model, the kind of the bifurcation, and the names of the two parameters.
    values
        Their values ``(N, 2)``, in order along the curve.
    x0, mode, period, multipliers
        As in :class:`hybrid.Branch`.
    points
        Each :class:`hybrid.CodimensionTwo` on the curve, in order.
    status
        Why the curve ends where it does.
    outputs
        Values ``(N,)`` of the functions in ``outputs=``, by name.
    output_units
        Units of these as far as they are known, by name.

    Examples
    --------
    >>> import numpy as np
    >>> import hybrid, models
    >>> orbit = hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    >>> grazing = hybrid.continue_orbit(orbit, "w", (0.9, 1.8)).bifurcations[-1]
    >>> curve = hybrid.continue_bifurcation(grazing, {"w": (1.3, 1.5), "A": (0.9, 1.1)})
    >>> w, A = curve["w"], curve["A"]
    >>> bool(np.allclose((1 - w**2) ** 2 + (0.1 * w) ** 2, A**2))
    True
    """

    system: HybridSystem
    kind: str
    names: tuple[str, str]
    values: np.ndarray
    x0: np.ndarray
    mode: np.ndarray
    period: np.ndarray
    multipliers: np.ndarray
    points: tuple[CodimensionTwo, ...]
    status: Status
    outputs: Mapping[str, np.ndarray]
    output_units: Mapping[str, str]
    _orbits: tuple[PeriodicOrbit, ...]

    def __getitem__(self, name: str) -> np.ndarray:
        if isinstance(name, str) and name in self.outputs:
            return self.outputs[name]
        what, kind = "curve: Parameter", "Parameters"
        if self.outputs:
            what, kind = "curve: Parameter or output", "Parameters and outputs"
        arguments.known(what, name, (*self.names, *self.outputs), kind)
        return self.values[:, self.names.index(name)]

    def orbit(self, i: int) -> PeriodicOrbit:
        """The orbit of a point of the curve.

        Raises
        ------
        ArgumentError
            If there is no such point.
        """
        return self._orbits[arguments.index("i", i, len(self))]

    def to_xarray(self) -> xarray.Dataset:
        """The curve over the axis ``point``, with both parameters as coordinates.

        Each function in ``outputs=`` has a variable of its name.
        """
        import xarray

        names = Names(self.system.state_names, self.system.units)
        variables: dict[str, Any] = {
            "x0": (("point", "state"), self.x0, names.states),
            "mode": ("point", self.mode.astype(str)),
            "period": ("point", self.period, names.of("t")),
            "multipliers": (("point", "multiplier"), self.multipliers.astype(complex)),
        }
        for name, found in self.outputs.items():
            unit = {"units": self.output_units[name]} if name in self.output_units else {}
            variables[name] = ("point", found, unit)
        coords = {name: ("point", self[name], names.of(name)) for name in self.names}
        made_by = attributes(f"curve of {plural(self.kind)}", self.status, self.system)
        return xarray.Dataset(variables, {**coords, **names.coords()}, made_by)
