"""What all runs of a system by one solver share: which kernels run, in which modes, and how many are kept."""

from types import SimpleNamespace

import numpy as np
import pytest

import hybrid
from hybrid.kernels.types.codes import EXACT, HIGHEST_ORDER, INCOMPLETE, ROOTED, RUNGE_KUTTA
from hybrid.kernels.types.layout import Attempts
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


@pytest.mark.parametrize(
    ("solver", "by_steps", "kinds", "order", "degree"),
    [
        (hybrid.Taylor(), None, [EXACT, RUNGE_KUTTA], "series", HIGHEST_ORDER),
        (hybrid.Taylor(), 0, [RUNGE_KUTTA, RUNGE_KUTTA], 0, 7),
        (hybrid.DOP853(), None, [RUNGE_KUTTA, RUNGE_KUTTA], 0, 7),
        (hybrid.Tsit5(), None, [RUNGE_KUTTA, RUNGE_KUTTA], 0, 4),
    ],
)
def test_how_modes_are_advanced(compiled, solver, by_steps, kinds, order, degree):
    made = plan.plan_of(compiled, solver, 0, by_steps)
    assert made.model.propagator.tolist() == kinds
    assert list(made.propagators) == ["free", "branching"]
    assert made.method.order == (solver.series_order if order == "series" else 0)
    assert made.degree == degree
    assert plan.plan_of(compiled, solver, 0, by_steps) is made
    assert plan.plan_of(compiled, solver, 1, by_steps) is not made
    assert (made.task.tangents, made.task.orthonormal) == (0, 0)


def test_the_kernels_view_of_a_solver():
    solver = hybrid.Tsit5(rtol=1e-5, atol=1e-7, max_step=0.5)
    method = plan.kernel_method(solver, False)
    assert (method.rtol, method.atol, method.max_step) == (1e-5, 1e-7, 0.5)
    assert method.exponent == 1.0 / solver.tableau.error_order == 0.2
    assert (method.implicit, plan.kernel_method(hybrid.RadauIIA(), False).implicit) == (0, 1)
    np.testing.assert_array_equal(method.b, solver.tableau.b)


# What a run may need, and the parts that are handed over for it.
PARTS = {
    "forced": ("explained_step", "explained_attempt", "explained_series"),
    "tangents": ("keep_apart",),
    "abrupt": ("look_back",),
    "timed": ("late_step", "late_jump"),
}


@pytest.mark.parametrize("need", [None, *PARTS])
@pytest.mark.parametrize("steps", [False, True])
def test_what_a_run_does_not_need_is_not_loaded(need, steps):
    absent = ("hybrid.kernels.steps.step", "no_attempt")
    parts, attempts = plan.driver_parts(absent, steps=steps, **{name: name == need for name in PARTS})
    assert isinstance(attempts, Attempts)
    assert parts.runge_kutta_step.name == ("runge_kutta_step" if steps else "no_step")
    for name, needed in PARTS.items():
        for each in needed:
            part = getattr(parts, each, None) or getattr(attempts, each)
            assert (part.address != 0) == (name == need)


def test_parts_that_a_run_needs():
    """By tangent vectors, by fields that may change abruptly, and by what depends on time."""

    def parts_of(field, guard, tangents, reset=None):
        system = hybrid.HybridSystem(
            state=("q", "v"),
            modes=[hybrid.Mode("move", field)],
            transitions=[
                hybrid.Transition("move", "move", hybrid.Guard(guard), reset and hybrid.Reset(reset))
            ],
        )
        made = plan.plan_of(hybrid.compile_system(system), hybrid.Taylor(), tangents)
        parts = made.parts.keep_apart, made.parts.look_back
        late = {made.parts.late_step.address != 0, made.parts.late_jump.address != 0}
        return *(each.address != 0 for each in parts), *late

    def smooth(t, x, p):
        return x.v, -x.q

    def steep(t, x, p):
        return x.v, -np.tanh(1e8 * x.q)

    def level(t, x, p):
        return x.q - 0.5

    assert parts_of(smooth, level, 0) == (False, False, False)
    assert parts_of(smooth, level, 2) == (True, False, False)
    assert parts_of(steep, level, 0) == (False, False, False)
    assert parts_of(steep, level, 2) == (True, True, False)
    assert parts_of(smooth, lambda t, x, p: x.q - t, 0) == (False, False, True)
    assert parts_of(lambda t, x, p: (x.v, t), level, 0) == (False, False, True)
    assert parts_of(smooth, level, 0, lambda t, x, p: (x.q, t)) == (False, False, True)


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


class Memory:
    """A structure with one number."""

    def __init__(self):
        self.number = 1

    def saved(self):
        return self.number

    def restore(self, held):
        self.number = held


class TestCalls:
    """The call adds one to its memory, and asks for missing parts unless they are complete."""

    def called(self, complete, monkeypatch, *, asks=True, stopped=False):
        def compiled(parts):
            if stopped:
                raise KeyboardInterrupt
            return SimpleNamespace(complete=1)

        def call(parts):
            self.calls.append(parts.complete)
            self.structure.number += 1
            self.array += 1.0
            return INCOMPLETE if asks and not parts.complete else 7

        monkeypatch.setattr(plan, "completed", compiled)
        self.calls, self.structure, self.array = [], Memory(), np.array([1.0, 2.0])
        made = plan.Plan(*[None] * 8)
        made.parts_so_far = SimpleNamespace(complete=complete)
        return made.called(call, self.structure, self.array)

    def test_missing_parts_are_compiled_and_the_call_repeated(self, monkeypatch):
        assert self.called(0, monkeypatch) == 7
        assert self.calls == [0, 1]
        assert self.structure.number == 2
        assert self.array.tolist() == [2.0, 3.0]

    @pytest.mark.parametrize(("complete", "asks"), [(1, True), (0, False)])
    def test_a_call_that_needs_no_other_parts_is_made_once(self, complete, asks, monkeypatch):
        assert self.called(complete, monkeypatch, asks=asks) == 7
        assert self.calls == [complete]
        assert self.structure.number == 2

    def test_an_interrupted_compilation_leaves_the_memory_as_it_was(self, monkeypatch):
        assert self.called(0, monkeypatch, stopped=True) == hybrid.StatusCode.INTERRUPTED
        assert self.calls == [0]
        assert (self.structure.number, self.array.tolist()) == (1, [1.0, 2.0])
