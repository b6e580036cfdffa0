"""Differences of the flow across a jump, and divergences, against exact answers in several units."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis.errors import UnsatisfiedAssumption

from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, Transition
from hybrid.testing import PropertyError, check_extension, check_saltation
from hybrid.testing import saltation as module
from hybrid.testing.case import Case, Engine
from tests.hybrid.testing.test_planted_faults import Saltation, reset_only

G, E, C = 9.81, 0.8, 0.3
# Units of length and time.
UNITS = [(1.0, 1.0), (1e-6, 1.0), (1e6, 1.0), (1.0, 30.0), (1e3, 0.1)]


def ball(length=1.0, time=1.0, solver=None, engine=None, until=1.0):
    """A ball that is dropped from a height of 1 and bounces once."""
    system = HybridSystem(
        state=("q", "v"),
        parameters={"g": G * length / time**2, "e": E},
        modes=[Mode("flight", lambda t, x, p: (x.v, -p.g))],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: (x.q, -p.e * x.v)),
                name="bounce",
            )
        ],
    )
    return Case(
        system,
        dict(system.parameters),
        "flight",
        (length, 0.0),
        0.0,
        until * time,
        solver=solver or DOP853(rtol=1e-12, atol=1e-14 * min(length, length / time)),
        engine=engine or Engine(),
    )


def exact(width, length, time):
    """The derivative of the flow over the window, from free flight and the saltation matrix."""
    g, speed = G * length / time**2, -np.sqrt(2 * G) * length / time
    flight = np.array([[1.0, width], [0.0, 1.0]])
    return flight @ np.array([[-E, 0.0], [-(1 + E) * g / speed, -E]]) @ flight


@pytest.mark.parametrize(("length", "time"), UNITS)
def test_a_window_around_a_bounce(length, time):
    case = ball(length, time)
    window = module._Window(case, case.the_jump())
    # The height changes by 0.2 of its size while the speed is at its largest, at the bounce.
    width = 0.2 / np.sqrt(2 * G) * time
    assert window.width == pytest.approx(width, rel=1e-9)
    assert (window.begin, window.end) == (window.jump.t - window.width, window.jump.t + window.width)
    wanted = exact(window.width, length, time)
    differences, tolerance = window.differences()
    for found in (differences, window.fundamental(), window.through(window.product())):
        np.testing.assert_allclose(window.scaled(found), window.scaled(wanted), rtol=0, atol=2e-7)
    size = 1.0 + np.abs(window.scaled(wanted)).max()
    least = (20.0 * (1e-12 + 1e-13) / module.STEP + 1e-7) * size
    assert np.all(tolerance >= 0.999 * least)
    assert np.all(tolerance <= 1.5 * least)
    check_saltation(case)


def test_a_window_reaches_half_way_to_the_next_event_if_nothing_bends():
    """Between two walls at constant speed: events at 1, 3 and 5, and an end at 5.6."""
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("run", lambda t, x, p: (0.0 * t + 1.0 * x.q**0, 0.0))],
        transitions=[
            Transition("run", "run", Guard(lambda t, x, p: x.q - 1.0, +1), Reset(lambda t, x, p: (-1.0, x.v)))
        ],
    )
    for fraction, width in ((0.0, 0.5), (0.4, 1.0), (0.9, 0.3)):
        case = Case(system, {}, "run", (0.0, 0.5), 0.0, 5.6, fraction=fraction, solver=DOP853(rtol=1e-12))
        window = module._Window(case, case.the_jump())
        assert window.width == pytest.approx(width, abs=1e-9)


def test_tolerances_of_runs_count_in_those_of_differences():
    """At 1e-8 the differences of the flow may be off by 2e-3; at 1e-7 they tell nothing."""
    fine, coarse = (ball(solver=DOP853(rtol=rtol)) for rtol in (1e-8, 1e-7))
    _, tolerance = module._Window(fine, fine.the_jump()).differences()
    assert np.all(tolerance > 2e-3)
    with pytest.raises(UnsatisfiedAssumption, match="do not converge"):
        module._Window(coarse, coarse.the_jump()).differences()


def test_jumps_at_one_instant_are_multiplied_in_their_order():
    first, second = np.array([[1.0, 2.0], [0.0, 1.0]]), np.array([[1.0, 0.0], [3.0, 1.0]])
    lost = np.array([[1.0, 0.0], [0.0, 1e-7]])

    def window(*matrices):
        jumps = [SimpleNamespace(saltation=each) for each in matrices]
        made = SimpleNamespace(jump=jumps[0], jumps=jumps, scaled=lambda matrix: matrix)
        return module._Window.product(made), module._Window.invertible(made)

    np.testing.assert_array_equal(window(first, second)[0], [[1.0, 2.0], [3.0, 7.0]])
    assert window(first, second)[1]
    assert window(first, lost)[1]
    assert not window(lost, first)[1]


@pytest.mark.parametrize("length", [1e-6, 1.0, 1e6])
def test_a_reset_beyond_its_guard_is_noticed_in_any_unit(length):
    check_extension(ball(length))
    with pytest.raises(PropertyError, match="the guard added to the reset"):
        check_extension(ball(length, engine=Saltation(reset_only)))


def test_integrals_of_the_divergence():
    """They go over the stretches between jumps, and in size over both signs."""
    system = HybridSystem(
        state=("q", "w"),
        parameters={"c": C},
        modes=[Mode("run", lambda t, x, p: (1.0 - p.c * x.q, (t - 1.0) * x.w))],
        transitions=[
            Transition("run", "run", Guard(lambda t, x, p: x.q - 1.0, +1), Reset(lambda t, x, p: (0.2, x.w)))
        ],
    )
    case = Case(system, {"c": C}, "run", (0.0, 1.0), 0.0, 3.0, solver=DOP853(rtol=1e-12, atol=1e-14))
    assert len(case.run.arc.jumps) == 2
    # The divergence ``t - 1.3`` changes its sign once.
    total, size = module._divergence(case)
    assert total == pytest.approx(4.5 - 1.3 * 3.0, rel=1e-12)
    assert size == pytest.approx(0.5 * (1.3**2 + 1.7**2), rel=3e-2)
