"""What all runs of a search for attractors have in common: system, section, parameters, solver."""

from __future__ import annotations

import math
from functools import cached_property
from hashlib import blake2b
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compiler.compiled import compile_system
from hybrid.errors import ArgumentError
from hybrid.simulation.pace import time_scale
from hybrid.simulation.periods import check_time
from hybrid.simulation.plan import check_solver
from hybrid.simulation.trajectory import Trajectory, start
from hybrid.solvers import Solver
from hybrid.sweep.attractors.asked import AskedOfRuns, AskedOfSearch
from hybrid.sweep.attractors.features import Features, checked_features
from hybrid.system.elements import Guard
from hybrid.system.graph import HybridSystem, as_system, check_mode
from hybrid.transform.aged import aged, original_of
from hybrid.transform.markers import with_section


@attrs.frozen(eq=False)
class Setup:
    """Where runs begin and where their points are taken.

    Attributes
    ----------
    system, marked
        The model, and the model with the markers of the section, if there is one.
    mode, parameters, t0, solver
        As for :func:`hybrid.simulate`.
    section, interval
        The surface, or the time between two points; a forced system without a surface has one point per
        forcing period, and the interval is that period.
    periods
        Points after which a start is given up.
    recurrences
        Points in succession near one attractor that decide a start.
    tolerance
        How near that is, as a share of the extent of the attractor's orbit.
    features
        What tells attractors apart in place of their points, if anything does.
    """

    system: HybridSystem
    marked: HybridSystem
    mode: str | None
    parameters: dict[str, float]
    t0: float
    solver: Solver
    section: Guard | None
    interval: float
    periods: int
    recurrences: int
    tolerance: float
    features: Features | None = None

    @property
    def markers(self) -> int:
        """How many of the first transitions mark the section."""
        return 0 if self.section is None else len(self.system.modes)

    @cached_property
    def turns(self) -> np.ndarray:
        """Lengths of a turn ``(n,)``, 0 for components that are no angle.

        That of a counter is 1: two states that differ by a counter are the same place, unless it counts what
        delays have under way.
        """
        system = self.system
        others = np.array([name not in system.under_way for name in system.state_names])
        counts = others & (np.arange(system.dimension) >= system.tangent_dimension)
        return np.where(counts, 1.0, system.turn_lengths)

    @property
    def forced(self) -> bool:
        """Whether points are taken once per forcing period."""
        return self.section is None and self.system.period is not None

    def begin(
        self, x0: np.ndarray, mode: str | None, *, marked: bool = False, tangent: np.ndarray | None = None
    ) -> Trajectory:
        """A trajectory from a state at the phase of the start."""
        return start(
            self.marked if marked else self.system,
            x0,
            self.t0,
            mode=mode,
            parameters=self.parameters,
            solver=self.solver,
            tangent=tangent,
        )

    def facts(self) -> dict[str, Any]:
        """What decides the results, by name."""
        own = ("mode", "t0", "solver", "section", "interval", "periods", "recurrences", "tolerance")
        asked = {} if self.features is None else {"features": self.features}
        return {
            "model": original_of(self.system),
            **{name: getattr(self, name) for name in own},
            **asked,
            **{f"parameter_{name}": value for name, value in self.parameters.items()},
        }


def digest(array: np.ndarray) -> str:
    """A text that stands for the numbers of an array among the facts of a store."""
    return blake2b(np.ascontiguousarray(array).tobytes(), digest_size=8).hexdigest()


def setup_of(system: HybridSystem, origins: np.ndarray, given: AskedOfRuns) -> Setup:
    """The setup of a search with every argument checked.

    The system is the aged one: where a mode is left at a time after its entry, that time is a part of the
    state. The least of the starts ``origins (N, n)`` shows the time scale, whatever their order. ``given``
    may be an `AskedOfSearch`, which has a section and features besides.
    """
    as_system("system", system)
    asked: AskedOfSearch = {"section": None, "features": None, "together": None, **given}
    system = aged(system)
    overrides = system.variables.overrides(asked["parameters"])
    system.parameter_values(overrides)
    mode, section, interval = asked["mode"], asked["section"], asked["interval"]
    if mode is not None:
        check_mode(system, mode)
    if section is not None:
        arguments.instance("section", section, Guard, "Write Guard(function, direction=...).")
    length = None if interval is None else arguments.positive("interval", interval, "be a positive time")
    forcing = system.forcing_period(overrides)
    if length is not None and (section is not None or forcing is not None):
        what = "the section" if section is not None else "the forcing period"
        raise ArgumentError(f"interval must be None here; got {length}: points are taken by {what}.")
    marked = system if section is None else with_section(system, section)
    found = Setup(
        system=system,
        marked=marked,
        mode=mode,
        parameters=overrides,
        t0=arguments.number("t0", asked["t0"]),
        solver=check_solver(asked["solver"]),
        section=section,
        interval=float(length or forcing or 0.0),
        periods=arguments.count("periods", asked["periods"], 1),
        recurrences=arguments.count("recurrences", asked["recurrences"], 1),
        tolerance=arguments.positive("tolerance", asked["tolerance"], "be a share below 1"),
        features=checked_features(asked["features"], asked["together"]),
    )
    known = math.sqrt(found.solver.rtol)
    if not known < found.tolerance < 1.0:
        raise ArgumentError(
            f"tolerance must be above {known:.2g} and below 1; got {found.tolerance}. Points of an orbit are "
            "known to the square root of the solver's rtol: raise tolerance=, or lower rtol by solver=."
        )
    check_time("t0", found.t0, forcing or 0.0)
    compile_system(marked)
    if not found.interval:
        least = origins[np.lexsort(origins.T[::-1])[0]]
        found = attrs.evolve(found, interval=time_scale(found.begin(least, mode)))
    return found
