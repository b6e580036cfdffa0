"""Locked jumps: a reset lands beyond their guards, so they fire at the time of the first guard."""

from functools import cache, reduce
from types import SimpleNamespace

import numpy as np
import pytest

import hybrid
from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, Taylor, Transition, simulate
from hybrid.kernels.jumps import locked
from hybrid.simulation.memory import empty_record
from hybrid.simulation.trajectory import start
from hybrid.testing.case import Case
from hybrid.testing.saltation import check_saltation, check_sum_rule
from lyapunov import lyapunov_spectrum
from tests.hybrid.kernels.plain import plain

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


class TestMapOfAnInstant:
    """Three states and two tangent vectors, with the kernels as plain Python."""

    N, TANGENTS = 3, 2

    @pytest.fixture
    def kernels(self):
        return plain(locked)

    @pytest.fixture
    def run(self):
        n, k = self.N, self.TANGENTS
        return SimpleNamespace(
            y=np.arange(1.0, 1.0 + n * (1 + k)),
            before=np.zeros(n * k),
            growth=np.array([0.25, 0.5]),
            growth_before=np.zeros(k),
            log_determinant=3.0,
            log_determinant_before=0.0,
            ill_conditioned_growth=7,
            ill_conditioned_growth_before=0,
            instant=np.full(n * (1 + n), 9.0),
            map_is_known=5,
        )

    def map_in(self, kernels, run):
        out = np.zeros((self.N, self.N))
        kernels.map_of_instant(run, self.N, out)
        return out

    def test_tangent_vectors_are_restored_with_their_sums(self, kernels, run):
        kernels.keep_tangents(run, self.N, self.TANGENTS)
        kept = run.y.copy()
        run.y[:] = -1.0
        run.growth[:] = -1.0
        run.log_determinant, run.ill_conditioned_growth = -1.0, -1
        kernels.restore_tangents(run, self.N, self.TANGENTS)
        np.testing.assert_array_equal(run.y, [-1.0, -1.0, -1.0, *kept[3:]])
        assert run.growth.tolist() == [0.25, 0.5]
        assert (run.log_determinant, run.ill_conditioned_growth) == (3.0, 7)

    def test_the_instant_changes_with_the_state(self, kernels, run):
        """The speed of the guard is ``8 - 2 * 7 + 2 = -4``."""
        work = SimpleNamespace(gradient=np.array([2.0, 0.0, -1.0, 8.0]), field=np.array([-7.0, 3.0, -2.0]))
        kernels.change_of_instant(run, self.N, work)
        assert run.instant[:3].tolist() == [0.5, 0.0, -0.25]
        assert run.instant[3] == 9.0
        # What the guard does not feel stays zero at a speed of zero, too.
        at_rest = SimpleNamespace(gradient=np.zeros(4), field=np.ones(3))
        kernels.change_of_instant(run, self.N, at_rest)
        assert run.instant[:3].tolist() == [0.0, 0.0, 0.0]

    def test_a_map_that_is_stored(self, kernels, run):
        matrix = np.arange(9.0).reshape(3, 3) ** 2
        kernels.begin_instant(run, self.N, self.TANGENTS, SimpleNamespace(saltation=matrix))
        assert run.map_is_known == 1
        np.testing.assert_array_equal(run.before, run.y[3:])
        np.testing.assert_array_equal(self.map_in(kernels, run), matrix)
        assert run.instant[:3].tolist() == [9.0, 9.0, 9.0]
        kernels.postpone_map(run, self.N)
        assert run.map_is_known == 0
        np.testing.assert_array_equal(run.instant[:3], run.y[:3])

    def test_at_a_start_the_map_is_the_identity_and_the_instant_is_given(self, kernels, run):
        kernels.begin_at_start(run, self.N, self.TANGENTS)
        assert run.map_is_known == 1
        np.testing.assert_array_equal(run.before, run.y[3:])
        np.testing.assert_array_equal(self.map_in(kernels, run), np.eye(3))
        assert run.instant[:3].tolist() == [0.0, 0.0, 0.0]

    @pytest.mark.parametrize("kicks", [np.array([0.5, 0.0, -2.0]), np.zeros(3)])
    def test_a_locked_jump(self, kernels, run, kicks):
        """The new map is ``D_x R P - kick a``; its own matrix takes the old map to the new one."""
        rng = np.random.default_rng(2)
        first, reset, change = rng.normal(size=(3, 3)), rng.normal(size=(3, 4)), rng.normal(size=3)
        work = SimpleNamespace(
            saltation=first,
            reset_jacobian=reset,
            settled=kicks,
            jacobian=np.zeros((3, 4)),
            error=np.zeros(9),
            state=np.zeros(3),
            rounding=np.zeros((4, 3)),
        )
        kernels.keep_map(run, self.N, work)
        run.instant[:3] = change
        work.saltation = np.zeros((3, 3))
        kernels.follow(run, self.N, work)
        new = reset[:, :3] @ first - np.outer(kicks, change)
        np.testing.assert_allclose(self.map_in(kernels, run), new, rtol=1e-13)
        np.testing.assert_allclose(work.saltation @ first, new, rtol=1e-12)
        np.testing.assert_array_equal(run.instant[:3], change)
