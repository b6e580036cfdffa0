"""Locked jumps: a reset lands beyond their guards, so they fire at the time of the first guard."""

from functools import cache, reduce

import numpy as np
import pytest

import hybrid
from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, Taylor, Transition, simulate
from hybrid.simulation.memory import empty_record
from hybrid.simulation.trajectory import start
from hybrid.testing.case import Case
from hybrid.testing.saltation import check_saltation, check_sum_rule
from lyapunov import lyapunov_spectrum

SOLVERS = (Taylor(), DOP853(rtol=1e-12, atol=1e-14))


def steady(name, *velocity):
    """A mode with a constant field."""
    return Mode(name, lambda t, x, p: velocity)


def product(arc):
    """The product of the saltation matrices of all jumps."""
    return reduce(lambda total, xi: xi @ total, arc.jumps.saltation)


@cache
def pair():
    """``y = y0 - 1 + 5 (t - 1 + x0)`` at the end."""
    return HybridSystem(
        state=("x", "y"),
        modes=[steady("a", 1.0, 0.0), steady("b", 1.0, 2.0), steady("c", 1.0, 5.0)],
        transitions=[
            Transition("a", "b", Guard(lambda t, x, p: x.x - 1, +1), Reset(lambda t, x, p: (x.x, x.y - 1))),
            Transition("b", "c", Guard(lambda t, x, p: x.y, -1)),
        ],
    )


@cache
def chain(last="d"):
    """``y = 3 (y0 - 1) - (1 - x0) + 7 (t - 1 + x0)`` and ``x = 1 + 2 (t - 1 + x0)`` at the end."""
    return HybridSystem(
        state=("x", "y"),
        modes=[
            steady("a", 1.0, 0.0),
            steady("b", 1.0, 2.0),
            steady("c", -1.0, 5.0),
            *([steady("d", 2.0, 7.0)] if last else []),
        ],
        transitions=[
            Transition("a", "b", Guard(lambda t, x, p: x.x - 1, +1), Reset(lambda t, x, p: (x.x, x.y - 1))),
            Transition("b", "c", Guard(lambda t, x, p: x.y, -1), Reset(lambda t, x, p: (x.x, 3 * x.y))),
            Transition(
                "c",
                last,
                Guard(lambda t, x, p: x.y + 0.1 - t, -1),
                Reset(lambda t, x, p: (x.x, x.y - t)) if last else None,
            ),
        ],
    )


@pytest.mark.parametrize("solver", SOLVERS)
class TestExact:
    def test_a_pair(self, solver):
        arc = simulate(pair(), (0.0, 0.5), (0.0, 2.0), mode="a", solver=solver, tangent=True)
        assert arc.x[-1] == pytest.approx([2.0, 4.5])
        np.testing.assert_allclose(arc.fundamental, [[1, 0], [5, 1]], atol=1e-13)
        np.testing.assert_allclose(product(arc), arc.fundamental, atol=1e-13)
        check_saltation(Case(pair(), {}, "a", (0.0, 0.5), 0.0, 2.0))

    def test_a_chain_of_three(self, solver):
        arc = simulate(chain(), (0.0, 0.5), (0.0, 2.0), mode="a", solver=solver, tangent=True)
        assert arc.x[-1] == pytest.approx([3.0, 4.5])
        np.testing.assert_allclose(arc.fundamental, [[2, 0], [8, 3]], atol=1e-13)
        np.testing.assert_allclose(product(arc), arc.fundamental, atol=1e-13)
        np.testing.assert_allclose(
            simulate(chain(), (0.0, 0.5), (0.0, 2.0), mode="a", solver=solver).jumps.saltation,
            arc.jumps.saltation,
        )

    def test_the_last_may_end_the_run(self, solver):
        arc = simulate(chain(None), (0.0, 0.5), (0.0, 2.0), mode="a", solver=solver, tangent=True)
        assert arc.status.code.name == "TERMINAL"
        np.testing.assert_allclose(arc.fundamental, [[0, 0], [0, 3]], atol=1e-13)

    def test_one_that_lands_on_a_guard_has_its_own_time(self, solver):
        """Orbits on one side cross the second guard later; the jump's own matrix belongs to that side."""
        arc = simulate(pair(), (0.0, 1.0), (0.0, 2.0), mode="a", solver=solver)
        assert len(arc.jumps) == 1
        system = hybrid.HybridSystem(
            state=("x", "y"),
            modes=[steady("a", 1.0, 0.0), steady("b", 1.0, -2.0), steady("c", 1.0, -5.0)],
            transitions=pair().transitions,
        )
        arc = simulate(system, (0.0, 1.0), (0.0, 2.0), mode="a", solver=solver, tangent=True)
        assert len(arc.jumps) == 2
        np.testing.assert_allclose(arc.fundamental, [[1, 0], [-5, 2.5]], atol=1e-13)

    def test_taken_up_again_between_the_jumps(self, solver):
        trajectory = start(chain(), (0.0, 0.5), 0.0, mode="a", solver=solver, tangent=np.eye(2))
        for jumps in (1, 2, 3):
            trajectory.advance(2.0, trajectory.no_record(), max_jumps=jumps)
            assert trajectory.jumps == jumps
        trajectory.advance(2.0, empty_record(2, 28))
        np.testing.assert_allclose(trajectory.tangent_matrix, [[2, 0], [8, 3]], atol=1e-13)

    @pytest.mark.parametrize("e", [0.0, 0.6])
    def test_the_end_of_a_chatter(self, solver, e):
        """The ball rests from ``t* = (v0 + s) / g + 2 e s / (g (1 - e))`` on, and the clock ``w`` starts."""
        system = HybridSystem(
            state=("q", "v", "w"),
            modes=[
                Mode("flight", lambda t, x, p: (x.v, -2.0, 0.0)),
                steady("rest", 0.0, 0.0, 0.0),
                steady("go", 0.0, 0.0, 1.0),
            ],
            transitions=[
                Transition(
                    "flight",
                    "flight",
                    Guard(lambda t, x, p: x.q, -1),
                    Reset(lambda t, x, p: (0.0, -e * x.v, x.w)),
                    accumulates_to="rest",
                ),
                Transition("rest", "go", Guard(lambda t, x, p: x.w - 1, -1)),
            ],
        )
        arc = simulate(system, (1.0, 0.0, 0.0), (0.0, 10.0), mode="flight", solver=solver, tangent=True)
        assert arc.mode[-1] == "go"
        count = 1 + 2 * e / (1 - e)
        assert arc.x[-1, 2] == pytest.approx(10 - count, abs=1e-9)
        # s = 2 here, so that ds/dq0 = 1 and ds/dv0 = 0.
        np.testing.assert_allclose(arc.fundamental[2], [-count / 2, -1 / 2, 1], atol=1e-7)
        np.testing.assert_allclose(arc.fundamental[:2], 0.0, atol=1e-7)


