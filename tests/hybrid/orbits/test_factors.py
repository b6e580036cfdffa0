"""Factors of a fundamental matrix: their product, how well-conditioned they are, how their run ended."""

from functools import partial

import numpy as np
import pytest

import hybrid
import models
from hybrid import Guard, HybridSystem, Mode, Reset, StatusCode, Transition, simulate
from hybrid.kernels.types import codes
from hybrid.orbits import factors
from hybrid.orbits.factors import fundamental_eigenvalues, fundamental_factors
from hybrid.simulation.trajectory import Trajectory, start

# Calls of a run, at most: each of the runs here takes far fewer steps and jumps.
MOST_CALLS = 40_000
SADDLE = HybridSystem(state=("a", "b"), modes=[Mode("only", lambda t, x, p: (3.0 * x.a, -4.0 * x.b))])


@pytest.fixture(autouse=True)
def _runs_end(monkeypatch):
    """A run that does not come to its end fails."""
    calls, advance_to = [], Trajectory.advance_to

    def counted(*args, **options):
        calls.append(1)
        assert len(calls) < MOST_CALLS
        return advance_to(*args, **options)

    monkeypatch.setattr(Trajectory, "advance_to", counted)


def began(system, x0, t0=0.0, **options):
    return start(system, x0, t0, tangent=np.eye(system.dimension), **options)


def factorised(system, x0, t, units=None, **options):
    units = np.ones(system.dimension) if units is None else np.array(units)
    return fundamental_factors(began(system, x0, **options), t, units)


def product(found):
    total = np.eye(len(found.units))
    for matrix in found.matrices:
        total = matrix @ total
    return total


SOLVERS = [None, hybrid.DOP853(rtol=1e-11, atol=1e-13), hybrid.RadauIIA(rtol=1e-9, atol=1e-12)]


class TestProduct:
    @pytest.mark.parametrize("solver", SOLVERS)
    @pytest.mark.parametrize("units", [(1.0, 1.0), (1e-3, 50.0)])
    def test_across_impacts_it_is_the_fundamental_matrix(self, solver, units):
        oscillator, x0, t = models.impact_oscillator(), (0.9, 1.0), 12.0
        exact = simulate(oscillator, x0, (0.0, t), tangent=np.eye(2))
        assert len(exact.jumps) >= 2
        found = factorised(oscillator, x0, t, units, solver=solver)
        assert (found.code, found.singular) == (codes.DONE, set())
        wanted = exact.fundamental / np.array(units)[:, None] * units
        np.testing.assert_allclose(product(found), wanted, rtol=1e-6, atol=1e-6 * np.abs(wanted).max())
        # What a jump does has a factor of its own.
        assert len(found.matrices) >= 2 * len(exact.jumps)

    @pytest.mark.parametrize("solver", SOLVERS)
    def test_a_stretch_that_no_float_holds_is_kept_as_factors(self, solver):
        """Growth ``exp(3 t)`` and ``exp(-4 t)`` over the time 100."""
        found = factorised(SADDLE, (0.0, 0.0), 100.0, solver=solver)
        assert found.code == codes.DONE
        logs = np.sum([np.log(np.abs(np.diagonal(each))) for each in found.matrices], axis=0)
        np.testing.assert_allclose(logs, [300.0, -400.0], rtol=1e-7)
        for each in found.matrices:
            assert np.linalg.cond(each) < 1e2 * factors.LONGEST_STEP
        eigenvalues = fundamental_eigenvalues(partial(began, SADDLE, (0.0, 0.0), solver=solver), 100.0)
        np.testing.assert_allclose(eigenvalues.log_moduli, [300.0, -400.0], rtol=1e-7)
        np.testing.assert_array_equal(eigenvalues.phases, 1.0)

    def test_units_suit_rows_and_columns(self):
        """``Phi`` has entries of 1e9 and 1e-9; in the units that are found, the sizes are alike."""
        shear = HybridSystem(state=("a", "b"), modes=[Mode("only", lambda t, x, p: (1e9 * x.b, -1e-9 * x.a))])
        found = factorised(shear, (0.0, 0.0), 1.0)
        assert 2e8 < found.units[0] / found.units[1] < 5e9
        again = factorised(shear, (0.0, 0.0), 1.0, found.units)
        np.testing.assert_allclose(again.units, found.units, rtol=10.0, atol=0.0)
        assert 2e8 < again.units[0] / again.units[1] < 5e9
        assert np.linalg.cond(product(again)) < 100.0
        wanted = [[np.cos(1.0), 1e9 * np.sin(1.0)], [-1e-9 * np.sin(1.0), np.cos(1.0)]]
        np.testing.assert_allclose(product(found), wanted, rtol=1e-9)

    @pytest.mark.parametrize(("unit", "runs"), [(1.0, 1), (100.0, 1), (1e4, 2), (1e-4, 2), (1e9, 2)])
    def test_a_run_is_repeated_in_units_that_suit_it(self, unit, runs):
        turn = HybridSystem(
            state=("a", "b"),
            parameters={"u": unit},
            modes=[Mode("only", lambda t, x, p: (p.u * x.b, -x.a / p.u))],
        )
        starts = []
        found = fundamental_eigenvalues(lambda: starts.append(began(turn, (0.0, 0.0))) or starts[-1], 1.0)
        np.testing.assert_allclose(found.values, np.exp([1j, -1j]), rtol=1e-12)
        assert len(starts) == runs

    @pytest.mark.parametrize("solver", SOLVERS)
    @pytest.mark.parametrize("rate", [3.0, -4.0])
    def test_one_vector_needs_a_factor_where_it_leaves_the_range(self, rate, solver):
        """In ``exp(400)`` there are three sizes of 1e50."""
        line = HybridSystem(state=("a",), modes=[Mode("only", lambda t, x, p: (rate * x.a,))])
        found = factorised(line, (0.0,), 400.0 / abs(rate), solver=solver)
        assert len(found.matrices) == 4
        logs = [float(np.log(each[0, 0])) for each in found.matrices]
        assert sum(logs) == pytest.approx(np.sign(rate) * 400.0, rel=1e-7)

    @pytest.mark.parametrize("rtol", [1e-4, 1e-6])
    def test_steps_of_an_implicit_method_are_short_enough(self, rtol):
        """The method takes the stiff direction to zero in a few steps, the tangent vectors may not follow."""
        solver = hybrid.RadauIIA(rtol=rtol, atol=1e-2 * rtol)
        stiff = HybridSystem(
            state=("a", "b"), modes=[Mode("only", lambda t, x, p: (-x.a + 0.1 * np.sin(x.b), -1e3 * x.b))]
        )
        found = factorised(stiff, (1.0, 0.0), 2.0, solver=solver)
        assert max(map(np.linalg.cond, found.matrices)) < factors.WORST_CONDITION * factors.LONGEST_STEP
        assert 100 < len(found.matrices) < 1000
        eigenvalues = fundamental_eigenvalues(partial(began, stiff, (1.0, 0.0), solver=solver), 2.0)
        np.testing.assert_allclose(eigenvalues.log_moduli, [-2.0, -2000.0], rtol=1e-4)


