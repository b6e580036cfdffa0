"""heyoka: Taylor series with terminal events and one integrator per mode.

A Hertz force has no Taylor series where the contact begins, and heyoka cannot start there. Therefore a mode
with a half-integer power of a gap ``z`` uses the clock ``dt = w ds`` with ``w = sqrt(z)``, and ``w`` and the
time as extra states, which makes it smooth. Each event costs time, so the end of the run is an event only
where a stay in a mode passes it; this stay is integrated again.
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
W, END = sympy.symbols("w t_end")
# Longer than any stay in a mode on its own clock, and more steps than a stay takes.
FOREVER, MOST_STEPS = 1e9, 10_000


def methods(problem: Problem) -> dict[str, Callable[[float], Answer]]:
    given = equations(problem.model)
    resets = [[None if e.reset is None else returning(e.reset) for e in exits] for exits in given.exits]

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
            if resets[mode][fired] is not None:
                x = resets[mode][fired](t, x)
            mode = given.exits[mode][fired].target

    return {"heyoka": run}


class _Stay:
    """The integrator of one mode."""

    def __init__(self, given: Equations, mode: int, rtol: float, t_end: float) -> None:
        field, exits, n = given.fields[mode], given.exits[mode], len(given.x)
        self.n, self.exits = n, len(exits)
        names = [f"x{i}" for i in range(n)]
        symbols = {s: hy.make_vars(name) for s, name in zip(given.x, names, strict=True)}
        symbols |= {given.t: hy.time}
        gap = _gap(field)
        self.clocked = gap is not None
        start = np.zeros(n)
        if gap is not None:
            symbols |= {W: hy.make_vars("w"), given.t: hy.make_vars("t"), END: hy.expression(t_end)}
            # W * gap in place of w**3: the series of a power divides by its base, which is zero at the start.
            smooth = [e.subs(sympy.Max(0, gap) ** sympy.Rational(3, 2), W * gap) for e in field]
            rate = sum(gap.diff(s) * e for s, e in zip(given.x, smooth, strict=True))
            field = (*(W * e for e in smooth), rate / 2, W)
            names, start = [*names, "w", "t"], np.zeros(n + 2)
            guards = [(W, exits[0].direction)]
        else:
            guards = [(leave.guard, leave.direction) for leave in exits]
        convert = functools.partial(_converted, symbols=symbols)

        def integrator(guards: Sequence[tuple[sympy.Expr, int]]) -> Any:
            return hy.taylor_adaptive(
                [(hy.make_vars(name), convert(e)) for name, e in zip(names, field, strict=True)],
                start,
                tol=rtol,
                t_events=[hy.t_event(convert(guard), direction=DIRECTIONS[d]) for guard, d in guards],
            )

        self.integrator = integrator(guards)
        self.to_the_end = integrator([*guards, (given.t - END, 1)]) if self.clocked else None

    def run(self, t: float, x: np.ndarray, end: float) -> tuple[float, np.ndarray, int | None, int]:
        """Time and state at the end of the stay, the exit or None at the end of the run, and the steps."""
        if not self.clocked:
            return self._advanced(self.integrator, t, x, end)
        stay = self._advanced(self.integrator, t, x, FOREVER)
        if stay[0] <= end and stay[2] is not None:
            return stay
        return self._advanced(self.to_the_end, t, x, FOREVER)

    def _advanced(
        self, ta: Any, t: float, x: np.ndarray, end: float
    ) -> tuple[float, np.ndarray, int | None, int]:
        ta.reset_cooldowns()
        ta.state[: self.n] = x
        if self.clocked:
            ta.state[self.n :] = 0.0, t
        ta.time = 0.0 if self.clocked else t
        outcome, _, _, steps, *_ = ta.propagate_until(end, max_steps=MOST_STEPS if self.clocked else 0)
        event = -int(outcome) - 1
        if outcome in (hy.taylor_outcome.time_limit, hy.taylor_outcome.step_limit):
            event = self.exits
        elif not 0 <= event <= self.exits:
            raise RuntimeError(f"heyoka ended with {outcome}")
        t = float(ta.state[self.n + 1] if self.clocked else ta.time)
        return t, ta.state[: self.n].copy(), None if event == self.exits else event, steps


def _gap(field: tuple[sympy.Expr, ...]) -> sympy.Expr | None:
    """The gap ``z`` of a force ``max(z, 0)**1.5``, or None."""
    bases = {sum(m.args) for e in field for m in e.atoms(sympy.Max)}
    return bases.pop() if bases else None


def _converted(expression: sympy.Expr, symbols: dict[sympy.Symbol, Any]) -> Any:
    return hy.from_sympy(expression.evalf(17), symbols) + hy.expression(0.0)
