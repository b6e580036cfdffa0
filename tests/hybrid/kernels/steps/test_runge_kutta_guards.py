"""Landings of Runge-Kutta steps on guards where Newton's method converges slowly."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Transition, Tsit5, simulate
from hybrid.kernels.arithmetic.bernstein import NO_ROOT
from hybrid.kernels.steps import runge_kutta_guards
from hybrid.kernels.steps.runge_kutta_guards import NOT_THERE
from tests.hybrid.kernels.plain import plain

SOLVERS = {"DOP853": DOP853(), "Tsit5": Tsit5(), "RadauIIA": RadauIIA()}


@cache
def cubic(direction):
    """The guard is ``s (t - c)**3`` on a surface that moves."""
    return HybridSystem(
        state=("q", "v", "a"),
        parameters={"s": 1.0, "w": 0.0},
        modes=[Mode("move", lambda t, x, p: (x.v, x.a, 6.0 * p.s))],
        transitions=[Transition("move", "move", Guard(lambda t, x, p: x.q - p.w * t, direction))],
    )


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("way", [-1, 1])
def test_a_triple_root_is_crossed_once(way, solver):
    for c in np.linspace(0.3, 1.7, 15):
        for w in (0.0, 3.0, -40.0):
            start = (-way * c**3, way * 3.0 * c**2 + w, -way * 6.0 * c)
            for direction, count in ((0, 1), (way, 1), (-way, 0)):
                arc = simulate(
                    cubic(direction), start, (0.0, 2.3), parameters={"s": float(way), "w": w}, solver=solver
                )
                assert len(arc.jumps) == count, (c, w, direction)
                # The place is known to the cube root of rounding.
                np.testing.assert_allclose(arc.jumps.t, [c] * count, rtol=0, atol=2e-4)


def first_landing(zeros, fired, *, side=(1, 1, 1), passed=NO_ROOT, missing=()):
    """Length and transition of a landing on a step of 4 from the time 7, with guards zero after ``zeros``."""

    def land(parts, model, method, transition, side, mode, t, rounding, h, theta, y, tangents, work):
        assert (side, mode, t) == (1, 0, 7.0)
        return (NOT_THERE, 0.0) if transition in missing else (zeros[transition] - 0.125, 0.125)

    def is_beyond(model, run, transition, side, t, work):
        return side * (t - 7.0 - zeros[transition]) > 1e-9

    tested = plain(runge_kutta_guards, land=land, is_beyond=is_beyond)
    model = SimpleNamespace(first_outgoing=np.array([0, 3]), outgoing=np.arange(3))
    run = SimpleNamespace(
        mode=0, y=None, side=np.array(side), rehearsal=np.ones((4, 3), dtype=int), passed=np.full(3, passed)
    )
    length, correction, first = tested.land_on_first(
        None, model, None, run, fired, 7.0, 7.0, 4.0, 0.5, 0, None
    )
    return length + correction, first


def test_the_landing_is_on_the_guard_that_is_crossed_first():
    assert first_landing((2.0, 1.5, 1.75), 0) == (1.5, 1)
    assert first_landing((2.0, 1.75, 1.5), 0) == (1.5, 2)
    assert first_landing((1.5, 2.0, 1.75), 0) == (1.5, 0)
    # Within rounding both are reached.
    assert first_landing((2.0, 2.0 - 1e-10, 3.0), 0) == (2.0, 0)


def test_a_guard_without_a_crossing_that_fires_is_not_landed_on():
    assert first_landing((2.0, 1.5, 3.0), 0, side=(1, -1, 1)) == (2.0, 0)
    assert first_landing((2.0, 1.5, 3.0), 0, passed=0.25) == (2.0, 0)
    assert first_landing((2.0, 1.5, 3.0), 0, missing=(1,)) == (2.0, 0)
