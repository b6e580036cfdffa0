"""The branch of an equilibrium over a parameter."""

from __future__ import annotations

from functools import partial

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.progress import Progress, progress_bar
from hybrid.errors import ArgumentError
from hybrid.orbits.equilibria.boundary import neighbour_of, neighbours, told
from hybrid.orbits.equilibria.branch import EquilibriumBifurcation, EquilibriumBranch
from hybrid.orbits.equilibria.curve import Spot, spot_at, walk
from hybrid.orbits.equilibria.equations import Barrier, Equations, Reduced, reduced, sizes_of
from hybrid.orbits.equilibria.equilibrium import Equilibrium, described, eigenvalues_of, is_stable
from hybrid.orbits.equilibria.met import TESTS, Item, between, branch_point
from hybrid.orbits.equilibria.normal_forms import Hopf, fold_at, hopf_at
from hybrid.orbits.equilibria.smooth import row_lengths
from hybrid.simulation.interrupt import interrupted_status
from hybrid.status import SUCCESS, Status, StatusCode

ENDS = {
    "range": "the end of the range",
    "closed": "its start: it is closed",
    "infinity": "a state that grows without bound",
    "most": "the limit of steps",
    "lost": "a point beyond which Newton's method finds none",
}
# A test function is zero at a start below this.
AT_ONE = 1e-9
# Equilibria come in families where a singular value is below this share of the largest.
FAMILY = 1e-10
# A walk whose start is on a bifurcation begins this far from it, in units of the branch.
ASIDE = 3e-3


def continue_equilibrium(
    point: Equilibrium,
    parameter: str,
    span: tuple[float, float],
    *,
    max_steps: int = 2000,
    progress: bool | None = None,
) -> EquilibriumBranch:
    """The branch of an equilibrium over a parameter, both ways, and the bifurcations on it.

    Steps are taken along the branch (pseudo-arclength), so that it may turn back at folds. The branch is that
    of one mode: where the equilibrium passes a guard it goes on as a virtual one, with
    ``branch.admissible`` false. `switch_branch` goes from a bifurcation to the equilibria of another mode,
    to the branch that crosses, or to the cycles that begin at a Hopf point.

    Parameters
    ----------
    point
        From `equilibrium`.
    parameter
        Name of the parameter.
    span
        ``(low, high)``, which contains the value of the point.
    max_steps
        Largest number of steps in either direction.
    progress
        Whether to show a progress bar; by default in a terminal or a notebook, after two seconds.

    Returns
    -------
    EquilibriumBranch
        With a status; if it is interrupted or lost it keeps what there is.

    Raises
    ------
    ArgumentError
        If the point has not converged, the parameter does not exist, the span does not contain its value, or
        equilibria come in families, such as all states at rest of a mass that friction holds.

    References
    ----------
    Y. A. Kuznetsov, Elements of Applied Bifurcation Theory, 4th ed., Springer 2023, chapter 10.
    M. di Bernardo, C. Budd, A. Champneys, P. Kowalczyk, Piecewise-smooth Dynamical Systems, Springer 2008,
    section 5.1: persistence and nonsmooth folds of boundary equilibria.

    Examples
    --------
    >>> import hybrid
    >>> bead = hybrid.HybridSystem(
    ...     state=("a", "b"),
    ...     parameters={"r": -1.0},
    ...     modes=[
    ...         hybrid.Mode(
    ...             "flow",
    ...             lambda t, x, p: (
    ...                 p.r * x.a - 2 * x.b - x.a * (x.a**2 + x.b**2),
    ...                 2 * x.a + p.r * x.b - x.b * (x.a**2 + x.b**2),
    ...             ),
    ...         )
    ...     ],
    ... )
    >>> rest = hybrid.equilibrium(bead, (0.1, 0.1))
    >>> [hopf] = hybrid.continue_equilibrium(rest, "r", (-1.0, 1.0)).of("Hopf")
    >>> abs(hopf.value) < 1e-10, round(hopf.coefficient, 6), round(hopf.period, 6)
    (True, -1.0, 3.141593)
    """
    arguments.instance("point", point, Equilibrium, "Call equilibrium first.")
    if not point.status.ok:
        raise ArgumentError(f"point has not converged: {point.status.message}")
    arguments.known("parameter: Parameter", parameter, point.system.parameters, "Parameters")
    low, high = arguments.span_around("span", span, parameter, point.parameters[parameter])
    most = arguments.count("max_steps", max_steps, 1)
    progress = None if progress is None else arguments.flag("progress", progress)
    vector = point.system.parameter_values(point.parameters)
    equations = Equations(point.system, point.mode, (parameter,), point.x, vector)
    with CTRL_C, progress_bar(None, "Branch", progress, "point") as bar:
        items, why = _both_ways(equations, low, high, most, bar)
        interrupted = CTRL_C.is_set()
    status = interrupted_status("the equilibria so far") if interrupted else _status(why)
    return _branch_of(equations, items, status)


