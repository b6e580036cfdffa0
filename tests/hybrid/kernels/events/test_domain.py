"""Guards that are no numbers farther along the step, and guards that are zero for a while."""

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Taylor, Transition, Tsit5, simulate

SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853(), "RadauIIA": RadauIIA(), "Tsit5": Tsit5()}
# Guards, each with the place of its root between 0 and 1; beyond 1 they have no value.
ENDING = {
    "sqrt": (lambda u, c: np.sqrt(1.0 - u) - np.sqrt(1.0 - c), -1),
    "log": (lambda u, c: np.log(1.0 - u) - np.log(1.0 - c), -1),
    "log1p": (lambda u, c: np.log1p(-u) - np.log1p(-c), -1),
    "arcsin": (lambda u, c: np.arcsin(u) - np.arcsin(c), +1),
    "arccos": (lambda u, c: np.arccos(u) - np.arccos(c), -1),
    "arctanh": (lambda u, c: np.arctanh(u) - np.arctanh(c), +1),
    "power": (lambda u, c: (1.0 - u) ** 1.5 - (1.0 - c) ** 1.5, -1),
    "product": (lambda u, c: np.sqrt(1.0 - u) * (u - c), +1),
}


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("name", ENDING)
def test_a_crossing_before_the_guard_ends(name, solver):
    guard, direction = ENDING[name]
    system = HybridSystem(
        state=("y",),
        parameters={"c": 0.5, "bend": 0.0},
        modes=[Mode("m", lambda t, x, p: (1.0 + p.bend * x.y**2,))],
        transitions=[Transition("m", None, Guard(lambda t, x, p: guard(x.y, p.c), direction))],
    )
    rng = np.random.default_rng(1)
    for end in (0.95, 1.001, 1.3, 2.0, 7.0, 60.0):
        c, bend = rng.uniform(0.05, 0.9), rng.choice([0.0, 0.05])
        arc = simulate(system, (0.0,), (0.0, end), parameters={"c": c, "bend": bend}, mode="m", solver=solver)
        assert arc.x[-1, 0] == pytest.approx(c, rel=1e-7)


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("start", [-1.0, 0.5])
def test_a_guard_changes_its_side_where_it_stops_being_zero(start, solver):
    system = HybridSystem(
        state=("y",),
        modes=[Mode("m", lambda t, x, p: (1.0,))],
        transitions=[
            Transition(
                "m", None, Guard(lambda t, x, p: np.maximum(x.y - 1.0, 0.0) - np.maximum(-x.y, 0.0), +1)
            )
        ],
    )
    for end in (3.0, 5.0, 7.0, 30.0):
        arc = simulate(system, (start,), (0.0, end), mode="m", solver=solver)
        assert arc.x[-1, 0] == pytest.approx(1.0, abs=1e-9)