class TestSingular:
    """The first reset sets ``x`` to a constant, but the time of the jump still depends on ``x``."""

    @staticmethod
    @cache
    def system():
        return HybridSystem(
            state=("x", "y"),
            modes=[
                Mode("a", lambda t, x, p: (1.0, -x.y)),
                steady("b", 0.0, 0.0),
                Mode("c", lambda t, x, p: (1.0, -0.5 * x.y)),
            ],
            transitions=[
                Transition(
                    "a", "b", Guard(lambda t, x, p: x.x - 1, +1), Reset(lambda t, x, p: (1.0, x.y - 1))
                ),
                Transition("b", "c", Guard(lambda t, x, p: x.y, -1), Reset(lambda t, x, p: (x.x, x.y + 1))),
                Transition("c", "a", Guard(lambda t, x, p: x.x - 2, +1), Reset(lambda t, x, p: (0.0, x.y))),
            ],
        )

    def test_fundamental(self):
        arc = simulate(self.system(), (0.25, 0.5), (0.0, 1.5), mode="a", tangent=True)
        assert len(arc.jumps) == 2
        # x = 1 + t - t*, y = y0 exp(-t* - (t - t*) / 2) with t* = 1 - x0.
        y = 0.5 * np.exp(-0.75 - 0.375)
        np.testing.assert_allclose(arc.fundamental, [[1, 0], [0.5 * y, y / 0.5]], atol=1e-12)

    @pytest.mark.parametrize("solver", SOLVERS)
    def test_exponents(self, solver):
        spectrum = lyapunov_spectrum(
            self.system(), (0.25, 0.5), mode="a", interval=2.0, intervals=20, transient=2, solver=solver
        )
        assert spectrum.status.ok
        np.testing.assert_allclose(spectrum.growths.sum(axis=1), -0.75, atol=1e-10)
        assert spectrum.sum_rule == pytest.approx(-0.75, abs=1e-10)


@cache
def bent():
    """Nonlinear forced modes, moving guards, resets that depend on time and state and land beyond a guard."""
    return HybridSystem(
        state=("q", "v"),
        parameters={"w": 1.7},
        modes=[
            Mode("before", lambda t, x, p: (x.v + 0.2 * np.sin(x.q), np.cos(p.w * t) - x.q**3)),
            Mode("between", lambda t, x, p: (x.q * x.v, 3.0 + t * x.q)),
            Mode("after", lambda t, x, p: (-0.5 * x.q + t * x.v, np.sin(x.q + t) - x.v)),
        ],
        transitions=[
            Transition(
                "before",
                "between",
                Guard(lambda t, x, p: x.q**2 + 0.3 * x.v - 0.5 - 0.1 * t**2, +1),
                Reset(lambda t, x, p: (x.q * np.cos(t) + 0.1 * x.v**2, x.v + np.exp(-x.q) * t)),
            ),
            Transition(
                "between",
                "after",
                Guard(lambda t, x, p: x.q * x.v + 0.2 * t, +1),
                Reset(lambda t, x, p: (x.q + x.v * t, x.v * np.cos(p.w * t) - 0.1 * x.q**2)),
            ),
        ],
    )


@pytest.mark.parametrize("solver", [Taylor(rtol=1e-13, atol=1e-14), DOP853(rtol=1e-13, atol=1e-14)])
def test_finite_differences(solver):
    x0, step = np.array([0.3, 0.6]), 1e-5

    def end(x, **options):
        arc = simulate(bent(), x, (0.0, 1.5), mode="before", solver=solver, **options)
        assert len(arc.jumps) == 2
        assert arc.jumps.t[0] == arc.jumps.t[1]
        return arc

    columns = [(end(x0 + h).x[-1] - end(x0 - h).x[-1]) / (2 * step) for h in step * np.eye(2)]
    np.testing.assert_allclose(end(x0, tangent=True).fundamental, np.column_stack(columns), rtol=1e-7)


def test_properties():
    for system, mode, x0, t1 in ((bent(), "before", (0.3, 0.6), 1.5), (chain(), "a", (0.0, 0.5), 2.0)):
        case = Case(system, dict(system.parameters), mode, x0, 0.0, t1)
        check_saltation(case)
        check_sum_rule(case)
