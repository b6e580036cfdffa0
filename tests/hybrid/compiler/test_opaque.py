"""Functions that are compiled as they are: their values and slopes, and what is said where that fails."""

import math
from functools import partial

import numpy as np
import pytest

from hybrid.compiler.opaque import (
    OpaqueFunction,
    _own_copy,
    check_plain,
    compiled_functions,
)
from hybrid.errors import ModelError

NAMED, COUNTED = ("q", "v"), 2


def opaque(function, state=NAMED, shape=(2,), slopes=False):
    title, reason = "Mode 'a': field", "a comparison"
    return OpaqueFunction(title, function, reason, state, ("k",), shape, slopes)


def refusal(*args, **options):
    with pytest.raises(ModelError) as caught:
        compiled_functions("model_0", opaque(*args, **options))
    text = str(caught.value)
    assert text.startswith("Mode 'a': field")
    return text


class TestRefusal:
    """Either the function itself or what it returns cannot be compiled, and the text tells which."""

    @pytest.mark.parametrize("slopes", [False, True])
    @pytest.mark.parametrize("state", [NAMED, COUNTED])
    def test_a_number_where_a_row_is_needed(self, state, slopes):
        text = refusal(lambda t, x, p: x[0] if x[0].real > 1.0 else 2.0 * x[1], state, slopes=slopes)
        assert ": what it returns cannot be compiled: TypingError: " in text
        assert text.endswith("Return a tuple or an array of numbers.")

    def test_a_write_into_the_state(self):
        def field(t, x, p):
            x[0] = 1.0
            return x

        text = refusal(field, COUNTED)
        assert "as it is. Tracing stopped: a comparison. The compiler stopped: " in text
        assert "setitem(readonly array(float64, 1d, C)" in text

    @pytest.mark.parametrize("state", [NAMED, COUNTED])
    def test_a_function_of_real_numbers_that_needs_a_slope(self, state):
        def field(t, x, p):
            return x[1], math.gamma(x[0])

        assert len(compiled_functions("model_0", opaque(field, state))) == 1
        text = refusal(field, state, slopes=True)
        assert "The compiler stopped: TypingError: " in text
        assert "signature: gamma(complex128). Write" in text


def test_what_may_be_compiled_as_it_is():
    """Functions, but no other object that can be called, and none that catches errors."""

    def careful(t, x, p):
        try:
            return math.sqrt(x[0])
        except ValueError:
            return 0.0

    def plain(t, x, p):
        return x[0] if x[0] > 1.0 else 0.0

    check_plain("Mode 'a': field", plain)
    check_plain("Mode 'a': field", lambda t, x, p: x[0])
    for function in (partial(plain, 0.0), math.sqrt, np.sin, float):
        with pytest.raises(ModelError, match="only if it is a plain function; got"):
            check_plain("Mode 'a': field", function)
    with pytest.raises(ModelError, match="what catches errors"):
        check_plain("Mode 'a': field", careful)


def test_large_whole_numbers_among_defaults_are_floats():
    def function(t, x, p, whole=2**31, large=2**31 + 1, low=-(2**40), real=0.5, flag=True):
        return t

    copy = _own_copy(function)
    assert copy.__defaults__ == (2**31, 2.0**31 + 1, -(2.0**40), 0.5, True)
    assert [type(each) for each in copy.__defaults__] == [int, float, float, float, bool]
    assert (copy.__name__, copy.__module__) == ("function", __name__)
    assert copy is not function
    assert _own_copy(lambda t, x, p: t).__defaults__ == ()
