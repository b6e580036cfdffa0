"""Resets that round the quantity of their guard otherwise, and limits that go on in the wrong part."""

import attrs
import numpy as np
import pytest

import hybrid
from hybrid import Guard, HybridSystem, Mode, Reset, Transition
from hybrid.testing import Case, PropertyError, check_landings, check_limits, check_system
from hybrid.testing.engine import Engine
from hybrid.testing.landing import LIMITS


def wheel(reset):
    return HybridSystem(
        state=("th",),
        modes=[Mode("turn", lambda t, x, p: (1.3 - 0.2 * x.th,))],
        transitions=[
            Transition("turn", "turn", Guard(lambda t, x, p: x.th - 1, +1), Reset(reset), name="wrap")
        ],
    )


def case_of(system, x0, t1, mode, **options):
    return Case(system, dict(system.parameters), mode, x0, 0.0, t1, **options)


@pytest.mark.parametrize(
    "reset",
    [
        lambda t, x, p: (np.mod(x.th, 1.0),),
        lambda t, x, p: (x.th - np.floor(x.th),),
        lambda t, x, p: (np.where(x.th > 1.0, 0.0, 0.5),),
        lambda t, x, p: (0.0,),
    ],
)
def test_a_reset_may_jump_at_its_own_guard(reset):
    check_landings(case_of(wheel(reset), (0.3,), 3.0, "turn"))


def test_a_reset_that_rounds_the_quantity_otherwise_is_named():
    """The last digit of the angle decides where the wrap goes."""
    chance = wheel(lambda t, x, p: (np.where(np.mod(2.0**52 * x.th, 2.0) > 0.5, 0.5, 0.0),))
    with pytest.raises(PropertyError, match="'wrap'"):
        check_landings(case_of(chance, (0.3,), 3.0, "turn"))


def belt():
    """A parcel that bounces on a belt and is then taken along."""
    return hybrid.split(
        HybridSystem(
            state=("x", "y", "vx", "vy"),
            modes=[
                Mode("fly", lambda t, x, p: (x.vx, x.vy, 0.0, -10.0)),
                Mode("belt", lambda t, x, p: (x.vx, 0.0, -np.sign(x.vx - 2.0), 0.0)),
            ],
            transitions=[
                Transition(
                    "fly",
                    "fly",
                    Guard(lambda t, x, p: x.y, -1),
                    Reset(lambda t, x, p: {"y": 0.0, "vy": -0.5 * x.vy}),
                    accumulates_to="belt",
                )
            ],
        )
    )


class Otherwise(Engine):
    """A limit that leaves the parcel where it is."""

    def simulate(self, system, x0, t_span, *, mode, **options):
        arc = super().simulate(system, x0, t_span, mode=mode, **options)
        return attrs.evolve(arc, x=0.5 * arc.x) if mode == "belt" else arc


def test_the_limit_of_a_chatter_goes_on_as_a_start_there():
    case = case_of(belt(), (0.0, 5.0, 0.0, 0.0), 10.0, "fly")
    check_limits(case)
    with pytest.raises(PropertyError, match="limit of a chatter"):
        check_limits(attrs.evolve(case, engine=Otherwise()))


def resting_ball(rest):
    return HybridSystem(
        state=("q", "v"),
        modes=[Mode("flight", lambda t, x, p: (x.v, -9.81)), Mode("rest", rest)],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: {"q": 0.0, "v": -0.5 * x.v}),
                accumulates_to="rest",
                name="bounce",
            )
        ],
    )


@pytest.mark.parametrize(
    ("rest", "what"),
    [(lambda t, x, p: (x.v, -9.81), "its speed is"), (lambda t, x, p: (-1.0, 0.0), "its value is -")],
)
def test_the_mode_of_a_limit_stays_on_the_guard(rest, what):
    options = {"mode": "flight", "states": {"q": (0.1, 1.0)}, "t_span": (0.0, 5.0), "examples": 10}
    report = check_system(resting_ball(lambda t, x, p: (0.0, 0.0)), **options)
    assert next(each for each in report.properties if each.name == LIMITS).examples > 0
    with pytest.raises(PropertyError) as caught:
        check_system(resting_ball(rest), **options)
    message = str(caught.value)
    assert "mode 'rest', to which the jumps of 'bounce' accumulate, leaves its guard" in message
    assert what in message
