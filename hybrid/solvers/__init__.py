"""Integration methods, one file each."""

from hybrid.solvers.dop853 import DOP853
from hybrid.solvers.radau import RadauIIA
from hybrid.solvers.runge_kutta import RungeKutta
from hybrid.solvers.taylor import Taylor
from hybrid.solvers.tsit5 import Tsit5

__all__ = ["DOP853", "RadauIIA", "RungeKutta", "Taylor", "Tsit5"]
