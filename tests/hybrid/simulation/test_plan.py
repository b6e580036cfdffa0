"""What all runs of a system by one solver share: which kernels run, in which modes, and how many are kept."""

from types import SimpleNamespace

import pytest

import hybrid
from hybrid.kernels.types.codes import EXACT, ROOTED, RUNGE_KUTTA
from hybrid.simulation import plan
from hybrid.simulation.memory import MOST_LAYOUTS
from hybrid.solvers.solver import Solver


class Lookalike:
    """Has a tableau, and is no solver."""

    tableau = hybrid.DOP853.tableau


@pytest.fixture(scope="module")
def compiled():
    """A mode with an exact series, and one that cannot be traced."""

    def branching(t, x, p):
        return (-x.q if x.q > 0.0 else x.q,)

    return hybrid.compile_system(
        hybrid.HybridSystem(
            state=("q",),
            modes=[
                hybrid.Mode("free", lambda t, x, p: (-x.q,)),
                hybrid.Mode("branching", branching, jacobian=lambda t, x, p: [[-1.0 if x.q > 0.0 else 1.0]]),
            ],
            transitions=[
                hybrid.Transition("free", "branching", hybrid.Guard(lambda t, x, p: x.q - 1.0, +1)),
                hybrid.Transition("branching", "free", hybrid.Guard(lambda t, x, p: x.q + 1.0, -1)),
            ],
        )
    )


@pytest.mark.parametrize("solver", [Solver(), Lookalike(), hybrid.DOP853, 0])
def test_what_is_no_solver_is_refused(solver):
    with pytest.raises(hybrid.ArgumentError, match="solver must be a solver object"):
        plan.check_solver(solver)


def test_solvers_are_taken_as_they_are():
    assert plan.check_solver(None) is plan.DEFAULT_SOLVER
    solver = hybrid.Tsit5(rtol=1e-5)
    assert plan.check_solver(solver) is solver


def test_plans_of_the_last_solvers_are_kept(compiled):
    compiled.plans.clear()
    solvers = [hybrid.Taylor(rtol=1e-10 * (1.0 + k)) for k in range(MOST_LAYOUTS + 2)]
    made = [plan.plan_of(compiled, solver, 0) for solver in solvers]
    assert len(compiled.plans) == MOST_LAYOUTS
    assert plan.plan_of(compiled, solvers[-1], 0) is made[-1]
    assert plan.plan_of(compiled, solvers[2], 0) is made[2]
    assert plan.plan_of(compiled, solvers[1], 0) is not made[1]


@pytest.mark.parametrize(
    ("solver", "tangents", "kinds"),
    [
        (hybrid.Taylor(), 0, [ROOTED, EXACT]),
        (hybrid.DOP853(), 0, [RUNGE_KUTTA, RUNGE_KUTTA]),
        (hybrid.DOP853(), 1, [ROOTED, RUNGE_KUTTA]),
        (hybrid.DOP853(), 3, [ROOTED, RUNGE_KUTTA]),
        (hybrid.RadauIIA(), 1, [ROOTED, RUNGE_KUTTA]),
    ],
)
def test_modes_whose_tangent_vectors_need_series_get_them(solver, tangents, kinds):
    compiled = SimpleNamespace(
        emitted=SimpleNamespace(propagators=[SimpleNamespace(kind=kind) for kind in (ROOTED, EXACT)]),
        needs_series=lambda mode: mode == 0,
    )
    assert plan.propagator_kinds(compiled, solver, tangents) == kinds
