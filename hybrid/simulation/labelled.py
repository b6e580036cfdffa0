"""What results become as an ``xarray.Dataset``: names of axes, units, and what made them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import attrs
import numpy as np

from hybrid.display.tables import with_unit
from hybrid.status import Status
from hybrid.system.graph import HybridSystem


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
        return {"units": f"1/{self.units['t']}"} if "t" in self.units else {}


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
