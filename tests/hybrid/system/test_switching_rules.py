"""What is noted of the functions that a field applies to the state, and where they switch."""

import numpy as np
import pytest

from hybrid.system import switching
from hybrid.system.variables import Variables

NAN = np.nan
VARIABLES = Variables(("q", "v"), {"k": 3.0})
X, VALUES = np.array([0.5, -2.0]), np.array([3.0])


def noted(field):
    """The names and heights of the switching functions at one point."""
    return switching._applied(VARIABLES, field, 1.0, X, VALUES)


@pytest.mark.parametrize(
    ("field", "expected"),
    [
        (lambda t, x, p: np.sign(x.q), [("sign", (0.5,))]),
        (lambda t, x, p: abs(x.v), [("absolute", (-2.0,))]),
        (lambda t, x, p: np.heaviside(x.v, 0.5), [("heaviside", (-2.0,))]),
        (lambda t, x, p: np.maximum(x.q, p.k), [("maximum", (-2.5,))]),
        (lambda t, x, p: np.fmin(x.v, x.q), [("fmin", (-2.5,))]),
        (lambda t, x, p: x.q < 1.0, [("less", (-0.5,))]),
        (lambda t, x, p: x.q > 1.0, [("greater", (-0.5,))]),
        (lambda t, x, p: np.clip(x.q, -1.0, p.k), [("clip", (1.5, -2.5))]),
        (lambda t, x, p: np.floor(3.0 * x.q), [("floor", (NAN,))]),
        (lambda t, x, p: x.q % 0.2, [("remainder", (NAN,))]),
        (lambda t, x, p: np.sin(x.q) + np.sqrt(x.q) * x.v, []),
        (lambda t, x, p: np.sign(t) * np.abs(p.k), []),
        # One function of the result of another, and entries of an array one by one.
        (lambda t, x, p: np.sign(np.maximum(x.q, 4.0) - 3.0), [("maximum", (-3.5,)), ("sign", (1.0,))]),
        (lambda t, x, p: np.abs(np.array([x.q, x.v])), [("absolute", (0.5,)), ("absolute", (-2.0,))]),
        (lambda t, x, p: np.where(x.q > 0.0, x.v, 1.0), [("greater", (0.5,))]),
        # What was applied before an error is known.
        (lambda t, x, p: np.sign(x.q) + 1 / 0, [("sign", (0.5,))]),
        (lambda t, x, p: np.cos(np.array([x.q], dtype=object)), []),
    ],
)
def test_what_is_noted(field, expected):
    found = noted(field)
    assert [name for name, _ in found] == [name for name, _ in expected]
    for (_, heights), (_, wanted) in zip(found, expected, strict=True):
        np.testing.assert_array_equal(heights, wanted)


def test_a_probe_is_a_number():
    log = []
    probe = switching._Probe(2.5, log)
    assert isinstance(probe, float)
    assert (float(probe), int(probe), bool(probe), hash(probe)) == (2.5, 2, True, hash(2.5))
    assert not switching._Probe(0.0, log)
    assert (probe + 1.0).value == 3.5
    assert probe.sqrt().value == np.sqrt(2.5)
    for name in ("nothing", "__array__", "pi"):
        with pytest.raises(AttributeError):
            getattr(probe, name)
    assert log == []
    assert np.sum([probe, probe]).value == 5.0
    assert np.where([True, False], probe, 1.0).tolist() == [2.5, 1.0]


def test_values_of_a_guard_at_points():
    def guard(t, x, p):
        return t * x.q - p.k if x.q > 0 else 1 / 0

    points = [(2.0, np.array([0.5, 0.0])), (1.0, np.array([-1.0, 0.0]))]
    np.testing.assert_array_equal(switching._values(VARIABLES, guard, points, VALUES), [-2.0, NAN])


@pytest.mark.parametrize(
    ("heights", "others", "proportional"),
    [
        ((1.0, 2.0, -3.0), (2.0, 4.0, -6.0), True),
        ((1.0, 2.0, -3.0), (-1.0, -2.0, 3.0), True),
        ((1.0, 2.0, -3.0), (1.0, 2.0, -3.0 * (1 + 1e-12)), True),
        ((1.0, 2.0, -3.0), (1.0, 2.0, -3.0 * (1 + 1e-7)), False),
        ((1.0, 2.0, -3.0), (-1.0, -2.0, 3.0001), False),
        ((1.0, NAN), (1.0, 2.0), False),
        ((1.0, 2.0), (0.0, 2.0), False),
    ],
)
def test_surfaces_that_are_the_same(heights, others, proportional):
    assert switching._proportional(heights, others) is proportional


@pytest.mark.parametrize(
    ("field", "guards", "names"),
    [
        (lambda t, x, p: np.sign(x.q - 1.0), [lambda t, x, p: 2.0 - 2.0 * x.q], []),
        (lambda t, x, p: np.sign(x.q - 1.0), [lambda t, x, p: x.q - 2.0], ["sign"]),
        (lambda t, x, p: np.sign(x.q - 1.0), [lambda t, x, p: x.v, lambda t, x, p: x.q - 1.0], []),
        (lambda t, x, p: np.sign(x.q - 1.0) + np.abs(x.v), [lambda t, x, p: x.q - 1.0], ["abs"]),
        # By name once, in order, whether or not some of them are at a guard.
        (lambda t, x, p: np.abs(x.v) + np.sign(x.q) * abs(x.q) + abs(x.q - 1.0), [], ["abs", "sign"]),
        (lambda t, x, p: np.abs(x.v) + abs(x.q), [lambda t, x, p: x.v], ["abs"]),
        # This guard vanishes at some points, where the field has no switch.
        (lambda t, x, p: np.abs(x.v), [lambda t, x, p: np.maximum(x.q - 0.7, 0.0)], ["abs"]),
        (lambda t, x, p: np.floor(x.q), [lambda t, x, p: x.q], ["floor"]),
        (lambda t, x, p: np.clip(x.q, -1.0, 1.0), [lambda t, x, p: x.q - 1.0], ["clip"]),
        (
            lambda t, x, p: np.clip(x.q, -1.0, 1.0),
            [lambda t, x, p: x.q - 1.0, lambda t, x, p: x.q + 1.0],
            [],
        ),
        # A branch in Python: some points have calls that others lack.
        (lambda t, x, p: np.abs(x.q - 1.0) if x.v > 0 else x.q, [lambda t, x, p: x.q - 1.0], [">", "abs"]),
        (lambda t, x, p: x.q * x.v, [], []),
    ],
)
def test_what_switches_inside_of_a_mode(field, guards, names):
    both = lambda t, x, p: (field(t, x, p), x.q)  # noqa: E731
    assert switching.switching_inside(VARIABLES, both, guards, VALUES) == names
