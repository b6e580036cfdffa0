import numpy as np
import pytest

from hybrid.errors import ModelError
from hybrid.system.elements import Mode
from hybrid.system.graph import HybridSystem
from hybrid.system.variables import PARAMETERS, named_values, parameter_view, plain_class, state_values


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


def test_views_of_a_system():
    named = HybridSystem(
        state=("q",), parameters={"k": 2.0}, modes=[Mode("a", lambda t, x, p: (-p.k * x.q,))]
    )
    plain = HybridSystem(state=2, modes=[Mode("a", lambda t, x, p: -x)])
    values = np.array([3.0, 4.0])
    assert state_values(named, [3.0]).q == 3.0
    view = state_values(plain, values)
    np.testing.assert_array_equal(view, values)
    with pytest.raises(ValueError, match="read-only"):
        view[0] = 1.0
    assert parameter_view(named, [5.0]).k == 5.0


def test_compiled_code_takes_the_plain_class():
    numba = pytest.importorskip("numba")
    parameters = plain_class(PARAMETERS, ("count", "e"))
    assert numba.njit(lambda e: parameters(e, 2.0).count)(3.0) == 3.0
