"""Follow a bifurcation of an equilibrium over two parameters."""

from __future__ import annotations

from collections.abc import Callable

import attrs
import numpy as np

from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.progress import Progress, progress_bar
from hybrid.errors import ArgumentError
from hybrid.orbits.equilibria.bifurcation_curve import EquilibriumCurve, SpecialEquilibrium
from hybrid.orbits.equilibria.branch import EquilibriumBifurcation
from hybrid.orbits.equilibria.curve import Spot, spot_at, walk, zero_between
from hybrid.orbits.equilibria.defining import (
    BoundaryPoint,
    Defining,
    FoldPoint,
    HopfPoint,
    defining_of,
    state_of,
)
from hybrid.orbits.equilibria.equations import Equations, Reduced, reduced
from hybrid.orbits.equilibria.equilibrium import described, eigenvalues_of
from hybrid.orbits.equilibria.met import pair_sums
from hybrid.orbits.equilibria.normal_forms import eigenvectors, fold_forms, lyapunov_at
from hybrid.orbits.kinds import KINDS
from hybrid.orbits.zeros import SHARES, at_zero
from hybrid.simulation.interrupt import interrupted_status
from hybrid.status import SUCCESS, Status, StatusCode

ENDS = {
    "range": "the end of a range",
    "closed": "its start: it is closed",
    "infinity": "a state that grows without bound",
    "Bogdanov-Takens": "a Bogdanov-Takens point, where the frequency is zero",
    "most": "the limit of steps",
    "lost": "a point beyond which Newton's method finds none",
}
# Of two eigenvalues that are zero where a curve is found the second is below this, as a share of those
# of the matrix of magnitudes.
DOUBLE = 1e-3
MESSAGES = {
    "cusp": "the coefficient of the fold is zero: two curves of folds end in one point",
    "Bogdanov-Takens": "two eigenvalues are zero: a curve of Hopf points ends on one of folds",
    "generalized Hopf": "the first Lyapunov coefficient is zero: a curve of folds of cycles begins",
    "zero-Hopf": "an eigenvalue is zero besides the pair on the imaginary axis",
    "boundary-fold": "an eigenvalue is zero where the equilibrium is on the guard",
    "boundary-Hopf": "a pair is on the imaginary axis where the equilibrium is on the guard",
}


def curve_of(
    bifurcation: EquilibriumBifurcation,
    names: tuple[str, str],
    lows: np.ndarray,
    highs: np.ndarray,
    most: int,
    progress: bool | None,
) -> EquilibriumCurve:
    """The curve of a bifurcation both ways from where it was found; errors are those of the public call."""
    point = bifurcation.equilibrium
    if KINDS[bifurcation.kind].lost:
        raise ArgumentError(
            f"bifurcation is {KINDS[bifurcation.kind].lost}; allowed are a fold, a Hopf point and a boundary."
        )
    vector = point.system.parameter_values(point.parameters)
    equations = Equations(point.system, point.mode, names, point.x, vector)
    begin = _begun(bifurcation, equations, highs - lows)
    items: list[Spot | tuple[str, Spot]] = [begin]
    why: list[str] = []
    with CTRL_C, progress_bar(None, "Curve", progress, "point") as bar:
        for sign in (-1.0, 1.0):
            items = items[::-1]
            start = attrs.evolve(begin, tangent=sign * begin.tangent)
            why.append(_walked(start, lows, highs, most, items, bar))
            if why[-1] in ("closed", "interrupted"):
                break
        interrupted = CTRL_C.is_set()
    status = interrupted_status("the points so far") if interrupted else _status(why)
    return _result(bifurcation, equations, items, status)


