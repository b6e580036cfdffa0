"""Pulses far narrower than a step belong to one mode, or come once in each period: none is stepped over."""

from functools import cache

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Taylor, Transition, Tsit5, simulate

SOLVERS = (Taylor(), DOP853(), RadauIIA(rtol=1e-8, atol=1e-10), Tsit5(rtol=1e-8, atol=1e-10))
# A lag of one unit of time, that long after a pulse of height 1 and width 0.01: the integral of
# ``exp(s - 1 - (s / w)^2)``.
WIDTH = 0.01
ANSWER = np.exp(-1.0) * WIDTH * np.sqrt(np.pi) * np.exp(WIDTH**2 / 4)


def gauss(t, height, place, width):
    return height * np.exp(-(((t - place) / width) ** 2))


def allowed_error(solver):
    """A share of the pulse and some absolute tolerances, as for single pulses."""
    share = 1e-3 if isinstance(solver, Tsit5) else 1e-6
    return share * WIDTH + 100 * solver.atol


@cache
def in_turn(backwards):
    """Three modes for 300 each, with pulses of their own; ``backwards`` the last one is listed first."""

    def lagging(k):
        return lambda t, x, p: (-x.x + gauss(t, p.A, p.a + 300.0 * k, p.w),)

    return HybridSystem(
        state=("x",),
        parameters={"A": 1.0, "a": 100.0, "w": 0.01},
        modes=[Mode(f"m{k}", lagging(k)) for k in (range(2, -1, -1) if backwards else range(3))],
        transitions=[
            Transition(f"m{k}", f"m{k + 1}", Guard(lambda t, x, p, k=k: t - 300.0 * (k + 1), +1))
            for k in range(2)
        ],
    )


@pytest.mark.parametrize("solver", SOLVERS, ids=str)
@pytest.mark.parametrize("k", range(3))
@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("after", [1.0, 10.0, 30.0, 100.0])
def test_each_mode_answers_its_own_pulse(after, backwards, k, solver):
    """After a long rest, one unit of time after its pulse; that the mode before is calm says nothing."""
    place = after + 300.0 * k
    arc = simulate(
        in_turn(backwards), (0.0,), (0.0, place + 1.0), mode="m0", parameters={"a": after}, solver=solver
    )
    assert len(arc.jumps) == k
    assert arc.status.ok
    assert arc.x[-1, 0] == pytest.approx(ANSWER, rel=0, abs=allowed_error(solver))


PERIOD = 100.0


def periodic(t, p):
    """A pulse in each period."""
    return p.A * np.exp(-((np.sin(np.pi * (t - p.a) / PERIOD) * PERIOD / (np.pi * p.w)) ** 2))


@cache
def forced():
    return HybridSystem(
        state=("x",),
        parameters={"A": 1.0, "a": 5.0, "w": 0.01},
        period=PERIOD,
        modes=[Mode("lag", lambda t, x, p: (-x.x + periodic(t, p),))],
    )


@pytest.mark.parametrize("solver", SOLVERS, ids=str)
@pytest.mark.parametrize("phase", [0.5, 5.0, 60.0])
def test_each_period_has_its_pulse(phase, solver):
    """That the end of one period is calm says nothing of the next one."""
    for cycle in (0, 1, 2):
        end = phase + PERIOD * cycle + 1.0
        arc = simulate(forced(), (0.0,), (0.0, end), parameters={"a": phase}, solver=solver)
        assert arc.status.ok
        assert arc.x[-1, 0] == pytest.approx(ANSWER, rel=0, abs=allowed_error(solver))
