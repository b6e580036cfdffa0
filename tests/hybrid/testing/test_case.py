"""How far the run of a case is used: up to its first trouble."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis.vendor.pretty import pretty

import models
from hybrid import ArgumentError
from hybrid.testing.case import Case

BALL = models.bouncing_ball()


def test_a_run_is_cut_before_its_first_trouble_and_says_which():
    """A ball bounces more often in 10 s than is judged, and not at all in half a second."""
    bounces = Case(BALL, BALL.parameters, "flight", (1.0, 0.0), 0.0, 10.0).run
    assert bounces.cut == "it has more than 5 jumps"
    few = Case(BALL, BALL.parameters, "flight", (1.0, 0.0), 0.0, 1.0).run
    assert (few.cut, few.t1) == ("", 1.0)


@pytest.mark.parametrize(("fraction", "number"), [(0.0, 0), (0.2, 0), (0.25, 1), (0.6, 2), (0.99, 3)])
def test_the_fraction_selects_one_of_the_jumps(fraction, number):
    jumps = ["first", "second", "third", "fourth"]
    run = SimpleNamespace(arc=SimpleNamespace(jumps=jumps))
    assert Case.the_jump(SimpleNamespace(run=run, fraction=fraction)) == jumps[number]


def test_a_case_is_printed_in_one_line():
    case = Case(BALL, BALL.parameters, "flight", (1.0, 0.5), 0.0, 0.3)
    assert pretty(case) == repr(case)
    assert len(pretty([case]).splitlines()) == 1


def test_laws_of_a_case_go_by_name():
    case = Case(BALL, {**BALL.parameters, "g": 2.0}, "flight", (1.0, 0.5), 0.0, 0.3)
    assert case.law("energy", 0.0, case.x0) == pytest.approx(0.5 * 0.5**2 + 2.0, rel=1e-14)
    with pytest.raises(ArgumentError, match="Law 'enrgy' does not exist"):
        case.law("enrgy", 0.0, case.x0)


def test_states_and_fields_of_a_case_go_by_name():
    case = Case(BALL, {**BALL.parameters, "g": 2.0}, "flight", (1.0, 0.5), 0.0, 0.3)
    end = case.named(case.run.arc.x[-1])
    energy = 0.5 * end.v**2 + 2.0 * end.q
    assert energy == pytest.approx(0.5 * 0.5**2 + 2.0, rel=1e-12)
    np.testing.assert_allclose(case.field("flight", 0.0, case.x0), [0.5, -2.0], rtol=1e-14)
