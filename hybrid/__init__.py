"""Event-driven simulation and linearisation of hybrid (piecewise-smooth) dynamical systems.

A model is a graph: modes are smooth vector fields, transitions are guards and resets. The compiler is
imported and runs only when a call first needs it.
"""

from importlib import import_module
from typing import Any

from hybrid.accuracy.answer import Answer
from hybrid.accuracy.global_error import GlobalError, global_error
from hybrid.accuracy.work_precision import WorkPrecision, work_precision
from hybrid.compiler.compiled import CompiledSystem, compile_system
from hybrid.errors import ArgumentError, HybridError, ModelError
from hybrid.expression.table import Table
from hybrid.orbits.continuation.bifurcation_curve import BifurcationCurve, CodimensionTwo
from hybrid.orbits.continuation.branch import Bifurcation, Branch
from hybrid.orbits.continuation.continue_bifurcation import continue_bifurcation
from hybrid.orbits.continuation.continue_orbit import continue_orbit
from hybrid.orbits.continuation.switch_branch import switch_branch
from hybrid.orbits.diagrams.continue_all import continue_all
from hybrid.orbits.diagrams.diagram import Diagram
from hybrid.orbits.diagrams.saved import open_branch, open_diagram
from hybrid.orbits.equilibria.bifurcation_curve import EquilibriumCurve, SpecialEquilibrium
from hybrid.orbits.equilibria.branch import EquilibriumBifurcation, EquilibriumBranch
from hybrid.orbits.equilibria.continue_equilibrium import continue_equilibrium
from hybrid.orbits.equilibria.equilibrium import Equilibrium, equilibrium
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.periodic_orbit import periodic_orbit
from hybrid.orbits.sections import Section, poincare_section, stroboscopic_section
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.end import ArcEnd, open_end
from hybrid.simulation.jumps import Grazing, Jump
from hybrid.simulation.saltation import saltation_matrix
from hybrid.simulation.simulate import simulate
from hybrid.solvers import DOP853, RadauIIA, Solver, Taylor, Tsit5
from hybrid.status import Status, StatusCode
from hybrid.sweep.attractors.attractor import Attractor, Attractors
from hybrid.sweep.attractors.attractors import attractors
from hybrid.sweep.attractors.basins import basins
from hybrid.sweep.attractors.boundaries import (
    BasinEntropy,
    UncertaintyExponent,
    basin_entropy,
    uncertainty_exponent,
)
from hybrid.sweep.attractors.edge import EdgeState
from hybrid.sweep.attractors.edge_state import edge_state
from hybrid.sweep.attractors.fractions import basin_fractions
from hybrid.sweep.many import simulate_many
from hybrid.sweep.store import open_store
from hybrid.sweep.sweep import sweep
from hybrid.system.clocks import After, Every
from hybrid.system.delay import Delay
from hybrid.system.elements import Guard, Mode, Reset, Transition
from hybrid.system.graph import HybridSystem
from hybrid.system.laws import Laws
from hybrid.system.repeat import repeat
from hybrid.system.schedule import At
from hybrid.transform.complementarity import complementarity
from hybrid.transform.contacts.contact import Contact
from hybrid.transform.filippov import filippov
from hybrid.transform.mechanics import mechanics
from hybrid.transform.pairs.pair import Pair
from hybrid.transform.split import from_equations, split

__version__ = "1.0.0"

__all__ = [
    "DOP853",
    "After",
    "Answer",
    "ArcEnd",
    "ArgumentError",
    "At",
    "Attractor",
    "Attractors",
    "BasinEntropy",
    "Bifurcation",
    "BifurcationCurve",
    "Branch",
    "CodimensionTwo",
    "CompiledSystem",
    "Contact",
    "Delay",
    "Diagram",
    "EdgeState",
    "Equilibrium",
    "EquilibriumBifurcation",
    "EquilibriumBranch",
    "EquilibriumCurve",
    "Every",
    "GlobalError",
    "Grazing",
    "Guard",
    "HybridArc",
    "HybridError",
    "HybridSystem",
    "Jump",
    "Laws",
    "Mode",
    "ModelError",
    "Pair",
    "PeriodicOrbit",
    "RadauIIA",
    "Reset",
    "Section",
    "Solver",
    "SpecialEquilibrium",
    "Status",
    "StatusCode",
    "Table",
    "Taylor",
    "Transition",
    "Tsit5",
    "UncertaintyExponent",
    "WorkPrecision",
    "attractors",
    "basin_entropy",
    "basin_fractions",
    "basins",
    "compile_system",
    "complementarity",
    "continue_all",
    "continue_bifurcation",
    "continue_equilibrium",
    "continue_orbit",
    "edge_state",
    "equilibrium",
    "filippov",
    "from_equations",
    "global_error",
    "mechanics",
    "open_branch",
    "open_diagram",
    "open_end",
    "open_store",
    "periodic_orbit",
    "poincare_section",
    "repeat",
    "saltation_matrix",
    "simulate",
    "simulate_many",
    "split",
    "stroboscopic_section",
    "sweep",
    "switch_branch",
    "uncertainty_exponent",
    "work_precision",
]


# What is imported when it is first asked for: its module, and its name there unless it is the module. plot
# and testing need Matplotlib and Hypothesis. explore needs lyapunov, which stands on this package: no other
# name leads upwards.
ON_DEMAND = {
    "measures": ("hybrid.measures", ""),
    "plot": ("hybrid.plot", ""),
    "testing": ("hybrid.testing", ""),
    "explore": ("hybrid.explorer.explore", "explore"),
}


def __getattr__(name: str) -> Any:
    if name not in ON_DEMAND:
        raise AttributeError(f"module 'hybrid' has no attribute {name!r}")
    module, inner = ON_DEMAND[name]
    found = import_module(module)
    return getattr(found, inner) if inner else found


def __dir__() -> list[str]:
    return [*__all__, "__version__", *ON_DEMAND]
