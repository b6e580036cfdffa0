"""What an author knows of a model finds errors in it."""

import numpy as np
import pytest

from hybrid import ArgumentError, Guard, HybridSystem, Mode, Reset, Transition
from hybrid.testing import PropertyError, check_system

ABOVE = {"above the floor": lambda t, x, p: x.q}
ENERGY = {"energy": lambda t, x, p: 0.5 * x.v**2 + p.g * x.q}
GIVEN = {"states": {"q": (-1.0, 2.0), "v": (-2.0, 2.0)}, "t_span": (0.0, 2.0), "examples": 15}


def ball(*, floor=0.0, pull=-1.0, reset=lambda t, x, p: (x.q, -x.v)):
    return HybridSystem(
        state=("q", "v"),
        parameters={"g": 9.81},
        modes=[Mode("flight", lambda t, x, p: (x.v, pull * p.g))],
        transitions=[
            Transition("flight", "flight", Guard(lambda t, x, p: x.q - floor, -1), Reset(reset), name="floor")
        ],
    )


def test_a_right_model_keeps_its_laws():
    report = check_system(ball(), invariant=ABOVE, conserved=ENERGY, **GIVEN)
    held = {each.name: each.examples for each in report.properties}
    assert held["'above the floor' is non-negative"] > 0
    assert held["'energy' is conserved"] > 0


@pytest.mark.parametrize(
    ("fault", "laws", "words"),
    [
        ({"floor": -0.5}, {"invariant": ABOVE}, "'above the floor' is non-negative"),
        ({"pull": -0.9}, {"conserved": ENERGY}, "'energy' is conserved"),
        ({"reset": lambda t, x, p: (x.q, -0.99 * x.v)}, {"conserved": ENERGY}, "after 'floor'"),
    ],
)
def test_faults_break_a_law(fault, laws, words):
    with pytest.raises(PropertyError) as caught:
        check_system(ball(**fault), **laws, **GIVEN)
    assert words in str(caught.value)


def test_laws_of_one_mode():
    laws = {"flight": {"high": lambda t, x, p: x.q - 5.0}}
    with pytest.raises(PropertyError, match="none of"):
        check_system(ball(), invariant=laws, **GIVEN)
    with pytest.raises(ArgumentError, match="invariant: Mode 'flicht' does not exist"):
        check_system(ball(), invariant={"flicht": laws["flight"]}, **GIVEN)
    with pytest.raises(ArgumentError, match=r"conserved: 'energy' must be a function of \(t, x, p\)"):
        check_system(ball(), conserved={"energy": 3.0}, **GIVEN)


def test_a_guard_with_a_condition_is_no_wall():
    """A pendulum with a peg below its support: the peg is met from one side only."""
    pendulum = HybridSystem(
        state=("th", "w"),
        modes=[Mode("swing", lambda t, x, p: (x.w, -np.sin(x.th)))],
        transitions=[
            Transition(
                "swing",
                "swing",
                Guard(lambda t, x, p: x.th, -1, when=lambda t, x, p: x.w < -1.5),
                Reset(lambda t, x, p: (x.th, -0.8 * x.w)),
                name="peg",
            )
        ],
    )
    report = check_system(pendulum, states={"th": (-1.0, -0.1)}, t_span=(0.0, 3.0), examples=5)
    assert report.visits["swing"] > 0
