"""A periodic orbit as a dataset, in one line, and as a table for a notebook."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.display.tables import html_table, with_unit
from hybrid.simulation.labelled import Names, attributes, with_counters, with_outputs
from hybrid.simulation.quantities import table_of
from hybrid.status import StatusCode
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    import xarray


def labelled_orbit(orbit: Any) -> xarray.Dataset:
    """The numbers of a :class:`hybrid.PeriodicOrbit` with their names and units."""
    import xarray

    names = Names(orbit.system.state_names, orbit.system.units)
    variables: dict[str, Any] = {
        "x0": ("state", orbit.x0, names.states),
        "mode": orbit.mode,
        "t0": ((), orbit.t0, names.of("t")),
        "period": ((), orbit.period, names.of("t")),
        "multipliers": ("multiplier", np.asarray(orbit.multipliers, dtype=complex)),
        "log_moduli": ("multiplier", orbit.log_moduli),
        "fundamental": (("state", "direction"), with_counters(orbit.fundamental, len(names.state))),
        "residual": orbit.residual,
        "iterations": orbit.iterations,
    }
    made_by = attributes("periodic orbit", orbit.status, orbit.system, orbit.parameters)
    found = xarray.Dataset(
        variables,
        names.coords(),
        {**made_by, "signature": list(orbit.signature), "transitions": list(orbit.transitions)},
    )
    if orbit.shift:
        shift = [orbit.shift.get(name, 0.0) for name in orbit.system.state_names]
        found = found.assign(shift=("state", shift, names.states))
    [row] = table_at(orbit.system, [*orbit.system.outputs], [orbit])
    return with_outputs(found, orbit.system, {"outputs": ((), row)})


def table_at(system: HybridSystem, names: Sequence[str], orbits: Sequence[Any]) -> np.ndarray:
    """Components and outputs at the points of orbits, ``(N, len(names))``."""
    if not orbits:
        return np.empty((0, len(names)))
    return table_of(
        system,
        names,
        np.array([each.t0 for each in orbits]),
        np.array([each.x0 for each in orbits]),
        np.array([system.mode_index(each.mode) for each in orbits]),
        np.array([system.parameter_values(each.parameters) for each in orbits]),
    )


def described_orbit(orbit: Any) -> str:
    """A :class:`hybrid.PeriodicOrbit` in one line: where it goes, its largest multiplier with its sign.

    A point that is no orbit is not described as one: the line says how far from closing it is.
    """
    if not orbit.closes:
        return f"<PeriodicOrbit {unfinished(orbit)}: {orbit.status.message}>"
    through = f" through {', '.join(map(repr, orbit.transitions))}" if orbit.transitions else ""
    largest = orbit.multipliers[0]
    pair = f" +- {abs(largest.imag):.6g}i" if largest.imag else ""
    along = "".join(f", shift of {name} {value:.6g}" for name, value in orbit.shift.items())
    return (
        f"<PeriodicOrbit period {orbit.period:.9g}{along} from {orbit.mode!r}{through}, largest multiplier "
        f"{largest.real:.6g}{pair}, residual {orbit.residual:.1e}, {orbit.status.brief}>"
    )


def tabled_orbit(orbit: Any) -> str:
    """A :class:`hybrid.PeriodicOrbit` as HTML: its line, its point by name, and one row per multiplier."""
    units = orbit.system.units
    point = ", ".join(
        f"{with_unit(name, units.get(name))} = {value:.9g}"
        for name, value in zip(orbit.system.state_names, orbit.x0, strict=True)
    )
    rows = [
        [f"{value.real:.6g}" + (f" {value.imag:+.6g}i" if value.imag else ""), f"{abs(value):.6g}"]
        for value in np.asarray(orbit.multipliers, dtype=complex)
    ]
    said = f"<p>{escape(repr(orbit))}</p>\n<p>{escape(f'at t = {orbit.t0:.6g}: {point}')}</p>"
    return f"{said}\n{html_table(('multiplier', 'modulus'), rows)}"


def unfinished(orbit: Any) -> str:
    """What a search without success left, in words: how far its best point is from an orbit."""
    code = orbit.status.code
    word = "NOT CONVERGED" if code == StatusCode.NOT_CONVERGED else f"NO ORBIT, {code.name}"
    return f"{word}, residual {orbit.residual:.1e} after a period of {orbit.period:.9g} from {orbit.mode!r}"
