"""Each check of an argument, on both sides of each of its limits."""

import math
from fractions import Fraction

import numpy as np
import pytest

from hybrid import arguments
from hybrid.errors import ArgumentError

INF, NAN = math.inf, math.nan


def refused(check, *given, text, **options):
    with pytest.raises(ArgumentError) as caught:
        check("size", *given, **options)
    assert str(caught.value).startswith(text)


class TestNumbers:
    @pytest.mark.parametrize(
        ("value", "found"),
        [
            (2.5, 2.5),
            (-3, -3.0),
            (np.float32(0.5), 0.5),
            (np.array(7), 7.0),
            (Fraction(1, 4), 0.25),
            (INF, INF),
            (10**400, INF),
            (-(10**400), -INF),
            (True, None),
            (np.True_, None),
            (np.timedelta64(3, "s"), None),
            (1j, None),
            ("1", None),
            (None, None),
            ([1.0], None),
            (np.array([1.0]), None),
        ],
    )
    def test_what_is_a_real_number(self, value, found):
        assert arguments._as_float(value) == found

    def test_a_number_is_finite(self):
        assert arguments.number("size", -3) == -3.0
        refused(arguments.number, "3", text="size must be a number; got '3'")
        refused(arguments.number, INF, text="size must be finite; got inf")
        refused(arguments.number, NAN, text="size must be finite; got nan")

    def test_a_positive_number(self):
        assert arguments.positive("size", 1e-300) == 1e-300
        assert arguments.positive("size", INF, infinite=True) == INF
        for value in (0.0, -1.0, INF, NAN, "1"):
            refused(arguments.positive, value, text="size must be positive; got ")
        for value in (0.0, -INF, NAN):
            refused(arguments.positive, value, text="size must be positive; got ", infinite=True)
        refused(arguments.positive, 0.0, "be a length", text="size must be a length; got 0")

    def test_a_number_that_is_not_negative(self):
        assert arguments.not_negative("size", 0) == 0.0
        assert arguments.not_negative("size", INF, infinite=True) == INF
        for value in (-1e-300, INF, NAN, "1"):
            refused(arguments.not_negative, value, text="size must be at least 0; got ")
        for value in (-1e-300, NAN):
            refused(arguments.not_negative, value, text="size must be at least 0; got ", infinite=True)

    @pytest.mark.parametrize(
        ("value", "whole"),
        [(3, 3), (np.int8(-4), -4), (2**70, 2**70), (3.0, None), (True, None), (np.True_, None)],
    )
    def test_a_whole_number(self, value, whole):
        found = arguments.whole_number(value)
        assert found == whole
        assert whole is None or type(found) is int
        assert arguments.whole_number(np.timedelta64(3, "s")) is None

    def test_a_count(self):
        assert arguments.count("size", 2, 2) == 2
        assert arguments.count("size", np.int64(5), 2, 5) == 5
        for value in (1, 2.0, True):
            refused(arguments.count, value, 2, text="size must be a whole number of at least 2; got ")
        for value in (1, 6, "3"):
            refused(arguments.count, value, 2, 5, text="size must be a whole number from 2 to 5; got ")
        told = "size must be a whole number from 2 to 5, the states; got 6"
        refused(arguments.count, 6, 2, 5, ", the states", text=told)
        largest = arguments.LARGEST_COUNT
        assert arguments.count("size", largest, 1) == largest
        refused(arguments.count, largest + 1, 1, text=f"size must be a whole number from 1 to {largest}; got")

    def test_a_flag(self):
        assert arguments.flag("size", np.True_) is True
        assert arguments.flag("size", False) is False
        refused(arguments.flag, 1, text="size must be True or False; got 1")


