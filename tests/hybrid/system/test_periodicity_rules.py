"""Whether one function has a period at one point, and which numbers are periods."""

import math

import numpy as np
import pytest

from hybrid.errors import ArgumentError
from hybrid.system import periodicity
from hybrid.system.functions import ModelFunction
from hybrid.system.variables import Variables

VARIABLES, VALUES = Variables(("q", "v"), {"w": 2.0}), np.array([2.0])
X = np.array([0.5, -1.0])


def function(value, size=2):
    return ModelFunction("Mode 'a'", "field", value, "jacobian", None, size)


def fault(value, period=1.0, t=0.3, size=2):
    return periodicity.period_fault_at(VARIABLES, function(value, size), t, X, VALUES, period)


def test_what_is_a_period():
    assert periodicity.period_at(None, VARIABLES, VALUES) is None
    assert periodicity.period_at(3, VARIABLES, VALUES) == 3.0
    assert periodicity.period_at(lambda p: 6.0 / p.w, VARIABLES, VALUES) == 3.0
    for period, text in (
        (0.0, "HybridSystem: period must be positive; got 0.0. Check the parameters."),
        (-1.0, "HybridSystem: period must be positive; got -1.0."),
        (math.nan, "HybridSystem: period must be finite; got nan."),
        (lambda p: math.inf, "HybridSystem: period must be finite; got inf."),
        (lambda p: np.float64(1.0) / 0.0, "HybridSystem: period must be finite; got inf."),
        (lambda p: 1 / 0, "HybridSystem: period fails: division by zero. Check the parameters."),
    ):
        with pytest.raises(ArgumentError) as caught:
            periodicity.period_at(period, VARIABLES, VALUES)
        assert str(caught.value).startswith(text)


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (lambda t, x, p: (x.v, -x.q), None),
        (lambda t, x, p: (x.v, np.cos(2 * np.pi * t)), None),
        (lambda t, x, p: (x.v, 1e9 * np.cos(40 * np.pi * t)), None),
        (lambda t, x, p: (x.v, np.floor(t + 0.3) * 0.0), None),
        (
            lambda t, x, p: (x.v, t),
            "Mode 'a': field is 0.3 at t = 0.3, x = (0.5, -1), and 1.3 one period later",
        ),
        (lambda t, x, p: (np.cos(6.2 * t), 1.0), "Mode 'a': field is -0.2851890592 at"),
        (lambda t, x, p: (x.v, np.cos(2 * np.pi * t) + 1e-9 * t), "Mode 'a': field is -0.3090169941 at"),
        # Large terms that cancel leave their rounding, which is no difference.
        (lambda t, x, p: (x.v, (1e6 + np.cos(2 * np.pi * t)) - 1e6), None),
        # Where there is no value, nothing is known.
        (lambda t, x, p: (x.v, np.nan if t > 1 else t), None),
        (lambda t, x, p: (x.v, np.nan if t < 1 else t), None),
        (lambda t, x, p: (x.v, np.nan if t != 0.3 and t != 1.3 else t), None),
        (lambda t, x, p: (x.v, np.nan if t > 1.3 else t), None),
        # Beside a jump one period later, a period that is off by its rounding is none.
        (lambda t, x, p: (x.v, 1.0 if 1.0 < t <= 1.3 else 2.0), None),
        (lambda t, x, p: (x.v, 1.0 if 1.0 < t <= 1.31 else 2.0), "Mode 'a': field is 2 at t = 0.3"),
    ],
)
def test_one_point(value, told):
    found = fault(value)
    if told is None:
        assert found is None
    else:
        assert found.startswith("HybridSystem: period = 1 is not a period of the functions. ")
        assert told in found


def test_a_guard_has_one_value():
    assert fault(lambda t, x, p: x.q - np.sin(2 * np.pi * t), size=None) is None
    assert "Mode 'a': field is 0.2 at" in fault(lambda t, x, p: x.q - t, size=None)


def test_every_function_is_compared_at_three_phases_and_four_states():
    seen = []

    def looked_at(t, x, p):
        seen.append((t, x.q, x.v))
        return x.v, -x.q

    functions = [function(looked_at), function(lambda t, x, p: (x.v, t))]
    told = periodicity.period_fault(VARIABLES, functions, VALUES, 10.0)
    assert told.startswith("HybridSystem: period = 10 is not a period")
    phases = sorted({round(t % 10.0, 9) for t, *_ in seen})
    assert phases == [1.18, 3.651, 7.487]
    sizes = sorted({round(math.log10(abs(q))) for _, q, _ in seen})
    assert (sizes[0], sizes[-1]) == (-2, 1)
    assert len({(q, v) for _, q, v in seen}) == 4
    assert periodicity.period_fault(VARIABLES, functions[:1], VALUES, 10.0) is None


def test_how_far_rounding_moves_a_function():
    def value(t, x, p):
        return (x.q + 1e6) - 1e6, p.w

    here = np.array([0.5, 2.0])
    found = periodicity.rounding(VARIABLES, function(value), 0.3, X, VALUES, here)
    # The first loses up to half of the last place of 1e6; the second moves by two last places at most.
    assert 0.0 <= found[0] < 1e-8
    assert 0.0 < found[1] <= 16 * 4 * periodicity.EPSILON
    nothing = periodicity.rounding(VARIABLES, function(lambda t, x, p: (np.nan, 1.0)), 0.3, X, VALUES, here)
    assert nothing.tolist() == [0.0, 0.0]
