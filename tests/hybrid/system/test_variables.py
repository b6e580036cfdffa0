import numpy as np
import pytest

import models
from hybrid import simulate
from hybrid.errors import ArgumentError, ModelError
from hybrid.system.variables import PARAMETERS, Variables, as_state, named_values, plain_class


def test_values_are_read_by_name_by_index_and_in_order():
    x = named_values("State components", ("q", "v"), (1.0, 2.0))
    assert (x.q, x[1], tuple(x)) == (1.0, 2.0, (1.0, 2.0))


def test_fields_may_be_called_as_tuple_methods_are():
    x = named_values("State components", ("count", "index"), (1.0, 2.0))
    assert (x.count, x.index) == (1.0, 2.0)


@pytest.mark.parametrize(
    ("kind", "name", "text"),
    [
        (
            "State components",
            "qq",
            "State component 'qq' does not exist. State components: q, v. Did you mean 'q'?",
        ),
        ("Parameters", "foo", "Parameter 'foo' does not exist. Parameters: q, v."),
    ],
)
def test_an_unknown_name_lists_those_that_exist(kind, name, text):
    x = named_values(kind, ("q", "v"), (1.0, 2.0))
    with pytest.raises(ModelError) as caught:
        getattr(x, name)
    assert str(caught.value) == text
    assert not hasattr(x, name)


def test_views():
    named, plain = Variables(("q",), {"k": 2.0}), Variables(2, {})
    values = np.array([3.0, 4.0])
    assert named.state_view([3.0]).q == 3.0
    view = plain.state_view(values)
    np.testing.assert_array_equal(view, values)
    with pytest.raises(ValueError, match="read-only"):
        view[0] = 1.0
    assert named.parameter_view([5.0]).k == 5.0
    assert (named.dimension, plain.dimension) == (1, 2)
    assert plain.state_names == ("x0", "x1")
    np.testing.assert_array_equal(named.defaults, [2.0])
    with pytest.raises(ValueError, match="read-only"):
        named.defaults[0] = 1.0


def test_a_state_by_name():
    variables = Variables(("q", "v"), {})
    np.testing.assert_array_equal(variables.state_values("x0", {"v": 2.0, "q": 1}), [1.0, 2.0])
    for given, text in (
        ({"q": 1.0}, "x0 lacks v. The state is q, v; give each a number."),
        ({"q": 1.0, "w": 2.0}, "x0: State component 'w' does not exist. State components: q, v."),
        ({"q": 1.0, "v": "two"}, "x0 must hold 2 numbers; got [1.0, 'two']. The state is q, v."),
        ({"q": 1.0, "v": np.nan}, "x0: component 'v' must be finite; got nan."),
    ):
        with pytest.raises(ArgumentError) as caught:
            variables.state_values("x0", given)
        assert str(caught.value) == text


def test_a_run_starts_from_a_state_by_name():
    ball = models.bouncing_ball()
    arc = simulate(ball, {"v": 0.0, "q": 1.0}, (0.0, 1.0))
    np.testing.assert_array_equal(arc.x, simulate(ball, (1.0, 0.0), (0.0, 1.0)).x)


def test_compiled_code_takes_the_plain_class():
    numba = pytest.importorskip("numba")
    parameters = plain_class(PARAMETERS, ("count", "e"))
    assert numba.njit(lambda e: parameters(e, 2.0).count)(3.0) == 3.0


def test_names_in_an_array():
    assert as_state(np.array(["q", "v"])) == ("q", "v")
    for names in (np.array([["q", "v"]]), np.array("q")):
        with pytest.raises((ArgumentError, ModelError), match="tuple of names or a number of components"):
            as_state(names)
