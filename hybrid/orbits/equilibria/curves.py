"""Follow a bifurcation of an equilibrium over two parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.progress import Progress, progress_bar
from hybrid.display.tables import counted
from hybrid.errors import ArgumentError
from hybrid.orbits.equilibria.branch import EquilibriumBifurcation
from hybrid.orbits.equilibria.continue_equilibrium import pair_sums
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
from hybrid.orbits.equilibria.equilibrium import Equilibrium, described, eigenvalues_of
from hybrid.orbits.equilibria.normal_forms import eigenvectors, fold_forms, lyapunov_at
from hybrid.orbits.kinds import KINDS, plural
from hybrid.orbits.zeros import SHARES, at_zero
from hybrid.simulation.interrupt import interrupted_status
from hybrid.simulation.labelled import Names, attributes
from hybrid.status import SUCCESS, Status, StatusCode
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    import xarray

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


@attrs.frozen(eq=False)
class SpecialEquilibrium:
    """Where two things happen at once on a curve of bifurcations of an equilibrium.

    Attributes
    ----------
    kind
        On a curve of folds ``"cusp"`` or ``"Bogdanov-Takens"``, of Hopf points ``"generalized Hopf"``,
        ``"zero-Hopf"`` or ``"Bogdanov-Takens"``, of boundaries ``"boundary-fold"`` or ``"boundary-Hopf"``.
    values
        The two parameters by name.
    equilibrium, message
        The equilibrium there, and what happens, in words.

    Examples
    --------
    >>> import hybrid
    >>> cubic = hybrid.HybridSystem(
    ...     state=("x",),
    ...     parameters={"a": -2.0, "b": 1.0},
    ...     modes=[hybrid.Mode("flow", lambda t, x, p: (p.a + p.b * x.x - x.x**3,))],
    ... )
    >>> fold = hybrid.continue_equilibrium(hybrid.equilibrium(cubic, (-1.5,)), "a", (-2.0, 2.0)).of("fold")[0]
    >>> [cusp] = hybrid.continue_bifurcation(fold, {"a": (-2.0, 2.0), "b": (-1.0, 2.0)}).points
    >>> cusp.kind, abs(cusp.values["b"]) < 1e-10
    ('cusp', True)
    """

    kind: str
    values: Mapping[str, float]
    equilibrium: Equilibrium
    message: str

    def __str__(self) -> str:
        where = ", ".join(f"{name} = {value:.10g}" for name, value in self.values.items())
        return f"{self.kind} at {where}: {self.message}"


@attrs.frozen(eq=False, repr=False)
class EquilibriumCurve:
    """A bifurcation of an equilibrium over two parameters; ``curve["q"]`` are the values of one.

    Attributes
    ----------
    system, mode, kind, names
        The model, the mode, the kind of the bifurcation, and the names of the two parameters.
    values
        Their values ``(N, 2)``, in order along the curve.
    x
        The states ``(N, n)``.
    eigenvalues
        As those of :class:`hybrid.Equilibrium`, ``(N, k)``.
    coefficient
        The first Lyapunov coefficient along a curve of Hopf points, ``a`` of the normal form along one of
        folds, ``(N,)``; nan for boundaries.
    points
        Each :class:`hybrid.SpecialEquilibrium` on the curve, in order.
    status
        Why the curve ends where it does.

    Examples
    --------
    >>> import hybrid, models
    >>> rest = hybrid.equilibrium(models.relief_valve(), (2.5, 0.0, 12.5))
    >>> branch = hybrid.continue_equilibrium(rest, "q", (1.0, 10.0))
    >>> curve = hybrid.continue_bifurcation(branch.of("Hopf")[0], {"q": (1.0, 20.0), "kappa": (1.0, 1.5)})
    >>> [bautin] = curve.points
    >>> bautin.kind, {name: round(value, 4) for name, value in bautin.values.items()}
    ('generalized Hopf', {'q': 9.6103, 'kappa': 1.0731})
    """

    system: HybridSystem
    mode: str
    kind: str
    names: tuple[str, str]
    values: np.ndarray
    x: np.ndarray
    eigenvalues: np.ndarray
    coefficient: np.ndarray
    points: tuple[SpecialEquilibrium, ...]
    status: Status
    _equations: Equations

    def __getitem__(self, name: str) -> np.ndarray:
        arguments.known("curve: Parameter", name, self.names, "Parameters")
        return self.values[:, self.names.index(name)]

    def __len__(self) -> int:
        return len(self.values)

    def __repr__(self) -> str:
        spans = ", ".join(f"{name} = {self[name].min():.6g} to {self[name].max():.6g}" for name in self.names)
        special = ", ".join(each.kind for each in self.points) or "nothing special"
        kinds, count = plural(self.kind), counted(len(self), "point")
        return f"<Curve of {kinds}, {spans}, {count}, {special}, {self.status.brief}>"

    def equilibrium(self, i: int) -> Equilibrium:
        """The equilibrium of a point of the curve.

        Raises
        ------
        ArgumentError
            If there is no such point.
        """
        i = arguments.index("i", i, len(self))
        return described(self._equations, np.concatenate([self.x[i, : self._equations.n], self.values[i]]))

    def to_xarray(self) -> xarray.Dataset:
        """The curve over the axis ``point``, with both parameters as coordinates."""
        import xarray

        names = Names(self.system.state_names, self.system.units)
        variables = {
            "x": (("point", "state"), self.x, names.states),
            "eigenvalues": (("point", "eigenvalue"), self.eigenvalues),
            "coefficient": ("point", self.coefficient),
        }
        coords = {name: ("point", self[name], names.of(name)) for name in self.names}
        made_by = attributes(f"curve of {self.kind} of equilibria", self.status, self.system)
        return xarray.Dataset(variables, {**coords, **names.coords()}, {**made_by, "mode": self.mode})


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
