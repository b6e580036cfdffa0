"""Follow a bifurcation over two parameters."""

from __future__ import annotations

from collections.abc import Mapping

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.progress import Progress, progress_bar
from hybrid.errors import ArgumentError
from hybrid.measures.asked import Unmeasured
from hybrid.orbits.continuation.bifurcation_curve import BifurcationCurve, CodimensionTwo
from hybrid.orbits.continuation.branch import Bifurcation
from hybrid.orbits.continuation.clearances import curve_clearance_of
from hybrid.orbits.continuation.curve import BESIDE, SMOOTH, Curve, Special, Spot, along_curve
from hybrid.orbits.continuation.monitors import JUMPED
from hybrid.orbits.continuation.place import Place, place_of, place_on
from hybrid.orbits.continuation.result import Points, orbit_of, whole_orbit_of
from hybrid.orbits.continuation.route import Loop
from hybrid.orbits.continuation.watch import OfArc, Watch, checked_outputs, units_of
from hybrid.orbits.equilibria.bifurcation_curve import EquilibriumCurve
from hybrid.orbits.equilibria.branch import EquilibriumBifurcation
from hybrid.orbits.equilibria.curves import curve_of
from hybrid.orbits.kinds import KINDS, OF_ORBITS
from hybrid.orbits.orbit import unaged
from hybrid.simulation.interrupt import interrupted_status
from hybrid.simulation.plan import check_solver
from hybrid.solvers import Solver, Taylor
from hybrid.status import SUCCESS, Status, StatusCode

ENDS = {
    "range": "the end of a range",
    "closed": "its start: it is closed",
    "change": "a place where the orbit has other transitions",
    "infinity": "an orbit that grows without bound",
    "strong resonance": "a strong resonance, where the pair of multipliers becomes real",
    "most": "the limit of steps",
    "lost": "a place beyond which Newton's method finds no point",
    "unmeasured": "an orbit that a function fails on",
}


def continue_bifurcation(
    bifurcation: Bifurcation | EquilibriumBifurcation,
    over: Mapping[str, tuple[float, float]],
    *,
    outputs: Mapping[str, OfArc] | None = None,
    solver: Solver | None = None,
    max_steps: int = 500,
    progress: bool | None = None,
) -> BifurcationCurve | EquilibriumCurve:
    """The curve of a bifurcation over two parameters, both ways from where it was found.

    The orbits of two parameters form a surface. The curve is where the test function of the bifurcation is
    zero on it: of a fold, a flip or a torus the same as in :func:`hybrid.continue_orbit`, and where the
    transitions change the height, speed, time or comparison of a condition that vanishes there. Of a zero
    of ``events=`` it is that function. Of equilibria a fold, a Hopf point and a boundary are followed by
    regular equations of their own.

    Parameters
    ----------
    bifurcation
        Of a `Branch` or an `EquilibriumBranch`: any kind but a branch point, which two parameters do not
        keep. A Hopf point is followed as one of an `EquilibriumBranch`, not of the cycles that end there. A
        zero of a function in ``events=`` is followed where the function passes zero smoothly, not where it
        jumps to the other sign.
    over
        Names of two parameters with their ranges: ``{"omega": (6.5, 8.5), "P": (300.0, 700.0)}``.
    outputs
        Functions of an arc, by name, as of :func:`hybrid.continue_orbit`; not for equilibria.
    solver
        Method and tolerances, by default ``Taylor(rtol=1e-12, atol=1e-14)``.
    max_steps
        Largest number of steps in either direction.
    progress
        Whether to show a progress bar; by default in a terminal or a notebook, after two seconds.

    Returns
    -------
    BifurcationCurve or EquilibriumCurve
        With a status; if it is interrupted or lost it keeps what there is.

    Raises
    ------
    ArgumentError
        If the bifurcation has no curve, a parameter does not exist, a range does not contain its value, or a
        function in ``outputs`` or ``events`` gives no finite number for the orbit.

    References
    ----------
    Y. A. Kuznetsov, Elements of Applied Bifurcation Theory, 4th ed., Springer 2023, sections 10.3 and 9.1.

    Examples
    --------
    >>> import models
    >>> from hybrid import continue_bifurcation, continue_orbit, periodic_orbit
    >>> orbit = periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    >>> fold = continue_orbit(orbit, "w", (0.9, 1.8)).bifurcations[0]
    >>> fold.kind
    'fold'
    >>> curve = continue_bifurcation(fold, {"w": (1.7, 1.8), "r": (0.75, 0.85)})
    >>> curve.status.ok
    True
    """
    if not isinstance(bifurcation, EquilibriumBifurcation):
        arguments.instance("bifurcation", bifurcation, Bifurcation, "Take one of branch.bifurcations.")
    there = bifurcation.equilibrium if isinstance(bifurcation, EquilibriumBifurcation) else bifurcation.orbit
    names, lows, highs = _ranges(there.parameters, over)
    most = arguments.count("max_steps", max_steps, 1)
    progress = None if progress is None else arguments.flag("progress", progress)
    if isinstance(bifurcation, EquilibriumBifurcation):
        if outputs is not None:
            raise arguments.refusal("outputs", "be left out: an equilibrium has no arc", outputs)
        return curve_of(bifurcation, names, lows, highs, most, progress)
    method = Taylor(rtol=1e-12, atol=1e-14) if solver is None else check_solver(solver)
    measured = checked_outputs(outputs, bifurcation.orbit.system)
    function = bifurcation._zero_of.function
    located = {} if function is None else {bifurcation.kind: function}
    watch = Watch(method, Points(bifurcation.orbit.t0), measured, located)
    place = _start(bifurcation, names, highs - lows, method)
    curve = _curve_of(bifurcation, place, watch)
    begin = curve.begin(place)
    if begin is None:
        raise ArgumentError(f"the {bifurcation.kind} is not found again over {names[0]} and {names[1]}.")
    with CTRL_C, progress_bar(None, "Curve", progress, "point") as bar:
        found = _Found([begin], {begin: watch.outputs_of(begin.place.orbit)})
        _both_ways(curve, (lows, highs), most, watch, found, bar)
        interrupted = CTRL_C.is_set()
    status = interrupted_status("the points so far") if interrupted else _status(found)
    return _result(found, bifurcation, names, status, watch)


