"""Choices, sums of booleans and conversions of traced numbers, one by one."""

import math
import operator

import numpy as np
import pytest

from hybrid.symbolic.printer import assignments
from hybrid.symbolic.tracing import TraceError, trace

POINTS = [(-2.5, 0.5), (-1.0, -1.0), (0.0, 0.0), (0.25, 2.0), (1.5, -3.0), (2.5, 0.0)]


def values(function):
    """What a traced function of ``q`` and ``v`` gives at all points."""
    return computed(trace(lambda t, x, p: np.ravel(np.array(function(x.q, x.v))), ("q", "v"), ()))


def values_of_array(function):
    """The same for a function of the state as an array."""
    return computed(trace(lambda t, x, p: np.ravel(function(x)), 2, ()))


def computed(expressions):
    out = np.zeros(len(expressions))
    code = "\n".join(assignments([f"out[{i}]" for i in range(len(out))], expressions))
    rows = []
    for x in POINTS:
        exec(code, {"x": x, "out": out, "np": np, **vars(math)})
        rows.append(out.tolist())
    return rows


def between(low, value, high):
    return min(max(value, low), high)


@pytest.mark.parametrize(
    ("traced", "plain"),
    [
        (lambda q, v: np.clip(q, -1.0, 1.0), lambda q, v: between(-1.0, q, 1.0)),
        (lambda q, v: np.clip(q, a_min=v, a_max=1.0), lambda q, v: min(max(q, v), 1.0)),
        (lambda q, v: np.clip(q, -1.0, None), lambda q, v: max(q, -1.0)),
        (lambda q, v: np.clip(q, None, v), lambda q, v: min(q, v)),
        (lambda q, v: np.clip(q, min=-1.0, max=v), lambda q, v: min(max(q, -1.0), v)),
        (lambda q, v: np.clip(q, max=1.0), lambda q, v: min(q, 1.0)),
        # The first condition that holds decides in a select, the last one in a piecewise.
        (lambda q, v: np.select([q > 1.0, q > -1.0], [v, 2.0]), lambda q, v: v if q > 1 else 2.0 * (q > -1)),
        (lambda q, v: np.select([q > 1.0], [v], q), lambda q, v: v if q > 1 else q),
        (lambda q, v: np.select([q > 1.0], [v], default=7.0), lambda q, v: v if q > 1 else 7.0),
        (
            lambda q, v: np.piecewise(q, [q > -1.0, q > 1.0], [2.0, lambda u: 3.0 * u]),
            lambda q, v: 3.0 * q if q > 1 else 2.0 if q > -1 else 0.0,
        ),
        (
            lambda q, v: np.piecewise(q, [q > 1.0, v > 0.0], [lambda u: u, 2.0, lambda u: -u]),
            lambda q, v: 2.0 if v > 0 else q if q > 1 else -q,
        ),
        (lambda q, v: np.piecewise(q, q > 1.0, [5.0, 6.0]), lambda q, v: 5.0 if q > 1 else 6.0),
        (
            lambda q, v: np.piecewise(q, [q > 1.0], [lambda u, a, b: a * u + b], 2.0, b=v),
            lambda q, v: 2.0 * q + v if q > 1 else 0.0,
        ),
        (lambda q, v: np.where(q > 1.0, v, 4.0), lambda q, v: v if q > 1 else 4.0),
    ],
)
def test_choices(traced, plain):
    assert values(traced) == [[plain(*x)] for x in POINTS]


@pytest.mark.parametrize(
    ("function", "text"),
    [
        (lambda q, v: np.where(q > 1.0), "np.where needs both values to be traced"),
        (lambda q, v: np.select([q > 1.0, v > 1.0], [q]), "np.select needs one choice per condition"),
        (lambda q, v: np.piecewise(q, [q > 1.0, v > 1.0], [q]), "np.piecewise needs one function per"),
        (lambda q, v: np.piecewise(q, [q > 1.0], [q, v, 1.0]), "np.piecewise needs one function per"),
        (lambda q, v: float(q), "a number is needed where tracing has a symbol: use np.sin in place of math"),
        (lambda q, v: complex(q), "a number is needed where tracing has a symbol"),
        (lambda q, v: [1.0, 2.0][q], "a number is needed where tracing has a symbol"),
        (lambda q, v: f"{q:.3f}", "a number is needed where tracing has a symbol"),
        (lambda q, v: int(q), r"a whole number is needed where tracing has a symbol: use np.trunc\(x\)"),
        (lambda q, v: math.trunc(q), r"use np.trunc\(x\)"),
        (lambda q, v: math.ceil(q), r"use np.ceil\(x\)"),
        (lambda q, v: {q: 1.0}, "a number is needed as a key"),
        (lambda q, v: q.mean(), "a traced number has no attribute 'mean'"),
        (lambda q, v: "text", "'text' is not a number"),
        (lambda q, v: np.sinc(q), r"np.sinc cannot be traced: write np.sin\(np.pi\*x\)/\(np.pi\*x\)"),
    ],
)
def test_what_cannot_be_followed_is_refused(function, text):
    with pytest.raises(TraceError, match=text):
        trace(lambda t, x, p: (function(x.q, x.v),), ("q", "v"), ())


def test_an_attribute_that_no_number_has():
    """A function may ask for it and go on, because a number would have answered in the same way."""

    def asking(q, v):
        return v if hasattr(q, "nothing") else q

    assert values(asking) == [[q] for q, _ in POINTS]
    with pytest.raises(TraceError, match="a traced number has no attribute 'nothing'"):
        values(lambda q, v: q.nothing)


