"""heyoka: Taylor series with terminal events and one integrator per mode, as an expert would write them.

A Hertz force has no Taylor series where the contact begins, and heyoka cannot start there. Therefore a mode
with a half-integer power of a gap ``z`` uses the clock ``dt = w ds`` with ``w = sqrt(z)``, which makes it
smooth. ``w`` takes the place of the first state, which is in the gap, and the time is one more state. Each
event costs time, so the end of the run is an event only where a stay in a mode passes it; this stay is
integrated again. What the rates have in common is written once.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import heyoka as hy
import numpy as np
import sympy

from benchmarks.peers.problem import Equations, Problem, equations, limit_events, returning
from hybrid import Answer

DIRECTIONS = {
    -1: hy.event_direction.negative,
    0: hy.event_direction.any,
    1: hy.event_direction.positive,
}
ENDS = (hy.taylor_outcome.time_limit, hy.taylor_outcome.step_limit)
W, SQUARE, END = sympy.symbols("w square t_end")
# Longer than any stay in a mode on its own clock, and more steps than a stay takes.
FOREVER, MOST_STEPS = 1e9, 10_000
# A coefficient below this share of those that it is a difference of is rounding.
ROUNDING = 1e-14


def methods(problem: Problem) -> dict[str, Callable[[float], Answer]]:
    given = equations(problem.model)
    leaves = [
        [(e.target, None if e.reset is None else returning(e.reset)) for e in exits] for exits in given.exits
    ]

    @functools.cache
    def integrators(rtol: float) -> list[_Stay]:
        return [_Stay(given, mode, rtol, problem.t_span[1]) for mode in range(len(given.fields))]

    def run(rtol: float) -> Answer:
        stays = integrators(rtol)
        t, end = problem.t_span
        mode, x, times, steps = problem.first_mode, np.array(problem.x0, dtype=float), [], 0
        while True:
            t, x, fired, taken = stays[mode].run(t, x, end)
            steps += taken
            if fired is None:
                return Answer(x, times=times, steps=steps)
            times.append(t)
            limit_events(times)
            mode, reset = leaves[mode][fired]
            if reset is not None:
                x = reset(t, x)

    return {"heyoka": run}


class _Stay:
    """The integrator of one mode."""

    def __init__(self, given: Equations, mode: int, rtol: float, t_end: float) -> None:
        field, exits = given.fields[mode], given.exits[mode]
        names = [f"x{i}" for i in range(len(given.x))]
        symbols = {s: hy.make_vars(name) for s, name in zip(given.x, names, strict=True)}
        symbols |= {given.t: hy.time}
        gap = _gap(field)
        self.exits, self.clocked = len(exits), gap is not None
        guards = [(leave.guard, leave.direction) for leave in exits]
        if gap is None:
            rates = _shared(field, symbols)
        else:
            w = hy.make_vars("w")
            # A product: the series of a power divides by its base, which is zero at the start.
            symbols |= {W: w, SQUARE: w * w, given.t: hy.make_vars("t"), END: hy.expression(t_end)}
            [left_out] = sympy.solve(gap - SQUARE, given.x[0])
            self.left_out = sympy.lambdify((*given.x[1:], W), left_out.subs(SQUARE, W**2))
            smooth = [e.subs(sympy.Max(0, gap) ** sympy.Rational(3, 2), W * SQUARE) for e in field]
            speed = sum(gap.diff(s) * e for s, e in zip(given.x, smooth, strict=True))
            inside = [sympy.expand(e.subs(given.x[0], left_out)) for e in smooth[1:]]
            rates = [w * e for e in _shared(inside, symbols)]
            rates += [_converted(speed.subs(given.x[0], left_out) / 2, symbols), w]
            names = [*names[1:], "w", "t"]
            guards = [(W, exits[0].direction)]
        convert = functools.partial(_converted, symbols=symbols)

        def integrator(guards: Sequence[tuple[sympy.Expr, int]]) -> tuple[Any, np.ndarray]:
            made = hy.taylor_adaptive(
                [(hy.make_vars(name), rate) for name, rate in zip(names, rates, strict=True)],
                np.zeros(len(names)),
                tol=rtol,
                t_events=[hy.t_event(convert(guard), direction=DIRECTIONS[d]) for guard, d in guards],
            )
            # The state is a view, which stays the same.
            return made, made.state

        self.integrator = integrator(guards)
        self.to_the_end = integrator([*guards, (given.t - END, 1)]) if self.clocked else None

    def run(self, t: float, x: np.ndarray, end: float) -> tuple[float, np.ndarray, int | None, int]:
        """Time and state at the end of the stay, the exit or None at the end of the run, and the steps."""
        if self.clocked:
            return self._run_on_clock(self.integrator, t, x, end)
        ta, state = self.integrator
        ta.reset_cooldowns()
        state[:] = x
        ta.time = t
        result = ta.propagate_until(end)
        return ta.time, state, self._exit(result[0]), result[3]

    def _run_on_clock(
        self, integrator: tuple[Any, np.ndarray], t: float, x: np.ndarray, end: float
    ) -> tuple[float, np.ndarray, int | None, int]:
        ta, state = integrator
        ta.reset_cooldowns()
        state[:-2] = x[1:]
        state[-2], state[-1] = 0.0, t
        ta.time = 0.0
        result = ta.propagate_until(FOREVER, MOST_STEPS)
        exit = self._exit(result[0])
        *others, later = state.tolist()
        if integrator is self.integrator and (later > end or exit is None):
            return self._run_on_clock(self.to_the_end, t, x, end)
        others[-1] = self.left_out(*others)
        return later, np.array(others[-1:] + others[:-1]), exit, result[3]

    def _exit(self, outcome: Any) -> int | None:
        """The number of the event if it is an exit; None for the end of the run."""
        event = -1 - int(outcome)
        if 0 <= event < self.exits:
            return event
        if event == self.exits or outcome in ENDS:
            return None
        raise RuntimeError(f"heyoka ended with {outcome}")


def _gap(field: tuple[sympy.Expr, ...]) -> sympy.Expr | None:
    """The gap ``z`` of a force ``max(z, 0)**1.5``, or None."""
    bases = {sum(m.args) for e in field for m in e.atoms(sympy.Max)}
    return bases.pop() if bases else None


def _shared(rates: Sequence[sympy.Expr], symbols: dict[sympy.Symbol, Any]) -> list[Any]:
    """The rates as heyoka's expressions, each as a multiple of a later one and a rest, if that is shorter.

    A force that acts on two bodies is so computed once.
    """
    made: list[Any] = []
    for i in reversed(range(len(rates))):
        terms, multiple = _coefficients(rates[i]), hy.expression(0.0)
        rest = terms
        for later, other in zip(rates[i + 1 :], made, strict=True):
            others = _coefficients(later)
            for share in {terms[term] / others[term] for term in others if term in terms}:
                left = {e: terms.get(e, 0.0) - share * others.get(e, 0.0) for e in {*terms, *others}}
                left = {e: c for e, c in left.items() if abs(c) > ROUNDING * abs(terms.get(e, 0.0))}
                if len(left) < len(rest):
                    rest, multiple = left, share * other
        made.insert(0, _sum(rest, symbols) + multiple)
    return made


def _sum(terms: dict[sympy.Expr, float], symbols: dict[sympy.Symbol, Any]) -> Any:
    """A sum, in which a coefficient multiplies all of its terms together."""
    total = hy.expression(0.0)
    for size in sorted({abs(number) for number in terms.values()}):
        signed = {term: number / size for term, number in terms.items() if abs(number) == size}
        total += size * sum((sign * _converted(term, symbols) for term, sign in signed.items()))
    return total


def _coefficients(expression: sympy.Expr) -> dict[sympy.Expr, float]:
    """The coefficient of each term of a sum; none for zero."""
    pairs = (term.as_coeff_Mul() for term in sympy.Add.make_args(expression))
    return {term: float(number) for number, term in pairs if number != 0}


def _converted(expression: sympy.Expr, symbols: dict[sympy.Symbol, Any]) -> Any:
    return hy.from_sympy(expression.evalf(17), symbols) + hy.expression(0.0)