@attrs.define(eq=False)
class _Found:
    """What has been found of a curve: its items in order, outputs of its spots, why it ends, what failed."""

    items: list[Spot | Special]
    outputs: dict[Spot, dict[str, float]]
    why: list[str] = attrs.field(factory=list)
    failures: list[str] = attrs.field(factory=list)


def _ranges(parameters: Mapping[str, float], over: object) -> tuple[tuple[str, str], np.ndarray, np.ndarray]:
    """Names of the parameters, and the ends of their ranges."""
    wanted = "map the names of two parameters to their ranges, as in {'omega': (6.5, 8.5), 'P': (300, 700)}"
    if not isinstance(over, Mapping) or len(over) != 2:
        raise arguments.refusal("over", wanted, over)
    lows, highs = np.empty(2), np.empty(2)
    for j, (name, span) in enumerate(over.items()):
        arguments.known("over: Parameter", name, parameters, "Parameters")
        ends = arguments.numbers(f"over[{name!r}]", span, "be (low, high)")
        value = np.array([parameters[name]])
        if ends.shape != (2,) or not ends[0] < ends[1] or arguments.within(value, *ends) is None:
            raise arguments.refusal(f"over[{name!r}]", f"be (low, high) around {parameters[name]}", span)
        lows[j], highs[j] = min(ends[0], *value), max(ends[1], *value)
    first, second = over
    return (first, second), lows, highs


def _start(bifurcation: Bifurcation, names: tuple[str, str], sizes: np.ndarray, solver: Solver) -> Place:
    """The orbit at the bifurcation on the surface over both parameters."""
    known_kind = KINDS.get(bifurcation.kind)
    if known_kind is not None and known_kind.lost:
        raise ArgumentError(f"bifurcation is {known_kind.lost}; allowed are the other kinds.")
    if bifurcation.kind == "Hopf":
        raise ArgumentError(
            "bifurcation is the Hopf point at which a branch of cycles ends, where no orbit is left; follow "
            "that of the equilibrium, from continue_equilibrium."
        )
    if bifurcation.kind not in OF_ORBITS and bifurcation._zero_of.function is None:
        raise ArgumentError(
            f"bifurcation is a zero of events[{bifurcation.kind!r}] of a branch that was opened again or "
            "pickled, which keeps no functions: take it from one that continue_orbit makes."
        )
    known = bifurcation._place
    if known is None:
        if bifurcation.kind not in SMOOTH:
            raise ArgumentError(
                f"bifurcation is a {bifurcation.kind} of a branch that was opened again: take it from one "
                "that continue_orbit makes."
            )
        return place_on(bifurcation.orbit, names, sizes, solver)
    orbit = known.orbit
    values = np.array([bifurcation.orbit.parameters[name] for name in names])
    family = attrs.evolve(
        orbit.family, names=names, parameters=dict(bifurcation.orbit.parameters), solver=solver
    )
    made = family.around(Loop(orbit.loop.x, orbit.loop.times, values))
    place = None if made is None else place_of(made, np.eye(len(made.loop.flat))[-2:], sizes)
    if place is None:
        raise ArgumentError("the orbit at the bifurcation is not found again: tighten solver=.")
    return place


