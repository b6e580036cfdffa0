"""What results become as an ``xarray.Dataset``: names of axes, units, and what made them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from hybrid.display.tables import NO_UNIT, with_unit
from hybrid.status import Status
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    import xarray


@attrs.frozen
class Names:
    """Names of the state's components and units of all names, which results keep of their system."""

    state: tuple[str, ...]
    units: Mapping[str, str] = attrs.field(factory=dict)

    def coords(self) -> dict[str, Any]:
        """The coordinates of the axis ``state``: names, and units if any is known."""
        found: dict[str, Any] = {"state": ("state", list(self.state))}
        if any(name in self.units for name in self.state):
            found["unit"] = ("state", [self.units.get(name, "") for name in self.state])
        return found

    def of(self, name: str) -> dict[str, str]:
        """Attributes of a variable: its unit, if known."""
        return {"units": self.units[name]} if name in self.units else {}

    @property
    def states(self) -> dict[str, str]:
        """Attributes of an array of states: the unit that its components share, or one per component."""
        listed = [self.units.get(name, "") for name in self.state]
        if not any(listed):
            return {}
        return {"units": listed[0] if len(set(listed)) == 1 else ", ".join(unit or "1" for unit in listed)}

    def label(self, name: str) -> str:
        """The name with its unit, for an axis of a picture."""
        return with_unit(name, self.units.get(name))

    @property
    def rate(self) -> dict[str, str]:
        """Attributes of a value per unit of time, such as an exponent."""
        unit = self.units.get("t")
        if unit is None:
            return {}
        return {"units": "1" if unit in NO_UNIT else f"1/{unit}"}


def with_outputs(
    dataset: xarray.Dataset,
    system: HybridSystem,
    tables: Mapping[str, tuple[tuple[str, ...], np.ndarray]],
    names: Iterable[str] | None = None,
) -> xarray.Dataset:
    """The dataset with outputs of a system along the axis ``output``, if there are any: by default all.

    Each table has the name of its variable, its other axes, and values ``(..., outputs)``.
    """
    listed = [*(system.outputs if names is None else names)]
    if not listed:
        return dataset
    named = {name: ((*axes, "output"), values) for name, (axes, values) in tables.items()}
    return dataset.assign(named).assign_coords(output_coords(listed, system.units))


def output_coords(names: list[str], units: Mapping[str, str]) -> dict[str, Any]:
    """The coordinates of the axis ``output``: names, and units if any is known."""
    coords: dict[str, Any] = {"output": ("output", names)}
    if any(name in units for name in names):
        coords["output_unit"] = ("output", [units.get(name, "") for name in names])
    return coords


def with_counters(rows: np.ndarray, n: int) -> np.ndarray:
    """Tangent vectors ``(..., k, m)`` with ``n`` rows: nan for counters, which come last and have none."""
    whole = np.full((*rows.shape[:-2], n, rows.shape[-1]), np.nan)
    whole[..., : rows.shape[-2], :] = rows
    return whole


def attributes(
    kind: str,
    status: Status | None = None,
    system: HybridSystem | None = None,
    parameters: Mapping[str, float] | None = None,
) -> dict[str, str]:
    """Attributes of a dataset: kind of the result, model and parameters, and how the run ended."""
    found = {"kind": kind}
    if system is not None:
        found["model"] = system.name or "unnamed"
    if parameters is not None:
        found["model_parameters"] = json.dumps({name: float(value) for name, value in parameters.items()})
    if status is not None:
        found |= {"status": status.code.name, "message": status.message}
    return found
