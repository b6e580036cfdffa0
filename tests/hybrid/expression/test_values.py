"""NumPy's functions on traced numbers: they give what NumPy gives, or are refused."""

import math
import operator
import warnings

import numpy as np
import pytest

from hybrid.expression.tracing import trace
from hybrid.expression.values import TraceError, _content
from tests.hybrid.code import values_of

POINTS = [
    np.array([0.75, -0.5, 1.5, 0.25]),
    np.array([-0.75, 0.5, -1.5, 2.0]),
    np.zeros(4),
    np.array([1.0, 1.0, -1.0, 3.0]),
]
for point in POINTS:
    point.flags.writeable = False
# Functions of files, of settings, of indices and of NumPy itself.
NOT_OF_NUMBERS = {
    *("fromfile", "fromregex", "genfromtxt", "getbufsize", "geterr", "geterrcall", "get_include", "info"),
    *("get_printoptions", "load", "loadtxt", "memmap", "save", "savetxt", "savez", "savez_compressed"),
    *("setbufsize", "seterr", "seterrcall", "set_printoptions", "show_config", "show_runtime", "test"),
    *("fromfunction", "frombuffer", "bmat", "asmatrix", "ix_"),
    # Of booleans alone these do what depends on how NumPy stores them.
    *("reciprocal", "trapezoid", "polyval"),
}


def functions():
    """Every function of NumPy and of its linear algebra, by name."""
    for module, prefix in ((np, ""), (np.linalg, "linalg.")):
        for name in dir(module):
            found = getattr(module, name)
            if (
                name[0] != "_"
                and name not in NOT_OF_NUMBERS
                and callable(found)
                and not isinstance(found, type)
            ):
                yield prefix + name, found


def flat(value):
    """Four numbers from any result."""
    parts = value if isinstance(value, tuple | list) else [value]
    numbers = [each for part in parts for each in np.ravel(part)]
    return (*numbers[:4], *[0.0] * (4 - len(numbers)))


CALLS = [
    lambda f, x: f(x),
    lambda f, x: f(x, x[::-1]),
    lambda f, x: f(x.reshape(2, 2)),
    lambda f, x: f(np.array([[2.0, 1.0], [1.0, 3.0]]), x[:2]),
    lambda f, x: f(x, 2),
    lambda f, x: f(x[0]),
    lambda f, x: f(x[0], x[1]),
    lambda f, x: f([x[0], x[1], 1.0]),
    lambda f, x: f((x, 2 * x)),
    lambda f, x: f(x > 0),
    lambda f, x: f([x[0] > 0, x[1] > 0]),
    lambda f, x: f(x > 0, x > 1),
    lambda f, x: f(x[0] > 0, x[1] > 0),
    lambda f, x: f(x > 0, x, 2 * x),
    lambda f, x: f(x, -1.0, 1.0),
]


def untraced(call, function):
    """The values at all points, or None if NumPy does not have them."""
    try:
        with np.errstate(all="ignore"):
            values = np.array([flat(call(function, x)) for x in POINTS])
    except Exception:
        return None
    return values.astype(float) if values.dtype.kind in "fiub" else None


@pytest.mark.parametrize("call", CALLS)
def test_every_function_of_numpy(call):
    """The traced function equals NumPy's at every point where NumPy has a number, or it is refused."""
    followed, wrong = 0, []
    for name, function in functions():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            wanted = untraced(call, function)
            if wanted is None:
                continue
            try:
                expressions = trace(lambda t, x, p, f=function: flat(call(f, x)), 4, ())
            except TraceError:
                continue
            found = np.array([values_of(expressions, x) for x in POINTS])
        followed += 1
        finite = np.isfinite(wanted) & ~np.isinf(found)
        if not np.allclose(found[finite], wanted[finite], rtol=1e-13, atol=1e-15):
            wrong.append(f"{name}: {found.tolist()} for {wanted.tolist()}")
    assert not wrong, "\n".join(wrong)
    assert followed > 5