def landing():
    """Both states grow; at ``t = 1`` the second is set to zero, at 2 the first is halved and turned."""
    zero = Reset(lambda t, x, p: (x.a, 0.0))
    turn = Reset(lambda t, x, p: (-x.a / 2, x.b))
    return HybridSystem(
        state=("a", "b"),
        modes=[Mode("only", lambda t, x, p: (x.a, 2.0 * x.b))],
        transitions=[
            Transition("only", "only", Guard(lambda t, x, p: t - 1.0, +1), zero, name="zero"),
            Transition("only", "only", Guard(lambda t, x, p: t - 2.0, +1), turn, name="turn"),
        ],
    )


class TestJumps:
    def test_a_singular_jump_is_marked(self):
        found = factorised(landing(), (1.0, 1.0), 3.0)
        assert found.code == codes.DONE
        assert len(found.singular) == 1
        [place] = found.singular
        assert abs(np.linalg.det(found.matrices[place])) < 1e-14
        others = [np.linalg.det(each) for i, each in enumerate(found.matrices) if i != place]
        assert min(map(abs, others)) > 1e-3
        eigenvalues = fundamental_eigenvalues(partial(began, landing(), (1.0, 1.0)), 3.0)
        np.testing.assert_allclose(eigenvalues.values, [-np.exp(3.0) / 2, 0.0], rtol=1e-10)

    @pytest.mark.parametrize("times", [1, 3])
    def test_a_jump_at_the_start_is_not_made_again_at_the_end(self, times):
        """A ball that is taken up where it bounces: each period has one impact."""
        ball = models.bouncing_ball()
        elastic = {"e": 1.0}
        speed, g = 2.0, 9.81
        period = 2 * speed / g
        found = fundamental_factors(
            began(ball, (0.0, -speed), parameters=elastic), times * period, np.ones(2)
        )
        assert found.code == codes.DONE
        shear = np.array([[1.0, period], [0.0, 1.0]])
        impact = np.array([[-1.0, 0.0], [2 * g / speed, -1.0]])
        wanted = np.linalg.matrix_power(shear @ impact, times)
        np.testing.assert_allclose(product(found), wanted, rtol=1e-9, atol=1e-9)


class TestEnds:
    def test_a_run_that_is_asked_to_stop(self):
        class Asked:
            def is_set(self):
                return True

        found = factorised(SADDLE, (1.0, 1.0), 1.0, stop=Asked())
        assert (found.code, len(found.matrices)) == (StatusCode.INTERRUPTED, 1)

    @pytest.mark.parametrize("most", [1, 3])
    def test_a_limit_of_steps(self, most):
        solver = hybrid.DOP853(rtol=1e-10, max_steps=most)
        found = factorised(SADDLE, (1.0, 1.0), 50.0, solver=solver)
        assert found.code == codes.MAX_STEPS
        eigenvalues = fundamental_eigenvalues(partial(began, SADDLE, (1.0, 1.0), solver=solver), 50.0)
        assert np.isnan(eigenvalues.log_moduli).all()
        assert len(eigenvalues.log_moduli) == len(eigenvalues.phases) == 2

    def test_a_state_that_leaves_the_range(self):
        blown = HybridSystem(state=("a",), modes=[Mode("only", lambda t, x, p: (x.a**2,))])
        found = factorised(blown, (1.0,), 2.0)
        assert found.code not in (codes.DONE, codes.MAX_JUMPS)
        assert np.isnan(fundamental_eigenvalues(partial(began, blown, (1.0,)), 2.0).log_moduli).all()
