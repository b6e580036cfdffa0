"""Guards whose value is constant between jumps are met each time that their sign changes."""

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, simulate

SPAN, COUNT = (0.25, 12.75), 12


def one_more(t, x, p):
    return {"n": x.n + 1}


def system(guard, direction=1, reset=one_more, **kinds):
    """A clock ``q`` and a number ``n`` that each event changes."""
    kinds = kinds or {"held": ("n",)}
    return HybridSystem(
        state=("q",),
        modes=[Mode("run", lambda t, x, p: (1.0,))],
        transitions=[Transition("run", "run", Guard(guard, direction), reset and Reset(reset), name="tick")],
        **kinds,
    )


COUNTED = {
    "where of a floor": (lambda t, x, p: np.where(np.floor(t) > x.n, 1.0, -1.0), 1),
    "downwards": (lambda t, x, p: np.where(np.floor(t) > x.n, -3.0, 0.5), -1),
    "both ways": (lambda t, x, p: np.where(np.floor(t) > x.n, 1.0, -1.0), 0),
    "of the state": (lambda t, x, p: np.where(np.floor(x.q) > x.n, 1.0, -1.0), 1),
    "from zero": (lambda t, x, p: np.where(np.floor(x.q) > x.n, 1.0, 0.0), 1),
    "at least": (lambda t, x, p: np.where(np.floor(x.q) >= x.n + 1, 1.0, -1.0), 1),
    "an equality": (lambda t, x, p: np.where(np.floor(x.q) == x.n, -1.0, 1.0), 1),
    "a difference": (lambda t, x, p: np.floor(x.q) - x.n, 1),
    "half between": (lambda t, x, p: np.floor(x.q) - x.n - 0.5, 1),
    "a sign": (lambda t, x, p: np.sign(np.floor(x.q) - x.n) - 0.5, 1),
    "a ceiling": (lambda t, x, p: np.where(np.ceil(x.q) > x.n + 1, 1.0, -1.0), 1),
    "a quotient": (lambda t, x, p: np.where(x.q // 1.0 > x.n, 1.0, -1.0), 1),
    "a comparison of smooth parts": (lambda t, x, p: np.where(x.q > x.n + 1, 1.0, -1.0), 1),
}


@pytest.mark.parametrize("solver", [Taylor(), DOP853(), RadauIIA(), DOP853(max_step=0.11)])
@pytest.mark.parametrize("name", COUNTED)
def test_a_count_of_whole_numbers_passed_is_complete(name, solver):
    guard, direction = COUNTED[name]
    arc = simulate(system(guard, direction), (0.25, 0.0), SPAN, solver=solver)
    assert arc.status.ok
    np.testing.assert_allclose(arc.jumps.t, 1.0 + np.arange(COUNT), rtol=1e-14)


def test_a_number_is_counted_alike_whether_it_is_held_a_counter_or_a_state():
    guard, _ = COUNTED["where of a floor"]
    for kinds in ({"held": ("n",)}, {"counters": ("n",)}):
        assert len(simulate(system(guard, **kinds), (0.25, 0.0), SPAN).jumps) == COUNT
    plain = HybridSystem(
        state=("n",),
        modes=[Mode("run", lambda t, x, p: (0.0 * x.n,))],
        transitions=[Transition("run", "run", Guard(guard, 1), Reset(one_more), name="tick")],
    )
    assert len(simulate(plain, (0.0,), SPAN).jumps) == COUNT


@pytest.mark.parametrize(("direction", "count"), [(1, 6), (-1, 6), (0, 12)])
def test_a_guard_that_alternates_fires_at_each_change_in_its_direction(direction, count):
    """Half of the jumps of the floor are upwards, and none is hidden between two others."""
    odd = system(lambda t, x, p: np.where(np.floor(x.q) % 2 == 1, 1.0, -1.0), direction, None)
    assert len(simulate(odd, (0.25, 0.0), SPAN).jumps) == count


def test_thirds_are_passed_although_they_are_no_numbers_of_the_machine():
    def third(q):
        return np.floor(3 * q) / 3

    made = system(lambda t, x, p: np.where(third(x.q) > x.n, 1.0, -1.0), 1, lambda t, x, p: {"n": third(x.q)})
    arc = simulate(made, (0.25, 0.0), SPAN)
    np.testing.assert_allclose(arc.jumps.t, np.arange(1, 39) / 3, rtol=1e-14)


@pytest.mark.parametrize("solver", [Taylor(), DOP853(), RadauIIA()], ids=lambda solver: type(solver).__name__)
@pytest.mark.parametrize("end", [4.0, 8.0, 10.0, 12.0, 100.0])
@pytest.mark.parametrize("shift", [0.5, 1.0, 1.3])
def test_a_jump_in_the_middle_of_a_step_is_met(solver, end, shift):
    """A step over a constant field is the whole span, and is halved where the guard jumps."""
    system = HybridSystem(
        state=("y",),
        parameters={"s": shift},
        modes=[Mode("m", lambda t, x, p: (0.0,))],
        transitions=[
            Transition(
                "m",
                "m",
                Guard(lambda t, x, p: np.where(np.mod(t - p.s, 2.0) < 1.0, 1.0, -1.0), +1),
                name="on",
            ),
            Transition(
                "m", "m", Guard(lambda t, x, p: np.where((t > 2) & (t < 5), 1.0, -1.0), +1), name="once"
            ),
        ],
    )
    arc = simulate(system, (0.0,), (0.0, end), solver=solver)
    rises = np.arange(shift, end, 2.0)
    np.testing.assert_allclose([each.t for each in arc.jumps["on"]], rises, atol=1e-9)
    np.testing.assert_allclose([each.t for each in arc.jumps["once"]], [2.0], atol=1e-9)
