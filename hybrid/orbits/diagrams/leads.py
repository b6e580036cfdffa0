"""Where branches of a diagram may begin, and how that is written down."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from hybrid.orbits.continuation.branch import Branch
from hybrid.orbits.diagrams.diagram import Origin
from hybrid.orbits.equilibria.branch import EquilibriumBranch
from hybrid.orbits.equilibria.equations import Equations
from hybrid.orbits.equilibria.equilibrium import Equilibrium, described
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.status import Status, StatusCode
from hybrid.system.graph import HybridSystem
from hybrid.transform.aged import aged

Start = PeriodicOrbit | Equilibrium
ARRAYS = ("x0", "multipliers", "log_moduli", "fundamental")
COMPLEX = "complex"


@attrs.frozen(eq=False)
class Lead:
    """An orbit or an equilibrium from which a branch may be followed.

    ``level`` is how many switches lead to it, and ``origin`` where the last one is; None if there is none.
    """

    start: Start
    level: int = 0
    origin: Origin | None = None


def written(lead: Lead, branches: Sequence[Branch | EquilibriumBranch]) -> dict[str, Any]:
    """A lead as JSON."""
    place = None
    if lead.origin is not None:
        there = branches[lead.origin.branch].bifurcations
        place = [
            lead.origin.branch,
            next(i for i, each in enumerate(there) if each is lead.origin.bifurcation),
        ]
    return {"level": lead.level, "origin": place, "start": numbers_of(lead.start)}


def read(given: dict[str, Any], system: HybridSystem, branches: Sequence[Branch | EquilibriumBranch]) -> Lead:
    """A lead from JSON."""
    origin = None
    if given["origin"] is not None:
        branch, i = given["origin"]
        origin = Origin(branch, branches[branch].bifurcations[i])
    numbers = dict(given["start"])
    made = _orbit if "period" in numbers else _equilibrium
    return Lead(made(numbers, system), given["level"], origin)


def numbers_of(start: Start) -> dict[str, Any]:
    """An orbit or an equilibrium as JSON, to the last bit."""
    if isinstance(start, Equilibrium):
        return {"mode": start.mode, "x": start.x.tolist(), "parameters": dict(start.parameters)}
    fields = attrs.asdict(start, recurse=False, filter=lambda field, _: field.name != "system")
    fields |= {name: _listed(np.asarray(fields[name])) for name in ARRAYS}
    fields |= {name: dict(fields[name]) for name in ("parameters", "turns", "shift")}
    status = fields["status"]
    fields["status"] = [status.code.name, status.message, status.remedy]
    found: dict[str, Any] = json.loads(json.dumps(fields))
    return found


def _listed(values: np.ndarray) -> Any:
    if values.dtype.kind != "c":
        return values.tolist()
    return {COMPLEX: [values.real.tolist(), values.imag.tolist()]}


def _array(given: Any) -> np.ndarray:
    if isinstance(given, dict):
        real, imaginary = given[COMPLEX]
        found = np.array(real, dtype=complex)
        found.imag = imaginary
        return found
    return np.array(given, dtype=float)


def _orbit(numbers: dict[str, Any], system: HybridSystem) -> PeriodicOrbit:
    code, message, remedy = numbers["status"]
    arrays = {name: _array(numbers[name]) for name in ARRAYS}
    lists = {name: tuple(numbers[name]) for name in ("signature", "transitions")}
    if len(arrays["x0"]) > system.dimension:
        system = aged(system)
    status = Status(StatusCode[code], message, remedy)
    return PeriodicOrbit(**{**numbers, **arrays, **lists, "status": status}, system=system)


def _equilibrium(numbers: dict[str, Any], system: HybridSystem) -> Equilibrium:
    vector = system.parameter_values(numbers["parameters"])
    equations = Equations(system, numbers["mode"], (), np.array(numbers["x"]), vector)
    return described(equations, equations.start())
