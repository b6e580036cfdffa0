"""Resets that return a dict of the components that change; all others stay."""

import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, ModelError, Reset, Transition, saltation_matrix, simulate, split
from hybrid.testing import check_system


def ball(reset, state=("q", "v"), **options):
    return HybridSystem(
        state=state,
        parameters={"g": 9.81, "e": 0.8},
        modes=[Mode("flight", lambda t, x, p: (x[1], -p.g))],
        transitions=[
            Transition(
                "flight", "flight", Guard(lambda t, x, p: x[0], -1), Reset(reset, **options), name="hit"
            )
        ],
    )


def traced(t, x, p):
    return {"v": -p.e * x.v}


def branching(t, x, p):
    """Tracing cannot follow it; numba compiles it as it is."""
    if x.v.real > 100.0:
        return {}
    return {"v": -p.e * x.v, "q": 0.0} if x.v.real < -3.0 else {"v": -p.e * x.v}


@pytest.mark.parametrize(
    ("reset", "options"),
    [
        (traced, {}),
        (traced, {"jacobian": lambda t, x, p: ((1.0, 0.0), (0.0, -p.e))}),
        (branching, {}),
    ],
)
def test_a_dict_is_the_whole_reset(reset, options):
    whole = ball(lambda t, x, p: (x.q, -p.e * x.v))
    wanted, found = (
        simulate(each, (1.0, 0.0), (0.0, 2.0), tangent=True) for each in (whole, ball(reset, **options))
    )
    np.testing.assert_allclose(found.jumps.t, wanted.jumps.t, rtol=1e-12)
    np.testing.assert_allclose(found.fundamental, wanted.fundamental, atol=1e-12)


def test_a_branch_may_choose_what_changes():
    arc = simulate(ball(branching), (1.0, 0.0), (0.0, 2.0))
    assert len(arc.jumps) == 3
    np.testing.assert_allclose(arc.jumps.x_plus[:, 1], -0.8 * arc.jumps.x_minus[:, 1], rtol=1e-14)


def test_an_empty_dict_is_the_identity():
    system = ball(lambda t, x, p: {})
    np.testing.assert_allclose(saltation_matrix(system, "hit", 0.0, (0.0, -1.0)), np.eye(2), atol=1e-15)


def test_a_split_system_keeps_it():
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("m", lambda t, x, p: (x.v, -1.0 - 0.1 * np.sign(x.v)))],
        transitions=[
            Transition("m", "m", Guard(lambda t, x, p: x.q, -1), Reset(lambda t, x, p: {"v": -x.v}))
        ],
    )
    [jump] = [
        each for each in simulate(split(system), (0.5, 0.0), (0.0, 1.5)).jumps if each.x_minus[1] < -0.1
    ]
    assert jump.x_plus[1] == -jump.x_minus[1]


def test_it_has_the_properties_of_every_system():
    report = check_system(ball(traced), states={"q": (0.1, 1.0)}, examples=3)
    assert report.jumps["hit"] > 0


@pytest.mark.parametrize(
    ("reset", "text"),
    [
        (
            lambda t, x, p: {"w": 1.0},
            "'hit': reset: State component 'w' does not exist. State components: q, v",
        ),
        (lambda t, x, p: {"vv": 1.0}, "Did you mean 'v'"),
        (lambda t, x, p: {1: 1.0}, "State component 1 does not exist"),
        (lambda t, x, p: {"v": "fast"}, "value 1 is not a number: 'fast'"),
    ],
)
def test_what_is_no_component_is_refused(reset, text):
    with pytest.raises(ModelError, match=text):
        ball(reset)


def test_an_unknown_name_behind_a_branch_is_refused_when_it_is_compiled():
    def reset(t, x, p):
        if x.v.real > 50.0:
            return {"vv": 0.0}
        return {"v": -p.e * x.v}

    with pytest.raises(ModelError, match="State component 'vv' does not exist"):
        simulate(ball(reset), (1.0, 0.0), (0.0, 1.0))


def test_a_branch_is_told_what_to_write():
    with pytest.raises(ModelError, match=r"return \{'v': np.where\(x.v < -3, -x.v, x.v\)\}"):
        simulate(ball(lambda t, x, p: branch(x)), (1.0, 0.0), (0.0, 1.0))


def branch(x):
    if x.v < -3:
        return {"v": -x.v}
    return {}


def test_without_names_a_dict_is_refused():
    with pytest.raises(ModelError, match="a dict of what changes needs names, and the 2 components"):
        ball(lambda t, x, p: {"x1": 1.0}, state=2)
