"""Functions that are compiled as they are: their values and slopes, and what is said where that fails."""

import math
from functools import partial

import numpy as np
import pytest

from hybrid.compiler.opaque import (
    LONGEST_REASON,
    OpaqueFunction,
    _indices,
    _own_copy,
    _short,
    _text,
    check_plain,
    compiled_functions,
)
from hybrid.errors import ModelError
from hybrid.system.variables import PARAMETERS, STATE, plain_class

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


class TestTextOfTheCompiler:
    @pytest.mark.parametrize(
        ("text", "told"),
        [
            ("Failed in nopython mode\n  | Use of unknown type.\nFile x, line 3", "Use of unknown type"),
            ("Unknown.\nMore", "Unknown"),
            ("None for signature:\n >>> floor(complex128)\nMore", "None for signature: floor(complex128)"),
            ("None for signature:\n >>> floor(complex128)", "None for signature: floor(complex128)"),
            ("Wrong signature:", "Wrong signature:"),
            ("Failed in nopython mode", "Failed in nopython mode"),
        ],
    )
    def test_the_line_that_names_the_problem(self, text, told):
        assert _short(ValueError(text)) == f"ValueError: {told}"

    def test_an_error_without_a_text_is_named(self):
        assert _short(AssertionError()) == "it failed with AssertionError"

    def test_a_long_line_is_cut(self):
        most = "x" * LONGEST_REASON
        assert _short(ValueError(f"{most}y")) == f"ValueError: {most} ..."
        assert _short(ValueError(most)) == f"ValueError: {most}"


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


class TestWrittenText:
    """The text around a model function, run in plain Python."""

    def scope(self, function, state, shape, slopes=True):
        given = opaque(function, state, shape, slopes)
        scope = {"function": function, "readonly": lambda x: x}
        scope["State"] = plain_class(STATE, NAMED)
        scope["Parameters"] = plain_class(PARAMETERS, ("k",))
        exec(_text(given), scope)
        return scope

    @pytest.mark.parametrize("state", [NAMED, COUNTED])
    @pytest.mark.parametrize("shape", [(), (2,), (2, 3)])
    def test_values_and_slopes(self, state, shape):
        """Multiples of ``k q^2 + t v``, whose slopes are ``2 k q``, ``t`` and, along time, ``v``."""

        def function(t, x, p):
            q, v = (x.q, x.v) if state == NAMED else x
            value = p.k * q * q + t * v
            if not shape:
                return value
            rows = [value, 10.0 * value]
            return rows if len(shape) == 1 else [[each, 3.0 * each, each * 0.0] for each in rows]

        scope = self.scope(function, state, shape)
        factors = {(): [1.0], (2,): [1.0, 10.0], (2, 3): [1.0, 3.0, 0.0, 10.0, 30.0, 0.0]}[shape]
        assert opaque(function, state, shape).size == len(factors)
        # Numbers behind the state do not count.
        x, p = np.array([0.5, -2.0, 1e300]), np.array([4.0])
        out = np.full(len(factors), 7.0)
        scope["value"](3.0, x, p, out)
        np.testing.assert_allclose(out, np.multiply(factors, 4.0 * 0.25 - 6.0))
        for column, slope in enumerate((4.0, 3.0, -2.0)):
            scope["slopes"](3.0, x, p, column, out)
            np.testing.assert_allclose(out, np.multiply(factors, slope), rtol=1e-14)

    @pytest.mark.parametrize("state", [NAMED, COUNTED])
    def test_an_error_gives_nan(self, state):
        def function(t, x, p):
            raise ValueError("no value")

        scope = self.scope(function, state, (2,))
        for name, more in (("value", ()), ("slopes", (0,))):
            out = np.zeros(3)
            scope[name](0.0, np.zeros(2), np.ones(1), *more, out)
            np.testing.assert_array_equal(out, [np.nan, np.nan, 0.0])

    def test_slopes_only_where_they_are_asked_for(self):
        assert "slopes" not in self.scope(lambda t, x, p: x.q, NAMED, (), slopes=False)


@pytest.mark.parametrize(
    ("place", "shape", "indices"),
    [(0, (), []), (1, (3,), [1]), (0, (2, 3), [0, 0]), (4, (2, 3), [1, 1]), (5, (2, 3), [1, 2])],
)
def test_places_row_by_row(place, shape, indices):
    assert _indices(place, shape) == indices


def test_large_whole_numbers_among_defaults_are_floats():
    def function(t, x, p, whole=2**31, large=2**31 + 1, low=-(2**40), real=0.5, flag=True):
        return t

    copy = _own_copy(function)
    assert copy.__defaults__ == (2**31, 2.0**31 + 1, -(2.0**40), 0.5, True)
    assert [type(each) for each in copy.__defaults__] == [int, float, float, float, bool]
    assert (copy.__name__, copy.__module__) == ("function", __name__)
    assert copy is not function
    assert _own_copy(lambda t, x, p: t).__defaults__ == ()