@pytest.mark.parametrize(
    "function",
    [
        lambda a, b: (a > 0) + (b > 0),
        lambda a, b: (a > 0) + (b > 0) + 1.0,
        lambda a, b: 1 + (a > 0) + (b > 0),
        lambda a, b: sum([a > 0, b > 0]),
        lambda a, b: np.sum([a > 0, b > 0]) + np.mean([a > 0, b > 0]),
        lambda a, b: (a > 0) * (b > 0) - 1,
        lambda a, b: np.where((a > 0) ^ (b > 0), a, 2.0),
        lambda a, b: np.where(a > 0, b > 0, b > 1) + (a > 1),
        lambda a, b: True + (a > 0),
        lambda a, b: np.maximum(a > 0, b > 0) + (a > 0),
        lambda a, b: np.any([a, b][:1]) + (b > 0),
        lambda a, b: abs(a > 0) + (b > 0),
    ],
)
@pytest.mark.parametrize("x", [(2.0, 2.0), (-2.0, 2.0), (-2.0, -2.0), (0.5, -1.0)])
def test_a_sum_of_booleans_is_a_boolean_and_the_sum_of_a_list_counts_them(function, x):
    try:
        expressions = trace(lambda t, x, p: (function(x[0], x[1]),), 2, ())
    except TraceError:
        return
    assert values_of(expressions, x) == float(function(*map(np.float64, x)))


@pytest.mark.parametrize(
    ("function", "advice"),
    [
        (lambda x: np.exp(x[0] > 0), r"NumPy computes in float16 np.exp of a boolean: write np.where"),
        (lambda x: -(x[0] > 0), r"NumPy does not compute np.negative of a boolean"),
        (lambda x: (x[0] > 0) & 2, r"join conditions: write \(x.q > 0\) & \(x.v > 0\)"),
        (lambda x: x[x > 0], r"write np.where\(x > 0, x, 0\) in place of x\[x > 0\]"),
        (lambda x: _added(np.zeros(4), x), r"use np.zeros_like\(x\) in place of np.zeros"),
        (lambda x: math.erf(x[0]), r"scipy.special.erf in place of math.erf"),
        (lambda x: math.floor(x[0]), r"use np.floor\(x\)"),
        (lambda x: np.logaddexp(0.0, x[0]), r"write np.log\(np.exp\(a\) \+ np.exp\(b\)\)"),
    ],
)
def test_what_to_write_instead(function, advice):
    with pytest.raises(TraceError, match=advice):
        trace(lambda t, x, p: function(x), 4, ())


def _added(rate, x):
    rate += x
    return rate


def test_entries_that_a_condition_picks_may_be_set():
    def clipped(x):
        x = x.copy()
        x[x > 1] = 1.0
        x[x < -1] = x[0]
        return x

    expressions = trace(lambda t, x, p: clipped(x), 4, ())
    for x in POINTS:
        np.testing.assert_array_equal(values_of(expressions, x), clipped(x))


@pytest.mark.parametrize(
    "rounded",
    [
        np.rint,
        np.round,
        np.around,
        round,
        lambda z: round(z, 2),
        lambda z: np.round(z, 1),
        lambda z: np.round(z, -1),
        lambda z: np.round(z, decimals=3),
        lambda z: np.round(np.array([z, 2 * z]), 1)[1],
    ],
)
def test_numbers_are_rounded_as_numpy_rounds_half_to_even(rounded):
    [expression] = trace(lambda t, x, p: (rounded(x[0]),), 1, ())
    for z in (-3.5, -2.5, -0.5, 0.5, 1.5, 2.5, 0.125, 14.9, 15.0, 25.0, 1e17, -0.2):
        assert values_of([expression], (z,))[0] == rounded(np.float64(z))


