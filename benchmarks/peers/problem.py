"""A problem for all packages: a model's fields, guards and resets as expressions, and the exact answer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import attrs
import numpy as np
import sympy

from hybrid import Answer, HybridSystem
from hybrid.expression.graph import in_order
from hybrid.expression.nodes import Expression
from hybrid.expression.tracing import model_symbols, trace

# Ratio of absolute to relative tolerance, the same for all.
ATOL_OVER_RTOL = 1e-2

# A mode that starts on one of its guards can fire again and again at one instant.
MOST_EVENTS = 2000


def limit_events(times: Sequence[float]) -> None:
    """Raise a RuntimeError if a run has more events than any of these problems."""
    if len(times) > MOST_EVENTS:
        raise RuntimeError(f"more than {MOST_EVENTS} events, the last at t = {times[-1]:.6g}")


@attrs.frozen(eq=False)
class Problem:
    """One run of one system.

    Attributes
    ----------
    title
        For tables and charts.
    system, x0, t_span, mode
        The run, as :func:`hybrid.simulate` takes it.
    reference
        The exact answer.
    peers
        The model that other packages solve: ``system``, or a model with the same motion and simpler guards.
    straight
        A model of one mode that contains the discontinuity; None if the state jumps.
    left_out
        Final values of the last components of the state that ``straight`` lacks.
    tangent
        Whether the fundamental matrix is computed.
    """

    title: str
    system: HybridSystem
    x0: Sequence[float]
    t_span: tuple[float, float]
    reference: Answer | None
    mode: str | None = None
    peers: HybridSystem | None = None
    straight: HybridSystem | None = None
    left_out: Sequence[float] = ()
    tangent: bool = False

    @property
    def model(self) -> HybridSystem:
        return self.peers or self.system

    @property
    def straight_start(self) -> np.ndarray:
        return np.array(self.x0[: len(self.x0) - len(self.left_out)], dtype=float)

    def straight_answer(self, state: np.ndarray, **facts: Any) -> Answer:
        return Answer([*state, *self.left_out], **facts)

    @property
    def first_mode(self) -> int:
        return 0 if self.mode is None else self.model.mode_index(self.mode)


class Leave(NamedTuple):
    """An exit of a mode: expressions of guard and reset, direction, index of the next mode."""

    guard: sympy.Expr
    direction: int
    target: int
    reset: tuple[sympy.Expr, ...] | None


class Equations(NamedTuple):
    """Fields and exits by mode, in the symbols ``t`` and ``x``, with numbers in place of parameters."""

    t: sympy.Symbol
    x: tuple[sympy.Symbol, ...]
    fields: tuple[tuple[sympy.Expr, ...], ...]
    exits: tuple[tuple[Leave, ...], ...]


def equations(system: HybridSystem) -> Equations:
    """The equations of a model as plain SymPy."""
    names = tuple(system.parameters)
    symbols = model_symbols(system.dimension, len(names))
    known: dict[Expression, sympy.Expr] = {x: sympy.Symbol(x.label, real=True) for x in symbols.variables}
    known |= zip(symbols.p, map(sympy.Float, system.parameter_values()), strict=True)

    def expressions(function: Callable[..., Any]) -> tuple[sympy.Expr, ...]:
        return tuple(_in_sympy(e, known) for e in trace(function, system.variables.components, names))

    exits = tuple(
        tuple(
            Leave(
                expressions(transition.guard.function)[0],
                transition.guard.direction,
                system.mode_index(transition.target or mode),
                None if transition.reset is None else expressions(transition.reset.function),
            )
            for transition in system.transitions
            if transition.source == mode
        )
        for mode in system.mode_names
    )
    fields = tuple(expressions(mode.field) for mode in system.modes)
    return Equations(known[symbols.t], tuple(known[x] for x in symbols.x), fields, exits)


# Functions that SymPy has under other names; the others have its names.
THEIRS = {
    "Arccos": sympy.acos,
    "Arcsin": sympy.asin,
    "Arctan": sympy.atan,
    "Maximum": sympy.Max,
    "Minimum": sympy.Min,
    "Absolute": sympy.Abs,
    "Sign": sympy.sign,
    "Remainder": sympy.Mod,
    "Less": lambda a, b: sympy.Piecewise((1, a < b), (0, True)),
    "Select": lambda condition, a, b: sympy.Piecewise((a, condition > 0), (b, True)),
    "Sum": sympy.Add,
    "Product": sympy.Mul,
    "Power": sympy.Pow,
}


def _in_sympy(expression: Expression, known: dict[Expression, sympy.Expr]) -> sympy.Expr:
    """An expression in SymPy's functions, which its printers support."""
    for node in in_order([expression]):
        if node.is_number:
            known[node] = sympy.sympify(node.value)
        elif node not in known:
            name = type(node).__name__
            function = THEIRS.get(name) or getattr(sympy, name.lower())
            known[node] = function(*(known[each] for each in node.args))
    return known[expression]


def compiled(expressions: Sequence[sympy.Expr]) -> Callable[[float, np.ndarray, np.ndarray], None]:
    """``fill(t, x, out)``, compiled with numba."""
    import numba

    shared, results = sympy.cse(expressions)
    lines = [f"    {name} = {sympy.pycode(value)}" for name, value in shared]
    lines += [f"    out[{i}] = {sympy.pycode(value)}" for i, value in enumerate(results)]
    namespace: dict[str, Any] = {"math": __import__("math")}
    exec("def fill(t, x, out):\n" + "\n".join(lines), namespace)
    return numba.njit(namespace["fill"])


def returning(expressions: Sequence[sympy.Expr], scalar: bool = False) -> Callable[[float, np.ndarray], Any]:
    """``f(t, x)``, compiled with numba: returns an array, or one number."""
    import numba

    fill, n = compiled(expressions), len(expressions)

    @numba.njit
    def values(t: float, x: np.ndarray) -> np.ndarray:
        out = np.empty(n)
        fill(t, x, out)
        return out

    @numba.njit
    def value(t: float, x: np.ndarray) -> float:
        return values(t, x)[0]

    return value if scalar else values