class TestArrays:
    @pytest.mark.parametrize(
        ("value", "found"),
        [
            ([1, 2.5], [1.0, 2.5]),
            ((), []),
            (range(3), [0.0, 1.0, 2.0]),
            ([[1, 2], [3, 4]], [[1.0, 2.0], [3.0, 4.0]]),
            (np.array([1, 2], dtype=np.uint8), [1.0, 2.0]),
            ([10**400, -1], [INF, -1.0]),
            ([Fraction(1, 2), np.float32(2)], [0.5, 2.0]),
            (3.5, 3.5),
            ([True, 1.0], None),
            (np.array([True]), None),
            ([1.0, "2"], None),
            ([1.0, None], None),
            ([[1.0], [1.0, 2.0]], None),
            (b"12", None),
            (bytearray(b"12"), None),
            (np.array([1, 2], dtype="m8[s]"), None),
            # As objects, these would be the counts of their unit.
            (np.array([1, 2], dtype="m8[ns]"), None),
            (np.array(["2020"], dtype="M8[Y]"), None),
            (np.array([1j]), None),
            (np.ma.masked_array([1.0, 2.0], [False, True]), None),
            (np.ma.masked_array([1.0, 2.0], [False, False]), [1.0, 2.0]),
        ],
    )
    def test_what_are_real_numbers(self, value, found):
        made = arguments.floats(value)
        if found is None:
            assert made is None
            return
        assert made.dtype == float
        np.testing.assert_array_equal(made, found)
        assert made is not value

    def test_an_array_is_new(self):
        given = np.array([1.0, 2.0])
        made = arguments.numbers("size", given, "be numbers")
        made[0] = 7.0
        assert given[0] == 1.0
        refused(arguments.numbers, ["1"], "be numbers", text="size must be numbers; got ['1']")

    @pytest.mark.as_given
    def test_a_time_span(self):
        assert arguments.time_span("size", (0, 2)) == (0.0, 2.0)
        assert arguments.time_span("size", [1.0, 1.0]) == (1.0, 1.0)
        for value in ({0.0, 2.0}, (0.0,), (0.0, 1.0, 2.0), [[0.0, 1.0]], 3.0, "ab"):
            refused(arguments.time_span, value, text="size must be a pair (t0, t1) of numbers; got ")
        refused(arguments.time_span, (0.0, INF), text="size must be finite; got (0.0, inf)")
        refused(arguments.time_span, (NAN, 1.0), text="size must be finite; got (nan, 1.0)")
        told = "size must not run backwards; got (2.0, 1.0). Write (1.0, 2.0)"
        refused(arguments.time_span, (2.0, 1.0), text=told)

    @pytest.mark.as_given
    def test_increasing_times(self):
        for value in ([], [1.0], [1.0, 1.0, 2.0], [0.0, 3.0]):
            found = arguments.increasing_times("size", value, 0.0, 3.0)
            np.testing.assert_array_equal(found, value)
        # Sums of 0.1 may end a last bit before or beyond the end that they mean.
        computed = np.cumsum([0.1] * 30)
        assert computed[-1] != 3.0
        found = arguments.increasing_times("size", computed, 0.1, 3.0)
        assert (found[0], found[-1]) == (0.1, min(computed[-1], 3.0))
        for value, text in (
            ("12", "size must be increasing times of shape (N,); got '12'"),
            ([[1.0]], "size must be increasing times of shape (N,); got shape (1, 1)."),
            (1.0, "size must be increasing times of shape (N,); got shape ()."),
            ([1.0, NAN, 2.0], "size must be finite; got size[1] = nan."),
            ([INF], "size must be finite; got size[0] = inf."),
            ([0.5, 2.0, 1.0, 0.0], "size must be increasing times; got size[1] = 2.0 before size[2] = 1.0."),
            ([-0.5, 1.0], "size must lie in t_span, [0.0, 3.0]; got times from -0.5 to 1.0."),
            ([1.0, 3.5], "size must lie in t_span, [0.0, 3.0]; got times from 1.0 to 3.5."),
        ):
            refused(arguments.increasing_times, value, 0.0, 3.0, text=text)


class TestCollections:
    def test_a_mapping(self):
        given = {"a": 1.0}
        found = arguments.mapping("size", given)
        assert found == given
        assert found is not given
        assert arguments.mapping("size", None) == {}
        refused(arguments.mapping, [("a", 1.0)], text="size must map names to numbers; got ")
        refused(arguments.mapping, 3, "map a to b", text="size must map a to b; got 3")

    def test_items(self):
        assert arguments.items("size", (1, 2), "be items") == [1, 2]
        assert arguments.items("size", iter("ab"), "be items", least=2) == ["a", "b"]
        assert arguments.items("size", [], "be items") == []
        for value in (3, "ab", b"ab", bytearray(b"ab"), np.array(3.0)):
            refused(arguments.items, value, "be items", text="size must be items; got ")
        refused(arguments.items, ["a"], "be two", text="size must be two; got ['a']", least=2)

    def test_an_object_of_a_class(self):
        assert arguments.instance("size", 3, int) == 3
        refused(arguments.instance, "x", int, text="size must be a int; got 'x'.")
        refused(
            arguments.instance,
            3,
            ArgumentError,
            "Make one.",
            text="size must be an ArgumentError; got 3. Make one.",
        )

    def test_a_function(self):
        assert arguments.function("size", len, "(t, x, p)") is len
        refused(arguments.function, 3, "(t, x, p)", text="size must be a function of (t, x, p); got 3")

    def test_one_of_a_few_values(self):
        allowed = ("up", "down", None)
        assert [arguments.one_of("size", each, allowed) for each in allowed] == [*allowed]
        for value in (0, "UP", ["up"], False):
            refused(arguments.one_of, value, allowed, text='size must be "up", "down" or None; got ')

    def test_a_name_that_exists(self):
        assert arguments.known("size", "b", iter("ab"), "Names") == "b"
        for value in ("c", 3, ["a"]):
            with pytest.raises(ArgumentError, match="size"):
                arguments.known("size", value, ("a", "b"), "Names")