def test_the_text_of_a_number_is_its_expression():
    told = []
    values(lambda q, v: told.extend([f"{q}", repr(2 * v), str(q - q)]) or q)
    assert told == ["Traced(x[0])", "Traced(2*x[1])", "Traced(0)"]


def test_a_real_number():
    assert values(lambda q, v: (q.real, q.imag, np.conjugate(q), q.conjugate())) == [
        [q, 0.0, q, q] for q, _ in POINTS
    ]
    assert values(lambda q, v: isinstance(q, float) + 0.0 * q) == [[1.0]] * len(POINTS)


@pytest.mark.parametrize(
    ("traced", "plain"),
    [
        # Sums of single conditions are conditions, those of a list their number.
        (lambda q, v: (q > 0.0) + (v > 0.0), lambda q, v: q > 0 or v > 0),
        (lambda q, v: np.sum([q > 0.0, v > 0.0, q > 1.0]), lambda q, v: (q > 0) + (v > 0) + (q > 1)),
        (lambda q, v: np.sum([q, v]), lambda q, v: q + v),
        (lambda q, v: np.prod([q, v, 2.0]), lambda q, v: q * v * 2.0),
        (lambda q, v: (q > 0.0) * (v > 0.0), lambda q, v: q > 0 and v > 0),
        (lambda q, v: (q > 0.0) * 3.0, lambda q, v: 3.0 * (q > 0)),
        (lambda q, v: (q > 0.0) & ~(v > 0.0), lambda q, v: q > 0 and not v > 0),
        (lambda q, v: (q > 0.0) | (v > 0.0), lambda q, v: q > 0 or v > 0),
        (lambda q, v: (q > 0.0) ^ (v > 0.0), lambda q, v: (q > 0) != (v > 0)),
        (lambda q, v: np.array([[q, v], [v, q]]) @ [1.0, 2.0], lambda q, v: (q + 2 * v, v + 2 * q)),
        (lambda q, v: divmod(q, 0.75), lambda q, v: divmod(q, 0.75)),
    ],
)
def test_sums_and_conditions(traced, plain):
    assert values(traced) == [np.ravel(np.array(plain(*x), dtype=float)).tolist() for x in POINTS]


@pytest.mark.parametrize(
    ("function", "plain"),
    [
        (lambda x: np.sum(x > 0.0), lambda q, v: [(q > 0) + (v > 0)]),
        (lambda x: np.add.reduce(x > 0.0), lambda q, v: [(q > 0) + (v > 0)]),
        (lambda x: np.add.accumulate(x > 0.0), lambda q, v: [q > 0, (q > 0) + (v > 0)]),
        (lambda x: (x > 0.0) + (x > 1.0), lambda q, v: [q > 0, v > 0]),
        (lambda x: 1.0 * np.any(x > 0.0), lambda q, v: [q > 0 or v > 0]),
        (lambda x: 1.0 * np.any(x), lambda q, v: [q != 0 or v != 0]),
        (lambda x: 1.0 * np.all(x), lambda q, v: [q != 0 and v != 0]),
        (lambda x: 1.0 * np.any(x[:1]), lambda q, v: [q != 0]),
        (lambda x: np.logical_and.reduce(x[:1]) + (x[1] > 9.0), lambda q, v: [q != 0]),
        (lambda x: np.maximum.reduce(x), lambda q, v: [max(q, v)]),
        (lambda x: np.multiply.outer(x, x), lambda q, v: [q * q, q * v, v * q, v * v]),
        (lambda x: np.dot(x, x[::-1]), lambda q, v: [2 * q * v]),
        (lambda x: np.array([[1.0, 2.0], [3.0, 4.0]]) @ x, lambda q, v: [q + 2 * v, 3 * q + 4 * v]),
        (lambda x: np.clip(x, -1.0, 1.0), lambda q, v: [between(-1.0, q, 1.0), between(-1.0, v, 1.0)]),
        (lambda x: np.where(x > 1.0, 2.0, x), lambda q, v: [2.0 if q > 1 else q, 2.0 if v > 1 else v]),
    ],
)
def test_functions_of_arrays(function, plain):
    assert values_of_array(function) == [[float(each) for each in plain(*x)] for x in POINTS]


def test_writing_into_arrays():
    def added(x):
        total = x.copy()
        total += 1.0
        total *= [2.0, 3.0]
        total[total > 4.0] = 4.0
        return total

    assert values_of_array(added) == [
        [min(2.0 * (q + 1.0), 4.0), min(3.0 * (v + 1.0), 4.0)] for q, v in POINTS
    ]

    def chosen(condition, value):
        def function(x):
            total = x.copy()
            total[condition(x)] = value
            return total

        return function

    one = chosen(lambda x: np.array([x[0] > 0.0, x[0] > 1.0]), 7.0)
    assert values_of_array(one) == [[7.0 if q > 0 else q, 7.0 if q > 1 else v] for q, v in POINTS]
    assert values_of_array(chosen(lambda x: 1, 7.0)) == [[q, 7.0] for q, _ in POINTS]
    for condition, value in (
        (lambda x: np.array([x[0] > 0.0]), 7.0),
        (lambda x: x > 0.0, np.array([1.0, 2.0])),
        (lambda x: x[0] > 0.0, 7.0),
    ):
        with pytest.raises(TraceError, match="a condition as an index cannot be traced"):
            values_of_array(chosen(condition, value))
    with pytest.raises(TraceError, match="cannot take symbols"):
        values_of_array(lambda x: operator.iadd(np.zeros(2), x))


def test_the_argument_is_not_written_into():
    def writing(t, x, p):
        x[0] = 1.0
        return x

    with pytest.raises(TraceError, match="it writes into its argument"):
        trace(writing, 2, ())
