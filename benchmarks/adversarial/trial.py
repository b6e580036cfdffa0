"""One structure: a flow with guards and many parameter values, by every method, against the exact answer."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.adversarial.compare import Found, Outcome, compare
from benchmarks.adversarial.flows import FLOWS, Flow, draw
from benchmarks.adversarial.guards import FAMILIES, RandomGuard, random_guard
from benchmarks.adversarial.pool import Begin
from benchmarks.adversarial.truth import Composed, Roots, Scalar, all_roots
from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, simulate

SOLVERS: dict[str, Any] = {"Taylor": Taylor(), "DOP853": DOP853(), "RadauIIA": RadauIIA()}
SCIPY = "SciPy DOP853"
METHODS = (*SOLVERS, SCIPY)
# Slow methods run only every n-th sample.
ONE_IN = {"RadauIIA": 4, SCIPY: 16}
SCIPY_OPTIONS: dict[str, Any] = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-12}
# Numbers of guards in a model; the events of other guards cut the steps.
SIZES = (1, 1, 2, 4)
MOST_JUMPS = 2000
# Number of times at which a draw is checked for overflow.
LOOKS = 65


class Structure(NamedTuple):
    """A system that is compiled once, and the parameter values of its runs."""

    index: int
    flow: Flow
    guards: tuple[RandomGuard, ...]
    system: HybridSystem
    # Names and values (N,) of all parameters, including those of the motion.
    values: dict[str, np.ndarray]


def structure(seed: int, index: int, samples: int) -> Structure:
    rng = np.random.default_rng([seed, index])
    flow = FLOWS[index % len(FLOWS)]
    size = SIZES[rng.integers(len(SIZES))]
    families = list(FAMILIES)
    guards = tuple(
        random_guard(rng, flow, f"{'abcd'[i]}_", families[(index + i * 7) % len(families)])
        for i in range(size)
    )
    ranges = dict(flow.parameters)
    for guard in guards:
        ranges |= guard.parameters
    values = {name: draw(rng, how, 2 * samples) for name, how in ranges.items()}
    good = np.flatnonzero(bounded(flow, guards, values))[:samples]
    # If too few draws are bounded, some are used more than once.
    values = {name: np.resize(column[good], samples) for name, column in values.items()}
    return Structure(index, flow, guards, model(flow, guards, values), values)


def bounded(flow: Flow, guards: tuple[RandomGuard, ...], values: dict[str, np.ndarray]) -> np.ndarray:
    """Draws ``(N,)`` for which no guard overflows along the motion."""
    runs = np.arange(len(next(iter(values.values()))))
    motion = [Scalar(text) for text in flow.motion]
    fine = np.ones(len(runs), dtype=bool)
    for guard in guards:
        along = Composed(Scalar(guard.text), flow.state, motion, values)
        for t in np.linspace(0.0, flow.end, LOOKS):
            fine &= np.isfinite(along.value(runs, np.full(len(runs), t)))
    return fine


def function(text: str) -> Callable[..., Any]:
    return eval(compile(f"lambda t, x, p: {text}", "<model>", "eval"), {"np": np})


def model(flow: Flow, guards: tuple[RandomGuard, ...], values: dict[str, np.ndarray]) -> HybridSystem:
    counted = any(guard.counts for guard in guards)
    state = (*flow.state, "n") if counted else flow.state
    field = (*flow.field, "0.0") if counted else flow.field
    reset = Reset(function("(" + ", ".join(f"x.{name}" for name in flow.state) + ", x.n + 1)"))
    texts = " ".join([*field, *(guard.text for guard in guards)])
    used = [name for name in values if re.search(rf"\bp\.{name}\b", texts)]
    return HybridSystem(
        name=flow.name,
        state=state,
        parameters={name: float(values[name][0]) for name in used},
        modes=[Mode("run", function("(" + ", ".join(field) + ",)"))],
        transitions=[
            Transition(
                "run",
                "run",
                Guard(function(guard.text), guard.direction),
                reset if guard.counts else None,
                name=f"{i}: {guard.family}",
            )
            for i, guard in enumerate(guards)
        ],
    )


def composed_guards(made: Structure) -> list[Composed]:
    motion = [Scalar(text) for text in made.flow.motion]
    return [Composed(Scalar(guard.text), made.flow.state, motion, made.values) for guard in made.guards]


def starts(made: Structure, samples: int) -> np.ndarray:
    motion = [Scalar(text) for text in made.flow.motion]
    everywhere = np.arange(samples)
    composed = Composed(Scalar("0.0"), made.flow.state, motion, made.values)
    columns = composed.states(everywhere, np.zeros(samples))
    return np.column_stack([columns[name] for name in made.flow.state])


def our_runs(
    made: Structure, method: str, samples: int, begin: Callable[[int], None], left_out: set[int]
) -> list[Found]:
    """Events that the library finds, per guard; calls ``begin`` before each run."""
    x0, n = starts(made, samples), len(made.flow.state)
    filler = [0.0] * (made.system.dimension - n)
    names = list(made.system.parameters)
    found = [Found.empty(samples, n) for _ in made.guards]
    for k in sorted(set(range(0, samples, ONE_IN.get(method, 1))) - left_out):
        begin(k)
        parameters = {name: float(made.values[name][k]) for name in names}
        arc = simulate(
            made.system,
            [*x0[k], *filler],
            (0.0, made.flow.end),
            mode="run",
            parameters=parameters,
            solver=SOLVERS[method],
            max_jumps=MOST_JUMPS,
        )
        fired, times, states = arc.jumps.transition_index, arc.jumps.t, arc.jumps.x_minus[:, :n]
        for i, one in enumerate(found):
            which = fired == i
            one.add(k, times[which], states[which])
            one.end(k, float(arc.t[-1]), arc.x[-1, :n], arc.status.ok)
            one.see(k, times, states)
    return found


def scipy_runs(made: Structure, samples: int) -> list[Found]:
    """Events that SciPy finds, on a part of the runs."""
    x0, n = starts(made, samples), len(made.flow.state)
    found = [Found.empty(samples, n) for _ in made.guards]
    names = list(made.system.parameters)
    texts = [*made.flow.field, *(guard.text for guard in made.guards)]
    # Replace x.q and p.k by plain indexing, as a SciPy user would write it.
    for place, name in enumerate(made.flow.state):
        texts = [re.sub(rf"\bx\.{name}\b", f"x[{place}]", text) for text in texts]
    texts = [re.sub(r"\bp\.(\w+)", r"p['\1']", text) for text in texts]
    functions = [function(text) for text in texts]
    for k in range(0, samples, ONE_IN[SCIPY]):
        p = {name: float(made.values[name][k]) for name in names}

        def field(t: float, x: np.ndarray, p: dict[str, float] = p) -> list[float]:
            return [part(t, x, p) for part in functions[:n]]

        events = []
        for guard, of in zip(made.guards, functions[n:], strict=True):

            def event(t: float, x: np.ndarray, of: Any = of, p: dict[str, float] = p) -> float:
                return float(of(t, x, p))

            event.direction = guard.direction  # type: ignore[attr-defined]
            events.append(event)
        try:
            with np.errstate(all="ignore"):
                run = solve_ivp(field, (0.0, made.flow.end), x0[k], events=events, **SCIPY_OPTIONS)
        except RuntimeError:
            # SciPy's root finder failed, so the run has no result.
            for one in found:
                one.end(k, 0.0, x0[k], False)
            continue
        for i, one in enumerate(found):
            times, states = run.t_events[i], np.reshape(run.y_events[i], (-1, n))
            one.add(k, times, states)
            one.end(k, run.t[-1], run.y[:, -1], run.status == 0)
            one.see(k, times, states)
    return found


class Part(NamedTuple):
    """Outcomes of one method on the guards of one structure, and the time taken."""

    index: int
    method: str
    families: list[str]
    outcomes: list[Outcome]
    seconds: dict[str, float]
    # Runs whose changes of sign do not alternate, so that the exact answer must be wrong.
    doubts: int


def trial(
    seed: int,
    index: int,
    samples: int,
    methods: Iterable[str] = METHODS,
    begin: Begin = lambda method, run: None,
    left_out: Mapping[str, set[int]] = MappingProxyType({}),
) -> Iterator[Part]:
    """Yield one part per method; call ``begin`` before each library run, and skip those in ``left_out``."""
    clock = time.perf_counter
    made = structure(seed, index, samples)
    began = clock()
    guards = composed_guards(made)
    roots = [all_roots(guard, 0.0, made.flow.end, samples) for guard in guards]
    seconds = {"truth": clock() - began}
    for method in methods:
        if method in SOLVERS:
            began = clock()
            start = [*starts(made, 1)[0], 0.0][: made.system.dimension]
            simulate(made.system, start, (0.0, 0.0), mode="run", solver=SOLVERS[method])
            seconds["compile"] = clock() - began
        began = clock()
        if method == SCIPY:
            found = scipy_runs(made, samples)
        else:
            found = our_runs(made, method, samples, partial(begin, method), left_out.get(method, set()))
        seconds[method] = clock() - began
        outcomes = [
            compare(guard, its_roots, one, made.guards[i].direction, sharpness(made, i))
            for i, (guard, its_roots, one) in enumerate(zip(guards, roots, found, strict=True))
        ]
        families = [guard.family for guard in made.guards]
        yield Part(index, method, families, outcomes, seconds, sum(map(doubtful, roots)))
        seconds = {}


def sharpness(made: Structure, guard: int) -> np.ndarray:
    """The largest sharpness in a guard, ``(N,)``; nan for guards without a sharpness."""
    names = made.guards[guard].sharpness
    samples = len(next(iter(made.values.values())))
    if not names:
        return np.full(samples, np.nan)
    return np.max([made.values[name] for name in names], axis=0)


def doubtful(roots: Roots) -> int:
    """Number of runs without touches whose changes of sign do not alternate."""
    bad = roots.run[1:][(roots.run[1:] == roots.run[:-1]) & (roots.direction[1:] == roots.direction[:-1])]
    first = np.ones(len(roots.run), dtype=bool)
    first[1:] = roots.run[1:] != roots.run[:-1]
    also = roots.run[first][roots.direction[first] == roots.start[roots.run[first]]]
    return len(set(bad.tolist() + also.tolist()) - set(roots.touch_run.tolist()))


def described(seed: int, index: int, samples: int, guard: int, run: int) -> str:
    """A failing case as text, complete enough to reproduce it."""
    made = structure(seed, index, samples)
    values = {name: float(column[run]) for name, column in made.values.items()}
    start = starts(made, samples)[run].tolist()
    one = made.guards[guard]
    return (
        f"structure {index} guard {guard} of {len(made.guards)} run {run}: {made.flow.name}, x0 = {start}, "
        f"end {made.flow.end}, {one.text}, direction {one.direction:+d}, counts {one.counts}, {values}"
    )
