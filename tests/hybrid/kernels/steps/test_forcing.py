"""Pulses far narrower than a step belong to one mode, or come once in each period: none is stepped over."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Taylor, Transition, Tsit5, simulate
from hybrid.kernels.events import guards
from hybrid.kernels.steps import forcing
from hybrid.kernels.types.codes import ARGUMENTS, IN_TIME, TERMS
from tests.hybrid.kernels.plain import plain

METHOD = SimpleNamespace(atol=0.5, rtol=0.25, nodes="nodes", b=np.zeros(2))


def model_with(*kinds, components=(-1, 1, -1)):
    """The second of two modes has forcings of these kinds; there are two transitions."""
    count = len(kinds)
    return SimpleNamespace(
        dimension=2,
        target=np.zeros(2),
        timed=np.array([0, 1]),
        first_forcing=np.array([0, 0, count]),
        forcing_kind=np.array(kinds, dtype=int),
        forcing_component=np.array(components),
        programs=SimpleNamespace(first=np.arange(8), checked=np.ones(8, dtype=int)),
    )


def new_run(**values):
    given = {"mode": 1, "phase": 3.0, "cycle": 2, "y": np.array([7.0, -2.0]), "coarse": 0, "unresolved": 0}
    given |= {"calm_mode": 0, "calm_cycle": 2, "calm_until": 0.0, "calm_wait": 0, "since_entry": 0.0}
    return SimpleNamespace(**(given | values))


def test_tolerances_of_forcings():
    """Of the component that a forcing enters; none if that is unknown. The first component counts as well."""
    model = model_with(IN_TIME, IN_TIME, IN_TIME, components=(-1, 1, 0))
    found = [plain(forcing)._tolerance(model, METHOD, new_run(), i) for i in range(3)]
    assert found == [0.0, 0.5 + 0.25 * 2.0, 0.5 + 0.25 * 7.0]


@pytest.mark.parametrize(
    ("kinds", "has"),
    [((), False), ((IN_TIME,), False), ((ARGUMENTS, TERMS), True), ((IN_TIME, ARGUMENTS), False)],
)
def test_modes_with_terms_in_the_state(kinds, has):
    assert bool(plain(guards).has_terms_in_state(model_with(*kinds), 1)) == has


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