def _begun(bifurcation: EquilibriumBifurcation, equations: Equations, reach: np.ndarray) -> Spot:
    """The first point of the curve."""
    u = equations.start()
    part = reduced(equations, u)
    system: Defining
    if bifurcation.kind == "fold":
        system = FoldPoint(part)
    elif bifurcation.kind == "Hopf":
        system = HopfPoint(part, eigenvectors(equations, u)[1])
    else:
        barrier = next(each for each in equations.barriers if bifurcation.barrier in each.names)
        system = BoundaryPoint(part, barrier)
    units = np.concatenate([bifurcation._place.units[:-1], reach])
    extra, sizes = system.extra(u, units)
    whole, units = np.concatenate([extra, u]), np.concatenate([sizes, units])
    spot = spot_at(system, whole, units, np.eye(len(whole))[-1])
    found = spot or spot_at(system, whole, units, np.eye(len(whole))[-2])
    made = None if found is None else found.step(0.0)
    if made is None:
        raise ArgumentError(
            f"the {bifurcation.kind} is not found again over {' and '.join(equations.names)}: it may be "
            "degenerate."
        )
    return made[0]


def _renewed(spot: Spot) -> Spot:
    """A point with the equations as they are there, and units that have grown with the state."""
    system, u = defining_of(spot), state_of(spot)
    part = reduced(system.part.equations, u, system.part.basis)
    units = spot.units.copy()
    units[-len(u) : -2] = np.maximum(units[-len(u) : -2], np.abs(u[:-2]))
    onward = spot.tangent * spot.units / units
    return spot_at(system.renewed(part, spot.u), spot.u, units, onward, spot.scales) or spot


def _walked(
    start: Spot,
    lows: np.ndarray,
    highs: np.ndarray,
    most: int,
    items: list[Spot | tuple[str, Spot]],
    bar: Progress,
) -> str:
    """Walk from a point; what is met goes to the items. Returns why the walk ends."""
    before = start
    with CTRL_C.ending():
        for item in walk(start, lows, highs, most, _renewed):
            if isinstance(item, str):
                return item
            for kind, function in TESTS[type(defining_of(item))].items():
                one, other = function(before), function(item)
                if one * other < 0.0:
                    found = (
                        _without_frequency(before, item)
                        if kind == "frequency"
                        else zero_between(before, item, function)
                    )
                    named = None if found is None else _named(kind, found)
                    if found is not None and named is not None:
                        items.append((named, found))
                        if kind == "frequency":
                            return "Bogdanov-Takens"
            items.append(item)
            before = _renewed(item)
            bar.update(True)
            if CTRL_C.is_set():
                break
    return "interrupted"


def _parts(spot: Spot) -> tuple[Reduced, np.ndarray]:
    return defining_of(spot).part, state_of(spot)


def _fold_forms(spot: Spot) -> float:
    """Zero at a cusp, and where a second eigenvalue is zero."""
    bent, product = _forms(spot)
    return bent * product


def _forms(spot: Spot) -> tuple[float, float]:
    part, u = _parts(spot)
    return fold_forms(part, u, 2, spot.u[: part.equations.n])


def _frequency(spot: Spot) -> float:
    return float(spot.u[-len(state_of(spot)) - 1])


def _without_frequency(spot: Spot, after: Spot) -> Spot | None:
    """The point between two at which the frequency is zero, where the equations are singular.

    The unknowns are polynomials of the frequency through points on both sides.
    """
    low, high = 0.0, spot.distance(after)
    best: Spot | None = None
    for _ in range(3):
        lengths = 0.5 * (low + high) + 0.5 * (high - low) * np.array(SHARES)
        found = [made[0] for made in map(spot.step, lengths) if made is not None]
        heights = np.array([_frequency(each) for each in found])
        if len(found) < 4 or len(set(heights.tolist())) < len(found):
            break
        unknowns = at_zero(heights, np.array([np.append(each.u, spot.distance(each)) for each in found]))
        best = attrs.evolve(spot, u=unknowns[:-1])
        middle, width = float(unknowns[-1]), 0.1 * (high - low)
        low, high = middle - width, middle + width
    return best


