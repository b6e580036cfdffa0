"""From a bifurcation to the branch that begins or crosses there."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.branch import Bifurcation
from hybrid.orbits.continuation.crossing import crossing
from hybrid.orbits.continuation.place import place_on
from hybrid.orbits.continuation.result import Points, orbit_of
from hybrid.orbits.equilibria.branch import EquilibriumBifurcation
from hybrid.orbits.equilibria.equilibrium import Equilibrium
from hybrid.orbits.equilibria.switching import switched
from hybrid.orbits.kinds import KINDS
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.simulation.plan import check_solver
from hybrid.solvers import Solver, Taylor


def switch_branch(
    bifurcation: Bifurcation | EquilibriumBifurcation, *, solver: Solver | None = None
) -> PeriodicOrbit | Equilibrium:
    """An orbit on the branch that begins at a flip, or crosses at a branch point; continue it from there.

    It is a small distance from the bifurcation along the direction in which the equations of the orbit are
    singular: at a flip the eigenvector of the multiplier -1, for the orbit of twice the period. Where the
    sequence of transitions changes it is the orbit with the new sequence.

    At a Hopf point of an equilibrium it is a small cycle, at a branch point an equilibrium on the other
    branch, and at a boundary the equilibrium of another mode, where it is admissible.

    Parameters
    ----------
    bifurcation
        Of a `Branch`: a ``"flip"``, a ``"branch point"``, or a change of the transitions. Of an
        `EquilibriumBranch`: a ``"Hopf"`` point, a ``"branch point"``, or a ``"boundary"``.
    solver
        Method and tolerances, by default ``Taylor(rtol=1e-12, atol=1e-14)``.

    Returns
    -------
    PeriodicOrbit or Equilibrium
        For `continue_orbit` or `continue_equilibrium`.

    Raises
    ------
    ArgumentError
        If no branch begins at such a bifurcation, or none is found.

    References
    ----------
    R. Seydel, Practical Bifurcation and Stability Analysis, 3rd ed., Springer 2010, section 5.6.

    Examples
    --------
    >>> import hybrid, models
    >>> orbit = hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    >>> grazing = hybrid.continue_orbit(orbit, "w", (0.9, 1.8)).bifurcations[-1]
    >>> free = hybrid.switch_branch(grazing)
    >>> free.status.ok, len(free.arc().jumps)
    (True, 0)
    """
    method = Taylor(rtol=1e-12, atol=1e-14) if solver is None else check_solver(solver)
    if isinstance(bifurcation, EquilibriumBifurcation):
        return switched(bifurcation, method)
    arguments.instance("bifurcation", bifurcation, Bifurcation, "Take one of branch.bifurcations.")
    passes = KINDS[bifurcation.kind].passes if bifurcation.kind in KINDS else 0
    if not passes:
        beyond = None if bifurcation._change is None else bifurcation._change.onward.place
        if beyond is None:
            raise ArgumentError(
                f"bifurcation is a {bifurcation.kind}, where no other branch of orbits begins; allowed are a "
                "flip, a branch point, and a change of the transitions beyond which there is an orbit."
            )
        return orbit_of(beyond.orbit, Points(bifurcation.orbit.t0))
    place = bifurcation._place
    if place is None:
        # The value may be zero where another one is declared.
        declared = bifurcation.orbit.system.parameters[bifurcation.parameter]
        sizes = np.array([max(abs(bifurcation.value), abs(declared)) or 1.0])
        place = place_on(bifurcation.orbit, (bifurcation.parameter,), sizes, method)
    family = attrs.evolve(place.family, solver=method)
    place = attrs.evolve(place, orbit=attrs.evolve(place.orbit, family=family))
    found = crossing(place, passes)
    if found is None:
        raise ArgumentError(f"no other branch is found near the {bifurcation.kind}: tighten solver=.")
    return orbit_of(found, Points(bifurcation.orbit.t0))
