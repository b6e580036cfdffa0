"""What the author of a model knows, checked on runs: `hybrid.Laws`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import attrs
import numpy as np
from hypothesis.errors import UnsatisfiedAssumption

from hybrid.simulation.arc import HybridArc
from hybrid.simulation.jumps import Jump
from hybrid.simulation.simulate import simulate
from hybrid.system.growth import Finished, finished, stage_of
from hybrid.system.laws import Law, Laws
from hybrid.system.outputs import function_in
from hybrid.system.rows import fires, plain_firing
from hybrid.testing.alike import check_alike
from hybrid.testing.case import Case, as_case
from hybrid.testing.errors import PropertyError, discard
from hybrid.testing.run import lasting
from hybrid.testing.sizes import sizes_of_terms
from hybrid.testing.words import jump_told, matrix_told

# A value may differ by this share of the sizes of its terms.
TOLERANCE = 1e-8
# The sizes of terms are taken at some rows of a run.
ROWS_OF_SIZE = 20
# Laws are judged on the first rows of a run: more of them show nothing new.
MOST_ROWS = 1000
NOWHERE = "{!r} has no value in any mode of a run"
GAUSS_NODES, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(5)
KINDS = {
    "invariant": "is non-negative",
    "equal": "is zero",
    "conserved": "is conserved",
    "dissipated": "never grows by more than is put in",
    "balance": "changes at its rate",
}


def check_laws(case: Case) -> None:
    """Every law of a case holds on its run: those of its system, and those given to `cases`.

    Raises
    ------
    PropertyError
        If a law does not hold.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_laws
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_laws(case)
    """
    case = _grown(as_case(case))
    for check in law_checks(case.laws).values():
        check(case)


def _grown(case: Case) -> Case:
    """The case with a system that has all modes that its run makes."""
    if case.system.growth is None or isinstance(case.system.growth, Finished):
        return case
    simulate(case.system, case.x0, (case.t0, case.t1), mode=case.mode, parameters=case.parameters)
    return attrs.evolve(case, system=finished(stage_of(case.system)))


def law_checks(laws: Laws) -> dict[str, Callable[[Case], None]]:
    """A property for each law, by its words; those of states first, which are the nearest to the run."""
    checks: dict[str, Callable[[Case], None]] = {}

    def add(told: str, check: Callable[[Case], None]) -> None:
        checks[told] = lambda case: declared_too(case, check)

    for kind, some in laws.in_modes.items():
        check = _check_value if kind in ("invariant", "equal") else _check_change
        for law in some:
            add(_told(law, kind), partial(check, law=law, kind=kind))
    for law in laws.across:
        add(_across_told(law), partial(_check_across, law=law))
    for name in laws.continuous:
        told = f"State and field are continuous at {name!r}"
        add(told, partial(_check_continuous, name=name, told=told))
    for name in laws.alike:
        told = f"Members of {name!r} are alike"
        add(told, partial(check_alike, name=name, told=told))
    return checks


def declared_too(case: Case, check: Callable[[Case], None]) -> None:
    """Check a case; where that fails, say so if it holds with the parameters as declared."""
    error = _failure(case, check)
    if error is None:
        return
    declared = case.system.parameters
    changed = [name for name, value in case.parameters.items() if value != declared[name]]
    other = attrs.evolve(case, parameters=dict(declared))
    if not (changed and _holds(other, check)):
        raise error
    if not np.array_equal(other.whole.jumps.transition, case.whole.jumps.transition):
        raise error
    # With the traceback of the failure: Hypothesis takes failures of two places for two mistakes.
    raise PropertyError(
        f"{error}\n  It holds with the parameters as declared: a number stands where a parameter belongs "
        f"({', '.join(changed)}), or parameters= needs narrower ranges.",
        error.time,
    ).with_traceback(error.__traceback__)


def _failure(case: Case, check: Callable[[Case], None]) -> PropertyError | None:
    """How a case fails; None if it holds."""
    try:
        check(case)
    except PropertyError as error:
        return error
    return None


def _holds(case: Case, check: Callable[[Case], None]) -> bool:
    """Whether a case can be judged, and holds."""
    try:
        return _failure(case, check) is None
    except UnsatisfiedAssumption:
        return False


def _told(law: Law, kind: str) -> str:
    """The property in words."""
    return f"{law.name!r} {KINDS[kind]}" + (f" in mode {law.of!r}" if law.of else "")


def _across_told(law: Law) -> str:
    return (
        f"The rule {law.name!r} holds at {law.of!r}"
        if law.name != law.of
        else f"The rule of {law.of!r} holds"
    )


def _check_value(case: Case, law: Law, kind: str) -> None:
    """Fail if a quantity is negative, or not zero, anywhere on the whole run."""
    arc = case.whole
    tolerance = TOLERANCE * _size_on(case, law, arc)
    for i in _rows(case, law, arc):
        value = _value(case, law, arc, i)
        if (value < -tolerance) if kind == "invariant" else (abs(value) > tolerance):
            mode, last = str(arc.mode[i]), str(arc.jumps.transition[arc.j[i] - 1]) if arc.j[i] else ""
            causes = [_of_mode(case, mode, kind)]
            if last and case.system.transitions[case.system.transition_index(last)].reset is not None:
                landed = arc.t[i] == arc.jumps.t[arc.j[i] - 1]
                reset = f"the reset of {last!r}: a wrong sign, or a component that it does not write"
                causes.insert(0 if landed else 1, reset)
            case.fail(
                _told(law, kind),
                f"got {value:.8g} at t = {arc.t[i]:.8g}, {case.state_told(arc.x[i])}, in mode {mode!r}",
                _before(case, arc, i),
                hint=f"{'; or '.join(causes)}.",
                time=arc.t[i],
            )


def _of_mode(case: Case, mode: str, kind: str) -> str:
    """The likely reason for a value that goes wrong inside of a mode."""
    if kind == "equal":
        return f"the field of mode {mode!r}: it leaves the surface on which the quantity is zero"
    names = [repr(each.name) for each in case.system.transitions if each.source == mode]
    guards = f"guards of {', '.join(names)}" if names else "none"
    return (
        f"the transitions that leave mode {mode!r} ({guards}): a wrong sign, direction or threshold, or a "
        "transition that is missing"
    )


def _check_change(case: Case, law: Law, kind: str) -> None:
    """Fail if a quantity changes by more than its law allows, along the flow or at a jump."""
    arc, start, last = case.whole, 0.0, -1
    tolerance = TOLERANCE * _size_on(case, law, arc)
    for i in _rows(case, law, arc):
        value = _value(case, law, arc, i)
        jumps = last >= 0 and arc.j[i] != arc.j[last]
        # Jumps at once have no rows between them that count.
        follows = last >= 0 and (last == i - 1 or (jumps and arc.t[last] == arc.t[i]))
        last = i
        if not follows or (jumps and kind == "balance"):
            start = value
            continue
        if not jumps and law.flow is not None:
            start += _integral(case, law, arc, i)
        if (value - start if kind == "dissipated" else abs(value - start)) > tolerance:
            where = (
                f"the reset of {str(arc.jumps.transition[arc.j[i] - 1])!r}"
                if jumps
                else f"the field of mode {str(arc.mode[i])!r}"
            )
            case.fail(
                _told(law, kind),
                f"got {value:.8g} for {start:.8g} {'after a jump' if jumps else 'on the way'}, at "
                f"t = {arc.t[i]:.8g}, {case.state_told(arc.x[i])}, in mode {str(arc.mode[i])!r}",
                _before(case, arc, i),
                hint=f"{where}: a wrong sign or factor, a term that is missing, or a component that is not "
                "written.",
                time=arc.t[i],
            )
        if kind == "dissipated":
            start = value


def _rows(case: Case, law: Law, arc: HybridArc) -> Iterator[int]:
    """The rows of a run in the modes of a law; the example is discarded if there are none."""
    visited = map(str, np.unique(arc.mode))
    modes = {name: law.in_mode(*case.names_of_mode(name)) is not None for name in visited}
    if not any(modes.values()):
        discard(NOWHERE.format(law.name) if law.of is None else f"no run was in mode {law.of!r}")
    lasts = lasting(arc)
    yield from (i for i in range(min(len(arc.t), MOST_ROWS)) if lasts[i] and modes[str(arc.mode[i])])


def _integral(case: Case, law: Law, arc: HybridArc, i: int) -> float:
    """Integral of the flow of a law over the step that ends at row ``i``."""
    flow = law.flow_in(*case.names_of_mode(str(arc.mode[i])))
    if flow is None:
        discard(f"the rate of {law.name!r} has no value in mode {str(arc.mode[i])!r}")
    h = arc.t[i] - arc.t[i - 1]
    if not h > 0.0:
        return 0.0
    times = arc.t[i - 1] + 0.5 * h * (1.0 + GAUSS_NODES)
    rates = [case.evaluate(flow, t, x)[0] for t, x in zip(times, arc(times), strict=True)]
    return float(0.5 * h * GAUSS_WEIGHTS @ rates)


def _check_across(case: Case, law: Law) -> None:
    """Fail if the rule of a transition does not hold at one of its jumps."""
    variables, p = case.system.variables, case.system.variables.parameter_view(case.values)

    def rule(t: float, minus: Any, plus: Any, row: int) -> Any:
        with np.errstate(all="ignore"), fires(plain_firing(row)):
            return np.asarray(law.quantity(t, variables.state_view(minus), variables.state_view(plus), p))

    scale = np.tile(np.abs(case.whole.x).max(axis=0), 2)
    for jump in _jumps_of(case, law.of):
        there = partial(rule, jump.t, row=jump.row or 0)
        found = there(jump.x_minus, jump.x_plus)
        if found.dtype == bool:
            holds, got = bool(found.all()), "it does not hold"
        else:
            n = len(jump.x_minus)
            both = np.concatenate([jump.x_minus, jump.x_plus])
            size = sizes_of_terms(partial(_of_halves, there, n), both, found, scale)
            holds = bool(np.all(np.abs(found) <= TOLERANCE * size))
            got = f"got {matrix_told(found)}, not zero"
        if not holds:
            case.fail(
                _across_told(law),
                got,
                jump_told(case, jump),
                hint=f"the reset of {jump.transition!r}: a wrong sign or factor, or a component that it does "
                "not write; or it fires where it should not.",
                time=jump.t,
            )


def _of_halves(rule: Callable[..., Any], n: int, both: np.ndarray) -> Any:
    """A rule of the states ``(n,)`` before and after a jump, which come in one row."""
    return rule(both[:n], both[n:])


def _check_continuous(case: Case, name: str, told: str) -> None:
    """Fail if the state or the field jumps at a transition."""
    arc = case.whole
    for jump in _jumps_of(case, name):
        assert jump.target is not None
        (fields, sizes) = sized(case, case.rates_of(jump.source), jump.t, jump.x_minus, arc)
        (others, more) = sized(case, case.rates_of(jump.target), jump.t, jump.x_plus, arc)
        pairs = {
            "the state": (jump.x_minus, jump.x_plus, np.abs(arc.x).max(axis=0)),
            "the field": (fields, others, sizes + more),
        }
        for what, (minus, plus, size) in pairs.items():
            wrong = np.abs(plus - minus) > TOLERANCE * size
            if wrong.any():
                i = int(np.argmax(wrong))
                rate = (
                    f"the rate of {case.system.state_names[i]}"
                    if what == "the field"
                    else case.system.state_names[i]
                )
                case.fail(
                    told,
                    f"{rate} is {minus[i]:.8g} before it, in mode {jump.source!r}, and {plus[i]:.8g} after "
                    f"it, in mode {jump.target!r}",
                    jump_told(case, jump),
                    hint=f"a threshold or an offset that differs between the guard of {jump.transition!r} "
                    "and the fields that it joins."
                    if what == "the field"
                    else f"the reset of {jump.transition!r}.",
                    time=jump.t,
                )


def _jumps_of(case: Case, name: str | None) -> Iterator[Jump]:
    """The jumps of a transition on the whole run, without the limits of chatters."""
    jumps = [jump for jump in case.whole.jumps if jump.kind != "limit"]
    found = [jump for jump in jumps if name in case.names_of_transition(jump.transition)]
    if not found:
        discard(f"no run took {name!r}")
    yield from found


def _before(case: Case, arc: HybridArc, i: int) -> str:
    """What happened last before row ``i``."""
    j = int(arc.j[i])
    return f"the last jump: {jump_told(case, arc.jumps[j - 1])}" if j > 0 else "before any jump"


def _size_on(case: Case, law: Law, arc: HybridArc) -> float:
    """Size of the terms of a law on a run, in any mode."""
    functions = {
        name: function_in(law.quantity, *case.names_of_mode(name)) for name in map(str, np.unique(arc.mode))
    }
    known = np.flatnonzero([functions[str(name)] is not None for name in arc.mode])
    if not len(known):
        discard(NOWHERE.format(law.name))
    rows = known[np.unique(np.linspace(0, len(known) - 1, ROWS_OF_SIZE).astype(int))]
    return float(max(sized(case, functions[str(arc.mode[i])], arc.t[i], arc.x[i], arc)[1][0] for i in rows))


def _value(case: Case, law: Law, arc: HybridArc, i: int) -> float:
    """The quantity of a law at row ``i`` of a run, where the law says something."""
    function = law.in_mode(*case.names_of_mode(str(arc.mode[i])))
    return float(case.evaluate(function, arc.t[i], arc.x[i])[0])


def sized(case: Case, function: Any, t: float, x: Any, arc: HybridArc) -> tuple[np.ndarray, np.ndarray]:
    """Values ``(rows,)`` of a function of ``(t, x, p)``, and the sizes of their terms on a run."""
    values = case.evaluate(function, t, x)
    scale = np.abs(arc.x).max(axis=0)
    return values, sizes_of_terms(
        lambda y: case.evaluate(function, t, y), np.asarray(x, dtype=float), values, scale
    )