def _lyapunov(spot: Spot) -> float:
    part, u = _parts(spot)
    return lyapunov_at(part.equations, u, 2)


def _determinant(spot: Spot) -> float:
    """Zero where an eigenvalue is: the product of all, each by its size, in the order of their sizes."""
    part, u = _parts(spot)
    own = eigenvalues_of(part.equations.within(u))
    sizes = np.abs(own)
    smallest, largest = sizes.min(initial=np.inf), sizes.max(initial=0.0)
    sign = float(np.sign(np.prod(own / np.where(sizes == 0.0, 1.0, sizes)).real))
    return sign * float(smallest / largest) if largest else 0.0


def _pairs(spot: Spot) -> float:
    part, u = _parts(spot)
    return pair_sums(part.equations, u)


TESTS: dict[type, dict[str, Callable[[Spot], float]]] = {
    FoldPoint: {"cusp": _fold_forms},
    HopfPoint: {"frequency": _frequency, "generalized Hopf": _lyapunov, "zero-Hopf": _determinant},
    BoundaryPoint: {"boundary-fold": _determinant, "boundary-Hopf": _pairs},
}


def _named(kind: str, spot: Spot) -> str | None:
    """What is met where a test is zero; None if nothing is."""
    part, u = _parts(spot)
    if kind == "frequency":
        return "Bogdanov-Takens"
    if kind == "cusp":
        matrix = part.equations.within(u)
        sizes = np.sort(np.abs(eigenvalues_of(matrix)))
        largest = float(np.abs(eigenvalues_of(np.abs(matrix))).max())
        # A matrix whose powers vanish has no eigenvalues to measure by.
        zero = max(DOUBLE * largest, np.finfo(float).eps * float(np.linalg.norm(matrix)))
        return "Bogdanov-Takens" if len(sizes) > 1 and sizes[1] <= zero else "cusp"
    if kind == "boundary-Hopf":
        own = eigenvalues_of(part.equations.within(u))
        pair = own[np.argmin(np.abs(own.real))]
        return kind if abs(pair.real) < abs(pair.imag) else None
    return kind


def _result(
    bifurcation: EquilibriumBifurcation,
    equations: Equations,
    items: list[Spot | tuple[str, Spot]],
    status: Status,
) -> EquilibriumCurve:
    spots = [item for item in items if isinstance(item, Spot)]
    states = [state_of(each) for each in spots]
    coefficients = np.full(len(spots), np.nan)
    if bifurcation.kind == "Hopf":
        coefficients = np.array([_lyapunov(each) for each in spots])
    elif bifurcation.kind == "fold":
        forms = [_forms(each) for each in spots]
        coefficients = np.array([0.5 * bent / product for bent, product in forms])
    first, second = equations.names
    return EquilibriumCurve(
        system=equations.system,
        mode=equations.mode,
        kind=bifurcation.kind,
        names=(first, second),
        values=np.array([each[-2:] for each in states]),
        x=np.array([equations.state(each) for each in states]),
        eigenvalues=np.array([eigenvalues_of(equations.within(each)) for each in states]),
        coefficient=coefficients,
        points=tuple(_special(equations, *item) for item in items if not isinstance(item, Spot)),
        status=status,
        equations=equations,
    )


def _special(equations: Equations, kind: str, spot: Spot) -> SpecialEquilibrium:
    u = state_of(spot)
    values = dict(zip(equations.names, u[-2:].tolist(), strict=True))
    return SpecialEquilibrium(kind, values, described(equations, u), MESSAGES[kind])


def _status(why: list[str]) -> Status:
    text = " and at ".join(ENDS[each] for each in dict.fromkeys(why))
    if not {"lost", "most"} & set(why):
        return attrs.evolve(SUCCESS, message=f"The curve ends at {text}.")
    return Status(
        StatusCode.NOT_CONVERGED,
        f"The curve ends at {text}.",
        "Raise max_steps, or continue from another bifurcation.",
    )
