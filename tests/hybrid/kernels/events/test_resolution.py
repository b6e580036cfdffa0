"""Guards whose sign a step may not tell: states below their tolerance, fields with roots at a guard."""

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Taylor, Transition, Tsit5, simulate
from hybrid.status import StatusCode

SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853(), "Tsit5": Tsit5(), "RadauIIA": RadauIIA()}
each_solver = pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)


def watched(state, field, guard, direction=-1):
    return HybridSystem(
        state=state,
        modes=[Mode("m", field)],
        transitions=[Transition("m", None, Guard(guard, direction), name="zero")],
    )


DECAYS = {
    "linear": (("h",), lambda t, x, p: (-x.h,), lambda t, x, p: x.h, (1.0,)),
    "cubic": (("h",), lambda t, x, p: (-x.h - x.h**3,), lambda t, x, p: x.h, (1.0,)),
    "saturating": (("h",), lambda t, x, p: (-np.tanh(x.h),), lambda t, x, p: x.h, (1.0,)),
    "difference": (
        ("h", "k"),
        lambda t, x, p: (-x.h, -3.0 * x.k * (1.0 + 0.1 * np.sin(x.h))),
        lambda t, x, p: x.h - 0.5 * x.k,
        (1.0, 1.0),
    ),
    "overdamped": (
        ("q", "v"),
        lambda t, x, p: (x.v, -np.sin(x.q) - 3 * x.v),
        lambda t, x, p: x.q,
        (1.0, 0.0),
    ),
    "bent guard": (
        ("q", "v"),
        lambda t, x, p: (x.v, -np.sin(x.q) - 3 * x.v),
        lambda t, x, p: x.q * (2.0 + np.cos(x.v)),
        (1.0, 0.0),
    ),
}


@each_solver
@pytest.mark.parametrize("direction", [-1, 0, 1])
@pytest.mark.parametrize("name", DECAYS)
def test_a_decay_never_crosses_zero(name, direction, solver):
    """All the way below the absolute tolerance and down to underflow, the state keeps its sign.

    Tsit5 has so few digits that it loses the sign of a difference of two decays near 1e-136.
    """
    state, field, guard, start = DECAYS[name]
    end = 300.0 if isinstance(solver, Tsit5) else 1000.0
    arc = simulate(watched(state, field, guard, direction), start, (0.0, end), mode="m", solver=solver)
    assert arc.status.code == StatusCode.SUCCESS
    assert len(arc.jumps) == 0


ROOTS = {
    "square root": (lambda h: -np.sqrt(np.abs(h)) * np.sign(h), 2.0),
    "square root of the positive part": (lambda h: -np.sqrt(np.maximum(h, 0.0)), 2.0),
    "square root, no level below": (lambda h: -np.sqrt(h), 2.0),
    "cube root": (lambda h: -np.cbrt(h), 1.5),
    "dry friction": (lambda h: -np.sign(h), 1.0),
    "fourth root": (lambda h: -(np.abs(h) ** 0.25) * np.sign(h), 4.0 / 3.0),
}


@each_solver
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e6])
@pytest.mark.parametrize("name", ROOTS)
def test_a_level_with_a_root_in_its_rate_reaches_its_guard(name, unit, solver):
    """The level comes to rest at zero in finite time; that arrival is the event.

    Below the absolute tolerance the level is not known, so the time is known up to the fall from there.
    """
    rate, end = ROOTS[name]
    system = watched(("h",), lambda t, x, p: (unit * rate(x.h / unit),), lambda t, x, p: x.h)
    solver = type(solver)(atol=1e-12 * unit)
    arc = simulate(system, (unit,), (0.0, 3.0), mode="m", solver=solver)
    assert arc.status.code == StatusCode.TERMINAL
    assert abs(arc.jumps.t[0] - end) < 5e-5
    assert abs(arc.x[-1, 0]) < 1e-12 * unit
