"""Integration methods, one per file."""

from hybrid.solvers.dop853 import DOP853
from hybrid.solvers.radau import RadauIIA
from hybrid.solvers.solver import Solver
from hybrid.solvers.taylor import Taylor
from hybrid.solvers.tsit5 import Tsit5

__all__ = ["DOP853", "RadauIIA", "Solver", "Taylor", "Tsit5"]
