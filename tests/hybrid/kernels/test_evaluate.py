"""Which function of a model a call from Python reaches."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels import evaluate
from tests.hybrid.kernels.plain import plain

kernels = plain(evaluate)
FIELD, GUARD, RESET, GRADIENT = range(4)


def model_of(**functions):
    """A model of two states whose field has two entries in its Jacobian; it fails if others are asked."""
    return SimpleNamespace(dimension=2, parameters="parameters", **functions)


def writing(value):
    def write(index, t, x, parameters, out):
        assert (index, t, x.tolist(), parameters) == (5, 0.25, [3.0, 4.0], "parameters")
        out[:] = value

    return write


@pytest.mark.parametrize(
    ("function", "name"),
    [(FIELD, "field"), (GUARD, "guard"), (RESET, "reset"), (GRADIENT, "guard_gradient")],
)
def test_the_number_tells_which_vector_is_written(function, name):
    model = model_of(**{name: writing([1.5, -2.5])})
    out = np.zeros(2)
    kernels.vector_function(model, function, 5, 0.25, np.array([3.0, 4.0]), out)
    assert out.tolist() == [1.5, -2.5]


def test_the_jacobian_of_a_field_has_its_zeros_too():
    """The field writes only the entries that may differ from zero."""

    def field_jacobian(index, t, x, parameters, out):
        assert (index, t, x.tolist(), parameters) == (5, 0.25, [3.0, 4.0], "parameters")
        out[0, 1] = 1.5
        out[1, 2] = -2.5

    out = np.full((2, 3), 88.0)
    model = model_of(field_jacobian=field_jacobian)
    kernels.matrix_function(model, FIELD, 5, 0.25, np.array([3.0, 4.0]), out)
    # The last column is the derivative in time, which a field writes in any case.
    assert out[:, :2].tolist() == [[0.0, 1.5], [0.0, 0.0]]
    assert out[1, 2] == -2.5


def test_the_jacobian_of_a_reset():
    jacobian = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    model = model_of(reset_jacobian=writing(jacobian))
    out = np.zeros((2, 3))
    kernels.matrix_function(model, RESET, 5, 0.25, np.array([3.0, 4.0]), out)
    assert out.tolist() == jacobian