def _both_ways(
    equations: Equations, low: float, high: float, most: int, bar: Progress
) -> tuple[list[Item], list[str]]:
    """The points and bifurcations of a branch in order, and why it ends on either side."""
    begin = _aside(equations, _first(equations, high - low), low, high)
    items: list[Item] = [begin]
    why: list[str] = []
    for sign in (-1.0, 1.0):
        items = items[::-1]
        spot = before = attrs.evolve(begin, tangent=sign * begin.tangent)
        with CTRL_C.ending():
            ends = np.array([low]), np.array([high])
            for item in walk(spot, *ends, most, partial(_renewed, equations)):
                if isinstance(item, str):
                    why.append(item)
                    break
                after = attrs.evolve(item, units=before.units) if item is begin else item
                items += [*between(equations, before, after), item]
                before = _renewed(equations, item)
                bar.update(True)
                if CTRL_C.is_set():
                    break
        if CTRL_C.is_set() or why[-1:] == ["closed"]:
            break
    return items, why


def _first(equations: Equations, reach: float) -> Spot:
    """The first point, towards larger values of the parameter."""
    u = equations.start()
    part, n = reduced(equations, u), equations.n
    rows = part.jacobian(u)
    # A unit of the state is how far the equilibrium moves over the range, or how large it is.
    moved = np.abs(np.linalg.lstsq(rows[:, :n], -rows[:, n], rcond=FAMILY)[0]) * reach
    least = np.maximum(np.abs(u[:n]), np.minimum(moved, _largest(u[:n], moved)))
    units = np.append(sizes_of(equations.matrix(u), least), reach)
    scaled = rows * units
    values = np.linalg.svd(scaled / row_lengths(scaled)[:, None], compute_uv=False)
    spot = spot_at(part, u, units, np.eye(n + 1)[n])
    if spot is None or spot.tangent[n] == 0.0:
        _, _, right = np.linalg.svd(scaled)
        spot = spot_at(part, u, units, right[-1])
    assert spot is not None, "the last singular vector is a direction"
    if n and values[-1] <= FAMILY * values[0]:
        # Where two branches cross there is one alone beside; in a family there are others everywhere.
        made = spot.step(ASIDE)
        if made is None or abs(branch_point(made[0])) <= FAMILY:
            raise ArgumentError(
                f"point is one of a family: other equilibria of mode {equations.mode!r} are beside it at "
                "the same parameters, so there is no branch over one. Hold what tells them apart (held=), or "
                "choose a mode in which the equilibrium is alone."
            )
    return spot


def _aside(equations: Equations, spot: Spot, low: float, high: float) -> Spot:
    """A point of the branch beside a start that is on a bifurcation; the start itself if it is on none."""
    known = equations.known(spot.u)
    on_it = any(each.height_beside(known, spot.units) == 0.0 for each in equations.barriers)
    on_it |= any(abs(function(spot)) <= AT_ONE for function in TESTS.values())
    for length in (ASIDE, -ASIDE) if on_it else ():
        made = spot.step(length)
        if made is not None and low <= made[0].u[-1] <= high and abs(branch_point(made[0])) > AT_ONE:
            return made[0]
    return spot


def _largest(x: np.ndarray, moved: np.ndarray) -> float:
    """A bound of the units near a fold, where an equilibrium moves without bound."""
    size = float(np.abs(x).max(initial=0.0))
    return 10.0 * size if size else float(moved.max(initial=0.0))


def _renewed(equations: Equations, spot: Spot) -> Spot:
    """A point with the surfaces of the mode as they are there, and units that have grown with the state."""
    assert isinstance(spot.system, Reduced)
    units = np.maximum(spot.units, np.append(np.abs(spot.u[:-1]), 0.0))
    part = reduced(equations, spot.u, spot.system.basis)
    return spot_at(part, spot.u, units, spot.tangent * spot.units / units, spot.scales) or spot


def _branch_of(equations: Equations, items: list[Item], status: Status) -> EquilibriumBranch:
    """The branch through points and bifurcations in order."""
    spots = [each for each in items if isinstance(each, Spot)]
    own = [eigenvalues_of(equations.within(each.u)) for each in spots]
    values = dict(zip(map(id, spots), own, strict=True))
    stable = [is_stable(each) for each in own]
    beside = dict(zip(map(id, spots), stable, strict=True))
    found = [
        _bifurcation(
            equations, *item, _sides(items, i, beside), sum(isinstance(each, Spot) for each in items[:i])
        )
        for i, item in enumerate(items)
        if not isinstance(item, Spot)
    ]
    notes = _notes(equations.names[0], items, values)
    return EquilibriumBranch(
        system=equations.system,
        name=equations.names[0],
        mode=equations.mode,
        parameter=np.array([each.u[-1] for each in spots]),
        x=np.array([equations.state(each.u) for each in spots]),
        eigenvalues=np.array(own),
        stable=np.array(stable),
        admissible=np.array([not equations.excluded_by(each.u, each.units) for each in spots]),
        bifurcations=tuple(found),
        status=attrs.evolve(status, message=" ".join([status.message, *notes])),
        equations=equations,
    )


