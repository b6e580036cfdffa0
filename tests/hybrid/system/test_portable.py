"""Systems and results pickle and copy."""

import copy
import pickle
from collections.abc import Mapping

import attrs
import numpy as np
import pytest

import hybrid
import lyapunov
import models
from hybrid import Guard, HybridSystem, Mode, Transition
from tests.hybrid import systems


def second(p):
    return 1.0 + 0.0 * p.g


def ball(**changes):
    return systems.ball(**{"period": second, **changes})


BALL = ball()
START = (1.0, 0.0)


def stored(value):
    return pickle.loads(pickle.dumps(value))


def same(one, other):
    """Whether two values are equal, arrays to the last bit."""
    if isinstance(one, np.ndarray) and one.dtype != object:
        return isinstance(other, np.ndarray) and np.array_equal(one, other, equal_nan=one.dtype.kind in "fc")
    if isinstance(one, tuple | list) or (isinstance(one, np.ndarray) and one.dtype == object):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, Mapping):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, HybridSystem):
        return described(one) == described(other)
    if attrs.has(type(one)) and not isinstance(one, hybrid.Status):
        names = [field.name for field in attrs.fields(type(one))]
        return type(one) is type(other) and all(same(getattr(one, n), getattr(other, n)) for n in names)
    if hasattr(one, "identical"):
        return one.identical(other)
    return one == other or (one != one and other != other)


def described(system):
    return [
        system.state,
        dict(system.parameters),
        system.modes,
        system.transitions,
        system.period,
        system.name,
    ]


@pytest.fixture(scope="module")
def results():
    section = Guard(lambda t, x, p: x.v, -1)
    arc = hybrid.simulate(BALL, START, (0.0, 2.0))
    return {
        "arc": arc,
        "end": arc.end,
        "samples": hybrid.simulate(BALL, START, (0.0, 2.0), samples=[0.5, 1.5], tangent=True),
        "jump": arc.jumps[1],
        "jumps": arc.jumps,
        "grazing": hybrid.Grazing(1.0, 0, "bounce", np.array([0.0, 1.0]), 0.0, 1.0),
        "section": hybrid.poincare_section(BALL, START, section, points=3),
        "orbit": hybrid.periodic_orbit(BALL, (0.0, 4.0), max_iterations=1),
        "spectrum": lyapunov.lyapunov_spectrum(BALL, START, intervals=3, transient=0),
        "two orbits": lyapunov.two_orbit_exponents(BALL, START, intervals=3),
        "chart": lyapunov.chart(BALL, {"e": [0.7, 0.8]}, START, intervals=2, transient=0, executor=1),
        "status": arc.status,
        "solver": hybrid.DOP853(rtol=1e-8),
        "taylor": hybrid.Taylor(),
        "error": hybrid.global_error(BALL, START, (0.0, 1.0)),
        "work": hybrid.work_precision(
            BALL, START, (0.0, 0.3), methods={"T": hybrid.Taylor()}, tolerances=[1e-6], repeats=1
        ),
        "comparison": lyapunov.compare_models(
            {"a": BALL}, START, reference="a", intervals=2, transient=0, points=[{"e": 0.7}]
        ),
        "answer": hybrid.Answer((1.0, 2.0), steps=3),
    }


@pytest.mark.parametrize("clone", [stored, copy.copy, copy.deepcopy])
def test_results(results, clone):
    for name, result in results.items():
        assert same(clone(result), result), name


@pytest.mark.parametrize("clone", [stored, copy.copy, copy.deepcopy])
def test_a_system_works_as_before(clone):
    _ = BALL.graph
    other = clone(BALL)
    assert described(other) == described(BALL)
    arc, again = (hybrid.simulate(each, START, (0.0, 2.0)) for each in (BALL, other))
    np.testing.assert_array_equal(arc.x, again.x)
    with pytest.raises(TypeError):
        other.parameters["g"] = 1.0


def test_copies_of_a_system_are_the_system():
    assert copy.copy(BALL) is copy.deepcopy(BALL) is BALL
    assert copy.deepcopy([BALL, BALL])[0] is BALL


def test_what_was_compiled_is_not_stored():
    new = ball()
    before = len(pickle.dumps(new))
    hybrid.compile_system(new)
    assert len(pickle.dumps(new)) == before < 2000
    assert stored(hybrid.compile_system(BALL)).emitted == hybrid.compile_system(BALL).emitted


def test_saltation_matrices_are_still_made_when_asked_for():
    arc = hybrid.simulate(BALL, START, (0.0, 2.0))
    other = stored(arc)
    np.testing.assert_array_equal(other.jumps.saltation, arc.jumps.saltation)
    np.testing.assert_array_equal(other(0.3), arc(0.3))
    np.testing.assert_array_equal(other.jumps[0].saltation, arc.jumps[0].saltation)


@pytest.mark.parametrize(
    ("system", "text"),
    [
        (
            ball(modes=[Mode("flight", lambda t, x, p: (x.v, -p.g))]),
            "Mode 'flight': field cannot be pickled",
        ),
        (ball(period=lambda p: 1.0), "HybridSystem 'ball': period cannot be pickled"),
        (
            ball(transitions=[Transition("flight", "flight", Guard(lambda t, x, p: x.q))]),
            "Guard: function cannot be pickled: <function",
        ),
    ],
)
def test_functions_without_a_name(system, text):
    """Functions without an importable name can only be stored by value."""
    cloudpickle = pytest.importorskip("cloudpickle")
    for each in (system, hybrid.simulate(system, START, (0.0, 1.0))):
        with pytest.raises(hybrid.ModelError, match=text) as caught:
            pickle.dumps(each)
        assert "Define it with def at the top level of a module, or pickle with cloudpickle." in str(
            caught.value
        )
        other = pickle.loads(cloudpickle.dumps(each))
        assert type(other) is type(each)
    arc, again = (hybrid.simulate(each, START, (0.0, 1.0)) for each in (system, other.system))
    np.testing.assert_array_equal(arc.x, again.x)
    assert copy.deepcopy(system) is system


def test_parts_of_a_system_can_be_pickled_and_copied():
    ball = models.bouncing_ball()
    for part in (ball.parameters, ball.units, ball.variables):
        for made in (pickle.loads(pickle.dumps(part)), copy.copy(part), copy.deepcopy(part)):
            assert type(made) is type(part)
    assert ball.parameters | {"e": 0.5} == {**ball.parameters, "e": 0.5}
    assert {"more": 1.0} | ball.parameters == {"more": 1.0, **ball.parameters}
    assert ball.parameters == pickle.loads(pickle.dumps(ball.parameters)) == dict(ball.parameters)
    with pytest.raises(TypeError):
        ball.parameters["e"] = 0.5
