"""How far the run of a case is used: up to its first trouble."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis.vendor.pretty import pretty

import models
from hybrid.testing.case import Case, _before_trouble


@pytest.mark.parametrize(
    ("kinds", "touches", "expected"),
    [
        # Without trouble all but the last stretch counts.
        (["transverse"] * 4, [], 3.5),
        (["transverse", "transverse", "grazing", "transverse"], [], 1.5),
        (["transverse", "transverse", "grazing", "grazing"], [], 1.5),
        (["transverse", "grazing", "transverse", "transverse"], [], 0.5),
        (["transverse"] * 4, [2.5, 3.5], 1.5),
        (["transverse", "transverse", "transverse", "grazing"], [1.5], 0.5),
        # Half of the time up to the first trouble if no jump comes before it.
        (["grazing"] * 4, [], 5.0),
        (["grazing"] * 4, [0.5], 0.25),
    ],
)
def test_time_before_trouble_is_midway_between_two_jumps(kinds, touches, expected):
    jumps = SimpleNamespace(t=np.arange(1.0, 5.0), kind=np.array(kinds))
    grazings = [SimpleNamespace(t=t) for t in touches]
    arc = SimpleNamespace(t=np.array([0.0, 10.0]), jumps=jumps, grazings=grazings)
    assert _before_trouble(arc) == expected


@pytest.mark.parametrize(("fraction", "number"), [(0.0, 0), (0.2, 0), (0.25, 1), (0.6, 2), (0.99, 3)])
def test_the_fraction_selects_one_of_the_jumps(fraction, number):
    jumps = ["first", "second", "third", "fourth"]
    run = SimpleNamespace(arc=SimpleNamespace(jumps=jumps))
    assert Case.the_jump(SimpleNamespace(run=run, fraction=fraction)) == jumps[number]


BALL = models.bouncing_ball()


def test_a_case_is_printed_in_one_line():
    case = Case(BALL, BALL.parameters, "flight", (1.0, 0.5), 0.0, 0.3)
    assert pretty(case) == repr(case)
    assert len(pretty([case]).splitlines()) == 1


def test_states_and_fields_of_a_case_go_by_name():
    case = Case(BALL, {**BALL.parameters, "g": 2.0}, "flight", (1.0, 0.5), 0.0, 0.3)
    end = case.named(case.run.arc.x[-1])
    energy = 0.5 * end.v**2 + 2.0 * end.q
    assert energy == pytest.approx(0.5 * 0.5**2 + 2.0, rel=1e-12)
    np.testing.assert_array_equal(case.field("flight", 0.0, case.x0), [0.5, -2.0])
