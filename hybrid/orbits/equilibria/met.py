"""The bifurcations between two points of a branch of equilibria."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations

import attrs
import numpy as np

from hybrid.orbits.equilibria.curve import Spot, zero_between
from hybrid.orbits.equilibria.equations import Barrier, Equations, Reduced
from hybrid.orbits.equilibria.equilibrium import eigenvalues_of
from hybrid.orbits.equilibria.normal_forms import branch_point_near, critical_pair

# The real part of a pair at a Hopf point, as a share of its imaginary part, at most.
ON_THE_AXIS = 1e-6

# A step is halved so often at most in the search for bifurcations.
DEEPEST = 5

Found = tuple[str, Spot, Barrier | None]

Item = Spot | Found


def between(equations: Equations, spot: Spot, after: Spot, depth: int = 0) -> list[Item]:
    """The bifurcations between two points, in order.

    A step over which an eigenvalue or a guard may have passed zero and come back is looked at in parts.
    """
    if depth < DEEPEST and _may_pass_twice(equations, spot, after):
        made = spot.step(0.5 * spot.distance(after))
        if made is not None:
            middle = made[0]
            return [
                *between(equations, spot, middle, depth + 1),
                *between(equations, middle, after, depth + 1),
            ]
    return _in_a_part(equations, spot, after)


def _may_pass_twice(equations: Equations, spot: Spot, after: Spot) -> bool:
    """Whether something is as near to zero at both ends as it moves between them, or two things pass it."""
    one, other = (eigenvalues_of(equations.within(each.u)) for each in (spot, after))
    moved = np.abs(one.real - other.real)
    near = np.minimum(np.abs(one.real), np.abs(other.real)) < 2.0 * moved
    same = near & (np.sign(one.real) == np.sign(other.real))
    passed = int(np.sum((one.real > 0.0) != (other.real > 0.0)))
    if np.any(same & (moved > 0.0)) or passed > (2 if np.any(one.imag != 0.0) else 1):
        return True
    for barrier in equations.barriers:
        heights = [barrier.height_beside(equations.known(each.u), each.units) for each in (spot, after)]
        if min(map(abs, heights)) < 2.0 * abs(heights[0] - heights[1]) and heights[0] * heights[1] > 0.0:
            return True
    return False


def _in_a_part(equations: Equations, spot: Spot, after: Spot) -> list[Item]:
    """The bifurcations between two points, of each kind one at most, in order."""
    found: list[Found] = []
    changed = [kind for kind, function in TESTS.items() if _changes(function, spot, after)]
    if "branch point" in changed and "fold" in changed:
        # A branch that crosses another one at its turn, as the arms of a pitchfork do.
        changed.remove("fold")
    for kind in changed:
        there = _crossing(spot, after) if kind == "branch point" else zero_between(spot, after, TESTS[kind])
        if there is not None and (kind != "Hopf" or _is_hopf(equations, there)):
            found.append((kind, there, None))
    for barrier in equations.barriers:
        there = _met(equations, barrier, spot, after)
        if there is not None:
            found.append(("boundary", there, barrier))
    return [*sorted(_each_once(found), key=lambda each: spot.distance(each[1]))]


def _each_once(found: list[Found]) -> Iterator[Found]:
    """Boundaries at one point, of several guards on one surface, as the first of them."""
    met: list[Spot] = []
    for kind, spot, barrier in found:
        if kind == "boundary":
            if any(np.all(np.abs(spot.u - each.u) <= ON_THE_AXIS * spot.units) for each in met):
                continue
            met.append(spot)
        yield kind, spot, barrier


def _changes(function: Callable[[Spot], float], spot: Spot, after: Spot) -> bool:
    one, other = function(spot), function(after)
    return bool(one * other < 0.0 or (other == 0.0 and one != 0.0))


def _fold(spot: Spot) -> float:
    """Zero where the branch turns back."""
    return float(spot.tangent[-1])


def branch_point(spot: Spot) -> float:
    """Zero where another branch crosses."""
    return float(np.linalg.det(spot.matrix))


def _hopf(spot: Spot) -> float:
    """Zero where two eigenvalues have the sum zero."""
    assert isinstance(spot.system, Reduced)
    return pair_sums(spot.system.equations, spot.u)


def pair_sums(equations: Equations, u: np.ndarray) -> float:
    """The product of the sums of two eigenvalues, each by its size; 1 if there is only one eigenvalue."""
    own = eigenvalues_of(equations.within(u))
    product = 1.0 + 0.0j
    for one, other in combinations(own, 2):
        size = abs(one) + abs(other)
        product *= (one + other) / size if size else 0.0
    return float(product.real) if len(own) > 1 else 1.0


TESTS: dict[str, Callable[[Spot], float]] = {"fold": _fold, "branch point": branch_point, "Hopf": _hopf}


def _is_hopf(equations: Equations, spot: Spot) -> bool:
    """Whether the two eigenvalues are a pair on the imaginary axis, and not a saddle's."""
    pair = critical_pair(equations.within(spot.u))
    return bool(abs(pair.real) <= ON_THE_AXIS * pair.imag)


def _crossing(spot: Spot, after: Spot) -> Spot | None:
    """The branch point between two points."""
    assert isinstance(spot.system, Reduced)
    ends = [branch_point(spot), branch_point(after)]
    share = ends[0] / (ends[0] - ends[1])
    u = branch_point_near(spot.system, spot.u + share * (after.u - spot.u), spot.units, after.scales)
    if u is None or np.abs((u - spot.u) / spot.units).max() > 2.0 * spot.distance(after):
        return None
    return attrs.evolve(spot, u=u)


def _met(equations: Equations, barrier: Barrier, spot: Spot, after: Spot) -> Spot | None:
    """The point between two at which the state is on a guard."""

    def height(each: Spot) -> float:
        return barrier.height_beside(equations.known(each.u), each.units)

    if not _changes(height, spot, after):
        return None
    there: Spot | None = after
    if height(after):
        there = zero_between(
            spot, after, lambda each: float(barrier.height.value(equations.known(each.u))[0])
        )
    return there if there is not None and barrier.counts(equations.known(there.u)) else None
