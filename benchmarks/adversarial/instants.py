"""Random systems with many transitions at one instant, compared with exact rules.

A structure fixes fields, guards, directions, targets and the form of resets; thresholds, reset values and
starts are drawn. All numbers are dyadic, so that every state and time is exact.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from types import MappingProxyType, SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from benchmarks.adversarial.rules import Affine, Edge, Open, Rules, Run, simulate_exactly
from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, Taylor, Transition, simulate

STATES = ("y", "z", "w", "v", "n", "m")
END = 6.3
# Share of draws without simultaneous events that is kept.
APART_SHARE = 0.1
# Number of jumps at one instant that counts as endless; the library allows more.
MOST_AT_ONCE = 300
# Tolerance for times and states.
CLOSE = 1e-9
# Most draws per case; many draws are discarded.
MOST_DRAWS = 20
SOLVERS: dict[str, Any] = {"Taylor": Taylor(), "DOP853": DOP853()}
# Forms of guards, before a threshold is subtracted.
FORMS = (
    "x.y",
    "x.z",
    "x.w",
    "x.n",
    "x.m",
    "x.y - x.z",
    "x.y + x.z",
    "x.y - x.w",
    "t",
    "x.y - t",
    "x.w - x.z",
)
SPEEDS = (1.0, 1.0, 1.0, 1.0, -1.0, 2.0, -2.0, 0.5, 0.0)
VALUES = np.arange(-4, 5) / 2
LEVELS = np.arange(-2, 5) / 2
# Thresholds of conditions, which no state equals exactly.
BETWEEN = np.arange(-3, 4) + 0.328125


class Form(NamedTuple):
    """A transition as text, the input of both the library and the exact rules."""

    source: int
    target: int | None
    guard: str
    direction: int
    reset: tuple[str, ...] | None
    when: str | None


class Instant(NamedTuple):
    """A structure as text and as a library system, with the values its parameters are drawn from."""

    fields: tuple[tuple[str, ...], ...]
    edges: tuple[Form, ...]
    parameters: dict[str, np.ndarray]
    system: HybridSystem


def instant(seed: int, index: int) -> Instant:
    rng = np.random.default_rng([seed, index, 1])
    modes = int(rng.choice((1, 1, 2, 2, 3)))
    parameters: dict[str, np.ndarray] = {}

    def named(prefix: str, values: np.ndarray) -> str:
        name = f"{prefix}{len(parameters)}"
        parameters[name] = values
        return f"p.{name}"

    fields = tuple(
        (f"{rng.choice(SPEEDS)}", f"{rng.choice(SPEEDS)}", "x.v", "0.0", "0.0", "0.0") for _ in range(modes)
    )
    surfaces = [
        f"{form} - {named('c', LEVELS)}" for form in rng.choice(FORMS, int(rng.integers(2, 5)), replace=False)
    ]
    # A surface is used with direction 0 by all its transitions, or with a sign by all of them.
    both = {surface for surface in surfaces if rng.random() < 0.15}
    edges = []
    for source in range(modes):
        for _ in range(int(rng.integers(1, 4))):
            edges.append(_edge(rng, named, surfaces, both, source, modes))
    for mode in range(1, modes):
        # Make sure that every mode can be reached.
        if not any(edge.source == mode - 1 and edge.target == mode for edge in edges):
            edge = _edge(rng, named, surfaces, both, mode - 1, modes)
            edges.append(edge._replace(target=mode))
    edges = [edge if edge.target is not None else edge._replace(reset=None) for edge in edges]
    order = rng.permutation(len(edges))
    edges = [edges[i] for i in order]
    return Instant(fields, tuple(edges), parameters, _system(fields, edges, parameters))


def _edge(
    rng: np.random.Generator,
    named: Callable[[str, np.ndarray], str],
    surfaces: list[str],
    both: set[str],
    source: int,
    modes: int,
) -> Form:
    surface = str(rng.choice(surfaces))
    # +1 is likelier, because most forms grow with time.
    direction = 0 if surface in both else int(rng.choice((-1, 1, 1)))
    if direction and rng.random() < 0.1:
        surface, direction = f"{rng.choice((-1.0, 2.0, -0.5))}*({surface})", direction
    draw = rng.random()
    target: int | None = source
    if draw < 0.04:
        target = None
    elif draw < 0.45 and modes > 1:
        target = int(rng.choice([mode for mode in range(modes) if mode != source]))
    reset = None if rng.random() < 0.2 else tuple(_part(rng, named, name) for name in STATES)
    when = None
    if rng.random() < 0.25:
        name, way = rng.choice(("y", "z", "n", "m", "v")), rng.choice(("", "-"))
        when = f"{way}(x.{name} - {named('h', BETWEEN)})"
    return Form(source, target, surface, direction, reset, when)


def _part(rng: np.random.Generator, named: Callable[[str, np.ndarray], str], name: str) -> str:
    """The expression for one state in a reset."""
    draw = rng.random()
    if draw < 0.6:
        return f"x.{name}"
    if name == "v":
        return str(rng.choice(("-x.v", "0.0*x.v", "1.0 + 0.0*x.v", "-1.0 + 0.0*x.v")))
    if draw < 0.75:
        return f"{named('r', VALUES)}"
    if draw < 0.9:
        return f"x.{name} + {named('s', VALUES)}"
    other = {"y": "z", "z": "y", "n": "m", "m": "n", "w": "y"}[name]
    return f"x.{other}" if draw < 0.97 else f"-x.{name}"


def _function(text: str) -> Callable[..., Any]:
    return eval(compile(f"lambda t, x, p: {text}", "<instant>", "eval"), {"np": np})


def _system(
    fields: tuple[tuple[str, ...], ...], edges: list[Form], parameters: dict[str, np.ndarray]
) -> HybridSystem:
    def tuple_of(texts: tuple[str, ...]) -> Callable[..., Any]:
        return _function("(" + ", ".join(texts) + ")")

    return HybridSystem(
        name="instant",
        state=STATES,
        parameters=dict.fromkeys(parameters, 0.0),
        modes=[Mode(f"m{i}", tuple_of(texts)) for i, texts in enumerate(fields)],
        transitions=[
            Transition(
                f"m{edge.source}",
                None if edge.target is None else f"m{edge.target}",
                Guard(
                    _function(edge.guard),
                    edge.direction,
                    when=None if edge.when is None else _function(f"{edge.when} > 0"),
                ),
                None if edge.reset is None else Reset(tuple_of(edge.reset)),
                name=str(i),
            )
            for i, edge in enumerate(edges)
        ],
    )


def affine(text: str, values: dict[str, Fraction]) -> Affine:
    """The exact affine function of a text, from its values at zero and at the unit vectors."""
    code, p = _function(text), SimpleNamespace(**values)

    def at(t: int, place: int | None) -> Fraction:
        x = {name: Fraction(int(i == place)) for i, name in enumerate(STATES)}
        value = code(Fraction(t), SimpleNamespace(**x), p)
        return value if isinstance(value, Fraction) else Fraction(value)

    constant = at(0, None)
    coefficients = tuple(at(0, i) - constant for i in range(len(STATES)))
    return Affine(coefficients, at(1, None) - constant, constant)


def exact_rules(made: Instant, values: dict[str, Fraction]) -> Rules:
    return Rules(
        tuple(tuple(affine(text, values) for text in texts) for texts in made.fields),
        tuple(
            Edge(
                edge.source,
                edge.target,
                affine(edge.guard, values),
                edge.direction,
                None if edge.reset is None else tuple(affine(text, values) for text in edge.reset),
                None if edge.when is None else affine(edge.when, values),
            )
            for edge in made.edges
        ),
    )


class Case(NamedTuple):
    """One draw: parameters, start, mode and the exact run."""

    parameters: dict[str, float]
    x0: list[float]
    mode: int
    truth: Run


def case(made: Instant, seed: int, index: int, number: int) -> Case | None:
    """A draw that the rules decide, or None; only few draws without simultaneous events are kept."""
    rng = np.random.default_rng([seed, index, 2, number])
    parameters = {name: float(rng.choice(values)) for name, values in made.parameters.items()}
    x0 = [float(value) for value in rng.choice(VALUES, len(STATES))]
    x0[STATES.index("v")] = float(rng.choice((-1.0, 0.0, 1.0)))
    mode = int(rng.integers(len(made.fields)))
    rules = exact_rules(made, {name: Fraction(value) for name, value in parameters.items()})
    limit = MOST_AT_ONCE
    try:
        truth = simulate_exactly(rules, tuple(map(Fraction, x0)), mode, Fraction(END), limit)
    except Open:
        return None
    times = [t for t, _ in truth.fired]
    together = len(set(times)) < len(times)
    if not together and rng.random() > APART_SHARE:
        return None
    return Case(parameters, x0, mode, truth)


# With AMBIGUOUS_ORDER the library reports that the order matters and continues in the listed order.
ENDINGS = {
    "SUCCESS": "end",
    "START_BEYOND": "end",
    "AMBIGUOUS_ORDER": "end",
    "STUCK": "stuck",
    "TERMINAL": "terminal",
}


def difference(made: Instant, drawn: Case, solver: Any) -> tuple[str, str]:
    """Kind and description of the difference between the library's run and the exact run, or empty texts."""
    arc = simulate(
        made.system, drawn.x0, (0.0, END), mode=f"m{drawn.mode}", parameters=drawn.parameters, solver=solver
    )
    truth = drawn.truth
    ending = ENDINGS.get(arc.status.code.name, arc.status.code.name)
    fired = arc.jumps.transition_index.tolist()
    expected = [i for _, i in truth.fired]
    times = [float(t) for t, _ in truth.fired]
    if truth.ending == ending == "stuck":
        # An endless sequence may be cut at any jump.
        shortest = min(len(fired), len(expected))
        if shortest >= 100 and fired[:shortest] == expected[:shortest]:
            return "", ""
    said = (
        f"{ending} {list(zip(arc.jumps.t.round(9).tolist(), fired, strict=True))[:12]}, truth {truth.ending} "
        f"{list(zip(times, expected, strict=True))[:12]}"
    )
    if ending != truth.ending:
        return f"ended {ending}, not {truth.ending}", said
    if fired != expected:
        for one, other in zip(fired, expected, strict=False):
            if one != other:
                return "another transition", said
        return ("missed" if len(fired) < len(expected) else "invented"), said
    if np.abs(arc.jumps.t - times).max(initial=0.0) > CLOSE:
        return "another time", said
    if np.abs(arc.x[-1] - np.array(truth.x, dtype=float)).max() > CLOSE:
        return "another state", f"{arc.x[-1]} for {[float(a) for a in truth.x]}; {said}"
    if arc.mode[-1] != f"m{truth.mode}":
        return "another mode", said
    return "", ""