def _curve_of(bifurcation: Bifurcation, place: Place, watch: Watch) -> Curve:
    if bifurcation.kind in SMOOTH:
        return Curve(bifurcation.kind, SMOOTH[bifurcation.kind])
    if bifurcation.kind in watch.events:
        return _curve_of_zero(bifurcation.kind, place, watch)
    assert bifurcation._change is not None
    exact = bifurcation._change.exact
    clearance = curve_clearance_of(exact.key)
    side = float(np.sign(clearance(exact.before.orbit)))
    bounded = exact.key.kind != "speed"
    return Curve(bifurcation.kind, lambda each: clearance(each.orbit), side, bounded)


def _curve_of_zero(name: str, place: Place, watch: Watch) -> Curve:
    """The curve of a zero of ``events=``, where the function passes zero in a continuous way."""

    def height(each: Place) -> float:
        return watch.value(name, each.orbit)

    made = [place.step(BESIDE * direction) for direction in (*np.eye(2), *-np.eye(2))]
    beside = [abs(height(each[0])) for each in made if each is not None]
    if abs(height(place)) > JUMPED * max(beside, default=0.0):
        raise ArgumentError(
            f"bifurcation is a place where events[{name!r}] jumps to the other sign, or where the "
            "transitions change, which has no curve over two parameters; allowed are zeros that the function "
            "passes continuously."
        )
    return Curve(name, height)


def _both_ways(
    curve: Curve,
    ranges: tuple[np.ndarray, np.ndarray],
    most: int,
    watch: Watch,
    found: _Found,
    bar: Progress,
) -> None:
    [begin] = found.outputs
    for sign in (-1.0, 1.0):
        found.items = found.items[::-1]
        start = attrs.evolve(begin, way=sign * begin.way)
        with CTRL_C.ending():
            try:
                for item in along_curve(curve, start, *ranges, most):
                    if isinstance(item, str):
                        found.why.append(item)
                        break
                    if isinstance(item, Spot):
                        found.outputs[item] = watch.outputs_of(item.place.orbit)
                    found.items.append(item)
                    bar.update(isinstance(item, Spot))
                    if CTRL_C.is_set():
                        break
            except Unmeasured as error:
                found.why.append("unmeasured")
                found.failures.append(str(error))
        if CTRL_C.is_set() or found.why[-1] == "closed":
            break


def _result(
    found: _Found, bifurcation: Bifurcation, names: tuple[str, str], status: Status, watch: Watch
) -> BifurcationCurve:
    points = watch.points
    spots = [item for item in found.items if isinstance(item, Spot)]
    orbits = tuple(unaged([whole_orbit_of(each.place.orbit, points) for each in spots]))
    special = tuple(
        CodimensionTwo(
            item.kind,
            dict(zip(names, item.spot.place.values.tolist(), strict=True)),
            orbit_of(item.spot.place.orbit, points),
            item.message,
        )
        for item in found.items
        if isinstance(item, Special)
    )
    return BifurcationCurve(
        system=orbits[0].system,
        kind=bifurcation.kind,
        names=names,
        values=np.array([each.place.values for each in spots]),
        x0=np.array([orbit.x0 for orbit in orbits]),
        mode=np.array([orbit.mode for orbit in orbits]),
        period=np.array([orbit.period for orbit in orbits]),
        multipliers=np.array([orbit.multipliers for orbit in orbits]),
        points=special,
        status=status,
        outputs={name: np.array([found.outputs[spot][name] for spot in spots]) for name in watch.outputs},
        output_units=units_of(watch.outputs, orbits[0].system),
        orbits=orbits,
    )


def _status(found: _Found) -> Status:
    told = " and at ".join(ENDS[each] for each in dict.fromkeys(found.why))
    message = " ".join([f"The curve ends at {told}.", *found.failures])
    if found.failures:
        return Status(StatusCode.FAILED, message, "Correct the function, or end the ranges there.")
    if not {"lost", "most"} & set(found.why):
        return attrs.evolve(SUCCESS, message=message)
    return Status(StatusCode.NOT_CONVERGED, message, "Tighten the tolerances of solver=, or raise max_steps.")
