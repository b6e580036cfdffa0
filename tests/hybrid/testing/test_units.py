"""Other units of state and time: which ones, and the system in them."""

import attrs
import numpy as np
import pytest

import hybrid
from hybrid.system.derivatives import evaluate
from hybrid.testing import Case, units
from hybrid.testing.engine import Engine


def swing(state):
    """Driven, and thrown back at a moving wall while it is fast."""
    return hybrid.HybridSystem(
        state=state,
        parameters={"a": 0.5, "w": 2.0},
        modes=[hybrid.Mode("m", lambda t, x, p: (x[1], p.a * np.sin(p.w * t) - x[0] * x[0]))],
        transitions=[
            hybrid.Transition(
                "m",
                "m",
                hybrid.Guard(
                    lambda t, x, p: x[0] - 0.1 * np.cos(p.w * t), -1, when=lambda t, x, p: -x[1] - 0.1
                ),
                hybrid.Reset(lambda t, x, p: (x[0], x[1] * x[1])),
                name="wall",
            )
        ],
        period=lambda p: 2 * np.pi / p.w,
    )


SWING = swing(("q", "v"))


class Noting(Engine):
    """Runs in other units, with how they were asked for."""

    def __init__(self):
        self.asked = []

    def simulate(self, system, x0, t_span, *, parameters, solver, **options):
        arc = super().simulate(system, x0, t_span, parameters=parameters, solver=solver, **options)
        if "unit_of_time" in parameters:
            self.asked.append((system, x0, t_span, parameters, solver, options))
        return arc


@pytest.mark.parametrize(
    ("fraction", "state", "time"),
    [(0.0, -40, 20), (0.5, 0, 0), (0.75, 20, -10), (1.0, 40, -20), (0.4, -8, 4), (0.59, 7, -4)],
)
def test_the_units_are_powers_of_two(fraction, state, time):
    """State and time, start, end, longest step and absolute tolerance are in the same units."""
    state, time, engine = 2.0**state, 2.0**time, Noting()
    solver = hybrid.DOP853(atol=1e-10, max_step=0.5)
    case = Case(
        SWING, {"a": 0.25, "w": 2.0}, "m", (0.5, -1.0), 0.25, 1.5, fraction, solver=solver, engine=engine
    )
    units.check_units(case)
    [(system, x0, t_span, parameters, used, options)] = engine.asked
    assert system is units.measured(SWING).system
    assert list(x0) == [0.5 * state, -state]
    assert t_span == (0.25 * time, case.run.t1 * time)
    assert parameters == {"a": 0.25, "w": 2.0, "unit_of_state_0": state, "unit_of_time": time}
    assert used == attrs.evolve(solver, atol=1e-10 * state, max_step=0.5 * time)
    assert options == {"mode": "m"}
    assert len(case.run.arc.jumps) == 1


class Longer(Engine):
    """Other units add a thousandth to the state."""

    def simulate(self, system, x0, t_span, *, parameters, **options):
        x0 = np.array(x0) * (1.001 if "unit_of_time" in parameters else 1.0)
        return super().simulate(system, x0, t_span, parameters=parameters, **options)


def test_a_difference_is_told_with_the_units():
    case = Case(SWING, {"a": 0.25, "w": 2.0}, "m", (0.5, -1.0), 0.25, 1.5, 0.75, engine=Longer())
    with pytest.raises(hybrid.testing.PropertyError, match=r"multiplied by 1.05e\+06, times by 0.000977"):
        units.check_units(case)


@pytest.mark.parametrize("state", [("q", "v"), 2])
def test_a_system_in_other_units_is_the_same_system(state):
    original = swing(state)
    made = units.measured(original)
    assert units.measured(original) is made
    system = made.system
    assert dict(system.parameters) == {"a": 0.5, "w": 2.0, "unit_of_state_0": 1.0, "unit_of_time": 1.0}
    p, x, t = original.parameter_values(), np.array([0.75, -1.5]), 0.375

    def values(one, function, t, x, p):
        return evaluate(one.variables, function, t, x, p)

    [mode], [other_mode] = original.modes, system.modes
    [wall], [other_wall] = original.transitions, system.transitions
    assert (other_wall.guard.direction, other_wall.name, other_mode.name) == (-1, "wall", "m")
    for space, time in ((1.0, 1.0), (4.0, 0.125), (0.5, 16.0)):
        place = (time * t, space * x, np.array([*p, space, time]))
        rates = values(original, mode.field, t, x, p)
        assert values(system, other_mode.field, *place).tolist() == (rates * space / time).tolist()
        for name in ("function", "when"):
            expected = values(original, getattr(wall.guard, name), t, x, p)
            assert values(system, getattr(other_wall.guard, name), *place).tolist() == expected.tolist()
        landing = values(original, wall.reset.function, t, x, p)
        assert values(system, other_wall.reset.function, *place).tolist() == (space * landing).tolist()
        given = {"unit_of_state_0": space, "unit_of_time": time}
        assert system.forcing_period(given) == time * np.pi


def test_what_is_not_there_has_no_units():
    plain = attrs.evolve(
        SWING,
        transitions=[hybrid.Transition("m", "m", hybrid.Guard(lambda t, x, p: x.q))],
        modes=[hybrid.Mode("m", lambda t, x, p: (x.v, -x.q))],
        period=None,
    )
    system = units.measured(plain).system
    assert system.period is None
    assert system.transitions[0].reset is None
    assert system.transitions[0].guard.when is None


def test_a_period_that_is_a_number_is_in_the_unit_of_time():
    system = units.measured(attrs.evolve(SWING, period=np.pi)).system
    assert system.forcing_period({"unit_of_time": 8.0}) == pytest.approx(8.0 * np.pi, rel=1e-14)


def relay(threshold):
    """A level that two modes fill and empty; one switches at a threshold of its own, the other at 2."""
    return hybrid.HybridSystem(
        state=("h",),
        modes=[
            hybrid.Mode("fill", lambda t, x, p: (3 - x.h,)),
            hybrid.Mode("empty", lambda t, x, p: (-x.h,)),
        ],
        transitions=[
            hybrid.Transition("fill", "empty", hybrid.Guard(lambda t, x, p: x.h - 2, +1)),
            hybrid.Transition("empty", "fill", hybrid.Guard(threshold, -1)),
        ],
    )


def test_one_mode_may_measure_the_state_in_units_of_its_own():
    system = relay(lambda t, x, p: x.h - 1)
    for mode, level in (("fill", 1.5), ("empty", 1.7)):
        for fraction in (0.1, 0.5, 0.9):
            case = Case(system, {}, mode, (level,), 0.0, 4.0, fraction)
            assert len(case.run.arc.jumps) > 2
            units.check_units(case)
    made = units.measured(system)
    mixed = dict(zip(made.state, (1.0, 1024.0), strict=True))
    arc = hybrid.simulate(made.system, (1.5,), (0.0, 4.0), mode="fill", parameters=mixed)
    np.testing.assert_allclose(arc.jumps.x_plus[:2, 0], (2048.0, 1.0), rtol=1e-9)