def text_of(made: Instant, drawn: Case) -> str:
    lines = [f"x0 = {drawn.x0}, mode m{drawn.mode}"]
    for i, texts in enumerate(made.fields):
        lines.append(f"m{i}: " + ", ".join(texts))
    for i, edge in enumerate(made.edges):
        lines.append(
            f"{i}: m{edge.source} -> {edge.target}, {edge.guard}, {edge.direction:+d}, "
            f"reset {edge.reset}, when {edge.when}"
        )
    text = "\n  ".join(lines)
    for name, value in drawn.parameters.items():
        text = text.replace(f"p.{name},", f"({value}),").replace(f"p.{name})", f"({value}))")
        text = text.replace(f"p.{name}'", f"({value})'")
    return text


class Compared(NamedTuple):
    """Result of one method on one structure; a difference is a draw, a kind and a description."""

    index: int
    method: str
    cases: int
    # Draws discarded because the rules leave them open or because they have no simultaneous events.
    left: int
    firings: int
    differences: list[tuple[int, str, str]]
    seconds: float


def drawn_cases(made: Instant, seed: int, index: int, cases: int) -> Iterator[tuple[int, Case | None]]:
    """Yield numbered draws until there are enough cases."""
    done = number = 0
    while done < cases and number < MOST_DRAWS * cases:
        drawn = case(made, seed, index, number)
        yield number, drawn
        done += drawn is not None
        number += 1


def compared(
    seed: int,
    index: int,
    cases: int,
    methods: Iterable[str],
    begin: Callable[[str, int], None] = lambda method, run: None,
    left_out: Mapping[str, set[int]] = MappingProxyType({}),
) -> Iterator[Compared]:
    """Yield one part per method; call ``begin`` before each run, and skip the runs in ``left_out``."""
    made = instant(seed, index)
    draws = list(drawn_cases(made, seed, index, cases))
    good = {number: drawn for number, drawn in draws if drawn is not None}
    firings = sum(len(drawn.truth.fired) for drawn in good.values() if drawn.truth.ending != "stuck")
    for method in methods:
        # Compile before runs are timed.
        simulate(made.system, [0.0] * len(STATES), (0.0, 0.0), mode="m0", solver=SOLVERS[method])
        began, differences = time.perf_counter(), []
        for number, drawn in good.items():
            if number in left_out.get(method, ()):
                continue
            begin(method, number)
            kind, said = difference(made, drawn, SOLVERS[method])
            if kind:
                differences.append((number, kind, said))
        seconds = time.perf_counter() - began
        yield Compared(index, method, len(good), len(draws) - len(good), firings, differences, seconds)
