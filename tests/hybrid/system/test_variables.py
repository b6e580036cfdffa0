import numpy as np
import pytest

import models
from hybrid import simulate
from hybrid.errors import ArgumentError, ModelError
from hybrid.system.declared import as_parameters, as_state
from hybrid.system.variables import MOST_COMPONENTS, PARAMETERS, Variables, named_values, plain_class


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


NOT_NAMES = ("1q", "a b", "lambda", "_q", "", 3, None)


class TestNamesAndNumbers:
    @pytest.mark.parametrize(
        ("value", "state"),
        [(1, 1), (np.int64(3), 3), (MOST_COMPONENTS, MOST_COMPONENTS), (("q", "v"), ("q", "v"))],
    )
    def test_states(self, value, state):
        assert as_state(value) == state
        assert as_state(["q"]) == as_state(np.array(["q"])) == ("q",)

    @pytest.mark.parametrize(
        ("value", "text"),
        [
            (0, "HybridSystem: state needs at least one component; got 0."),
            (-1, "HybridSystem: state needs at least one component; got -1."),
            (MOST_COMPONENTS + 1, f"HybridSystem: state has at most {MOST_COMPONENTS} components; got "),
            ("q", "HybridSystem: state must be a tuple of names or a number of components; got 'q'. Write"),
            (True, "HybridSystem: state must be a tuple of names or a number of components; got True."),
            (2.0, "HybridSystem: state must be a tuple of names or a number of components; got 2.0"),
            ({"q"}, "HybridSystem: state must be a tuple of names or a number of components; got "),
            (
                np.array([["q"]]),
                "HybridSystem: state must be a tuple of names or a number of components; got",
            ),
            (("q", "v", "q", "v"), "HybridSystem: state names must differ; given twice: q, v."),
            *(((each,), f"HybridSystem: state name {each!r} cannot be written") for each in NOT_NAMES),
        ],
    )
    def test_other_states_are_refused(self, value, text):
        with pytest.raises(ModelError) as caught:
            as_state(value)
        assert str(caught.value).startswith(text)

    def test_parameters(self):
        assert as_parameters(None) == {}
        assert as_parameters({"k": 2, "m": np.float32(0.5)}) == {"k": 2.0, "m": 0.5}
        for name in NOT_NAMES:
            with pytest.raises(ModelError, match=r"HybridSystem: parameter name .* cannot be written"):
                as_parameters({name: 1.0})
        with pytest.raises(ArgumentError, match="HybridSystem: parameter 'k' must be a number; got '1'"):
            as_parameters({"k": "1"})

    @pytest.mark.as_given
    def test_values_of_parameters(self):
        variables = Variables(("q",), {"k": 2.0, "m": 3.0})
        assert variables.parameter_values().tolist() == [2.0, 3.0]
        assert variables.parameter_values({"m": 5}).tolist() == [2.0, 5.0]
        assert variables.defaults.tolist() == [2.0, 3.0]
        assert not variables.defaults.flags.writeable
        for given, text in (
            ({"n": 1.0}, "parameters: Parameter 'n' does"),
            ({"m": "1"}, "parameters: Param"),
        ):
            with pytest.raises(ArgumentError, match=text):
                variables.parameter_values(given)

    def test_a_point_in_words(self):
        variables, x = Variables(("q", "v"), {"k": 2.0, "m": 3.0}), np.array([0.5, -1.0])
        told = "at t = 1.5, x = (0.5, -1)"
        assert variables.described(1.5, x, np.array([2.0, 3.0])) == told
        assert variables.described(1.5, x, np.array([2.0, 4.0])) == f"{told}, m = 4"

    @pytest.mark.parametrize(
        ("value", "text"),
        [
            ([1.0], r"x0 has shape \(1,\); the state needs shape \(2,\): q, v."),
            ([[1.0, 2.0]], r"x0 has shape \(1, 2\); the state needs"),
            (["1", 2.0], "x0 must hold 2 numbers; got "),
            ([1.0, np.nan], "x0: component 'v' must be finite; got nan."),
            ([np.inf, np.nan], "x0: component 'q' must be finite; got inf."),
            ({"q": 1.0}, "x0 lacks v. The state is q, v; give each a number."),
            ({"q": 1.0, "v": 2.0, "w": 3.0}, "x0: State component 'w' does not exist"),
        ],
    )
    def test_states_that_are_refused(self, value, text):
        with pytest.raises(ArgumentError, match=text):
            Variables(("q", "v"), {}).state_values("x0", value)

    def test_states_in_order_and_by_name(self):
        variables = Variables(("q", "v"), {})
        for value in ([1, 2.0], {"v": 2.0, "q": 1.0}, np.array([1.0, 2.0])):
            assert variables.state_values("x0", value).tolist() == [1.0, 2.0]

    def test_units(self):
        variables = Variables(("q",), {"k": 2.0})
        assert variables.as_units({"q": "m", "k": "N/m", "t": "s"}) == {"q": "m", "k": "N/m", "t": "s"}
        for given, text in (
            ({"v": "m"}, "units: Name 'v'"),
            ({"q": 3}, r"units\['q'\] must be a str; got 3"),
        ):
            with pytest.raises(ArgumentError, match=text):
                variables.as_units(given)