def _notes(name: str, items: list[Item], eigenvalues: dict[int, np.ndarray]) -> list[str]:
    """Where eigenvalues pass the axis and no bifurcation is listed, in words."""
    notes: list[str] = []
    before: tuple[float, int] | None = None
    for item in items:
        if not isinstance(item, Spot):
            before = None
            continue
        own = eigenvalues[id(item)]
        if np.any(np.abs(own.real) <= AT_ONE * np.abs(own).max(initial=0.0)):
            before = None
            continue
        value, count = float(item.u[-1]), int(np.sum(own.real > 0.0))
        if before is not None and count != before[1]:
            low, high = sorted([before[0], value])
            notes.append(
                f"Between {name} = {low:.6g} and {high:.6g} several eigenvalues pass the "
                "imaginary axis together, so the bifurcation there is not listed."
            )
        before = value, count
    return notes


def _sides(items: list[Item], i: int, stable: dict[int, bool]) -> tuple[bool | None, bool | None]:
    """Whether the equilibria before and after an item are stable; None at an end of the branch."""
    before, after = (
        next((stable[id(each)] for each in part if isinstance(each, Spot)), None)
        for part in (items[:i][::-1], items[i + 1 :])
    )
    return before, after


def _bifurcation(
    equations: Equations,
    kind: str,
    spot: Spot,
    barrier: Barrier | None,
    stable: tuple[bool | None, bool | None],
    position: int,
) -> EquilibriumBifurcation:
    """A bifurcation as a result."""
    assert isinstance(spot.system, Reduced)
    name, u = equations.names[0], spot.u
    coefficient, period, modes, guard = None, None, tuple[str, ...](), ""
    if kind == "fold":
        coefficient, side = fold_at(spot.system, u)
        message = f"two equilibria meet and vanish; they are on the side of {_side(side)} {name}"
    elif kind == "Hopf":
        hopf = hopf_at(equations, u, spot.units * spot.tangent)
        coefficient, period = hopf.first, 2.0 * np.pi / hopf.omega
        message = _hopf_told(equations, u, hopf, name)
    elif barrier is not None:
        others_there = neighbours(equations, u, spot.units)
        modes, guard = tuple(each.equations.mode for each in others_there if each.side), barrier.names[0]
        message = told(neighbour_of(equations, u, spot.units), others_there, barrier, name)
    else:
        message = "another branch of equilibria crosses"
    return EquilibriumBifurcation(
        kind=kind,
        parameter=name,
        value=float(u[-1]),
        equilibrium=described(equations, u),
        message=message,
        stable=stable,
        coefficient=coefficient,
        period=period,
        position=position,
        modes=modes,
        barrier=guard,
        place=spot,
    )


def _hopf_told(equations: Equations, u: np.ndarray, hopf: Hopf, name: str) -> str:
    """What begins at a Hopf point, in words."""
    period = f"period {2.0 * np.pi / hopf.omega:.6g}"
    if hopf.first == 0.0:
        return (
            f"degenerate: the first Lyapunov coefficient is zero, as it is in a linear mode; cycles of "
            f"{period} may be there at this {name} alone"
        )
    own = eigenvalues_of(equations.within(u))
    pair = [int(np.argmin(np.abs(own - sign * 1j * hopf.omega))) for sign in (1.0, -1.0)]
    attract = hopf.first < 0.0 and np.all(np.delete(own.real, pair) < 0.0)
    word = "supercritical" if hopf.first < 0.0 else "subcritical"
    kind = "stable" if attract else "unstable"
    return f"{word}: {kind} cycles of {period} begin, on the side of {_side(hopf.side)} {name}"


def _side(value: float) -> str:
    return "larger" if value > 0.0 else "smaller"


def _status(why: list[str]) -> Status:
    text = " and at ".join(ENDS[each] for each in dict.fromkeys(why))
    if not {"lost", "most"} & set(why):
        return attrs.evolve(SUCCESS, message=f"The branch ends at {text}.")
    return Status(
        StatusCode.NOT_CONVERGED,
        f"The branch ends at {text}.",
        "Raise max_steps, or continue from the last equilibrium.",
    )