@pytest.mark.parametrize("divisor", [0.1, 0.3, -0.7, 3.0, 1e-3, math.inf, -math.inf])
def test_whole_quotients_are_those_of_the_exact_numbers(divisor):
    """1.0 // 0.1 is 9: the float 0.1 is a little more than a tenth."""
    multiples = [
        n * unit for n in range(-20, 21) for unit in (1.0, divisor if math.isfinite(divisor) else 0.3)
    ]
    for function in (lambda x: x[0] // divisor, lambda x: x[0] // x[1], lambda x: divmod(x[0], divisor)[0]):
        expressions = trace(lambda t, x, p, f=function: (f(x),), 2, ())
        for a in multiples:
            x = np.array([a, divisor])
            assert values_of(expressions, x) == function(x), (a, divisor)


@pytest.mark.parametrize("ufunc", [np.fmax, np.fmin])
def test_a_number_is_larger_and_smaller_than_nan(ufunc):
    expressions = trace(lambda t, x, p: (ufunc(x[0], x[1]), ufunc(x[0], 2.0), ufunc(2.0, x[1])), 2, ())
    for x in ((1.0, math.nan), (math.nan, 1.0), (3.0, 1.0), (math.nan, math.nan)):
        wanted = [ufunc(*x), ufunc(x[0], 2.0), ufunc(2.0, x[1])]
        np.testing.assert_array_equal(values_of(expressions, x), wanted)


def test_an_array_without_axes_is_its_number():
    def field(t, x, p):
        boxed = np.empty((), dtype=object)
        boxed[()] = x.q
        assert _content(boxed) == _content(x.q)
        assert _content(np.array(2.0)) == 2
        return (x.q,)

    trace(field, ("q",), ())


@pytest.mark.parametrize("shape", [(1,), (2,), (1, 1)])
def test_an_array_with_axes_is_no_number(shape):
    with pytest.raises(TraceError, match="is not a number"):
        trace(lambda t, x, p: (_content(np.zeros(shape)),), ("q",), ())


PLACES = [(-2.5, 0.5), (-1.0, -1.0), (0.0, 0.0), (0.25, 2.0), (1.5, -3.0), (2.5, 0.0)]


def values(function):
    """What a traced function of ``q`` and ``v`` gives at all points."""
    return computed(trace(lambda t, x, p: np.ravel(np.array(function(x.q, x.v))), ("q", "v"), ()))


def values_of_array(function):
    """The same for a function of the state as an array."""
    return computed(trace(lambda t, x, p: np.ravel(function(x)), 2, ()))


def computed(expressions):
    return [values_of(expressions, x).tolist() for x in PLACES]


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
    assert values(traced) == [[plain(*x)] for x in PLACES]


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

    assert values(asking) == [[q] for q, _ in PLACES]
    with pytest.raises(TraceError, match="a traced number has no attribute 'nothing'"):
        values(lambda q, v: q.nothing)


def test_the_text_of_a_number_is_its_expression():
    told = []
    values(lambda q, v: told.extend([f"{q}", repr(2 * v), str(q - q)]) or q)
    assert told == ["Traced(x[0])", "Traced(2*x[1])", "Traced(0)"]


def test_a_real_number():
    assert values(lambda q, v: (q.real, q.imag, np.conjugate(q), q.conjugate())) == [
        [q, 0.0, q, q] for q, _ in PLACES
    ]
    assert values(lambda q, v: isinstance(q, float) + 0.0 * q) == [[1.0]] * len(PLACES)


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
    assert values(traced) == [np.ravel(np.array(plain(*x), dtype=float)).tolist() for x in PLACES]


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
    assert values_of_array(function) == [[float(each) for each in plain(*x)] for x in PLACES]


def test_writing_into_arrays():
    def added(x):
        total = x.copy()
        total += 1.0
        total *= [2.0, 3.0]
        total[total > 4.0] = 4.0
        return total

    assert values_of_array(added) == [
        [min(2.0 * (q + 1.0), 4.0), min(3.0 * (v + 1.0), 4.0)] for q, v in PLACES
    ]

    def chosen(condition, value):
        def function(x):
            total = x.copy()
            total[condition(x)] = value
            return total

        return function

    one = chosen(lambda x: np.array([x[0] > 0.0, x[0] > 1.0]), 7.0)
    assert values_of_array(one) == [[7.0 if q > 0 else q, 7.0 if q > 1 else v] for q, v in PLACES]
    assert values_of_array(chosen(lambda x: 1, 7.0)) == [[q, 7.0] for q, _ in PLACES]
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
